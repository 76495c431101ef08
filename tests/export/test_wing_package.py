"""The package of a wing is complete and imports without wingfit; in this process it moves as wingfit's own wing."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.oracles.exports import PACKAGE_NEEDS, run, site_of
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.formats import exported
from wingfit.export.predict import predictor
from wingfit.export.runtime.wing import WingModel

CODE = """
import robird
model = robird.Model()
refused = []
for given in ({"flap_frequency_hz": 9.0}, {"airspeed_m_s": float("nan")}):
    try:
        model.motion(**given)
    except ValueError as error:
        refused.append(f"{type(error).__name__}: {error}")
print(json.dumps([refused, [gene.name for gene in model.simulation.genes], robird.WING == model.wing]))
"""


@pytest.fixture
def model(wing: CalibratedModel) -> WingModel:
    found = predictor(wing)
    assert isinstance(found, WingModel)
    return found


def test_it_imports_without_wingfit_and_scipy(wing: CalibratedModel, tmp_path: Path) -> None:
    """Nothing is compiled here: that takes a minute, and `python -m benchmarks.export` compares the motion."""
    file = exported(wing, "python")
    with zipfile.ZipFile(io.BytesIO(file.body)) as archive:
        names = set(archive.namelist())
        archive.extractall(tmp_path)
    assert {"robird/pyproject.toml", "robird/LICENSE", "robird/README.md", "robird/robird/__main__.py"} <= names
    refused, genes, same = run(CODE, tmp_path / "robird", site_of(tmp_path / "site", PACKAGE_NEEDS), cache=tmp_path)
    assert refused[0].startswith("OutsideRangeError: flap_frequency_hz 9 is outside [2, 4] Hz")
    assert refused[1] == "ValueError: airspeed_m_s is nan; it must be a finite number in m/s"
    assert genes == [one.name for one in wing.parameters]
    assert same


def test_equal_models_give_equal_bytes(wing: CalibratedModel) -> None:
    assert exported(wing, "python") == exported(wing, "python")


def test_motion_and_its_errors(model: WingModel) -> None:
    found = model.motion(flap_frequency_hz=3.0, airspeed_m_s=3.5)
    stiffer = model.motion(
        flap_frequency_hz=3.0, airspeed_m_s=3.5, errors=False,
        values={"E_r": model.calibrated.parameters[0].value} | {"E_r": 1.05 * _value(model, "E_r")},
    )  # fmt: skip
    assert found.errors is not None
    moved = np.abs(stiffer.position_m - found.position_m)
    error = found.errors["position_m"]
    assert moved.max() == pytest.approx(error.max(), rel=0.15)
    means = found.means()
    assert means["mean_air_force_z_low_n"] < means["mean_air_force_z_n"] < means["mean_air_force_z_high_n"]


def test_a_transient_ends_in_the_periodic_motion(model: WingModel) -> None:
    where = {"flap_frequency_hz": 3.0, "airspeed_m_s": 3.5}
    time, position = model.transient(8, **where)  # type: ignore[arg-type]
    steps = len(position) // 8
    assert time[-1] == pytest.approx(8 / 3.0 - 1 / (3.0 * steps))
    rest = np.array([marker.position for marker in model.wing.markers])
    assert np.abs(position[0] - rest).max() < 0.01
    last, before = position[-steps:], position[-2 * steps : -steps]
    assert np.abs(last - before).max() < 1e-4
    _, after = model.transient(8, start={"flap_frequency_hz": 2.5, "airspeed_m_s": 3.5}, **where)  # type: ignore[arg-type]
    assert np.abs(after[-steps:] - last).max() < 1e-4
    assert np.abs(after[:steps] - last).max() > 1e-4
    with pytest.raises(ValueError, match="beats is 0"):
        model.transient(0)


def test_the_forces_are_json(model: WingModel) -> None:
    assert json.loads(json.dumps(model.motion(errors=False).means()))


def _value(model: WingModel, name: str) -> float:
    return next(one.value for one in model.calibrated.parameters if one.name == name)
