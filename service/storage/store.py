"""Queries and changes of the database. Functions take the caller's session, so the caller defines the transaction."""

from __future__ import annotations

import json
import logging
import re
import secrets
import sqlite3
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, TypeVar

from pydantic import TypeAdapter
from sqlalchemy import ColumnElement, delete, func, select
from sqlalchemy.orm import Session

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
    FindingRow,
    JobRow,
    KeyRow,
    OwnedRow,
    ParsedRow,
    RunRow,
    StepOfJob,
)
from wingfit.workers.jobs import Job, State, Wish

LOG = logging.getLogger("wingfit")
ANSWERS_KEPT = timedelta(days=7)
MB = 10**6
BEFORE = "before-"  # beginning of a cursor
# Value of fields that the first version did not store.
_SPEC = TypeAdapter(CalibrationSpec)
BEFORE_METHODS: dict[str, Any] = {"method": "genetic"}
ACTIVE = tuple(state.value for state in State if not state.final)

Row = TypeVar("Row", bound=OwnedRow | KeyRow)
Step = TypeVar("Step", bound=StepOfJob)


def now() -> str:
    """The present time, RFC 3339 in UTC."""
    return timestamp(datetime.now(UTC))


def timestamp(moment: datetime) -> str:
    """A time in UTC as it is stored: RFC 3339, which sorts by time."""
    return moment.isoformat(timespec="microseconds").replace("+00:00", "Z")


def new_id(prefix: str) -> str:
    """A random id that cannot be guessed."""
    return f"{prefix}_{secrets.token_hex(8)}"


# -- rows of any kind ------------------------------------------------------------------------------------


def one(session: Session, table: type[Row], row_id: str) -> Row:
    """The row with the id, or a 404."""
    found = session.scalar(select(table).where(table.id == row_id))
    if found is None:
        raise not_found(table.__tablename__, row_id)
    return found


# -- lists -----------------------------------------------------------------------------------------------


def page(
    session: Session, table: type[Row], limit: int, cursor: str | None, **equal: str | None
) -> tuple[list[Row], str | None]:
    """Up to ``limit`` rows, newest first, and the cursor to the next ones."""
    query = select(table).order_by(table.number.desc()).limit(limit + 1)
    if cursor is not None:
        query = query.where(table.number < number(cursor))
    for column, value in equal.items():
        if value is not None:
            query = query.where(getattr(table, column) == value)
    rows = list(session.scalars(query))
    following = cursor_before(rows[limit - 1].number) if len(rows) > limit else None
    return rows[:limit], following


def cursor_before(number: int) -> str:
    """The page cursor (opaque text) for the rows created before row ``number``."""
    return f"{BEFORE}{number}"


def number(cursor: str) -> int:
    """The row number that a cursor encodes; a 422 for an invalid cursor."""
    if re.fullmatch(rf"{BEFORE}[0-9]{{1,18}}", cursor):
        return int(cursor.removeprefix(BEFORE))
    item = error_item("query.cursor", cursor, "use next_cursor of the last page")
    raise invalid("the cursor is not one of this server", [item])


# -- datasets --------------------------------------------------------------------------------------------


def archive(session: Session, dataset_id: str) -> bytes:
    """The dataset's bytes as uploaded, or a 404."""
    body = session.scalar(select(ArchiveRow.body).where(ArchiveRow.dataset_id == dataset_id))
    if body is None:
        raise not_found("dataset", dataset_id)
    return body


def parsed(session: Session, dataset_id: str) -> bytes | None:
    """The dataset in its parsed form (bytes), or None if that form is not stored."""
    return session.scalar(select(ParsedRow.body).where(ParsedRow.dataset_id == dataset_id))


def has_parsed(connection: sqlite3.Connection, dataset_id: str) -> bool:
    """Whether the parsed form of the dataset is stored."""
    return connection.execute("SELECT 1 FROM parsed WHERE dataset_id = ?", (dataset_id,)).fetchone() is not None


def keep_parsed(session: Session, dataset_id: str, body: bytes) -> None:
    """Store the parsed form of a dataset, unless it was deleted meanwhile."""
    if session.scalar(select(ArchiveRow.dataset_id).where(ArchiveRow.dataset_id == dataset_id)):
        session.merge(ParsedRow(dataset_id=dataset_id, body=body))


def archive_piece(connection: sqlite3.Connection, dataset_id: str, start: int, size: int) -> bytes:
    """``size`` bytes of the dataset's archive from ``start``, without reading the rest; a 404 if it is deleted."""
    row = connection.execute("SELECT rowid FROM archive WHERE dataset_id = ?", (dataset_id,)).fetchone()
    if row is None:
        raise not_found("dataset", dataset_id)
    with connection.blobopen("archive", "body", row[0], readonly=True) as blob:
        blob.seek(start)
        return blob.read(size)


def make_room(session: Session, owner: str | None, size: int, most_mb: int) -> None:
    """A 429 if the archives of an owner and their parsed forms would take more than ``most_mb``."""
    held = session.scalar(select(func.sum(DatasetRow.size_bytes)).where(_of(DatasetRow, owner))) or 0
    beside = select(func.sum(func.length(ParsedRow.body))).join(DatasetRow, DatasetRow.id == ParsedRow.dataset_id)
    held += session.scalar(beside.where(_of(DatasetRow, owner))) or 0
    if held + size > most_mb * MB:
        raise ProblemError(
            429,
            "too-many",
            f"the archives of one owner may take {most_mb} MB (WINGFIT_MAX_STORED_MB); these take {held / MB:.1f} MB, "
            f"this one {size / MB:.1f} MB more; delete datasets that are not needed",
        )


def delete_dataset(session: Session, dataset_id: str) -> None:
    """Delete a dataset that no run or diagnosis refers to."""
    row = one(session, DatasetRow, dataset_id)
    for table, what in ((RunRow, "run(s)"), (DiagnosisRow, "diagnosis(es)")):
        count = session.scalar(select(func.count()).where(table.dataset_id == dataset_id)) or 0
        if count:
            raise conflict(f"{count} {what} refer to dataset {dataset_id}; delete them first")
    session.delete(row)


# -- jobs ------------------------------------------------------------------------------------------------


def delete_job(session: Session, table: type[JobRow], job_id: str) -> None:
    """Delete a job that has ended, with its steps and results; a 409 for one that has not."""
    row = one(session, table, job_id)
    if row.state in ACTIVE:
        raise conflict(f"{table.__tablename__} {row.id} is {row.state}; cancel it first", state=row.state)
    session.delete(row)


def steps(session: Session, table: type[Step], job_id: str, after: int = 0, limit: int | None = None) -> list[Step]:
    """Generations of a run, or steps of a diagnosis, after sequence ``after``, ascending."""
    query = select(table).where(table.job_id == job_id, table.sequence > after)
    return list(session.scalars(query.order_by(table.sequence).limit(limit)))


def checkpoint(session: Session, run_id: str) -> dict[str, Any] | None:
    """The checkpoint from which the run continues, or None at its start."""
    return session.scalar(select(CheckpointRow.body).where(CheckpointRow.run_id == run_id))


def finding(session: Session, diagnosis_id: str) -> dict[str, Any]:
    """The finding of a diagnosis as JSON; a 404, or a 409 before it has succeeded."""
    row = one(session, DiagnosisRow, diagnosis_id)
    body: dict[str, Any] | None = session.scalar(select(FindingRow.body).where(FindingRow.diagnosis_id == diagnosis_id))
    if body is None:
        message = f"diagnosis {diagnosis_id} is {row.state}; it has a finding when it has SUCCEEDED"
        raise conflict(message, state=row.state)
    return body


def admitted(session: Session, dataset_id: str, most: int) -> str | None:
    """The owner of a dataset, who will own a job on it; a 429 if ``most`` jobs of that owner have not ended."""
    owner = one(session, DatasetRow, dataset_id).owner
    unfinished = (
        select(func.count()).select_from(table).where(table.state.in_(ACTIVE), _of(table, owner))
        for table in (RunRow, DiagnosisRow)
    )
    count = sum(session.scalar(query) or 0 for query in unfinished)
    if count >= most:
        detail = f"{count} jobs have not ended, and {most} are the most at a time; wait for some, or cancel them"
        raise ProblemError(429, "too-many", detail)
    return owner


def _of(table: type[OwnedRow], owner: str | None) -> ColumnElement[bool]:
    return table.owner.is_(None) if owner is None else table.owner == owner


def jobs_in(session: Session, table: type[JobRow], state: State) -> list[JobRow]:
    """Jobs in ``state``, oldest first; unreadable rows are logged and skipped."""
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
    """The job of a row; ValueError or TypeError for values that a server cannot have stored."""
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
    """Store a job in its row, and the times that follow from its state."""
    row.state, row.wish = after.state.value, after.wish.value
    row.generations, row.progress, row.error, row.starts = after.generations, after.progress, after.error, after.starts
    if after.state is State.RUNNING and row.started_at is None:
        row.started_at = now()
    if after.state.final:
        row.finished_at = now()
    if after.state.final or after.state is State.PAUSED:
        row.eta_seconds = None


def spec(row: RunRow) -> CalibrationSpec:
    """The specification of a run from its row."""
    return spec_from(row.spec)


def spec_from(values: dict[str, Any]) -> CalibrationSpec:
    """A specification from its JSON form."""
    return _SPEC.validate_python(BEFORE_METHODS | values)


def spec_json(given: CalibrationSpec | DiagnosisSpec) -> dict[str, Any]:
    """The specification of a run or diagnosis as JSON, without the thresholds of a diagnosis: no request sets them."""
    plain: dict[str, Any] = json.loads(json.dumps(asdict(given)))
    plain.pop("policy", None)
    return plain


# -- answers to repeated requests ------------------------------------------------------------------------


# By the part of a location that names the resource.
_MADE: dict[str, type[OwnedRow]] = {"datasets": DatasetRow, "runs": RunRow, "diagnoses": DiagnosisRow}


@dataclass(frozen=True)
class Repeat:
    """The path and Idempotency-Key of a request, and the hash of its contents."""

    path: str
    key: str
    fingerprint: str


@dataclass(frozen=True)
class Answer:
    """The answer to a request that created a resource."""

    status: int
    location: str
    body: Mapping[str, Any]


def earlier_answer(session: Session, repeat: Repeat | None) -> Answer | None:
    """The earlier answer to the same request; a 422 if the key was used for another request.

    A 409 if the resource was deleted since: it neither exists nor should a repetition create it again.
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
    """Store an answer in the transaction that creates its resource."""
    if repeat:
        session.add(AnswerRow(**vars(repeat), **vars(answer), created_at=now()))


def forget_answers(session: Session) -> None:
    """Delete answers that are older than ANSWERS_KEPT."""
    session.execute(delete(AnswerRow).where(AnswerRow.created_at < timestamp(datetime.now(UTC) - ANSWERS_KEPT)))
