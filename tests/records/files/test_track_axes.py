"""The axes of tracks, against the described rest positions: 48 ways to assign them, and a left wing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import wingfit
from wingfit.records import Dataset, DatasetError, Recording
from wingfit.records.files.track_axes import AS_GIVEN, EVERY, Axes, other_axes
from wingfit.sim.virtual_rigs.campaign import Tracking, record, robird_wing, true_genome, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

WING = robird_wing()
MODEL = FlexibleWing(WING, "4")
RECORDED = tuple(
    record(MODEL, true_genome(MODEL, 3), one, Tracking(), np.random.default_rng(1))
    for one in (vacuum(10.0, 0.12, 4.0), tunnel(0.0, 2.0, 8.5))
)


def written(recording: Recording, axes: Axes) -> Recording:
    """``recording`` with its axes as a laboratory with other ``axes`` writes them."""
    order, signs = axes
    values = recording.positions.copy()
    shuffled = np.empty_like(values)
    for own, (column, sign) in enumerate(zip(order, signs, strict=True)):
        shuffled[..., column] = sign * values[..., own]
    return replace(recording, values=shuffled.reshape(recording.values.shape))


def up_to_the_sign_of_z(axes: Axes) -> Axes:
    return axes[0], (axes[1][0], axes[1][1], 1)


@pytest.mark.parametrize("recording", RECORDED, ids=["chamber", "tunnel"])
def test_every_other_assignment_is_found(recording: Recording) -> None:
    """But for the sign of z, which flapping does not show."""
    for axes in EVERY:
        found = other_axes(written(recording, axes), WING)
        if up_to_the_sign_of_z(axes) == AS_GIVEN:
            assert found is None
        else:
            assert found is not None, axes
            assert up_to_the_sign_of_z(found[0]) == up_to_the_sign_of_z(axes)
            assert found[1] < 0.03 * WING.span < found[2]


def test_what_fits_no_axes_is_not_refused_here() -> None:
    """A frame whose origin is elsewhere, and markers that the wing does not have."""
    assert other_axes(replace(RECORDED[0], values=RECORDED[0].values + 0.2), WING) is None
    unknown = replace(WING, markers=WING.markers[:5])
    assert other_axes(written(RECORDED[0], EVERY[-1]), unknown) is None
    nothing = replace(RECORDED[0], values=np.full_like(RECORDED[0].values, np.nan))
    assert other_axes(nothing, WING) is None


def test_a_left_wing_is_refused_with_the_remedy() -> None:
    left = Dataset("left", WING, tuple(written(one, ((0, 1, 2), (1, -1, 1))) for one in RECORDED))
    with pytest.raises(DatasetError, match=r"as of a left wing, which must be mirrored: change the sign of y"):
        wingfit.calibrate(left)


def test_swapped_columns_are_refused_with_their_order() -> None:
    swapped = Dataset("swapped", WING, tuple(written(one, ((1, 0, 2), (1, 1, 1))) for one in RECORDED))
    with pytest.raises(DatasetError, match=r"look like \(y, x, z\) of the columns: swap the columns"):
        wingfit.diagnose(swapped)


def test_three_markers_show_no_axes() -> None:
    few = replace(RECORDED[0], markers=RECORDED[0].markers[:3], values=-RECORDED[0].values[:, :9])
    assert other_axes(few, WING) is None
