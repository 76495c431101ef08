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


class Orientation:
    """Directions on the wing of the bright diagonals that C cameras see of K markers.

    Args:
        cameras: that see them.
        plane: [K, 2], places of the markers on the wing in any unit; NaN if unknown.
    """

    def __init__(self, cameras: Sequence[Camera], plane: Float[Array, "K 2"]) -> None:
        self._cameras = cameras
        self._groups, self._inverse = _groups(plane)
        self._sums = np.zeros(len(plane), complex)  # of twice the directions: after half a turn they are the same
        self._counts = np.zeros(len(plane), int)

    def directions(self, places: Float[Array, "K 3"], seen: Float[Array, "C K N 2"]) -> Float[Array, "C K N"]:
        """Return the directions on the wing (rad) of the bright diagonals between edges ``seen`` in the images.

        ``seen``: two directions (rad; NaN: none) each. ``places`` (m) of all markers show how the wing is seen. NaN
        where that is unknown, or too much edge-on.
        """
        found = np.full(seen.shape[:-1], np.nan)
        for camera, own, into in zip(self._cameras, seen, found, strict=True):
            pixels = camera.project(places)[self._groups]
            around = pixels - pixels.mean(axis=1, keepdims=True)
            stretch = np.einsum("kin,knj->kji", self._inverse, around)  # [K, pixel, place]
            good = np.isfinite(stretch).all(axis=(1, 2))
            sizes = np.linalg.svd(stretch[good], compute_uv=False)
            good[good] = sizes[:, 1] * _STEEPEST > sizes[:, 0]
            edges = np.stack([np.cos(own[good]), np.sin(own[good])], axis=1).reshape(-1, 2, 2 * own.shape[1])
            edges = np.linalg.solve(stretch[good], edges)
            edges /= np.linalg.norm(edges, axis=1, keepdims=True)
            x, y = np.moveaxis(edges.reshape(-1, 2, own.shape[1], 2).sum(axis=-1), 1, 0)
            into[good] = np.arctan2(y, x)
        return found

    def learn(self, directions: Float[Array, "C K"]) -> None:
        """Remember the ``directions`` on the wing (rad; NaN: unknown) of the markers at one more instant."""
        known = np.isfinite(directions)
        self._sums += np.where(known, np.exp(2j * np.nan_to_num(directions)), 0.0).sum(axis=0)
        self._counts += known.sum(axis=0)

    def allowed(self, directions: Float[Array, "C K N"]) -> Mask:
        """Return where [K, N] no camera sees another direction on the wing than the marker usually has."""
        usual = np.where(self._counts < _LEAST, np.nan, np.angle(self._sums) / 2)
        return np.asarray(~(_apart(directions, usual[None, :, None]) > _OTHER).any(axis=0))


def between_markers(directions: Float[Array, "T C K"]) -> Mask:
    """Return where [T, K] a camera saw another bright diagonal of a marker than it usually has.

    ``directions`` (rad) are those on the wing of all instants; NaN if unknown.
    """
    wrong = np.zeros((len(directions), directions.shape[2]), dtype=bool)
    for marker in range(directions.shape[2]):
        own = directions[:, :, marker]
        usual = _usual(own[np.isfinite(own)])
        wrong[:, marker] = (_apart(own, usual) > _OTHER).any(axis=1)
    return wrong


def _groups(plane: Float[Array, "K 2"]) -> tuple[Index, Float[Array, "K 2 N"]]:
    """Return the markers [K, N] around each one, and the inverse of their differences of place from their mean."""
    count = min(_NEIGHBOURS + 1, int(np.isfinite(plane).all(axis=1).sum()))
    apart = np.linalg.norm(plane[:, None] - plane[None], axis=2)
    groups = np.argsort(np.nan_to_num(apart, nan=np.inf), axis=1, kind="stable")[:, :count]
    inverse = np.full((len(plane), 2, count), np.nan)
    for marker, group in enumerate(groups):
        places = plane[group] - plane[group].mean(axis=0)
        if not np.isfinite(places).all():
            continue
        sizes = np.linalg.svd(places, compute_uv=False)
        if sizes[-1] > _FLATTEST * sizes[0]:
            inverse[marker] = np.linalg.pinv(places)
    return groups, inverse


def _usual(angles: Float[Array, " N"]) -> float:
    """Return the direction (rad) of most of ``angles``, which are the same after half a turn; NaN for too few."""
    if len(angles) < _LEAST:
        return np.nan
    near = angles[_apart(angles, _mean(angles)) < np.pi / 4]
    return _mean(near if len(near) else angles)


def _mean(angles: Float[Array, " N"]) -> float:
    return float(np.angle(np.exp(2j * angles).sum()) / 2)


def _apart(angles: Array, usual: Array | float) -> Array:
    """Return the distances (rad, at most a quarter of a turn) of directions from the ``usual`` one."""
    return np.asarray(np.abs((angles - usual + np.pi / 2) % np.pi - np.pi / 2))
