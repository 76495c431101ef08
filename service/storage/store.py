"""Queries and changes of the database. Functions take the caller's ``session``, so the caller sets the transaction."""

from __future__ import annotations

import json
import logging
import secrets
import sqlite3
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from itertools import chain
from typing import Any, TypeVar

from pydantic import TypeAdapter
from sqlalchemy import ColumnElement, delete, func, select
from sqlalchemy.orm import Session, object_session

from wingfit.calibration.search import CalibrationSpec
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.service.http.problems import ProblemError, conflict, error_item, invalid, not_found
from wingfit.service.storage.database import is_full
from wingfit.service.storage.tables import (
    AnswerRow,
    ArchiveRow,
    CheckpointRow,
    DatasetRow,
    DiagnosisRow,
    FilmRow,
    FindingRow,
    JobRow,
    KeyRow,
    OwnedRow,
    ParsedRow,
    PartialRow,
    RunRow,
    SimulatedRow,
    StepOfJob,
    TrackingRow,
)
from wingfit.workers.jobs import Job, State, Wish

LOG = logging.getLogger("wingfit")
ANSWERS_KEPT = timedelta(days=7)
MB = 10**6
LONGEST_NAME = 200
LONGEST_STEM = LONGEST_NAME - 10  # leaves room for a number
# Value of fields that the first version did not store.
_SPEC = TypeAdapter(CalibrationSpec)
BEFORE_METHODS: dict[str, Any] = {"method": "genetic"}
ACTIVE = tuple(state.value for state in State if not state.final)
JOBS: tuple[type[JobRow], ...] = (RunRow, DiagnosisRow, TrackingRow)

Row = TypeVar("Row", bound=OwnedRow | KeyRow)
Step = TypeVar("Step", bound=StepOfJob)


def now() -> str:
    """Return the present time in UTC as RFC 3339 text with microseconds, e.g. 2026-01-31T12:00:00.000000Z."""
    return timestamp(datetime.now(UTC))


def timestamp(moment: datetime) -> str:
    """Format ``moment`` (in UTC) as it is stored: RFC 3339 text, whose alphabetical order is the order in time."""
    return moment.isoformat(timespec="microseconds").replace("+00:00", "Z")


def new_id(prefix: str) -> str:
    """Return a new random id that cannot be guessed: ``prefix`` (e.g. "run"), "_" and 16 hexadecimal digits."""
    return f"{prefix}_{secrets.token_hex(8)}"


# -- rows of any kind ------------------------------------------------------------------------------------


def one(session: Session, table: type[Row], row_id: str) -> Row:
    """Return the row of ``table`` whose id is ``row_id``; raise a 404 if the caller may see no such row."""
    found = session.scalar(select(table).where(table.id == row_id))
    if found is None:
        raise not_found(table.__tablename__, row_id)
    return found


# -- datasets --------------------------------------------------------------------------------------------


def archive(session: Session, dataset_id: str) -> bytes:
    """Return the bytes of the dataset's file as uploaded; raise a 404 if there is no such dataset."""
    body = session.scalar(select(ArchiveRow.body).where(ArchiveRow.dataset_id == dataset_id))
    if body is None:
        raise not_found("dataset", dataset_id)
    return body


def parsed(session: Session, dataset_id: str) -> bytes | None:
    """Return the dataset in the internal format of `records/files/parsed.py` (bytes), or None if none is stored."""
    return session.scalar(select(ParsedRow.body).where(ParsedRow.dataset_id == dataset_id))


def has_parsed(connection: sqlite3.Connection, dataset_id: str) -> bool:
    """Return whether the dataset is stored in the internal format of `records/files/parsed.py`."""
    return connection.execute("SELECT 1 FROM parsed WHERE dataset_id = ?", (dataset_id,)).fetchone() is not None


def keep_parsed(session: Session, dataset_id: str, body: bytes) -> None:
    """Store ``body``, a dataset in the format of `records/files/parsed.py`, unless the dataset was deleted since."""
    if session.scalar(select(ArchiveRow.dataset_id).where(ArchiveRow.dataset_id == dataset_id)):
        session.merge(ParsedRow(dataset_id=dataset_id, body=body))


def archive_piece(connection: sqlite3.Connection, dataset_id: str, start: int, size: int) -> bytes:
    """Return ``size`` bytes of the uploaded file from offset ``start``, without reading the rest of the file.

    Raises a 404 if the dataset was deleted.
    """
    row = connection.execute("SELECT rowid FROM archive WHERE dataset_id = ?", (dataset_id,)).fetchone()
    if row is None:
        raise not_found("dataset", dataset_id)
    with connection.blobopen("archive", "body", row[0], readonly=True) as blob:
        blob.seek(start)
        return blob.read(size)


def make_room(session: Session, owner: str | None, size: int, most_mb: int) -> None:
    """Raise a 429 if the stored datasets of ``owner`` and ``size`` further bytes would exceed ``most_mb`` (10^6 bytes).

    Both the uploaded files and their forms in the internal format count. ``owner`` None: datasets without an owner.
    """
    held = session.scalar(select(func.sum(DatasetRow.size_bytes)).where(of_owner(DatasetRow, owner))) or 0
    beside = select(func.sum(func.length(ParsedRow.body))).join(DatasetRow, DatasetRow.id == ParsedRow.dataset_id)
    held += session.scalar(beside.where(of_owner(DatasetRow, owner))) or 0
    if held + size > most_mb * MB:
        raise ProblemError(
            429,
            "too-many",
            f"the archives of one owner may take {most_mb} MB (WINGFIT_MAX_STORED_MB); these take {held / MB:.1f} MB, "
            f"this one {size / MB:.1f} MB more; delete datasets that are not needed",
        )


def in_use(what: str, row_id: str, by: str, count: int) -> ProblemError:
    """Return the 409 for the deletion of ``what``, called ``row_id``, to which ``count`` jobs, ``by``, refer."""
    verb, them = ("refers", "it") if count == 1 else ("refer", "them")
    return conflict(f"{by} {verb} to {what} {row_id}; delete {them} first")


def delete_dataset(session: Session, dataset_id: str) -> None:
    """Delete a dataset; raise a 409 while a run or diagnosis refers to it, a 404 if there is no such dataset."""
    row = one(session, DatasetRow, dataset_id)
    for table, one_job, several in ((RunRow, "run", "runs"), (DiagnosisRow, "diagnosis", "diagnoses")):
        count = session.scalar(select(func.count()).where(table.dataset_id == dataset_id)) or 0
        if count:
            raise in_use("dataset", dataset_id, f"{count} {one_job if count == 1 else several}", count)
    session.delete(row)


# -- jobs ------------------------------------------------------------------------------------------------


def delete_job(session: Session, table: type[JobRow], job_id: str) -> None:
    """Delete a job that has ended, with its steps and results.

    Raises a 409 for a job that is queued, running or paused, a 404 if ``table`` has no such job.
    """
    row = one(session, table, job_id)
    if row.state in ACTIVE:
        raise conflict(f"{table.__tablename__} {row.id} is {row.state}; cancel it first", state=row.state)
    session.delete(row)


def steps(session: Session, table: type[Step], job_id: str, after: int = 0, limit: int | None = None) -> list[Step]:
    """Return up to ``limit`` steps (generations of a run, steps of a diagnosis) with sequence numbers above ``after``.

    They are in ascending order; ``limit`` None returns all of them.
    """
    query = select(table).where(table.job_id == job_id, table.sequence > after)
    return list(session.scalars(query.order_by(table.sequence).limit(limit)))


def checkpoint(session: Session, run_id: str) -> dict[str, Any] | None:
    """Return the stored state of the search, from which the run continues; None before its first generation."""
    return session.scalar(select(CheckpointRow.body).where(CheckpointRow.run_id == run_id))


def finding(session: Session, diagnosis_id: str) -> dict[str, Any]:
    """Return the finding (result) of a diagnosis as JSON; raise a 404, or a 409 if the diagnosis has not succeeded."""
    row = one(session, DiagnosisRow, diagnosis_id)
    body: dict[str, Any] | None = session.scalar(select(FindingRow.body).where(FindingRow.diagnosis_id == diagnosis_id))
    if body is None:
        message = f"diagnosis {diagnosis_id} is {row.state}; it has a finding when it has SUCCEEDED"
        raise conflict(message, state=row.state)
    return body


def partial_finding(session: Session, diagnosis_id: str) -> dict[str, Any] | None:
    """Return what a diagnosis without a finding knows so far, as JSON; raise a 404 if there is no such diagnosis.

    None before its nominal model has been fitted, and once it has a finding.
    """
    one(session, DiagnosisRow, diagnosis_id)
    return session.scalar(select(PartialRow.body).where(PartialRow.diagnosis_id == diagnosis_id))


def admitted(session: Session, row: JobRow, most: int) -> str | None:
    """Return the owner of the new job ``row``, that of its dataset or film; None for one without an owner.

    Raises a 429 if ``most`` jobs of this owner have not ended, a 404 if there is no such dataset or film.
    """
    table, subject_id = row.subject
    owner = one(session, table, subject_id).owner
    unfinished = (
        select(func.count()).select_from(table).where(table.state.in_(ACTIVE), of_owner(table, owner)) for table in JOBS
    )
    count = sum(session.scalar(query) or 0 for query in unfinished)
    if count >= most:
        detail = f"{count} jobs have not ended, and {most} are the most at a time; wait for some, or cancel them"
        raise ProblemError(429, "too-many", detail)
    return owner


def free_name(session: Session, row: JobRow, name: str) -> str:
    """Return ``name``, the default one of the new job ``row``, or with the first number that makes it the only one.

    Compared are the jobs of its kind on the same dataset or film. The name is cut to the length that names may have.
    """
    table, (subject, subject_id) = type(row), row.subject
    return _free(session, table, getattr(table, f"{subject.__tablename__}_id") == subject_id, name)


def free_dataset_name(session: Session, owner: str | None, name: str) -> str:
    """Return ``name``, or with the first number that makes it the only one among the datasets of ``owner``."""
    return _free(session, DatasetRow, of_owner(DatasetRow, owner), name)


def _free(session: Session, table: type[JobRow] | type[DatasetRow], among: ColumnElement[bool], name: str) -> str:
    stem = name[:LONGEST_STEM]
    taken = set(session.scalars(select(table.name).where(among, table.name.startswith(stem, autoescape=True))))
    candidates = chain([name[:LONGEST_NAME]], (f"{stem}, {count}" for count in range(2, len(taken) + 3)))
    return next(one for one in candidates if one not in taken)


def of_owner(table: type[OwnedRow], owner: str | None) -> ColumnElement[bool]:
    """Return the condition that a row of ``table`` belongs to ``owner``; None: to nobody."""
    return table.owner.is_(None) if owner is None else table.owner == owner


def jobs_in(session: Session, table: type[JobRow], state: State) -> list[JobRow]:
    """Return the jobs of ``table`` in ``state``, oldest first. Rows that cannot be read are logged and skipped."""
    numbers = session.scalars(select(table.number).where(table.state == state.value).order_by(table.number)).all()
    return [row for number in numbers if (row := _readable(session, table, number))]


def _readable(session: Session, table: type[JobRow], number: int) -> JobRow | None:
    try:
        row = session.get_one(table, number)
        job(row)
    except Exception as error:  # the stored values may be anything
        if is_full(error):  # the disk fails, the row may be readable
            raise
        LOG.error("row %d of %s cannot be read and is left alone (%s)", number, table.__name__, error)
        return None
    return row


def job(row: JobRow) -> Job:
    """Return the job that ``row`` stores; raise ValueError or TypeError for values that the server never stores."""
    starts = row.starts or 0
    numbers: tuple[object, ...] = (row.generations, starts, row.progress)
    times: tuple[object, ...] = (row.created_at, row.started_at, row.finished_at)
    readable = all(isinstance(one, int | float) for one in numbers) and all(
        isinstance(one, str | None) for one in times
    )
    if not readable:
        raise TypeError(f"its numbers are {numbers}, its times {times}")
    return Job(State(row.state), Wish(row.wish), row.generations, row.progress, row.error, starts)


def put_job(row: JobRow, after: Job) -> None:
    """Store ``after``, the job as it is after an event, in ``row``; set the start and end times that follow."""
    row.state, row.wish = after.state.value, after.wish.value
    row.generations, row.progress, row.error, row.starts = after.generations, after.progress, after.error, after.starts
    if after.state is State.RUNNING and row.started_at is None:
        row.started_at = now()
    if after.state.final:
        row.finished_at = now()
        if session := object_session(row):
            session.execute(delete(SimulatedRow).where(SimulatedRow.job_id == row.id))
    if after.state.final or after.state is State.PAUSED:
        row.eta_seconds = None


def spec(row: RunRow) -> CalibrationSpec:
    """Return the specification (model, method and settings) of the run stored in ``row``."""
    return spec_from(row.spec)


def spec_from(values: dict[str, Any]) -> CalibrationSpec:
    """Return the specification of a run from ``values``, its stored JSON; missing fields get their defaults."""
    return _SPEC.validate_python(BEFORE_METHODS | values)


def spec_json(given: CalibrationSpec | DiagnosisSpec) -> dict[str, Any]:
    """Return the specification of a run or diagnosis as JSON to be stored.

    The decision thresholds of a diagnosis (``policy``) are omitted, because no request can set them.
    """
    plain: dict[str, Any] = json.loads(json.dumps(asdict(given)))
    plain.pop("policy", None)
    return plain


# -- answers to repeated requests ------------------------------------------------------------------------


# By the part of a location that names the resource.
_MADE: dict[str, type[OwnedRow]] = {
    "datasets": DatasetRow,
    "films": FilmRow,
    "runs": RunRow,
    "diagnoses": DiagnosisRow,
    "trackings": TrackingRow,
}


@dataclass(frozen=True)
class Repeat:
    """Identifies a request, so that its repetition is recognised.

    ``path``: of the request, with the caller's owner if keys are required; ``key``: value of its Idempotency-Key
    header; ``fingerprint``: SHA-256 of its contents (hexadecimal).
    """

    path: str
    key: str
    fingerprint: str


@dataclass(frozen=True)
class Answer:
    """The HTTP response to a request that created a resource: status, path of the resource, and JSON body."""

    status: int
    location: str
    body: Mapping[str, Any]


def earlier_answer(session: Session, repeat: Repeat | None) -> Answer | None:
    """Return the stored answer to an earlier request with the same ``repeat``; None if there is none or no key.

    Raises a 422 if the Idempotency-Key was used for a request with other contents; a 409 if the created resource was
    deleted since, because a repetition must not create the resource again.
    """
    row = session.get(AnswerRow, (repeat.path, repeat.key)) if repeat else None
    if row is None or repeat is None:
        return None
    if row.fingerprint != repeat.fingerprint:
        raise invalid(
            "this Idempotency-Key was used for another request",
            [error_item("header.Idempotency-Key", repeat.key, "use a new key for a new request")],
        )
    *_, kind, made = row.location.split("/")
    if session.scalar(select(_MADE[kind].id).where(_MADE[kind].id == made)) is None:
        raise conflict(f"{made}, which this Idempotency-Key made, was deleted; use a new key to make it again")
    return Answer(row.status, row.location, row.body)


def keep_answer(session: Session, repeat: Repeat | None, answer: Answer) -> None:
    """Store ``answer`` in the transaction that creates its resource; does nothing if ``repeat`` is None (no key)."""
    if repeat:
        session.add(AnswerRow(**vars(repeat), **vars(answer), created_at=now()))


def forget_answers(session: Session) -> None:
    """Delete answers to repeatable requests that are older than ANSWERS_KEPT."""
    session.execute(delete(AnswerRow).where(AnswerRow.created_at < timestamp(datetime.now(UTC) - ANSWERS_KEPT)))
