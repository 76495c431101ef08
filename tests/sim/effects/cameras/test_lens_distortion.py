from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.rigs import Array, rigid_tracks, seen
from wingfit.sim.effects.library.cameras.lens_distortion import distorted
from wingfit.sim.effects.ports.stereo import Stereo


def values(**given: float) -> dict[str, Array]:
    return {name: np.array([given.get(name, 0.0)]) for name in ("k1", "k2", "p1", "p2")}


def image(u: float, v: float, **given: float) -> tuple[float, float]:
    a, b = distorted(np.full((1, 1, 1), u), np.full((1, 1, 1), v), values(**given))
    return float(a.item()), float(b.item())


@pytest.mark.parametrize(
    ("given", "expected"),
    [  # u = 0.3, v = -0.4: r^2 = 0.25, by hand
        ({"k1": 0.2}, (0.3 * 1.05, -0.4 * 1.05)),
        ({"k2": 0.16}, (0.3 * 1.01, -0.4 * 1.01)),
        ({"p1": 0.01}, (0.3 - 0.0024, -0.4 + 0.0057)),  # 2 u v = -0.24; r^2 + 2 v^2 = 0.57
        ({"p2": 0.01}, (0.3 + 0.0043, -0.4 - 0.0024)),  # r^2 + 2 u^2 = 0.43
        ({"k1": 0.2, "k2": 0.16, "p1": 0.01, "p2": 0.01}, (0.3 * 1.06 + 0.0019, -0.4 * 1.06 + 0.0033)),
    ],
)
def test_polynomial_as_printed(given: dict[str, float], expected: tuple[float, float]) -> None:
    assert image(0.3, -0.4, **given) == pytest.approx(expected, abs=1e-15)


def test_a_point_in_the_plane_aimed_at_moves_within_it() -> None:
    """There both images are alike, so depth stays: x' - x0 = D u', whatever the base."""
    before = rigid_tracks(0.0)
    before.beat[..., 2] = 0.0
    after = seen("lens_distortion", before, k1=-0.2, x=0.1, y=0.25, distance=1.5, base=0.7)
    u = (before.beat[..., :2] - [0.1, 0.25]) / 1.5
    expected = [0.1, 0.25] + 1.5 * u * (1 - 0.2 * (u * u).sum(axis=-1, keepdims=True))
    np.testing.assert_allclose(after.beat[..., :2], expected, atol=1e-15)
    np.testing.assert_allclose(after.beat[..., 2], 0.0, atol=1e-15)


def test_a_barrel_draws_the_tip_inwards() -> None:
    before = rigid_tracks(0.0)
    after = seen("lens_distortion", before, k1=-0.1)
    assert np.all(after.beat[0, :, -7:, 1] < before.beat[0, :, -7:, 1])


def test_undistorted_images_give_the_points_back() -> None:
    points = rigid_tracks().beat
    cameras = Stereo(*(np.full((1, 1, 1), value) for value in (0.1, 0.25, 1.4, 0.6)))
    np.testing.assert_allclose(
        cameras.points(cameras.image(points, -1.0), cameras.image(points, 1.0)), points, atol=1e-14
    )


def test_images_are_those_of_pinhole_cameras() -> None:
    """Two cameras 0.6 m apart, 1.4 m high, aimed at (0.1, 0.25): images of (0.2, 0.5, 0.3) by hand."""
    cameras = Stereo(*(np.full((1, 1, 1), value) for value in (0.1, 0.25, 1.4, 0.6)))
    point = np.array([[[[0.2, 0.5, 0.3]]]])
    u, v = cameras.image(point, -1.0)  # the camera at y = -0.05, which sees the point aimed at under 0.3 / 1.4
    assert u.item() == pytest.approx(0.1 / 1.1)
    assert v.item() == pytest.approx(0.55 / 1.1 - 0.3 / 1.4)
    u, v = cameras.image(point, 1.0)  # at y = 0.55
    assert v.item() == pytest.approx(-0.05 / 1.1 + 0.3 / 1.4)
