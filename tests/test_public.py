"""The public package: its names, how light it is, and that it computes what the parts compute."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import wingfit
from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.result import Result

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
HEAVY = ("numba", "ray", "fastapi", "sqlalchemy", "scipy", "numpy", "deap", "h5py", "plotly")


def loaded(code: str) -> set[str]:
    """Which of the heavy libraries a fresh interpreter has loaded after ``code``."""
    program = f"{code}; import sys; print(*[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd="/")
    return set(done.stdout.split())


def test_every_public_name_is_there_and_documented() -> None:
    for name in wingfit.__all__:
        assert getattr(wingfit, name).__doc__, name
    assert set(dir(wingfit)) == set(wingfit.__all__)
    with pytest.raises(AttributeError, match="no attribute 'calibrat'; it has"):
        _ = wingfit.calibrat


@pytest.mark.parametrize(
    "code",
    ["import wingfit", "from wingfit import Client, WingfitError, ServerAwayError", "import wingfit.cli.main"],
)
def test_client_and_command_line_load_nothing_heavy(code: str) -> None:
    assert loaded(code) == set()
    assert loaded(f"{code}; import numpy") == {"numpy"}


def test_figures_are_part_of_the_package_and_load_plotly_when_they_are_drawn() -> None:
    assert "plotly" not in loaded("import wingfit; wingfit.plot.history; from wingfit.plot import wing")
    assert "plotly" in loaded("import wingfit; wingfit.plot.forces({'phase': [0.0], 'lift_n': [1.0]})")


def test_the_help_of_every_command_loads_nothing_that_computes() -> None:
    program = "from typer.testing import CliRunner; from wingfit.cli.main import app; "
    program += "assert CliRunner().invoke(app, ['kinematics', '--help']).exit_code == 0; "
    program += "assert CliRunner().invoke(app, ['runs', 'submit', '--help']).exit_code == 0"
    assert loaded(program) == set()


def test_a_wing_is_calibrated_without_a_server() -> None:
    dataset = wingfit.load_dataset(EXAMPLES / "robird")
    names = tuple(recording.name for recording in dataset.recordings[:1])
    spec = wingfit.CalibrationSpec(
        division="4", mode="joint", method="gauss_newton", recordings=names, genes=("E_f",), max_generations=2
    )
    steps: list[float] = []
    found = wingfit.calibrate(dataset, spec, on_progress=lambda fraction, _: steps.append(fraction))
    assert isinstance(found, Result)
    assert found.after < found.before
    assert steps == sorted(steps)
    assert steps


def test_a_vehicle_is_calibrated_without_a_server() -> None:
    dataset = wingfit.load_dataset(EXAMPLES / "delfly")
    spec = wingfit.CalibrationSpec(recordings=(dataset.recordings[0].name,))
    found = wingfit.calibrate(dataset, spec)
    assert isinstance(found, ForceResult)
    with pytest.raises(ValueError, match="no"):
        wingfit.calibrate(dataset, wingfit.CalibrationSpec(recordings=("no such",)))
    assert np.isfinite(found.after)


def test_the_wheel_holds_one_package() -> None:
    """`make check-wheel` builds it; here: what is found for it, without a build."""
    text = (ROOT / "pyproject.toml").read_text()
    assert re.search(r'\[tool\.setuptools\.packages\.find\]\ninclude = \["wingfit\*"\]', text)
    links = {path.name for path in (ROOT / "wingfit").iterdir() if path.is_symlink()}
    assert links == {
        "inference",
        "calibration",
        "cameras",
        "checks",
        "cli",
        "client",
        "diagnosis",
        "export",
        "importers",
        "planning",
        "plot",
        "records",
        "report",
        "rigs",
        "service",
        "sim",
        "tracking",
        "workers",
    }
