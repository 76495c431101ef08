"""Tables of the database as SQLAlchemy classes; the migrations in `service/storage/migrations` create them."""

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
    """Base of all tables. Times are RFC 3339 text in UTC; ``number`` counts the rows of a table as they are created."""

    metadata = MetaData(naming_convention=NAMING)
    type_annotation_map = {dict[str, Any]: JSON, list[dict[str, Any]]: JSON}  # noqa: RUF012  # read by SQLAlchemy


class OwnedRow:
    """The columns that datasets, films and jobs share.

    Attributes:
        id: public id, e.g. "run_5c1e07a94bd83f26".
        owner: of a dataset or film, the owner of the API key that made it, None if no key was required; of a job, the
            owner of its dataset or film.
    """

    __tablename__: Any
    __table_args__: Any = {"sqlite_autoincrement": True}  # noqa: RUF012
    number: Mapped[int] = mapped_column(primary_key=True)
    id: Mapped[str] = mapped_column(unique=True)
    owner: Mapped[str | None] = mapped_column(index=True)
    name: Mapped[str]
    created_at: Mapped[str]


class KeyRow(Table):
    """An API key; revoked keys stay in the table, with the time ``revoked_at``.

    The secret itself is not stored, only its hash ``sha256``. ``scopes``: what the key permits (read, write, admin).
    """

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
    """The description of an uploaded dataset; its bytes are in :class:`ArchiveRow`.

    ``kind``: "tracks" (markers of a flexible wing), "forces" (of a vehicle) or "series" (of a rig of the user's own).
    ``filename``, ``sha256`` and ``size_bytes`` are those of the uploaded file; ``markers`` is the number of markers on
    the wing (else 0); ``recordings`` describes each recording as JSON, ``rig`` the rig of a dataset of series (else
    None); ``warnings`` the likely mistakes found at its upload (None for one of an earlier version); ``notes`` what
    its users wrote about it.
    """

    __tablename__ = "dataset"

    kind: Mapped[str] = mapped_column(server_default="tracks")
    description: Mapped[str]
    filename: Mapped[str]
    sha256: Mapped[str]
    size_bytes: Mapped[int]
    markers: Mapped[int]
    recordings: Mapped[list[dict[str, Any]]]
    rig: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    warnings: Mapped[list[dict[str, Any]] | None] = mapped_column(JSON(none_as_null=True))
    notes: Mapped[str] = mapped_column(default="", server_default="")


class ArchiveRow(Table):
    """The uploaded file of a dataset, byte for byte."""

    __tablename__ = "archive"

    dataset_id: Mapped[str] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class ParsedRow(Table):
    """A dataset in the internal format of `records/files/parsed.py`; stored for NetCDF uploads only.

    A damaged NetCDF file can hang its reader, so the uploaded file is opened only once.
    """

    __tablename__ = "parsed"

    dataset_id: Mapped[str] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class ClockRow(Table):
    """The service clock, a single row: seconds that the service has run, and the wall time when they were stored."""

    __tablename__ = "clock"

    id: Mapped[int] = mapped_column(primary_key=True)
    service_seconds: Mapped[float]
    wall_time: Mapped[str]


class JobRow(OwnedRow):
    """The columns that runs, diagnoses and trackings share.

    Attributes:
        spec: the specification (model, method, settings) as JSON.
        state, wish, generations, progress, error, starts: those of `workers.jobs.Job`.
        stage: name of the present stage of the search.
        eta_seconds: estimated remaining time (s), None if unknown.
        elapsed_seconds: computing time up to the last stored step (s).
        ended_at_service_seconds: reading of the service clock (s) when the end of the job was first noticed.
    """

    spec: Mapped[dict[str, Any]]
    state: Mapped[str] = mapped_column(index=True)
    wish: Mapped[str]
    stage: Mapped[str | None]
    progress: Mapped[float] = mapped_column(default=0.0)
    eta_seconds: Mapped[float | None]
    started_at: Mapped[str | None]
    finished_at: Mapped[str | None]
    generations: Mapped[int] = mapped_column(default=0)
    elapsed_seconds: Mapped[float] = mapped_column(default=0.0)
    error: Mapped[str | None]
    starts: Mapped[int] = mapped_column(default=0)
    ended_at_service_seconds: Mapped[float | None]

    @property
    def subject(self) -> tuple[type[OwnedRow], str]:
        """The table and the id of what the job computes on: of a dataset, or of a film."""
        raise NotImplementedError


class DatasetJobRow(JobRow):
    """The columns that runs and diagnoses share, beside those of every job.

    Attributes:
        kind: of the dataset.
        rig: of a job on series, the rig as `service.rigs.stored_rig` stores it; else None.
        rig_name, driven: its name, and whether drivers simulate it; lists of jobs do not read the rig.
        evaluations: number of evaluated individuals so far.
        residual_over_noise, held_out_over_noise: misfit to the fitted and the held-out recordings as a multiple of the
            noise; None if unknown, or before the job has succeeded.
        notes: what its users wrote about it.
    """

    kind: Mapped[str] = mapped_column(server_default="tracks")
    dataset_id: Mapped[str] = mapped_column(ForeignKey("dataset.id", ondelete="RESTRICT"), index=True)
    rig: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    rig_name: Mapped[str | None]
    driven: Mapped[bool] = mapped_column(default=False)
    evaluations: Mapped[int] = mapped_column(default=0)
    residual_over_noise: Mapped[float | None]
    held_out_over_noise: Mapped[float | None]
    notes: Mapped[str] = mapped_column(default="", server_default="")

    @property
    def subject(self) -> tuple[type[OwnedRow], str]:
        """The table of datasets, and the id of the dataset that the job computes on."""
        return DatasetRow, self.dataset_id


class RunRow(DatasetJobRow, Table):
    """A calibration run.

    Attributes:
        best_mm, best_mn: misfit of the best genome (of the present stage, at the end of the result): mm for tracks, mN
            for forces.
        best_percent: the same for series, in percent of the range of the channels; at the end of the search.
        genome: best genome so far, gene name to value; None before the first generation.
        result: result as JSON; None unless the run has succeeded.
    """

    __tablename__ = "run"

    best_mm: Mapped[float | None]
    best_mn: Mapped[float | None]
    best_percent: Mapped[float | None]
    genome: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    result: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


class DiagnosisRow(DatasetJobRow, Table):
    """A diagnosis; ``generations`` counts its steps.

    ``run_id``: the run whose best genome the diagnosis starts from, None if there is none or the run was deleted.
    ``verdict`` and ``summary`` come from the finding; None before the diagnosis has succeeded.
    """

    __tablename__ = "diagnosis"

    run_id: Mapped[str | None] = mapped_column(ForeignKey("run.id", ondelete="SET NULL"), index=True)
    verdict: Mapped[str | None]
    summary: Mapped[str | None]


class FindingRow(Table):
    """The finding (result as JSON) of a succeeded diagnosis; not in DiagnosisRow, because lists do not need it."""

    __tablename__ = "finding"

    diagnosis_id: Mapped[str] = mapped_column(ForeignKey("diagnosis.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[dict[str, Any]]


class PartialRow(Table):
    """What the diagnosis knew at its last stored step (a partial finding as JSON); deleted when it has its finding."""

    __tablename__ = "partial"

    diagnosis_id: Mapped[str] = mapped_column(ForeignKey("diagnosis.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[dict[str, Any]]


class StepOfJob:
    """The columns that the steps of all jobs share: the progress of the job at that step.

    ``sequence`` counts the steps of a job from 1, over all stages and restarts; ``elapsed_seconds``: computing time so
    far.
    """

    job_id: Mapped[str]
    sequence: Mapped[int] = mapped_column(primary_key=True)
    stage: Mapped[str]
    progress: Mapped[float]
    elapsed_seconds: Mapped[float]
    eta_seconds: Mapped[float | None]


class StepRow(StepOfJob, Table):
    """One step of a diagnosis: its progress, and the count of evaluated individuals, at that time."""

    __tablename__ = "step"

    job_id: Mapped[str] = mapped_column(
        "diagnosis_id", ForeignKey("diagnosis.id", ondelete="CASCADE"), primary_key=True
    )
    evaluations: Mapped[int]


class FilmRow(OwnedRow, Table):
    """The films of one recording with several cameras; the files are in the data folder (`service/films/files.py`).

    Attributes:
        cameras: as JSON, of each camera its name and stated rate, and what is known of its video
            (`service.films.description.CameraOfFilm`).
        calibration: name of the file of calibrated cameras; None before its upload.
        size_bytes: of all files of the film.
    """

    __tablename__ = "film"

    cameras: Mapped[list[dict[str, Any]]]
    calibration: Mapped[str | None]
    size_bytes: Mapped[int] = mapped_column(default=0)


class TrackingRow(JobRow, Table):
    """The tracking of the markers in a film; ``generations`` counts its steps.

    ``dataset_id``: of the wing whose markers are tracked, as requested; their places are copied into ``spec``, so that
    the dataset may be deleted.
    """

    __tablename__ = "tracking"

    film_id: Mapped[str] = mapped_column(ForeignKey("film.id", ondelete="RESTRICT"), index=True)
    dataset_id: Mapped[str | None]

    @property
    def subject(self) -> tuple[type[OwnedRow], str]:
        """The table of films, and the id of the film that is tracked."""
        return FilmRow, self.film_id


class TrackingStepRow(StepOfJob, Table):
    """One step of a tracking: its progress at that time."""

    __tablename__ = "tracking_step"

    job_id: Mapped[str] = mapped_column("tracking_id", ForeignKey("tracking.id", ondelete="CASCADE"), primary_key=True)


class TrackedRow(Table):
    """The result of a tracking that has succeeded, as JSON; the tracks themselves are files."""

    __tablename__ = "tracked"

    tracking_id: Mapped[str] = mapped_column(ForeignKey("tracking.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[dict[str, Any]]


class CheckpointRow(Table):
    """The state of a run's search after its last stored generation, as JSON; the run continues from it."""

    __tablename__ = "checkpoint"

    run_id: Mapped[str] = mapped_column(ForeignKey("run.id", ondelete="CASCADE"), primary_key=True)
    body: Mapped[dict[str, Any]]


class GenerationRow(StepOfJob, Table):
    """One finished generation of a run.

    Attributes:
        generation: number of the generation within its stage, from 0.
        best, mean: sum of squares (m^2 or N^2) of the best individual, and its mean over those that did not fail.
        best_mm, best_mn, best_percent: misfit of the best individual, as in :class:`RunRow`; two of them are None.
        failed, reasons: number of individuals whose simulation failed, and why.
    """

    __tablename__ = "generation"

    job_id: Mapped[str] = mapped_column("run_id", ForeignKey("run.id", ondelete="CASCADE"), primary_key=True)
    evaluations: Mapped[int]
    generation: Mapped[int]
    best: Mapped[float | None]
    mean: Mapped[float | None]
    diversity: Mapped[float | None]
    best_mm: Mapped[float | None]
    best_mn: Mapped[float | None]
    best_percent: Mapped[float | None]
    failed: Mapped[int]
    reasons: Mapped[list[str]] = mapped_column(JSON)


class SimulatedRow(Table):
    """One simulation that a driver computed for a job, so that a job that starts again does not ask for it again.

    ``key`` identifies effects, recording and values of the genes; ``channels`` are float64 values [T, C], row by row;
    None if the simulation failed, for the ``reason``. Rows are deleted when their job ends.
    """

    __tablename__ = "simulated"

    job_id: Mapped[str] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    channels: Mapped[bytes | None] = mapped_column(LargeBinary)
    reason: Mapped[str | None]


class AnswerRow(Table):
    """The answer to a request that carried an ``Idempotency-Key``, stored with what the request created.

    The columns are those of `store.Repeat` and `store.Answer`, and the time of storing.
    """

    __tablename__ = "answer"

    path: Mapped[str] = mapped_column(primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    fingerprint: Mapped[str]
    status: Mapped[int]
    location: Mapped[str]
    body: Mapped[dict[str, Any]]
    created_at: Mapped[str]
