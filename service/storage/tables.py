"""Tables of the database; `service/storage/migrations` creates and changes them."""

from __future__ import annotations

from typing import Any

from sqlalchemy import JSON, ForeignKey, LargeBinary, MetaData
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

NAMING = {
    "ix": "ix_%(table_name)s_%(column_0_name)s",
    "uq": "uq_%(table_name)s_%(column_0_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}


class Table(DeclarativeBase):
    """Base of all tables. Times are RFC 3339 text in UTC; ``number`` is the order of creation."""

    metadata = MetaData(naming_convention=NAMING)
    type_annotation_map = {dict[str, Any]: JSON, list[dict[str, Any]]: JSON}  # noqa: RUF012  # read by SQLAlchemy


class OwnedRow:
    """The columns that datasets and jobs share.

    ``owner`` is that of the key that made a dataset, None where no key was required; a job has that of its dataset.
    """

    __tablename__: Any
    __table_args__: Any = {"sqlite_autoincrement": True}  # noqa: RUF012
    number: Mapped[int] = mapped_column(primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    owner: Mapped[str | None] = mapped_column(index=True)
    name: Mapped[str]
    kind: Mapped[str] = mapped_column(server_default="tracks")
    created_at: Mapped[str]


class KeyRow(Table):
    """An API key. Of its secret only ``sha256`` is stored; revoked keys stay listed."""

    __tablename__ = "key"
    __table_args__ = {"sqlite_autoincrement": True}  # noqa: RUF012

    number: Mapped[int] = mapped_column(primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    name: Mapped[str]
    owner: Mapped[str]
    scopes: Mapped[list[str]] = mapped_column(JSON)
    sha256: Mapped[str] = mapped_column(unique=True)
    created_at: Mapped[str]
    revoked_at: Mapped[str | None]


class DatasetRow(OwnedRow, Table):
    """The description of an uploaded dataset; ``kind`` is "tracks" or "forces"; its bytes: :class:`ArchiveRow`."""

    __tablename__ = "dataset"

    description: Mapped[str]
    filename: Mapped[str]
    sha256: Mapped[str]
    size_bytes: Mapped[int]
    markers: Mapped[int]
    recordings: Mapped[list[dict[str, Any]]]


class ArchiveRow(Table):
    """The bytes of a dataset as they were uploaded."""

    __tablename__ = "archive"

    dataset_id: Mapped[str] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class ParsedRow(Table):
    """A dataset in the parsed form (`records/files/parsed.py`), if its archive must not be opened again."""

    __tablename__ = "parsed"

    dataset_id: Mapped[str] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class ClockRow(Table):
    """The service clock, one row: seconds that the service has run, and the wall time when they were stored."""

    __tablename__ = "clock"

    id: Mapped[int] = mapped_column(primary_key=True)
    service_seconds: Mapped[float]
    wall_time: Mapped[str]


class JobRow(OwnedRow):
    """The columns of every job: state, wish, generations, progress, error and starts are those of `workers.jobs.Job`.

    ``ended_at_service_seconds`` is the service clock (s) when the end of the job was first noticed.
    """

    dataset_id: Mapped[str] = mapped_column(ForeignKey("dataset.id", ondelete="RESTRICT"), index=True)
    spec: Mapped[dict[str, Any]]
    state: Mapped[str] = mapped_column(index=True)
    wish: Mapped[str]
    stage: Mapped[str | None]
    progress: Mapped[float] = mapped_column(default=0.0)
    eta_seconds: Mapped[float | None]
    started_at: Mapped[str | None]
    finished_at: Mapped[str | None]
    generations: Mapped[int] = mapped_column(default=0)
    evaluations: Mapped[int] = mapped_column(default=0)
    elapsed_seconds: Mapped[float] = mapped_column(default=0.0)
    error: Mapped[str | None]
    starts: Mapped[int] = mapped_column(default=0)
    ended_at_service_seconds: Mapped[float | None]


class RunRow(JobRow, Table):
    """A calibration run."""

    __tablename__ = "run"

    best_mm: Mapped[float | None]
    best_mn: Mapped[float | None]
    genome: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    result: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


class DiagnosisRow(JobRow, Table):
    """A diagnosis. ``generations`` counts its steps; ``run_id`` is the run it began with, None once deleted."""

    __tablename__ = "diagnosis"

    run_id: Mapped[str | None] = mapped_column(ForeignKey("run.id", ondelete="SET NULL"), index=True)
    verdict: Mapped[str | None]
    summary: Mapped[str | None]


class FindingRow(Table):
    """The finding of a diagnosis that has succeeded; in its own table, because lists do not need it."""

    __tablename__ = "finding"

    diagnosis_id: Mapped[str] = mapped_column(ForeignKey("diagnosis.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[dict[str, Any]]


class StepOfJob:
    """The columns that generations and steps share; ``sequence`` counts from 1 over all stages and restarts."""

    job_id: Mapped[str]
    sequence: Mapped[int] = mapped_column(primary_key=True)
    stage: Mapped[str]
    progress: Mapped[float]
    evaluations: Mapped[int]
    elapsed_seconds: Mapped[float]
    eta_seconds: Mapped[float | None]


class StepRow(StepOfJob, Table):
    """The progress of a diagnosis at some time."""

    __tablename__ = "step"

    job_id: Mapped[str] = mapped_column(
        "diagnosis_id", ForeignKey("diagnosis.id", ondelete="CASCADE"), primary_key=True
    )


class CheckpointRow(Table):
    """The state of the search after the last stored generation of a run."""

    __tablename__ = "checkpoint"

    run_id: Mapped[str] = mapped_column(ForeignKey("run.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[dict[str, Any]]


class GenerationRow(StepOfJob, Table):
    """One finished generation of a run."""

    __tablename__ = "generation"

    job_id: Mapped[str] = mapped_column("run_id", ForeignKey("run.id", ondelete="CASCADE"), primary_key=True)
    generation: Mapped[int]
    best: Mapped[float | None]
    mean: Mapped[float | None]
    diversity: Mapped[float | None]
    best_mm: Mapped[float | None]
    best_mn: Mapped[float | None]
    failed: Mapped[int]
    reasons: Mapped[list[str]] = mapped_column(JSON)


class AnswerRow(Table):
    """The answer to a request that carried an ``Idempotency-Key``, stored with what the request created."""

    __tablename__ = "answer"

    path: Mapped[str] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    fingerprint: Mapped[str]
    status: Mapped[int]
    location: Mapped[str]
    body: Mapped[dict[str, Any]]
    created_at: Mapped[str]
