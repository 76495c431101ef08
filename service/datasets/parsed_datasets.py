"""Keeps datasets in memory by id, because parsing one takes longer than most requests may.

A damaged NetCDF file can hang the process that opens it. Therefore each is opened once, in a separate process, which
converts it to an internal format (`records/files/parsed.py`); that is stored too, and later only that is read.
"""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from typing import NamedTuple

from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from wingfit.checks import Mistake
from wingfit.records import AnyDataset, Dataset, DatasetError, wing_or_vehicle
from wingfit.records.files.confined import STORED, Limits, convert_netcdf
from wingfit.records.files.parsed import load_parsed
from wingfit.records.files.storage import is_netcdf, label_of
from wingfit.service.http.problems import conflict
from wingfit.service.runs.engine import Engine
from wingfit.service.storage import store
from wingfit.service.storage.database import Database, is_full
from wingfit.service.storage.tables import DatasetRow

LOG = logging.getLogger("wingfit")
KEPT, KEPT_BYTES = 8, 2**28


class Opened(NamedTuple):
    """An uploaded dataset that was read.

    ``parsed``: for a NetCDF file the dataset in the internal format of `records/files/parsed.py`, for a zip None.
    ``mistakes``: likely ones, found by the checks of an upload.
    """

    dataset: AnyDataset
    parsed: bytes | None
    mistakes: tuple[Mistake, ...] = ()


class Datasets:
    """Cache of the datasets used last, limited in number and bytes. The contents of a dataset never change."""

    def __init__(self, database: Database, engine: Engine) -> None:
        self._database, self._engine = database, engine
        self._lock, self._loading, self._converting = threading.Lock(), threading.Lock(), threading.Lock()
        self._kept: OrderedDict[str, AnyDataset] = OrderedDict()
        # Unreadable files of earlier versions: opening one again could take a quarter of an hour.
        self._damaged: dict[str, DatasetError] = {}

    def get(self, dataset_id: str) -> AnyDataset:
        """Return the dataset with this id, from the cache or the database; raise a 404 if there is none."""
        with self._database.read() as session:
            row = store.one(session, DatasetRow, dataset_id)
        if (known := self._known(dataset_id)) is not None:
            return known
        old = self._is_old(dataset_id)
        # One at a time: a large one takes a minute and gigabytes. Conversions wait only for conversions.
        with self._converting if old else self._loading:
            if (known := self._known(dataset_id)) is not None:
                return known
            loaded = self._convert(dataset_id, row.filename) if old else self._load(dataset_id, row.filename)
            self.keep(dataset_id, loaded)
        return loaded

    def flapping(self, dataset_id: str) -> Dataset:
        """Return the dataset with this id; raise a 409 if it is not of a wing or vehicle, a 404 if there is none."""
        try:
            return wing_or_vehicle(self.get(dataset_id))
        except ValueError as error:
            raise conflict(f"dataset {dataset_id}: {error}") from None

    def accept(self, archive: bytes, filename: str) -> Opened:
        """Read and check an upload, the bytes ``archive`` of a zip or NetCDF file; ValueError says what is wrong.

        A dataset that is stored is not checked again when it is loaded: what was accepted stays accepted.
        """
        if not is_netcdf(archive):
            checked = self._engine.load_checked(archive, filename)
            return Opened(checked.dataset, None, checked.mistakes)
        opened = self.open(archive, filename)
        return opened._replace(mistakes=self._engine.examine(opened.dataset))

    def open(self, archive: bytes, filename: str, limits: Limits | None = None) -> Opened:
        """Read ``archive``, the bytes of a zip or NetCDF file; ValueError says what is wrong with it.

        ``limits``: on time and memory of the process that reads NetCDF; None: those of an upload.
        """
        if not is_netcdf(archive):
            return Opened(self._engine.load(archive, filename), None)
        label = label_of(filename)
        parsed = convert_netcdf(archive, label, limits)
        return Opened(load_parsed(parsed, label), parsed)

    def _load(self, dataset_id: str, filename: str) -> AnyDataset:
        with self._database.read() as session:
            parsed = store.parsed(session, dataset_id)
            archive = store.archive(session, dataset_id) if parsed is None else b""
        return self._engine.load(archive, filename) if parsed is None else load_parsed(parsed, filename)

    def _is_old(self, dataset_id: str) -> bool:
        """Return whether an earlier version stored this NetCDF dataset without its form in the internal format."""
        with self._database.look() as connection:
            return is_netcdf(store.archive_piece(connection, dataset_id, 0, 8)) and not store.has_parsed(
                connection, dataset_id
            )

    def _convert(self, dataset_id: str, filename: str) -> AnyDataset:
        if dataset_id in self._damaged:
            raise self._damaged[dataset_id].with_traceback(None)
        with self._database.read() as session:
            archive = store.archive(session, dataset_id)
        try:
            opened = self.open(archive, filename, STORED)
        except DatasetError as error:
            self._damaged[dataset_id] = error
            raise
        if opened.parsed is not None:
            self._keep_parsed(dataset_id, opened.parsed)
        return opened.dataset

    def _keep_parsed(self, dataset_id: str, parsed: bytes) -> None:
        """Store a dataset's internal format (bytes); a full disk is ignored, because the form only saves time."""
        try:
            with self._database.write() as session:
                store.keep_parsed(session, dataset_id, parsed)
        except OperationalError as error:
            if not is_full(error):
                raise
            LOG.warning("the stored form of %s is not kept: the disk is full or fails (%s)", dataset_id, error.orig)

    def _known(self, dataset_id: str) -> AnyDataset | None:
        with self._lock:
            if dataset_id in self._kept:
                self._kept.move_to_end(dataset_id)
            return self._kept.get(dataset_id)

    def keep(self, dataset_id: str, loaded: AnyDataset) -> None:
        """Put the dataset ``loaded`` into the cache."""
        with self._lock:
            self._kept[dataset_id] = loaded
            while len(self._kept) > KEPT or (len(self._kept) > 1 and self._bytes > KEPT_BYTES):
                self._kept.popitem(last=False)

    @property
    def _bytes(self) -> int:
        return sum(recording.values.nbytes for one in self._kept.values() for recording in one.recordings)

    def delete(self, session: Session, dataset_id: str) -> None:
        """Delete a dataset from the database and the cache."""
        store.delete_dataset(session, dataset_id)
        with self._lock:
            self._kept.pop(dataset_id, None)
            self._damaged.pop(dataset_id, None)
