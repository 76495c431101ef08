"""A mistake in the forces of one recording, which the others show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from tests.checks.samples import good_vehicle
from wingfit.checks import Mistake, examine
from wingfit.records import Dataset, Recording
from wingfit.records.array_types import Array
from wingfit.records.dataset import ForceAxis
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS, campaign

GOOD = good_vehicle()
GRAM_FORCE = 9.80665e-3


def changed(dataset: Dataset, factors: Mapping[str, Array | float]) -> Dataset:
    """Multiply the forces of the recordings with these names."""

    def one(recording: Recording) -> Recording:
        values = np.ascontiguousarray(recording.values * factors.get(recording.name, 1.0))
        return replace(recording, values=values)

    return replace(dataset, recordings=tuple(map(one, dataset.recordings)))


def along(axis: ForceAxis) -> Dataset:
    column = "xz".index(axis)
    kept = [
        replace(one, forces=(axis,), values=np.ascontiguousarray(one.values[:, [column]])) for one in GOOD.recordings
    ]
    return replace(GOOD, recordings=tuple(kept))


def place(mistake: Mistake) -> str:
    return mistake.where.removeprefix("recording ").strip("'")


NAMES = [one.name for one in GOOD.recordings]


def test_of_one_axis_the_sign_has_one_correction() -> None:
    [found] = examine(changed(along("x"), {NAMES[1]: -1.0}))
    assert (found.kind, found.alone, place(found)) == ("force axes", True, NAMES[1])
    assert found.cause.startswith("the sign of force_x_n:")
    assert "force_z_n" not in found.cause
    assert len(found.edits) == 1


def test_each_of_two_recordings_is_named() -> None:
    five = campaign(3, replace(EXAMPLE, beats=12), TRIALS[1:6])
    first, second = five.recordings[0].name, five.recordings[3].name
    wrong = changed(five, {first: np.array([-1.0, 1.0]), second: 1.0 / GRAM_FORCE})
    found = {place(one): one.kind for one in examine(wrong)}
    assert found == {first: "force axes", second: "force unit"}


def test_what_one_recording_has_is_not_what_all_have() -> None:
    [found] = examine(changed(GOOD, dict.fromkeys(NAMES, np.array([-1.0, 1.0]))))
    assert (found.kind, found.alone) == ("force axes", False)


@pytest.mark.parametrize("dataset", [GOOD, along("z")])
def test_a_sign_that_the_body_pitch_may_have_as_well_has_no_single_correction(dataset: Dataset) -> None:
    steep = max(GOOD.recordings, key=lambda one: one.condition.angle_of_attack)
    [found] = examine(changed(dataset, {steep.name: np.array([1.0, -1.0])[-dataset.recordings[0].values.shape[1] :]}))
    assert place(found) == steep.name
    assert all(sign in found.cause for sign in ("the sign of force_z_n", "; or ", "the sign of the body pitch"))
    assert found.edits == ()


def test_parts_of_a_beat_are_not_compared() -> None:
    def short(one: Recording) -> Recording:
        count = int(0.6 / (one.condition.flap_frequency * (one.times[1] - one.times[0])))
        return replace(one, times=one.times[:count], values=np.ascontiguousarray(-one.values[:count]))

    cut = replace(GOOD, recordings=tuple(map(short, GOOD.recordings)))
    assert {one.kind for one in examine(cut)} == {"cut"}
