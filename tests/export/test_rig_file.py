"""The parameters of a user's own rig, taken away without its simulation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.oracles.exports import EXAMPLES, SOURCE
from wingfit.calibration.preparation import prepare_rig
from wingfit.calibration.spec import CalibrationSpec
from wingfit.export.calibrated_model import AnyRig, CalibratedModel
from wingfit.export.formats import FormatError, exported
from wingfit.export.from_rig import of_series
from wingfit.export.model_file import model_from_json, model_json
from wingfit.export.runtime.conditions import OutsideRangeError
from wingfit.export.runtime.parts import FittedRange
from wingfit.export.runtime.rig import LoadedRig
from wingfit.records import SeriesDataset, load_dataset
from wingfit.rigs.load import load_rig
from wingfit.rigs.run import Run

PENDULUM = EXAMPLES / "pendulum"


def of(model: CalibratedModel, settings: dict[str, float] | None = None) -> Run:
    """A run of two seconds, as the simulation of the pendulum takes it."""
    times = np.linspace(0.0, 2.0, 41)
    return Run(model.recordings[0].name, times, settings or {}, {}, times)


@pytest.fixture(scope="module")
def model() -> CalibratedModel:
    dataset, rig = load_dataset(PENDULUM), load_rig(str(PENDULUM / "rig.py"))
    assert isinstance(dataset, SeriesDataset)
    assert isinstance(dataset, SeriesDataset)
    spec = CalibrationSpec(recordings=(dataset.fitted[0].name,))
    genes = prepare_rig(spec, rig, dataset).model.genes
    names = ["damping", "gravity", f"angle0[{dataset.fitted[0].name}]"]
    result = {
        "genes": [{"name": one.name, "searched": one.name in names} for one in genes],
        "recordings": [{"name": one.name, "fitted": one.name in spec.recordings} for one in dataset.recordings],
        "covariance": {"names": names, "matrix": np.diag([1e-4, 0.01, 1e-4]).tolist()},
        "after": 1.1,
        "relative_to": "noise",
        "remarks": [],
    }
    return of_series(spec, rig, dataset, {one.name: one.nominal for one in genes}, result, SOURCE)


@pytest.fixture(scope="module")
def space(model: CalibratedModel) -> dict[str, Any]:
    """The names of the file."""
    found: dict[str, Any] = {"__name__": "exported_rig"}
    exec(compile(exported(model, "python").body, "rig.py", "exec"), found)  # noqa: S102  (made above)
    return found


def test_it_is_complete(model: CalibratedModel) -> None:
    assert isinstance(model.rig, AnyRig)
    assert model.covariance is not None
    assert model_from_json(model_json(model)) == model
    with pytest.raises(FormatError, match="its own program"):
        exported(model, "tables")


def test_the_loaded_simulation_has_the_calibrated_parameters(model: CalibratedModel, space: dict[str, Any]) -> None:
    rig, name = load_rig(str(PENDULUM / "rig.py")), model.recordings[0].name
    loaded = space["load"](rig.simulate)
    run = of(model)
    found = loaded(run, recording=name)
    plain = {n.partition("[")[0]: v for n, v in model.values.items() if "[" not in n or n.endswith(f"[{name}]")}
    wanted = rig.simulate(plain, run)
    for channel, values in wanted.items():
        assert found.channels[channel] == pytest.approx(np.asarray(values), rel=1e-12)
        low, high = found.interval(channel)
        assert (low <= high).all()
        assert (high - low).max() > 0.0
    assert loaded(run, recording=name, errors=False).errors is None


def test_what_is_missing_or_unknown_is_refused(model: CalibratedModel, space: dict[str, Any]) -> None:
    loaded = space["load"](load_rig(str(PENDULUM / "rig.py")).simulate)
    run = of(model)
    name = model.recordings[0].name
    with pytest.raises(ValueError, match="unknown parameter 'no'"):
        loaded(run, recording=name, values={"no": 1.0})
    first = model.parameters[0].name
    with pytest.raises(ValueError, match=f"parameter {first} is nan"):
        loaded(run, recording=name, values={first: float("nan")})
    if any("[" in one.name for one in model.parameters):
        with pytest.raises(ValueError, match=r"in values, or the recording that they are of"):
            loaded(run)


def test_settings_outside_the_range_are_refused(model: CalibratedModel) -> None:
    known = replace(model.calibrated, ranges=(FittedRange("load", "N", 1.0, 2.0),))
    loaded = LoadedRig(load_rig(str(PENDULUM / "rig.py")).simulate, known)
    run = of(model, {"load": 3.0})
    with pytest.raises(OutsideRangeError, match=r"setting load 3 is outside \[1, 2\] N"):
        loaded(run, recording=model.recordings[0].name)
    found = loaded(run, recording=model.recordings[0].name, extrapolate=True, errors=False)
    assert found.remarks == ("extrapolated: setting load 3 is outside [1, 2] N",)
