"""Parsed datasets, by id: parsing takes longer than most requests may."""

from __future__ import annotations

import threading
from collections import OrderedDict

from sqlalchemy.orm import Session

from records import Dataset
from service import store
from service.database import Database
from service.engine import Engine

KEPT, KEPT_BYTES = 8, 2**28


class Datasets:
    """The last few datasets used, of the largest only the last. They never change once uploaded."""

    def __init__(self, database: Database, engine: Engine) -> None:
        self._database, self._engine = database, engine
        self._lock, self._loading = threading.Lock(), threading.Lock()
        self._kept: OrderedDict[str, Dataset] = OrderedDict()

    def get(self, dataset_id: str) -> Dataset:
        """The dataset, or a 404."""
        with self._database.read() as session:
            row = store.dataset(session, dataset_id)
        if (known := self._known(dataset_id)) is not None:
            return known
        # One at a time, and once: a large one takes a minute, and gigabytes.
        with self._loading:
            if (known := self._known(dataset_id)) is not None:
                return known
            with self._database.read() as session:
                body = store.archive(session, dataset_id)
            loaded = self._engine.load(body, row.filename)
            self.keep(dataset_id, loaded)
        return loaded

    def _known(self, dataset_id: str) -> Dataset | None:
        with self._lock:
            if dataset_id in self._kept:
                self._kept.move_to_end(dataset_id)
            return self._kept.get(dataset_id)

    def keep(self, dataset_id: str, loaded: Dataset) -> None:
        """Remember a dataset that was just parsed."""
        with self._lock:
            self._kept[dataset_id] = loaded
            while len(self._kept) > KEPT or (len(self._kept) > 1 and self._bytes > KEPT_BYTES):
                self._kept.popitem(last=False)

    @property
    def _bytes(self) -> int:
        return sum(recording.values.nbytes for one in self._kept.values() for recording in one.recordings)

    def delete(self, session: Session, dataset_id: str) -> None:
        """Delete a dataset here and there."""
        store.delete_dataset(session, dataset_id)
        with self._lock:
            self._kept.pop(dataset_id, None)
