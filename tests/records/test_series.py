"""Series in memory: what repeats a recording, and what needs a wing or a vehicle instead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import wingfit
from tests.records.samples import falcon_dataset
from tests.records.series_samples import arm_dataset
from wingfit.client.transport import WingfitError
from wingfit.records import save_dataset, wing_or_vehicle
from wingfit.records.series import SAME_TIMES, difference_of_repeats
from wingfit.service.diagnoses import local

WRONG_KIND = "dataset 'arm' is a series of rig 'motor arm'; this needs a wing or a vehicle"


def test_a_wing_is_not_a_series() -> None:
    dataset = falcon_dataset()
    assert wing_or_vehicle(dataset) is dataset
    with pytest.raises(ValueError, match=WRONG_KIND):
        wing_or_vehicle(arm_dataset())


def test_a_series_needs_the_simulation_of_its_rig(tmp_path: Path) -> None:
    for compute in (wingfit.calibrate, wingfit.diagnose):
        with pytest.raises(ValueError, match="has series of rig 'motor arm'; give its simulation as rig"):
            compute(arm_dataset())
    save_dataset(arm_dataset(), tmp_path / "arm")
    with pytest.raises(WingfitError, match="has series of rig 'motor arm': name its simulation"):
        local.diagnose(tmp_path / "arm", {}, 1, lambda *_: None)


def test_repeats_have_the_same_times_settings_and_inputs() -> None:
    first, other = arm_dataset().recordings[:2]
    span = first.times[-1] - first.times[0]
    assert difference_of_repeats(first, other) is None
    assert difference_of_repeats(first, replace(other, times=other.times + 0.5 * SAME_TIMES * span)) is None
    assert difference_of_repeats(first, replace(other, times=other.times + 2.0 * SAME_TIMES * span)) == "sample times"
    assert difference_of_repeats(first, arm_dataset(39).recordings[1]) == "sample times"
    assert difference_of_repeats(first, replace(other, settings={"mass": 0.2, "gear": 20.0})) == "settings"
    inputs = {"voltage": other.inputs["voltage"] * 1.01}
    assert difference_of_repeats(first, replace(other, inputs=inputs)) == "inputs"
