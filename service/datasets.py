"""Parsed datasets, by id: parsing takes longer than most requests may.

NetCDF files come from strangers, and a damaged one can hang whoever opens it. So each is opened once, in a process of
its own, and stored in the project's own form beside the archive; later only this form is read.
"""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from typing import NamedTuple

from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from records import Dataset
from records.confined import STORED, Limits, convert_netcdf
from records.parsed import load_parsed
from records.storage import is_netcdf, label_of
from service import store
from service.database import Database, is_full
from service.engine import Engine

LOG = logging.getLogger("wingfit")
KEPT, KEPT_BYTES = 8, 2**28


class Opened(NamedTuple):
    """A dataset, and its own form where its archive must not be opened again."""

    dataset: Dataset
    parsed: bytes | None


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
            loaded = self._load(dataset_id, row.filename)
            self.keep(dataset_id, loaded)
        return loaded

    def open(self, archive: bytes, filename: str, limits: Limits | None = None) -> Opened:
        """Read an archive; ValueError says what is wrong with it. ``limits`` are those of an upload, or others."""
        if not is_netcdf(archive):
            return Opened(self._engine.load(archive, filename), None)
        label = label_of(filename)
        parsed = convert_netcdf(archive, label, limits)
        return Opened(load_parsed(parsed, label), parsed)

    def _load(self, dataset_id: str, filename: str) -> Dataset:
        with self._database.read() as session:
            parsed, archive = store.parsed(session, dataset_id), b""
            if parsed is None:
                archive = store.archive(session, dataset_id)
        if parsed is not None:
            return load_parsed(parsed, filename)
        opened = self.open(archive, filename, STORED)
        if opened.parsed is not None:  # stored by an earlier version
            self._keep_parsed(dataset_id, opened.parsed)
        return opened.dataset

    def _keep_parsed(self, dataset_id: str, parsed: bytes) -> None:
        """Store what only saves time later, if there is room."""
        try:
            with self._database.write() as session:
                store.keep_parsed(session, dataset_id, parsed)
        except OperationalError as error:
            if not is_full(error):
                raise
            LOG.warning("the stored form of %s is not kept: the disk is full or fails (%s)", dataset_id, error.orig)

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
