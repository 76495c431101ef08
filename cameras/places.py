"""Places of the markers at all instants from their pixels: the error of a pixel, residuals, and the calibration's part.

An hour of film has millions of places, so that all is computed block by block; the blocks do not change the results.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.triangulation import Points, blocks, error_from_cameras, triangulate
from wingfit.records.array_types import Array, Float, Mask

_USED = 4000  # points from which the error of a pixel is estimated
_HALVINGS, _LARGEST_PX = 14, 3.0


def pixel_error(cameras: Sequence[Camera], pixels: Float[Array, "C N 2"], covariance: Float[Array, "C N 2 2"]) -> float:
    """Return the error of each pixel, beside that of its detection, for which half of the misfits are as expected.

    It holds what neighbouring pixels do not show: compression, uneven light, an imperfect calibration.
    """
    known = np.flatnonzero(np.isfinite(pixels).all(2).sum(0) >= 2)
    used = known[np.unique(np.linspace(0, len(known) - 1, _USED).astype(int))]
    low, high = 0.0, _LARGEST_PX
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        points = triangulate(cameras, pixels[:, used], covariance[:, used] + middle**2 * np.eye(2))
        expected = points.freedom * (1 - 2 / (9 * points.freedom)) ** 3
        low, high = (middle, high) if np.median(points.misfit / expected) > 1 else (low, middle)
    return (low + high) / 2


def residuals(
    cameras: Sequence[Camera], pixels: Float[Array, "C N 2"], places: Float[Array, "N 3"]
) -> Float[Array, "C N 2"]:
    """Return the ``pixels`` minus the projections of ``places`` (m)."""
    found = np.empty_like(pixels)
    for number, camera in enumerate(cameras):
        for block in blocks(len(places)):
            found[number, block] = pixels[number, block] - camera.project(places[block])
    return found


def from_calibration(
    cameras: Sequence[Camera],
    points: Points,
    pixels: Float[Array, "C N 2"],
    covariance: Float[Array, "C N 2 2"],
    calibration: Float[Array, "P P"],
    markers: int,
) -> Float[Array, "K 3 3"]:
    """Return the covariance (m^2) of each marker's places from that of the ``calibration``, mean over the instants.

    The ``points`` are those of all ``markers`` at the first instant, then at the next, and so on.
    """
    total, count = np.zeros((markers, 3, 3)), np.zeros((markers, 1, 1), dtype=int)
    for block in _whole_instants(len(points.positions), markers):
        known: Mask = np.asarray(np.isfinite(points.positions[block]).all(1))
        places = Points(
            points.positions[block],
            np.where(known[:, None, None], points.covariance[block], 0.0),
            points.misfit[block],
            points.freedom[block],
        )
        changes = error_from_cameras(cameras, places, pixels[:, block], covariance[:, block], calibration)
        each = np.einsum("nip,pq,njq->nij", changes, calibration, changes, optimize=True)
        each[~known] = 0.0
        # Added instant by instant to those before.
        total = np.add.reduce(np.concatenate([total[None], each.reshape(-1, markers, 3, 3)]))
        count += known.reshape(-1, markers).sum(0)[:, None, None]
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _whole_instants(count: int, markers: int) -> list[slice]:
    """Return the slices of ``count`` points whose blocks have whole instants."""
    size = max(blocks(count)[0].stop // markers, 1) * markers if count else 1
    return [slice(first, min(first + size, count)) for first in range(0, count, size)]
