"""Starts the computation with another number of lanes before the first test, since it compiles for a minute."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from wingfit.sim.kernels import LANES
from wingfit.sim.requested_lanes import VARIABLE

OTHER = 4 if LANES == 8 else 8
NAMES = ("motion of the wing with effects", "forces of the vehicle with effects", "Gauss-Newton on the wing")
COMMAND = """
import sys
from tests.golden.numbers import CASES, entry
for name in sys.argv[1:]:
    print(entry(CASES[name]())["sha256"])
"""
_running: list[subprocess.Popen[str]] = []


def pytest_collection_finish(session: pytest.Session) -> None:
    """Start the computation if its test is to run."""
    if session.config.option.collectonly:
        return
    if any("other_lanes" in getattr(item, "fixturenames", ()) for item in session.items):
        repository = Path(__file__).parents[2]
        environment = {**os.environ, VARIABLE: str(OTHER)}
        _running.append(
            subprocess.Popen(
                [sys.executable, "-c", COMMAND, *NAMES],
                cwd=repository,
                env=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        )


def pytest_unconfigure() -> None:
    """End the computation if the tests were interrupted."""
    for process in _running:
        process.kill()
        process.wait()


@pytest.fixture
def other_lanes() -> dict[str, str]:
    """Digests by name of the cases NAMES, computed with OTHER lanes."""
    out, log = _running[0].communicate(timeout=600)
    assert _running[0].returncode == 0, log
    return dict(zip(NAMES, out.split(), strict=True))
