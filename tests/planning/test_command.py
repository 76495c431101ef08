"""``wingfit plan``: its tables, its JSON, and what it refuses."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.command_line import Wingfit, in_process
from wingfit.cli.main import app

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def wingfit() -> Wingfit:
    return in_process(app)


@pytest.fixture
def description(tmp_path: Path) -> Path:
    return Path(shutil.copy(EXAMPLES / "delfly" / "dataset.yaml", tmp_path))


def test_tables_of_genes_and_effects(wingfit: Wingfit, description: Path) -> None:
    words = ("--effects", "stroke-bias,scale_error,unit_error", "--add", 0, "--recording", "test-1")
    code, out, err = wingfit("plan", description, *words)
    assert code == 0, err
    assert "plan of delfly: 1 recording of 28 beats and 100 samples per beat" in out
    assert "(a default; state yours)" in out
    assert "C_l" in out
    assert any({"scale_error", "unit_error"} <= set(line.split()) for line in out.splitlines()), out


def test_the_plan_as_json(wingfit: Wingfit, description: Path) -> None:
    words = ("--effects", "none", "--add", 0, "--noise-mn", 2, "--genes", "C_l", "--genome", "C_l=1.2", "--json")
    code, out, err = wingfit("plan", description, *words)
    assert code == 0, err
    found = json.loads(out)
    assert found["noise"]["deviation"] == {"x": 2.0, "z": 2.0}
    assert [(one["name"], one["value"]) for one in found["genes"]] == [("C_l", 1.2)]
    assert found["effects"] == []


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("--noise-mm", "0.4"), "noise_mm is a setting of marker tracks of a wing"),
        (("--beats", "0"), "beats is 0; give a whole number from 1 to 100000"),
        (("--effects", "backlash"), "unknown suspect 'backlash'"),
        (("--genes", "E_f"), "unknown gene 'E_f'"),
    ],
)
def test_what_cannot_be_planned_is_refused(
    wingfit: Wingfit, description: Path, words: tuple[str, ...], error: str
) -> None:
    code, _, err = wingfit("plan", description, *words)
    assert code == 1
    assert error in err


def test_a_dataset_that_does_not_exist_is_refused(wingfit: Wingfit, tmp_path: Path) -> None:
    code, _, err = wingfit("plan", tmp_path / "nothing")
    assert code == 1
    assert "does not exist" in err


def test_series_need_their_rig(wingfit: Wingfit) -> None:
    code, _, err = wingfit("plan", EXAMPLES / "pendulum")
    assert code == 1
    assert "name its simulation: --rig my_rig.py" in err
