"""A calibrated model: without loss in JSON, complete, and the same simulation again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.model_file import model_from_json, model_json
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import blank_recording


def test_json_loses_nothing(vehicle: CalibratedModel, wing: CalibratedModel) -> None:
    for model in (vehicle, wing):
        assert model_from_json(model_json(model)) == model


def test_json_refuses_what_is_not_finite_and_what_is_no_model(vehicle: CalibratedModel) -> None:
    with pytest.raises(ValueError, match="not finite"):
        model_json(replace(vehicle, misfit=float("nan")))
    for text in ("{}", "[1]", "no JSON", model_json(vehicle).replace('"forces"', '"weights"', 1)):
        with pytest.raises(ValueError, match="not a calibrated model: "):
            model_from_json(text)


def test_the_simulation_has_the_parameters_in_order(vehicle: CalibratedModel, wing: CalibratedModel) -> None:
    for model in (vehicle, wing):
        assert [one.name for one in model.parameters] == [gene.name for gene in model.simulation().genes]


def test_a_global_model_follows_the_condition(vehicle: CalibratedModel) -> None:
    lift = next(one for one in vehicle.parameters if one.name == "C_l")
    assert lift.per_hz != 0.0
    one, other = (replace(vehicle.middle(), flap_frequency=f) for f in (12.0, 13.0))
    change = lift.at(other) - lift.at(one)
    assert change == pytest.approx(lift.per_hz, rel=1e-9)
    own = vehicle.simulation()
    assert isinstance(own, BladeElementWing)
    forces = [own.beat([vehicle.genome(c)], blank_recording(c))[0] for c in (one, other)]
    assert np.abs(forces[0] - forces[1]).max() > 1e-3


def test_faults_of_the_measurement_stay_behind(wing: CalibratedModel) -> None:
    assert wing.settings.effects == ("circulation_lag",)
    assert not any(one.name.startswith("clock_offset") for one in wing.parameters)
    assert any("clock_offset" in remark for remark in wing.remarks)
