from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import phases, rigid_tracks, seen, wing_model
from wingfit.records import Wing
from wingfit.sim.effects.ports.markers import nearest, tangents

WING = wing_model().wing


def place_of(wing: Wing, marker: int) -> dict[str, float]:
    """Span station and part of the chord of a marker at rest."""
    x, y, _ = wing.markers[marker].position
    ys, leading, chord = (np.array([getattr(s, a) for s in wing.stations]) for a in ("y", "leading_edge", "chord"))
    part = (x - np.interp(y, ys, leading)) / np.interp(y, ys, chord)
    return {"station": float((y - ys[0]) / wing.span), "chord": float(part)}


@pytest.mark.parametrize("marker", range(0, 49, 5))
def test_every_marker_is_found_at_its_own_place(marker: int) -> None:
    place = {key: np.array([value]) for key, value in place_of(WING, marker).items()}
    assert nearest(WING, place)[0, 0] == marker


@pytest.mark.parametrize("marker", [0, 24, 48])
def test_on_a_rigid_wing_the_slip_turns_with_it(marker: int) -> None:
    """A flat wing turned by R: the marker is off by R (x, y, 0), all others are right."""
    before = rigid_tracks(0.5)
    angle = 0.5 * np.sin(phases())
    rest = np.array([m.position for m in WING.markers])
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    before.beat[0] = np.stack([np.broadcast_to(rest[:, 0], (96, 49)), c * rest[:, 1], s * rest[:, 1]], axis=-1)
    after = seen("marker_slip", before, x=0.004, y=-0.003, **place_of(WING, marker))
    off = after.beat[0] - before.beat[0]
    expected = np.hstack([np.full((96, 1), 0.004), -0.003 * c, -0.003 * s])
    np.testing.assert_allclose(off[:, marker], expected, atol=1e-13)
    assert not np.delete(off, marker, axis=1).any()


def test_tangents_of_a_bent_wing() -> None:
    """z = 0.4 y^2: dz/dy is 0.8 y but for the curvature within the neighbourhood; dz/dx is nothing."""
    rest = np.array([m.position for m in WING.markers])
    aft, out = tangents(rest[:, :2], 24, WING.span) @ (0.4 * rest[:, 1] ** 2)
    assert out == pytest.approx(0.8 * rest[24, 1], rel=0.05)
    assert abs(aft) < 0.05 * out
