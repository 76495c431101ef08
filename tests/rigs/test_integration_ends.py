"""An integration ends with a reason where the motion escapes to infinity or the solver makes no progress."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.rigs import run as module
from wingfit.rigs.run import Run, SimulationError

TIMES = np.linspace(0.0, 1.0, 11)


def test_motion_that_escapes_in_finite_time_fails_with_a_reason() -> None:
    run = Run("fall", TIMES, {}, {}, TIMES)
    with pytest.raises(SimulationError, match="grows without bound"):
        run.integrate(lambda _, y: [y[1], -60.0 * y[0] - 300.0 * y[0] ** 2 - 10.0], [0.1, 0.0])


def test_solver_without_progress_fails_with_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_RATES", 10)
    monkeypatch.setattr(module, "RATES_PER_SAMPLE", 1)
    run = Run("swing", TIMES, {}, {}, TIMES)
    with pytest.raises(SimulationError, match="no progress"):
        run.integrate(lambda _, y: [y[1], -400.0 * y[0]], [1.0, 0.0])
