"""The parts of a running service: creates, starts and stops them; and gives them to routes as FastAPI dependencies."""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack
from functools import partial
from typing import Annotated, Any, TypedDict, Unpack, cast

from fastapi import Depends, Request
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric

from wingfit.service.auth.access import KeyRing
from wingfit.service.datasets.parsed_datasets import Datasets
from wingfit.service.diagnoses.diagnoser import Diagnoser
from wingfit.service.diagnoses.diagnosing import Diagnosing
from wingfit.service.films.films import Films
from wingfit.service.films.tracking import TrackingFilms
from wingfit.service.http import concurrency_limit, threads
from wingfit.service.http.concurrency_limit import ConcurrencyLimit
from wingfit.service.http.events import Events
from wingfit.service.jobs.evaluator_startup import Pool
from wingfit.service.jobs.runner import JobRef, Runner
from wingfit.service.jobs.wakeups import Changes
from wingfit.service.operations.health import Health
from wingfit.service.operations.metrics_and_log import Metrics
from wingfit.service.operations.shutdown import StopLimits
from wingfit.service.rigs.driving import Driving
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
READ_SECONDS = 1.0  # that a caller waits for the database, or for the metrics


class Parts(TypedDict, total=False):
    """The parts of the service that compute; tests replace them by stubs that take no time."""

    engine: Engine
    diagnoser: Diagnoser
    make_evaluator: Callable[[], RunningEvaluator]


class Service:
    """What the routes need: settings, database, jobs, limits on concurrent requests, and metrics."""

    def __init__(self, settings: Settings, database: Database, **parts: Unpack[Parts]) -> None:
        self.settings, self.database = settings, database
        self.engine: Engine = parts.get("engine") or Engine()
        self.diagnoser: Diagnoser = parts.get("diagnoser") or Diagnoser()
        self.keys = KeyRing()
        # Requests being answered: method, path and start, by the id of their ASGI scope.
        self.open_requests: dict[int, tuple[str, str, float]] = {}
        self.metrics = Metrics(self.gauges)
        self.changes = Changes()
        self.events = Events(database, self.changes, self.keys)
        self.simulations = ConcurrencyLimit("simulations", concurrency_limit.SIMULATIONS)
        self.uploads = ConcurrencyLimit("uploads", concurrency_limit.UPLOADS)
        self.exports = ConcurrencyLimit("exports", concurrency_limit.EXPORTS)
        self.plans = ConcurrencyLimit("plans", concurrency_limit.PLANS, concurrency_limit.MAX_WAITING_PLANS)
        self.downloads = ConcurrencyLimit("downloads", concurrency_limit.DOWNLOADS)
        self.answers = ConcurrencyLimit("answers", concurrency_limit.ANSWERS)
        self.film_uploads = ConcurrencyLimit("uploads of films", concurrency_limit.FILM_UPLOADS)
        self.frames = ConcurrencyLimit("frames", concurrency_limit.FRAMES)
        self.backups = ConcurrencyLimit("backups", concurrency_limit.BACKUPS, concurrency_limit.MAX_WAITING_BACKUPS)
        self.datasets = Datasets(database, self.engine)
        self.calibrating = Calibrating(database, self.engine, self.datasets)
        self.diagnosing = Diagnosing(database, self.diagnoser, self.datasets)
        self.films = Films(settings, database)
        self.tracking = TrackingFilms(database, self.films.files)
        kinds = (self.calibrating, self.diagnosing, self.tracking)
        self.driving = Driving(database)
        limits = (settings.max_runs, settings.max_runs_per_owner, settings.max_starts)
        self.runner = Runner(database, self.changes, kinds, *limits, driving=self.driving)
        self._housekeeping = Housekeeping(database, settings.keep_days, self.forget_job)
        make = parts.get("make_evaluator")
        prepare = None if make or settings.ray_address else _compile  # the nodes of a cluster compile for themselves
        self._pool = Pool(make or partial(_evaluator, settings), self.runner.attach, prepare)
        self.health = Health(settings, database, self._pool, kinds)
        self._metrics_text = threads.SharedCall("metrics", self.metrics.text)

    def start(self) -> None:
        """Load the API keys, queue the jobs that an earlier process did not finish, and start the evaluator."""
        self.load_keys()
        forget_snapshots(self.settings.data)
        self.films.start()
        self.runner.recover()
        self._housekeeping.start()
        self._pool.start()

    def load_keys(self) -> None:
        """Read the valid API keys from the database; event streams that were opened with a revoked key end."""
        with self.database.read() as session:
            self.keys.load(session)
        self.changes.wake_all()

    def forget_job(self, job_id: str) -> None:
        """End the event streams of a job that was deleted from the database, and remove its files."""
        self.films.files.forget_tracked(job_id)
        self.changes.publish(job_id)

    def begin_stop(self) -> None:
        """End the event streams and start no more jobs. May be called in a signal handler."""
        self.runner.begin_stop()
        self._housekeeping.stop()
        self.changes.close()
        self.driving.board.changes.close()

    def stop(self, limits: StopLimits | None = None) -> bool:
        """Stop within ``limits``; return whether all threads ended.

        Unfinished jobs stay stored and continue at the next start; the log names what did not end in time.
        """
        limits = limits or StopLimits()
        self.begin_stop()
        # In a thread, because a job that waits for the database may hold the lock of the runner.
        ended = threads.done_within(limits.jobs, "stop-jobs", lambda: self.runner.stop(limits.jobs))
        for line in () if ended else self._running_jobs():
            LOG.warning("given up after %g s: %s", limits.jobs, line)
        self.films.stop()
        if not (closed := self._pool.close(limits.evaluator)):
            LOG.warning(
                "given up: the evaluator has not stopped within %g s; its workers end by themselves", limits.evaluator
            )
        if not (stored := self.database.close(limits.database)):
            LOG.warning("given up: a database write has not ended within %g s; it is rolled back", limits.database)
        return ended and closed and stored

    def unfinished(self) -> Iterator[str]:
        """Yield one line for each request that is being answered and each job that is being computed."""
        for method, path, began in list(self.open_requests.values()):
            yield f"{method} {path}, since {time.monotonic() - began:.1f} s"
        yield from self._running_jobs()

    def _running_jobs(self) -> Iterator[str]:
        for job in self.runner.under_way():
            yield f"{job} stays as stored ({self._last_step(job)}) and continues at the next start"

    def _last_step(self, job: JobRef) -> str:
        def stored() -> str:
            with self.database.read() as session:
                return f"after step {store.one(session, job.kind.table, job.id).generations}"

        try:
            return threads.call("stop-look", stored).result(READ_SECONDS)
        except Exception as error:  # only the log needs it, and the stop goes on
            return f"its last step is unknown: {type(error).__name__}"

    async def metrics_text(self) -> bytes:
        """Return all metrics in the text format of Prometheus; TimeoutError after ``READ_SECONDS``."""
        await self.health.look()
        return await self._metrics_text.result(READ_SECONDS)

    def gauges(self) -> Iterator[Metric]:
        """Yield the state of the service as Prometheus gauges, over all owners; jobs are those of the last count."""
        workers, pace = self._pool.standing or Standing(0), self.runner.pace()
        jobs = GaugeMetricFamily("wingfit_jobs", "Jobs by kind and state.", labels=["kind", "state"])
        for kind, counts in (self.health.jobs or {}).items():
            for state in State:
                jobs.add_metric([kind, state.value], counts.get(state, 0))
        yield jobs
        lost = CounterMetricFamily(
            "wingfit_worker_deaths", "Workers that died, or hung and were killed.", labels=["reason"]
        )
        lost.add_metric(["died"], workers.died)
        lost.add_metric(["hung"], workers.hung)
        yield lost
        yield CounterMetricFamily("wingfit_worker_restarts", "Workers started to replace others.", workers.restarts)
        free = shutil.disk_usage(self.settings.data).free
        size = sum(path.stat().st_size for path in self.settings.data.glob(f"{FILE_NAME}*"))
        for name, description, value in (
            ("database_up", "1 if the database answers.", self.health.jobs is not None),
            ("evaluator_up", "1 if jobs are computed.", self._pool.status == "ok"),
            ("workers", "Living workers of the evaluator.", workers.workers),
            ("job_stalled_seconds", "Longest time since the last progress of a running job.", pace.stalled_s),
            ("queue_age_seconds", "Time that the oldest waiting job has waited.", pace.waited_s),
            ("disk_free_bytes", "Free space on the disk of the data folder.", free),
            ("watchers", "Open event streams.", self.changes.watchers),
            ("database_bytes", "Size of the database and its log.", size),
        ):
            yield GaugeMetricFamily(f"wingfit_{name}", description, value)


def _compile(say: Callable[[str], None], stopped: Callable[[], bool]) -> None:
    from wingfit.workers.compiling import compile_simulator

    compile_simulator(say, stopped)


def _evaluator(settings: Settings) -> RunningEvaluator:
    from wingfit.workers import make_evaluator

    return make_evaluator(settings.evaluator, settings.workers, settings.ray_address)


async def _service(request: Request) -> Service:
    return cast(Service, request.app.state.service)


ServiceDep = Annotated[Service, Depends(_service)]


async def _held_slots() -> AsyncIterator[AsyncExitStack]:
    async with AsyncExitStack() as held:
        yield held


# The slots that a request holds until its answer is sent, or the client is gone.
HeldSlots = Annotated[AsyncExitStack, Depends(_held_slots)]


def _slot(limit_of: Callable[[Service], ConcurrencyLimit]) -> Any:
    async def hold(service: ServiceDep, held: HeldSlots) -> None:
        await held.enter_async_context(limit_of(service).slot())

    return Depends(hold)


async def _simulate(service: ServiceDep, held: HeldSlots) -> AsyncIterator[None]:
    async with service.simulations.slot():
        yield
        # Before the simulation slot is released, so that few answers are in memory at a time; a client that reads
        # slowly then holds no simulation slot.
        await held.enter_async_context(service.answers.slot())


async def _read(service: ServiceDep, held: HeldSlots) -> AsyncIterator[None]:
    async with service.uploads.slot():
        yield
        await held.enter_async_context(service.answers.slot())  # as for simulations


# Dependencies of routes that wait for a slot before they begin.
SIMULATION_SLOT = Depends(_simulate, scope="function")
READ_SLOT = Depends(_read, scope="function")
DOWNLOAD_SLOT = _slot(lambda service: service.downloads)
FRAME_SLOT = _slot(lambda service: service.frames)
UPLOAD_SLOT = _slot(lambda service: service.uploads)
