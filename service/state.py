"""The parts of a running service, put together and taken apart in order."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import AsyncIterator, Callable
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any, cast

from fastapi import Depends, Request

from calibration.evaluator import Evaluator
from service import store
from service.access import KeyRing, calling
from service.backup import forget_snapshots
from service.calibrating import Calibrating
from service.changes import Changes
from service.database import FILE_NAME, Database
from service.datasets import Datasets
from service.diagnoser import Diagnoser, ModelDiagnoser
from service.diagnosing import Diagnosing
from service.engine import Engine, ModelEngine
from service.events import Events
from service.housekeeping import Housekeeping
from service.observing import Gauges, Metrics
from service.pool import Pool
from service.reading import Reading
from service.runner import Runner
from service.schemas import HealthOut
from service.settings import Settings
from service.shortcut import Shortcut
from service.tables import DiagnosisRow, RunRow
from service.turns import EXPORTS_AT_ONCE, UPLOADS_AT_ONCE, Turns
from service.work import Work

LOG = logging.getLogger("wingfit")
STOP_SECONDS = 3.0

MakeEvaluator = Callable[[], Evaluator]


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
        self.engine: Engine = engine or ModelEngine()
        self.diagnoser: Diagnoser = diagnoser or ModelDiagnoser()
        self.keys = KeyRing()
        self.metrics = Metrics(self.gauges)
        self.changes = Changes()
        self.reading = Reading(database)
        self.shortcut = Shortcut(self.reading, self.keys, self.metrics)
        self.events = Events(database, self.changes, self.keys)
        self.turns, self.uploads = Turns(), Turns("uploads", UPLOADS_AT_ONCE)
        self.exports = Turns("exports", EXPORTS_AT_ONCE)
        self.datasets = Datasets(database, self.engine)
        self.calibrating = Calibrating(database, self.engine, self.datasets)
        self.diagnosing = Diagnosing(database, self.diagnoser, self.datasets)
        kinds = (self.calibrating, self.diagnosing)
        self.runner = Runner(database, self.changes, kinds, settings.max_runs, settings.max_runs_per_owner)
        self._housekeeping = Housekeeping(database, settings.keep_days, self.changes.publish)
        self._pool = Pool(make_evaluator or _maker(settings), self.runner.attach)

    def start(self) -> None:
        """Take up what was left and start the evaluator."""
        self.load_keys()
        forget_snapshots(self.settings.data)
        self.runner.recover()
        self._housekeeping.start()
        self._pool.start()

    def enqueue(self, work: Work, job_id: str) -> None:
        """Compute a job that was stored, when its turn comes."""
        with self.database.read() as session:
            owner = work.row(session, job_id).owner
        self.runner.enqueue(work, job_id, owner)

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

    def stop(self) -> bool:
        """Stop within seconds, leaving jobs as stored; whether all threads ended."""
        self.begin_stop()
        ended = self.runner.stop(STOP_SECONDS)
        closed = self._pool.close()
        self.database.close()
        return ended and closed

    def gauges(self) -> Gauges:
        """Standing of the service as numbers, of all owners, whoever asks."""
        with calling(None), self.database.read() as session:
            jobs: dict[tuple[tuple[str, str], ...], float] = {
                (("kind", work.what), ("state", state)): float(count)
                for work in (self.calibrating, self.diagnosing)
                for state, count in store.states(session, work.table)
            }
        size = sum(path.stat().st_size for path in self.settings.data.glob(f"{FILE_NAME}*"))
        return {
            "wingfit_jobs": ("Calibrations and diagnoses by state.", jobs),
            "wingfit_evaluator_up": ("Whether jobs are computed.", {(): float(self._pool.status == "ok")}),
            "wingfit_workers": ("Workers of the evaluator.", {(): float(self._pool.workers or 0)}),
            "wingfit_watchers": ("Open event streams.", {(): float(self.changes.watchers)}),
            "wingfit_database_bytes": ("Size of the database and its log.", {(): float(size)}),
        }

    def health(self) -> HealthOut:
        """Standing of the service, of all owners, whoever asks."""
        with calling(None), self.database.read() as session:
            active, diagnoses = store.active(session, RunRow), store.active(session, DiagnosisRow)
        return HealthOut(
            status=self._pool.status,
            version=wingfit_version(),
            sqlite_version=sqlite3.sqlite_version,
            evaluator=self.settings.evaluator,
            workers=self._pool.workers,
            runs_active=active,
            diagnoses_active=diagnoses,
            detail=self._pool.error,
        )


def wingfit_version() -> str:
    """Version of the installed package."""
    try:
        return version("wingfit")
    except PackageNotFoundError:
        return "0+uninstalled"


def _maker(settings: Settings) -> MakeEvaluator:
    def make() -> Evaluator:
        from workers import make_evaluator

        return make_evaluator(settings.evaluator, settings.workers, settings.ray_address)

    return make


async def _service(request: Request) -> Service:
    return cast(Service, request.app.state.service)


ServiceDep = Annotated[Service, Depends(_service)]


def _in_turn(turns_of: Callable[[Service], Turns]) -> Any:
    async def taken(service: ServiceDep) -> AsyncIterator[None]:
        async with turns_of(service).turn():
            yield

    return Depends(taken)


# Of a route that simulates, or reads an upload: it begins when its turn comes.
IN_TURN = _in_turn(lambda service: service.turns)
IN_TURN_OF_UPLOADS = _in_turn(lambda service: service.uploads)
