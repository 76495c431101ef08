"""A server that hangs in some of its parts: ``python -m tests.service.operations.stuck_server PARTS GIVE_UP KILL``.

The steps of its graceful stop take a fraction of a second each, so that tests do not wait; ``GIVE_UP`` and ``KILL`` are
the limits of what follows. A part says HANGS in the log once it does.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Iterator
from typing import Any, NoReturn

from tests.service.toy import STUCK_SEED, NoEvaluator, ToyEngine
from tests.service.toy_diagnosis import ToyDiagnoser
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.search import CalibrationSpec, Generation
from wingfit.records import Dataset
from wingfit.service.http import json_reads
from wingfit.service.operations.shutdown import StopLimits
from wingfit.service.server import serve
from wingfit.service.settings import Settings
from wingfit.service.storage.database import Database

PARTS = sys.argv[1].split(",")


def hang_here(*_: Any) -> NoReturn:
    print("HANGS", flush=True)
    while True:
        time.sleep(0.01)


def hang_in_c(*_: Any) -> NoReturn:
    print("HANGS", flush=True)
    ctypes.PyDLL(None).sleep(1000)  # which keeps the interpreter's lock
    raise AssertionError


def hang_with_the_database(*_: Any) -> NoReturn:
    with DATABASES[0].write():
        hang_here()


DATABASES: list[Database] = []


class StuckEngine(ToyEngine):
    def check(self, spec: CalibrationSpec, dataset: Dataset) -> CalibrationSpec:
        if "requests" in PARTS and spec.seed == STUCK_SEED:
            hang_here()
        return super().check(spec, dataset)

    def calibrate(
        self, spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None
    ) -> Iterator[Generation]:
        for number, generation in enumerate(super().calibrate(spec, dataset, evaluator, checkpoint)):
            for part in PARTS if number == 2 else ():
                HANGING.get(part, hang_nowhere)()
            yield generation


def hang_nowhere() -> None:
    pass


HANGING = {"job": hang_here, "interpreter": hang_in_c, "database": hang_with_the_database}


class StuckEvaluator(NoEvaluator):
    def close(self) -> None:
        if "evaluator" in PARTS:
            hang_here()


if __name__ == "__main__":
    opened = Database.__init__

    def noted(self: Database, *given: Any) -> None:
        opened(self, *given)
        DATABASES.append(self)

    Database.__init__ = noted  # type: ignore[method-assign, assignment]
    if "loop" in PARTS:
        json_reads.history = hang_here  # type: ignore[assignment]  # which the event loop itself calls
    limits = StopLimits(1, 0.3, 0.3, 0.3, float(sys.argv[2]), float(sys.argv[3]))
    settings = Settings.from_env()
    serve(settings, engine=StuckEngine(), make_evaluator=StuckEvaluator, diagnoser=ToyDiagnoser(), limits=limits)
