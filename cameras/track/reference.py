"""The places of markers whose places on the wing are not described: those at the instant that shows most of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from wingfit.cameras.track.cloud import Cloud
from wingfit.cameras.track.registration import surface_of
from wingfit.records.array_types import Array, Float, Index, Mask
from wingfit.records.errors import fail

LEAST_MARKERS = 6


def reference_of(
    clouds: Sequence[Cloud], progress: Callable[[int, int], object]
) -> tuple[tuple[str, ...], Float[Array, "K 3"]]:
    """Return names t01, t02, ... and places (m) of the markers, at the instant that shows most of them.

    ``progress`` is called with the count of clouds that were looked at, and of all.

    Raises:
        DatasetError: at no instant are there enough.
    """
    best, most = clouds[0], -1
    for number, cloud in enumerate(clouds):
        count = len(single_points(cloud))
        if count > most:
            best, most = cloud, count
        progress(number + 1, len(clouds))
    places = best.positions[_on_surface(best, single_points(best))]
    if len(places) < LEAST_MARKERS:
        raise fail(
            "markers", len(places), f"at most {len(places)} markers are seen by two cameras; {LEAST_MARKERS} are needed"
        )
    return _numbered(len(places), ()), places


def reference_with(cloud: Cloud, named: dict[str, int]) -> tuple[tuple[str, ...], Float[Array, "K 3"]]:
    """Return names and places (m) of the markers: the ``named`` points of ``cloud``, and t01, t02, ... for others."""
    labelled = np.array([*named.values()])
    single = single_points(cloud)
    trusted = np.union1d(labelled, single[unused(cloud, labelled)[single]])
    others = np.setdiff1d(_on_surface(cloud, trusted), labelled)
    return (*named, *_numbered(len(others), tuple(named))), cloud.positions[np.concatenate([labelled, others])]


def _numbered(count: int, taken: tuple[str, ...]) -> tuple[str, ...]:
    """Return ``count`` names that are not ``taken``."""
    names = (f"t{number + 1:02d}" for number in range(count + len(taken)))
    return tuple([name for name in names if name not in taken][:count])


def single_points(cloud: Cloud) -> Index:
    """Return the points whose detections belong to no other point."""
    alone = np.ones(len(cloud), dtype=bool)
    for row in cloud.detections:
        used, index, counts = np.unique(row, return_inverse=True, return_counts=True)
        alone &= (counts[index] == 1) | (used[index] < 0)
    return np.flatnonzero(alone)


def unused(cloud: Cloud, points: Index) -> Mask:
    """Return which points of ``cloud`` have no detection of the ``points``."""
    free = np.ones(len(cloud), dtype=bool)
    for row in cloud.detections:
        free &= (row < 0) | ~np.isin(row, row[points])
    return free


def _on_surface(cloud: Cloud, single: Index) -> Index:
    """Return the points ``single``, and of the ambiguous ones those near the smooth surface through these.

    Each detection is used once, first by the points whose rays meet best.
    """
    if len(single) < 2 * LEAST_MARKERS:
        return single
    surface = surface_of(cloud.positions[single])
    design, height = surface.quadratic(cloud.positions)
    fitted, *_ = np.linalg.lstsq(design[single], height[single], rcond=None)
    apart = np.abs(height - design @ fitted)
    near = max(4 * float(np.sqrt(np.mean(apart[single] ** 2))), 0.01 * surface.size)
    used = [set(row[single]) for row in cloud.detections]
    chosen = list(single)
    for point in np.argsort(cloud.points.misfit, kind="stable"):
        row = cloud.detections[:, point]
        free = all(index < 0 or index not in taken for index, taken in zip(row, used, strict=True))
        if free and apart[point] < near and np.abs(design[point, 1:3]).max() < 3:
            chosen.append(int(point))
            for index, taken in zip(row, used, strict=True):
                taken.add(int(index))
    return np.array(sorted(chosen))
