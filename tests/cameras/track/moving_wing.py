"""A wing with markers that flaps, twists and bends, by closed forms."""

from __future__ import annotations

import numpy as np

from wingfit.cameras.track.cloud import Cloud
from wingfit.cameras.triangulation import Points
from wingfit.records.array_types import Array, Mask

BEAT = 3.0  # Hz
DEVIATION = 1e-4  # m, of a point


def markers(rows: int = 7, columns: int = 7) -> Array:
    """Places [K, 3] (m) on a tapered wing at rest: no motion of the plane takes the pattern to itself."""
    y = 0.05 + 0.5 * np.linspace(0, 1, columns) ** 0.9
    part = np.linspace(0, 1, rows)
    x = (0.05 - part[:, None] * (0.22 - 0.2 * y**1.5 + 0.015 * np.sin(9 * y))).ravel()
    return np.column_stack([x, np.tile(y, rows), np.zeros(rows * columns)])


def moved(rest: Array, time: float, bend: float = 1.0) -> Array:
    """The markers at ``time`` (s), in axes that are not those at rest; ``bend`` scales what is no rigid motion."""
    phase = 2 * np.pi * BEAT * time
    x, y, _ = rest.T
    angle = 0.5 * np.sin(phase) + 0.25 * bend * (y / 0.55) ** 2 * np.cos(phase - 0.4)
    twist = 0.5 * bend * (y / 0.55) * np.cos(phase)
    places = np.column_stack([x * np.cos(twist), y * np.cos(angle), y * np.sin(angle) - x * np.sin(twist)])
    return np.asarray(places @ np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]) + [0.1, -0.2, 0.9])


def cloud_of(true: Array, seen: Mask, rng: np.random.Generator, false: int = 0) -> tuple[Cloud, Array]:
    """Points [M, 3] of the markers ``seen`` [K], with false ones among them, and the index [K] of each marker's."""
    box = true.min(0), true.max(0)
    places = np.concatenate([true[seen], rng.uniform(*box, (false, 3))])
    order = rng.permutation(len(places))
    noise = DEVIATION * rng.standard_normal(places.shape)
    spread = np.tile(DEVIATION**2 * np.eye(3), (len(places), 1, 1))
    points = Points((places + noise)[order], spread, np.zeros(len(places)), np.ones(len(places), dtype=int))
    index = np.full(len(true), -1)
    index[np.flatnonzero(seen)] = np.argsort(order)[: int(seen.sum())]
    return Cloud(points, np.full((2, len(places)), -1), np.full((2, len(places), 2), np.nan)), index
