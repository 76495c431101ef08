"""Axes, side, unit and origin of tracks, against the described rest positions and the drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

import wingfit
from wingfit.checks import Mistake, examine
from wingfit.checks.axes import AS_GIVEN, EVERY, LEFT, Axes, oriented
from wingfit.records import Dataset, DatasetError, Recording
from wingfit.sim.virtual_rigs.campaign import Tracking, record, robird_wing, true_genome, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

WING = robird_wing()
MODEL = FlexibleWing(WING, "4")
RECORDED = tuple(
    replace(record(MODEL, true_genome(MODEL, 3), one, Tracking(), np.random.default_rng(1)), name=name)
    for name, one in (("chamber", vacuum(10.0, 0.12, 4.0)), ("tunnel", tunnel(0.0, 2.0, 8.5)))
)
GOOD = Dataset("good", WING, RECORDED)


def written(recording: Recording, axes: Axes) -> Recording:
    """``recording`` with its axes as a laboratory with other ``axes`` writes them."""
    order, signs = axes
    values = recording.positions
    shuffled = np.empty_like(values)
    for own, (column, sign) in enumerate(zip(order, signs, strict=True)):
        shuffled[..., column] = sign * values[..., own]
    return replace(recording, values=shuffled.reshape(recording.values.shape))


def moved(change: npt.NDArray[np.float64] | float, *, factor: float = 1.0) -> Dataset:
    made = (replace(one, values=(factor * one.positions + change).reshape(one.values.shape)) for one in RECORDED)
    return replace(GOOD, recordings=tuple(made))


def only(dataset: Dataset) -> Mistake:
    found = examine(dataset)
    assert len(found) == 1, [str(one) for one in found]
    return found[0]


def test_good_tracks_have_no_mistake() -> None:
    assert examine(GOOD) == ()


@pytest.mark.parametrize("axes", [axes for axes in EVERY if axes != AS_GIVEN], ids=str)
def test_every_other_assignment_is_found_and_undone(axes: Axes) -> None:
    """All 47, the sign of z alone among them, which the mean and the second harmonic of the drive show."""
    wrong = replace(GOOD, recordings=tuple(written(one, axes) for one in RECORDED))
    found = only(wrong)
    assert found.kind == (
        "side"
        if axes == LEFT
        else "vertical sign"
        if axes[0] == (0, 1, 2) and sum(axes[1]) == 1 and axes[1][2] < 0
        else "axes"
    )
    for edit, bad, good in zip(found.edits, wrong.recordings, RECORDED, strict=True):
        assert not isinstance(edit, wingfit.checks.mistake.KeyEdit)
        _, values = edit.alter(bad.times, bad.values, bad.channels)
        np.testing.assert_allclose(values, good.values)


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "millimetres"), (100.0, "centimetres"), (39.37, "inches")])
def test_another_unit_of_length_is_certain(factor: float, unit: str) -> None:
    found = only(moved(0.0, factor=factor))
    assert (found.kind, found.certain) == ("length unit", True)
    assert unit in found.cause


@pytest.mark.parametrize("shift", [(0.15, 0, 0), (0, -0.2, 0), (0, 0, 0.2)])
def test_another_origin_is_found_with_the_shift(shift: tuple[float, float, float]) -> None:
    found = only(moved(np.array(shift)))
    assert found.kind == "origin"
    numbers = [float(one) for one in found.expected.split("(")[1].split(")")[0].split(", ")]
    np.testing.assert_allclose(numbers, [-one for one in shift], atol=0.01)


def test_a_little_displacement_is_no_mistake() -> None:
    """A hand that measures rest positions is wrong by millimetres, not by centimetres."""
    assert examine(moved(np.array([0.004, -0.004, 0.003]))) == ()


def test_a_left_wing_is_refused_with_the_remedy() -> None:
    left = Dataset("left", WING, tuple(written(one, LEFT) for one in RECORDED))
    with pytest.raises(DatasetError, match=r"a left wing, which must be mirrored.*\(x, y, z\) -> \(x, -y, z\)"):
        wingfit.calibrate(left)


def test_swapped_columns_are_refused_with_their_order() -> None:
    swapped = Dataset("swapped", WING, tuple(written(one, ((1, 0, 2), (1, 1, 1))) for one in RECORDED))
    with pytest.raises(DatasetError, match=r"\(x, y, z\) -> \(y, x, z\)"):
        wingfit.diagnose(swapped)


def test_few_markers_are_warned_about_not_refused() -> None:
    few = replace(RECORDED[0], markers=RECORDED[0].markers[:3], values=-RECORDED[0].values[:, :9])
    assert all(not one.certain for one in examine(replace(GOOD, recordings=(few,))))


def test_oriented_takes_columns_with_their_signs() -> None:
    np.testing.assert_array_equal(oriented(np.array([1.0, 2.0, 3.0]), ((2, 0, 1), (1, -1, 1))), [3.0, -1.0, 2.0])


def test_tracks_of_something_else_are_refused() -> None:
    """Markers on a person who walks past the origin: no turn about the hinge brings the wing near to them."""
    steps = np.linspace(-2.0, 2.0, len(RECORDED[0].times))
    path = np.stack([0 * steps, steps, 0.3 + 0.05 * np.sin(40 * steps)], axis=1)
    rest = np.array([marker.position for marker in WING.markers if marker.name in RECORDED[0].markers])
    upright = rest[:, [0, 2, 1]]
    walked = replace(RECORDED[0], values=(path[:, None] + upright).reshape(RECORDED[0].values.shape))
    found = examine(replace(GOOD, recordings=(walked,)))[0]
    assert (found.kind, found.certain) == ("origin", True)
    assert "tracks are those of something else" in str(found)
    few = tuple(RECORDED[0].markers[:3])
    part = replace(walked, markers=few, values=walked.values.reshape(len(steps), -1, 3)[:, :3].reshape(len(steps), -1))
    assert not any(one.certain for one in examine(replace(GOOD, recordings=(part,))))
