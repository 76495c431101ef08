"""Trackings as jobs of the runner, each computed in a process of its own; an interrupted one goes on where it was."""

from __future__ import annotations

import json
import logging
import os
import select
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import IO, Any

from sqlalchemy.orm import Session

from wingfit.calibration.evaluator import Evaluator
from wingfit.client.films.answers import Tracking, TrackingResult, TrackingStep
from wingfit.service.answers import checked
from wingfit.service.films import child, views
from wingfit.service.films.description import write_description
from wingfit.service.films.files import RESULT, FilmFiles
from wingfit.service.jobs.job_kind import InterruptedStepError, JobKind, Points, Step
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import FilmRow, TrackedRow, TrackingRow, TrackingStepRow
from wingfit.workers import jobs

LOG = logging.getLogger("wingfit.runs")
MODULE = "wingfit.service.films.tracking_process"
STORE_SECONDS = 0.5  # progress is stored at most so often within a stage: each transaction waits for the disk
LOOK_SECONDS = 0.2
LONGEST_LINE, TRACE_BYTES = 2**20, 4000


class TrackingFilms(JobKind):
    """The tracking of a film as a kind of job: how the runner computes, stores and describes it."""

    what, path, prefix, step_event = "tracking", "/v1/trackings", "tk", "step"
    table, step_table, step_answer = TrackingRow, TrackingStepRow, TrackingStep

    def __init__(self, database: Database, files: FilmFiles) -> None:
        self._database, self._files = database, files

    def view(self, row: TrackingRow) -> Tracking:
        """Return the JSON answer that describes the tracking stored in ``row``."""
        return views.tracking(row)

    def begin(self, _session: Session, row: TrackingRow) -> Points:
        """Reset the progress in ``row``; return no steps: what is detected already makes the next ones fast."""
        row.stage, row.progress, row.elapsed_seconds = None, 0.0, 0.0
        return []

    def steps(self, row: TrackingRow, _evaluator: Evaluator, interrupted: Callable[[], bool]) -> Iterator[Step]:
        """Yield a step at each new stage, within a stage at most every STORE_SECONDS, and one with the result."""
        with self._database.read() as session:
            film = store.one(session, FilmRow, row.film_id)
        if gone := views.absent(film, self._files):
            names = ", ".join(gone)
            raise ValueError(
                f"files of film {film.id} are not on this server: {names}; upload them, and submit it again"
            )
        folder = self._files.new_folder(self._files.tracked(film.id, row.id))
        try:
            description = write_description(folder, film, row.spec, self._files)
            self._files.new_folder(self._files.detected(film.id))
            command = child.command(MODULE, str(description), str(self._files.detected(film.id)), str(folder))
            stage, stored_at = "", 0.0
            for report in _reports(command, interrupted):
                if report["stage"] != stage or time.monotonic() - stored_at > STORE_SECONDS:
                    stage, stored_at = str(report["stage"]), time.monotonic()
                    yield _step(stage, float(report["progress"]))
            found = checked(TrackingResult, json.loads((folder / RESULT).read_text(encoding="utf-8")))
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        yield _result(found)


def _reports(command: list[str], interrupted: Callable[[], bool]) -> Iterator[dict[str, Any]]:
    """Run the process that tracks, and yield what it reports; it ends when this generator does.

    DatasetError with the faults that it reports, RuntimeError if it ends otherwise.
    """
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(  # noqa: S603  # fixed words and paths of this server
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            env=child.environment(),
            start_new_session=True,
            umask=0o077,
        )
        try:
            assert process.stdout is not None  # noqa: S101  # for the type checker
            last: dict[str, Any] = {}
            for line in _lines(process.stdout, interrupted):
                last = json.loads(line)
                if "faults" not in last:
                    yield last
            status = process.wait()
        finally:
            process.kill()
            process.wait()
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    stream.close()
        if status == child.FAULTS:
            raise child.error_of(last["faults"])
        if status:
            log.seek(max(0, os.fstat(log.fileno()).st_size - TRACE_BYTES))
            LOG.error("the process that tracks ended with status %d: %s", status, log.read().decode(errors="replace"))
            cause = f"signal {-status}" if status < 0 else f"status {status}"
            raise ValueError(
                f"the process that tracks ended with {cause}, perhaps for want of memory; track fewer frames, or "
                "convert the videos, for example to MP4 with H.264"
            )


def _lines(stream: IO[bytes], interrupted: Callable[[], bool]) -> Iterator[bytes]:
    """Yield the lines of ``stream`` until it ends; InterruptedStepError soon after ``interrupted()`` is True."""
    held = b""
    while True:
        if interrupted():
            raise InterruptedStepError
        if not select.select([stream], [], [], LOOK_SECONDS)[0]:
            continue
        piece = os.read(stream.fileno(), LONGEST_LINE)
        if not piece:
            return
        *lines, held = (held + piece).split(b"\n")
        yield from lines


def _step(stage: str, progress: float) -> Step:
    def store_step(session: Session, row: TrackingRow, eta: float | None) -> None:
        row.stage = stage
        row.eta_seconds = eta if row.state == jobs.State.RUNNING else None
        step = TrackingStepRow(job_id=row.id, sequence=row.generations, stage=stage, progress=row.progress)
        step.elapsed_seconds, step.eta_seconds = row.elapsed_seconds, eta
        session.add(step)

    return Step(progress, store_step)


def _result(found: TrackingResult) -> Step:
    def store_step(session: Session, row: TrackingRow, _eta: float | None) -> None:
        session.merge(TrackedRow(tracking_id=row.id, body=dict(found)))

    return Step(1.0, store_step, last=True)
