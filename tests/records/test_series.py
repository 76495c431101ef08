"""Series in memory: what repeats a recording, and what needs a wing or a vehicle instead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import wingfit
from tests.records.samples import falcon_dataset
from tests.records.series_samples import arm_dataset
from wingfit.client.transport import WingfitError
from wingfit.records import Channel, DatasetError, Series, SeriesDataset, save_dataset, wing_or_vehicle
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


def changed(**changes: object) -> Series:
    return replace(arm_dataset(12).recordings[0], **changes)  # type: ignore[arg-type]


def shuffled() -> Series:
    times = arm_dataset(12).recordings[0].times.copy()
    times[4], times[5] = times[5], times[4]
    return changed(times=times)


def with_recordings(*recordings: Series) -> SeriesDataset:
    return replace(arm_dataset(12), recordings=recordings, held_out=())


@pytest.mark.parametrize(
    ("message", "make"),
    [
        (r"recording 'light-1', sample 5: time_s is .* times must increase: sort the rows", shuffled),
        (
            r"recording 'light-1': settings.mass: is inf; give a finite number",
            lambda: changed(settings={"mass": np.inf}),
        ),
        (r"recording 'light-1': estimates.angle0: is NaN; give", lambda: changed(estimates={"angle0": np.nan})),
        (r"estimates.angle0: is '1'; give a finite number", lambda: changed(estimates={"angle0": "1"})),
        (r"settings.mass: is None; give a finite number", lambda: changed(settings={"mass": None})),
        (r"period: is 0 s; give a positive number of seconds, or None", lambda: changed(period=0.0)),
        (r"period: is 1e-05 s, but samples are .* s apart; a period needs at least 2", lambda: changed(period=1e-5)),
        (r"a channel is 1e\+60; give a number from -1e\+50", lambda: changed(values=np.full((12, 3), 1e60))),
        (r"sample 1: time_s is 1e-60 s after the one above", lambda: changed(times=np.r_[0.0, 1e-60, 1:11])),
        (r"time_s is 9.09e\+58 s; give a time from", lambda: changed(times=np.linspace(0.0, 1e60, 12))),
        (r"recordings\[1\]: 'light-1' is used a second time here", lambda: with_recordings(changed(), changed())),
        (r"the input 'voltage' of the dataset is missing; add it", lambda: with_recordings(changed(inputs={}))),
        (r"does not state the setting 'gear'; add", lambda: with_recordings(changed(settings={"mass": 0.1}))),
        (r"are not the channels", lambda: with_recordings(changed(quantities=(Channel("angle", "deg"),) * 3))),
        (r"name: has a bracket, which marks the recording in the name of a gene", lambda: changed(name="x[a")),
        (r"no recording is called 'heavyest'; did you mean", lambda: replace(arm_dataset(), held_out=("heavyest",))),
    ],
)
def test_a_wrong_series_cannot_be_made(message: str, make: Callable[[], object]) -> None:
    with pytest.raises(DatasetError, match=message):
        make()


def test_a_series_without_samples_is_a_series() -> None:
    empty = Series("empty", np.zeros(0), (Channel("x", "m"),), np.zeros((0, 1)))
    assert SeriesDataset("d", "rig", (empty,), empty.quantities).recordings == (empty,)
