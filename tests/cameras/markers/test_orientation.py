"""Gaps between chequers differ from chequers in the direction of their bright squares on the wing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cameras.markers.drawing import Mark, affine, chequer, drawn, lattice, noisy
from tests.cameras.track.simulated_films import around, wing_at
from wingfit.cameras.markers.chequer import detect_chequers
from wingfit.cameras.markers.orientation import Orientation, between_markers
from wingfit.cameras.track.registration import surface_of
from wingfit.records.array_types import Array

REST = np.column_stack([*(one.ravel() for one in np.meshgrid(np.linspace(-0.1, 0.1, 4), np.linspace(0.05, 0.5, 6))),
                        np.zeros(24)])  # fmt: skip
SQUARE = 0.003  # m


def seen_edges(places: Array, instant: float, turn: float, cameras: tuple[object, ...]) -> Array:
    """Edges [C, K, 1, 2] (rad) of chequers with their first edge at ``turn`` (rad) on the wing, as cameras see them."""
    found = []
    for camera in cameras:
        middle = camera.project(places)  # type: ignore[attr-defined]
        own = []
        for angle in (turn, turn + np.pi / 2):
            beside = REST + SQUARE * np.array([np.cos(angle), np.sin(angle), 0.0])
            x, y = (camera.project(wing_at(beside, instant)) - middle).T  # type: ignore[attr-defined]
            own.append(np.arctan2(y, x))
        found.append(np.stack(own, axis=1)[:, None])
    return np.array(found)


def test_the_direction_on_the_wing_is_the_same_at_every_instant_and_for_every_camera() -> None:
    cameras, surface = around((-25.0, 20.0)), surface_of(REST)
    orientation, every = Orientation(cameras, surface.plane), []
    for instant in np.linspace(0.0, 0.3, 12):
        places = wing_at(REST, instant)
        every.append(orientation.directions(places, seen_edges(places, instant, 0.4, cameras))[:, :, 0])
        orientation.learn(every[-1])
        gap = orientation.directions(places, seen_edges(places, instant, 0.4 + np.pi / 2, cameras))
        if len(every) > 3:
            assert not orientation.allowed(gap).any(), "a gap is no marker"
        if len(every) > 1:
            assert orientation.allowed(every[-1][:, :, None]).all()
    found = np.array(every)
    assert np.isfinite(found).all()
    usual = np.angle(np.exp(2j * found).mean()) / 2
    apart = np.abs((found - usual + np.pi / 2) % np.pi - np.pi / 2)
    assert apart.max() < np.radians(15), "the wing is seen between markers that are 10 cm apart"
    wrong = found.copy()
    wrong[3, 1, 5] += np.pi / 2
    flagged = between_markers(wrong)
    assert flagged[3, 5]
    assert flagged.sum() == 1
    assert not between_markers(found).any()
    assert not between_markers(np.full_like(found, np.nan)).any(), "dots have no edges"


def test_places_on_a_line_show_no_direction() -> None:
    cameras, line = around((-25.0, 20.0)), REST[REST[:, 0] == REST[0, 0]]
    plane = line[:, :2]
    orientation = Orientation(cameras, plane)
    found = orientation.directions(wing_at(line, 0.0), np.full((2, len(line), 1, 2), (0.0, 1.0)))
    assert np.isnan(found).all()
    assert orientation.allowed(found).all()


@pytest.mark.parametrize("size", [6.0, 12.0])
def test_a_bright_square_lies_between_the_detected_edges(size: float) -> None:
    rng = np.random.default_rng(4)
    area, places = lattice(rng, 30, 3 * size + 8)
    marks: list[Mark] = [(chequer, place, affine(rng, size)) for place in places]
    found = detect_chequers(noisy(drawn(area, marks, 0.6), 1.0, rng), 10.0, 1.0)
    apart = np.linalg.norm(places[:, None] - found.pixels[None], axis=2)
    seen = np.flatnonzero(apart.min(1) < 1)
    assert len(seen) > 25
    for mark in seen:
        axes, edges = marks[mark][2], found.edges[apart[mark].argmin()]
        directions = np.linalg.solve(axes, [np.cos(edges), np.sin(edges)])
        u, v = (directions / np.linalg.norm(directions, axis=0)).sum(axis=1)
        assert u * v > 0, "bright"
        assert abs(abs(np.degrees(np.arctan2(v, u)) % 180.0) - 45.0) < 12.0, "along the diagonal"
