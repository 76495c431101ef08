"""Opens, checks and stores a new dataset: what was uploaded, or made of the films of a wing."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import PurePath
from typing import Any

from sqlalchemy.orm import Session

from wingfit.checks import Mistake
from wingfit.records import AnyDataset
from wingfit.records.files.confined import ReaderError
from wingfit.service.auth.access import owner_of_new
from wingfit.service.container import Service
from wingfit.service.datasets.parsed_datasets import Opened
from wingfit.service.http import responses as http
from wingfit.service.http.problems import ProblemError, error_item, invalid
from wingfit.service.runs import views
from wingfit.service.storage import store
from wingfit.service.storage.tables import ArchiveRow, DatasetRow


def opened(service: Service, data: bytes, filename: str) -> Opened:
    """Read and check the bytes ``data`` of an archive; a 422 lists what is wrong, a 503 says that none can be read."""
    try:
        return service.datasets.accept(data, filename)
    except ReaderError as error:
        raise ProblemError(503, "unavailable", str(error)) from None
    except ValueError as error:
        faults = getattr(error, "errors", None) or []
        listed = [error_item(fault.where, fault.value, fault.message) for fault in faults]
        fallback = [error_item(filename, None, str(error))]
        raise invalid("the dataset cannot be read", listed or fallback) from None


def stored(
    service: Service,
    again: store.Repeat | None,
    found: Opened,
    archive: tuple[str, bytes],
    name: str | None = None,
    body: Callable[[Mapping[str, Any]], Mapping[str, Any]] = dict,
) -> store.Answer:
    """Store what was opened, and return the 201 of it.

    Args:
        service: which stores it.
        again: identifies a repeated request, which stores nothing.
        found: the dataset.
        archive: name and bytes of the file from which it was opened.
        name: instead of the dataset's own, which gets a number if its owner has a dataset of that name.
        body: makes the body of the answer from the description of the dataset.

    """
    filename, data = archive
    made: list[str] = []

    def create(session: Session) -> store.Answer:
        row = _row(found.dataset, found.mistakes, name, filename, data)
        store.make_room(session, row.owner, len(data) + len(found.parsed or b""), service.settings.max_stored_mb)
        row.name = name or store.free_dataset_name(session, row.owner, row.name)
        session.add(row)
        session.flush()
        session.add(ArchiveRow(dataset_id=row.id, body=data))
        if found.parsed is not None:
            store.keep_parsed(session, row.id, found.parsed)
        made.append(row.id)
        return store.Answer(201, f"/v1/datasets/{row.id}", dict(body(views.dataset(row))))

    answer, new = http.created(service.database, again, create)
    if new:
        service.datasets.keep(made[-1], found.dataset)
    return answer


def _row(loaded: AnyDataset, mistakes: Sequence[Mistake], name: str | None, filename: str, data: bytes) -> DatasetRow:
    return DatasetRow(
        id=store.new_id("ds"),
        owner=owner_of_new(),
        name=name or loaded.name.strip() or PurePath(filename).stem,
        kind=loaded.kind,
        description=loaded.description,
        filename=filename,
        created_at=store.now(),
        sha256=hashlib.sha256(data).hexdigest(),
        size_bytes=len(data),
        markers=len(loaded.wing.markers) if loaded.kind == "tracks" else 0,
        recordings=views.recordings(loaded),
        rig=views.rig_info(loaded),
        warnings=views.warnings(mistakes),
    )
