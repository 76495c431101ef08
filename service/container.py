"""The parts of a running service, put together and taken apart in order."""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Annotated, Any, cast

from fastapi import Depends, Request

from wingfit.service.auth.access import KeyRing
from wingfit.service.datasets.parsed_datasets import Datasets
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.diagnoses.diagnosing import Diagnosing
from wingfit.service.http import threads
from wingfit.service.http.concurrency_limit import (
    ANSWERS_AT_ONCE,
    BACKUPS_AT_ONCE,
    BACKUPS_WAITING,
    DOWNLOADS_AT_ONCE,
    EXPORTS_AT_ONCE,
    UPLOADS_AT_ONCE,
    Place,
    Turns,
)
from wingfit.service.http.events import Events
from wingfit.service.http.json_reads import Reading
from wingfit.service.http.shortcut import Shortcut
from wingfit.service.jobs.evaluator_startup import Pool
from wingfit.service.jobs.job_kind import JobKind
from wingfit.service.jobs.runner import JobRef, Runner
from wingfit.service.jobs.wakeups import Changes
from wingfit.service.operations.health import Health
from wingfit.service.operations.metrics_and_log import Gauges, Metrics
from wingfit.service.operations.shutdown import StopLimits
from wingfit.service.runs.calibrating import Calibrating
from wingfit.service.runs.engine import Engine
from wingfit.service.settings import Settings
from wingfit.service.storage import store
from wingfit.service.storage.backup import forget_snapshots
from wingfit.service.storage.database import FILE_NAME, Database
from wingfit.service.storage.retention import Housekeeping
from wingfit.workers import RunningEvaluator
from wingfit.workers.jobs import State
from wingfit.workers.watch import Standing

LOG = logging.getLogger("wingfit")
LOOK_SECONDS = 1.0

MakeEvaluator = Callable[[], RunningEvaluator]


class Service:
    """What request handlers work with."""

    def __init__(
        self,
        settings: Settings,
        database: Database,
        engine: Engine | None = None,
        make_evaluator: MakeEvaluator | None = None,
        diagnoser: Diagnoser | None = None,
    ) -> None:
        self.settings, self.database = settings, database
        self.engine: Engine = engine or Engine()
        self.diagnoser: Diagnoser = diagnoser or Diagnoser()
        self.keys = KeyRing()
        # Requests that are being answered: method, path, and when they came.
        self.under_way: dict[int, tuple[str, str, float]] = {}
        self.metrics = Metrics(self.gauges)
        self.changes = Changes()
        self.reading = Reading(database)
        self.shortcut = Shortcut(self.reading, self.keys, self.metrics)
        self.events = Events(database, self.changes, self.keys)
        self.turns, self.uploads = Turns(), Turns("uploads", UPLOADS_AT_ONCE)
        self.exports = Turns("exports", EXPORTS_AT_ONCE)
        self.downloads, self.answers = Turns("downloads", DOWNLOADS_AT_ONCE), Turns("answers", ANSWERS_AT_ONCE)
        self.backups = Turns("backups", BACKUPS_AT_ONCE, BACKUPS_WAITING)
        self.datasets = Datasets(database, self.engine)
        self.calibrating = Calibrating(database, self.engine, self.datasets)
        self.diagnosing = Diagnosing(database, self.diagnoser, self.datasets)
        kinds = (self.calibrating, self.diagnosing)
        self.runner = Runner(
            database, self.changes, kinds, settings.max_runs, settings.max_runs_per_owner, settings.max_starts
        )
        self._housekeeping = Housekeeping(database, settings.keep_days, self.changes.publish)
        self._pool = Pool(make_evaluator or _maker(settings), self.runner.attach)
        self.health = Health(settings, database, self._pool, kinds)
        self._metrics_text = threads.Shared("metrics", self.metrics.text)

    def start(self) -> None:
        """Take up what was left and start the evaluator."""
        self.load_keys()
        forget_snapshots(self.settings.data)
        self.runner.recover()
        self._housekeeping.start()
        self._pool.start()

    def enqueue(self, kind: JobKind, job_id: str) -> None:
        """Compute a job that was stored, when its turn comes."""
        with self.database.read() as session:
            owner = store.one(session, kind.table, job_id).owner
        self.runner.enqueue(kind, job_id, owner)

    def load_keys(self) -> None:
        """Take the keys that are good now; streams that were opened with another one end."""
        with self.database.read() as session:
            self.keys.load(session)
        self.changes.wake_all()

    def begin_stop(self) -> None:
        """Let go of whoever watches, start nothing more. Safe in a signal handler."""
        self.runner.begin_stop()
        self._housekeeping.stop()
        self.changes.close()

    def stop(self, limits: StopLimits | None = None) -> bool:
        """Stop within ``limits``, leaving jobs as stored; whether all threads ended. The log says what did not."""
        limits = limits or StopLimits()
        self.begin_stop()
        # A job that waits for the database may hold the lock by which the runner knows its threads.
        ended = threads.done_within(limits.jobs, "stop-jobs", lambda: self.runner.stop(limits.jobs))
        for line in () if ended else self._jobs_under_way():
            LOG.warning("given up after %g s: %s", limits.jobs, line)
        if not (closed := self._pool.close(limits.evaluator)):
            LOG.warning(
                "given up: the evaluator does not stop within %g s; its workers end by themselves", limits.evaluator
            )
        if not (stored := self.database.close(limits.database)):
            LOG.warning("given up: a write to the database does not end within %g s; it is undone", limits.database)
        return ended and closed and stored

    def unfinished(self) -> Iterator[str]:
        """What is under way, in words: requests, jobs."""
        for method, path, began in list(self.under_way.values()):
            yield f"{method} {path}, since {time.monotonic() - began:.1f} s"
        yield from self._jobs_under_way()

    def _jobs_under_way(self) -> Iterator[str]:
        for job in self.runner.under_way():
            yield f"{job} is left as stored ({self._last_step(job)}) and goes on at the next start"

    def _last_step(self, job: JobRef) -> str:
        def stored() -> str:
            with self.database.read() as session:
                return f"after step {store.one(session, job.kind.table, job.id).generations}"

        try:
            return threads.call("stop-look", stored).result(LOOK_SECONDS)
        except Exception as error:  # the words are for the log, and the stop goes on
            return f"its last step is unknown: {type(error).__name__}"

    async def metrics_text(self) -> bytes:
        """Counters and gauges in the text format of Prometheus; TimeoutError where they take too long."""
        await self.health.look()
        return await self._metrics_text.result(LOOK_SECONDS)

    def gauges(self) -> Gauges:
        """Standing of the service as numbers, of all owners, whoever asks; jobs as of the last look at them."""
        jobs: dict[tuple[tuple[str, str], ...], float] = {
            (("kind", kind), ("state", state.value)): float(counts.get(state, 0))
            for kind, counts in (self.health.jobs or {}).items()
            for state in State
        }
        size = sum(path.stat().st_size for path in self.settings.data.glob(f"{FILE_NAME}*"))
        workers, pace = self._pool.standing or Standing(0), self.runner.pace()
        lost: dict[tuple[tuple[str, str], ...], float] = {
            (("reason", "died"),): float(workers.died),
            (("reason", "hung"),): float(workers.hung),
        }
        return {
            "wingfit_jobs": ("Calibrations and diagnoses by state.", jobs),
            "wingfit_database_up": ("Whether the database answers.", {(): float(self.health.jobs is not None)}),
            "wingfit_evaluator_up": ("Whether jobs are computed.", {(): float(self._pool.status == "ok")}),
            "wingfit_workers": ("Workers of the evaluator that live.", {(): float(workers.workers)}),
            "wingfit_worker_deaths_total": ("Workers that died, or hung and were killed.", lost),
            "wingfit_worker_restarts_total": ("Workers started in place of others.", {(): float(workers.restarts)}),
            "wingfit_job_stalled_seconds": (
                "Time since the last progress of the running job that has waited longest for one.",
                {(): pace.stalled_s},
            ),
            "wingfit_queue_age_seconds": ("Time that the oldest waiting job has waited.", {(): pace.waited_s}),
            "wingfit_disk_free_bytes": (
                "Free space where the data folder is.",
                {(): float(shutil.disk_usage(self.settings.data).free)},
            ),
            "wingfit_watchers": ("Open event streams.", {(): float(self.changes.watchers)}),
            "wingfit_database_bytes": ("Size of the database and its log.", {(): float(size)}),
        }


def _maker(settings: Settings) -> MakeEvaluator:
    def make() -> RunningEvaluator:
        from wingfit.workers import make_evaluator

        return make_evaluator(settings.evaluator, settings.workers, settings.ray_address)

    return make


async def _service(request: Request) -> Service:
    return cast(Service, request.app.state.service)


ServiceDep = Annotated[Service, Depends(_service)]


async def _place() -> AsyncIterator[Place]:
    place = Place()
    try:
        yield place
    finally:
        place.give_back()


# Held until the answer is sent, or the client is gone.
PlaceDep = Annotated[Place, Depends(_place)]


def _in_turn(turns_of: Callable[[Service], Turns]) -> Any:
    async def taken(service: ServiceDep, place: PlaceDep) -> None:
        await place.take(turns_of(service))

    return Depends(taken)


async def _simulating(service: ServiceDep, place: PlaceDep) -> AsyncIterator[None]:
    async with service.turns.turn():
        yield
        # Before the turn is given back, so that few answers are in memory; who reads slowly then holds no such turn.
        await place.take(service.answers)


# Of a route that simulates, whose answer may be large, or that reads an upload: it begins when its turn comes.
IN_TURN = Depends(_simulating, scope="function")
IN_TURN_OF_DOWNLOADS = _in_turn(lambda service: service.downloads)
IN_TURN_OF_UPLOADS = _in_turn(lambda service: service.uploads)
