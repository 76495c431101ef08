"""Which detections of a chequer are not the chequer, but the gap to its neighbour.

Where two chequers are close, a bright square of one and a bright square of the other touch nearly, and the gap between
them is a saddle too. All cameras see it, so that its rays meet. But its bright squares lie along another diagonal. On
the wing, the bright diagonal of a marker has the same direction at every instant and for every camera.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.records.array_types import Array, Float, Index, Mask

_NEIGHBOURS = 8  # markers that show how the wing around a marker is seen
_FLATTEST = 0.1  # ratio of the sizes of the group of neighbours across and along it, below which it is a line
_STEEPEST = 8.0  # ratio of the lengths of two equal distances in the image: seen more edge-on, angles are not compared
_OTHER = np.radians(35.0)  # from the usual direction: the diagonal of a gap is about at right angles to it
_LEAST = 5  # detections that show the usual direction


def between_markers(
    cameras: Sequence[Camera],
    plane: Float[Array, "K 2"],
    predicted: Float[Array, "T K 3"],
    diagonals: Float[Array, "C T K"],
) -> Mask:
    """Return where [T, K] a camera saw another bright diagonal of a marker than it usually has.

    ``plane`` are places of the markers on the wing (any unit; NaN if unknown), ``predicted`` where the smooth motion of
    the wing has them (m; NaN if unknown), and ``diagonals`` the directions seen in the images (rad; NaN if unknown).
    """
    groups, inverse = _groups(plane)
    wrong = np.zeros(predicted.shape[:2], dtype=bool)
    angles = np.stack(
        [_on_wing(camera, groups, inverse, predicted, seen) for camera, seen in zip(cameras, diagonals, strict=True)]
    )
    for marker in range(angles.shape[2]):
        own = angles[:, :, marker]
        usual = _usual(own[np.isfinite(own)])
        wrong[:, marker] = (_apart(own, usual) > _OTHER).any(axis=0)
    return wrong


def _groups(plane: Float[Array, "K 2"]) -> tuple[Index, Float[Array, "K 2 N"]]:
    """Return the markers [K, N] around each one, and the inverse of their differences of place from their mean."""
    count = min(_NEIGHBOURS + 1, len(plane))
    apart = np.linalg.norm(plane[:, None] - plane[None], axis=2)
    groups = np.argsort(np.nan_to_num(apart, nan=np.inf), axis=1, kind="stable")[:, :count]
    inverse = np.full((len(plane), 2, count), np.nan)
    for marker, group in enumerate(groups):
        places = plane[group] - plane[group].mean(axis=0)
        if not np.isfinite(places).all():
            continue
        sizes = np.linalg.svd(places, compute_uv=False)
        if sizes[1] > _FLATTEST * sizes[0]:
            inverse[marker] = np.linalg.pinv(places)
    return groups, inverse


def _on_wing(
    camera: Camera,
    groups: Index,
    inverse: Float[Array, "K 2 N"],
    predicted: Float[Array, "T K 3"],
    seen: Float[Array, "T K"],
) -> Float[Array, "T K"]:
    """Return the directions on the wing (rad) of those that a camera has ``seen``; NaN where that is unknown."""
    pixels = camera.project(predicted.reshape(-1, 3)).reshape(*predicted.shape[:2], 2)
    found = np.full(seen.shape, np.nan)
    for marker, group in enumerate(groups):
        around = pixels[:, group] - pixels[:, group].mean(axis=1, keepdims=True)
        stretch = np.einsum("in,tnj->tji", inverse[marker], around)  # [T, pixel, place]
        direction = np.stack([np.cos(seen[:, marker]), np.sin(seen[:, marker])], axis=1)
        known = np.isfinite(stretch).all(axis=(1, 2)) & np.isfinite(direction).all(axis=1)
        sizes = np.linalg.svd(stretch[known], compute_uv=False)
        known[known] = sizes[:, 1] * _STEEPEST > sizes[:, 0]
        x, y = np.linalg.solve(stretch[known], direction[known, :, None])[..., 0].T
        found[known, marker] = np.arctan2(y, x)
    return found


def _usual(angles: Float[Array, " N"]) -> float:
    """Return the direction (rad) of most of ``angles``, which are the same after half a turn; NaN for too few."""
    if len(angles) < _LEAST:
        return np.nan
    usual = _mean(angles)
    near = angles[_apart(angles, usual) < np.pi / 4]
    return _mean(near) if len(near) else usual


def _mean(angles: Float[Array, " N"]) -> float:
    return float(np.angle(np.exp(2j * angles).sum()) / 2)


def _apart(angles: Array, usual: float) -> Array:
    """Return the distances (rad, at most a quarter of a turn) of directions from the ``usual`` one."""
    return np.asarray(np.abs((angles - usual + np.pi / 2) % np.pi - np.pi / 2))
