from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import rigid_tracks, seen, wing_model
from wingfit.sim.effects.ports.markers import nearest

PLACE = {"station": 0.55, "chord": 0.4}


def pair() -> tuple[int, int]:
    one, other = nearest(wing_model().wing, {key: np.array([value]) for key, value in PLACE.items()})[0, :2]
    return int(one), int(other)


def test_two_neighbours_change_places_to_the_last_digit() -> None:
    before = rigid_tracks()
    after = seen("marker_swap", before, part=1.0, **PLACE).beat
    one, other = pair()
    order = np.arange(49)
    order[[one, other]] = other, one
    assert after.tobytes() == np.ascontiguousarray(before.beat[:, :, order]).tobytes()


def test_they_are_the_two_nearest_to_the_place() -> None:
    markers = np.array([m.position[:2] for m in wing_model().wing.markers])
    stations = wing_model().wing.stations
    y = stations[0].y + PLACE["station"] * wing_model().wing.span
    ys, leading, chord = (np.array([getattr(s, a) for s in stations]) for a in ("y", "leading_edge", "chord"))
    x = np.interp(y, ys, leading) + PLACE["chord"] * np.interp(y, ys, chord)
    assert set(pair()) == set(np.argsort(np.linalg.norm(markers - [x, y], axis=1))[:2].tolist())


def test_in_part_it_is_what_least_squares_sees_of_such_frames() -> None:
    """The mean over frames of which a quarter are swapped, at each phase."""
    before = rigid_tracks()
    one, other = pair()
    whole, part = (seen("marker_swap", before, part=p, **PLACE).beat for p in (1.0, 0.25))
    np.testing.assert_allclose(part, 0.75 * before.beat + 0.25 * whole, atol=1e-15)
    assert np.abs(part - before.beat)[..., one, :].max() == pytest.approx(
        0.25 * np.abs(before.beat[..., other, :] - before.beat[..., one, :]).max()
    )
