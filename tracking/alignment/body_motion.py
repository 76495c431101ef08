"""Removes the motion of the body that carries the hinge: by markers on it, or what is slow and common to the wing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.records.array_types import Array, Index
from wingfit.records.errors import fail
from wingfit.tracking.alignment.flapping import MOST_FRAMES, Flapping, basis, flapping_of, strongest
from wingfit.tracking.alignment.pose_error import STEADY, PoseError
from wingfit.tracking.alignment.request import Tracks
from wingfit.tracking.alignment.rigid_motion import RigidMotion, rigid_motion
from wingfit.tracking.rigid_body import Poses, poses

_BODY_MISFIT = 0.02  # RMS over the extent of the body markers above which they are not rigid
_MOST_ORDER = 3
_MOST_CORRELATION = 0.95  # of consecutive residuals of the body's markers
_SETTLED = 1e-4
_ROUNDS = 10  # as the body's motion and the wing's do not add up, but multiply
_LEAST_TURN, _LEAST_WAY = 0.01, 0.015  # RMS of slow motion below which there is none: rad, and of the tracks' extent
_NOTICED = 4.0  # a slow motion is removed if it is as many times larger than the scatter around it, in RMS of a mean


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """Motion of the body relative to its mean pose.

    Attributes:
        rotation, shift: [T, 3, 3], [T, 3] (m); a point that rests on the body is at rotation @ point + shift.
        words: what it is.
        error: of its pose in each frame.
    """

    rotation: Array
    shift: Array
    words: str
    error: PoseError

    def removed(self, positions: Array) -> Array:
        """Return ``positions`` [T, K, 3] as seen from the body."""
        return np.asarray(np.einsum("tji,tkj->tki", self.rotation, positions - self.shift[:, None]))


def by_markers(tracks: Tracks, names: tuple[str, ...]) -> BodyMotion:
    """Return the motion of the body by its tracks ``names``; NaN without a pose. DatasetError if they are not rigid."""
    points = tracks.positions[:, [tracks.names.index(name) for name in names]]
    seen = np.isfinite(points).all(axis=(1, 2))
    if not seen.any():
        raise fail("--body", None, f"no frame shows all of {', '.join(names)}; name tracks that are seen together")
    try:
        found = poses(points, points[int(np.argmax(seen))])
    except ValueError as error:
        raise fail("--body", None, f"{error}; name other tracks") from None
    extent = float(np.linalg.norm(np.ptp(found.shape, axis=0)))
    misfit = float(np.sqrt(np.nanmean(found.residuals**2)))
    if misfit > _BODY_MISFIT * extent:
        message = f"are not rigid: their distances change by {1e3 * misfit:.3g} mm of {1e3 * extent:.3g} mm"
        raise fail("--body", ", ".join(names), f"{', '.join(names)} {message}; name tracks on the body")
    path = np.linalg.norm(np.ptp(found.position[np.isfinite(found.position[:, 0])], axis=0))
    words = f"motion of the body removed by {len(names)} tracks on it, {100 * path:.3g} cm of way"
    return BodyMotion(found.rotation, found.position, words, _error_of(found))


def _error_of(found: Poses) -> PoseError:
    """Return the error of poses by the residuals of the markers, which also have the noise of the poses."""
    count, seen = len(found.shape), np.isfinite(found.residuals)
    noise = float(np.sqrt((found.residuals[seen] ** 2).mean() * 3 * count / (3 * count - 6)))
    arms = found.shape - found.shape.mean(axis=0)
    turning = np.trace(arms.T @ arms) * np.eye(3) - arms.T @ arms
    now, then = found.residuals[1:], found.residuals[:-1]
    both = np.isfinite(now) & np.isfinite(then)
    r = float((now[both] * then[both]).sum() / max((now[both] ** 2).sum(), 1e-300))
    r = min(max(r, 0.0), _MOST_CORRELATION)
    memory = (1 + r) / (1 - r)
    return PoseError(noise**2 * np.linalg.inv(turning), noise / float(np.sqrt(count)), found.shape.mean(axis=0), memory)


def slow(
    times: Array, frames: Index, motion: RigidMotion, flapping: Flapping, *, surely: bool = False
) -> BodyMotion | None:
    """Return the slow motion that is common to the wing's tracks, a polynomial over time; None if there is none.

    With ``surely``, it is known that there is one.

    ``motion`` is that of the ``frames`` [F] of all ``times`` [T]; the result is that of all. The pose of the wing as a
    rigid body is a polynomial, the body's motion, plus harmonics of the flapping.
    """
    fitted = np.isfinite(motion.rotation[:, 0, 0])
    t = times - times[0]
    order = order_of(times, flapping)
    if order < 1:
        return None
    s = 2 * t / t[-1] - 1
    powers = np.polynomial.legendre.legvander(s, order)
    turns = basis(t, flapping.frequency)[:, 1:]
    X = np.column_stack([powers, turns])[frames]
    hinge = np.einsum("tij,j->ti", motion.rotation, motion.pivot) + motion.shift
    y = np.column_stack([motion.rotation.reshape(-1, 9), hinge])[fitted]
    c, *_ = np.linalg.lstsq(X[fitted], y, rcond=None)
    left = (y - X[fitted] @ c).std(axis=0)
    still = c.copy()
    still[1 : order + 1] = 0
    drift = (X[fitted] @ (c - still)).std(axis=0)
    limit = _NOTICED * left / np.sqrt(max(fitted.sum() / 8, 1))
    size = float(np.linalg.norm(np.nanstd(motion.shape, axis=0)))
    if not surely and not (drift > np.maximum(limit, [_LEAST_TURN] * 9 + [_LEAST_WAY * size] * 3)).any():
        return None
    mean = powers @ c[: order + 1]
    rotation, place = _nearest(mean[:, :9].reshape(-1, 3, 3)), mean[:, 9:]
    middle = _nearest(mean[:, :9].mean(axis=0).reshape(1, 3, 3))[0]
    # Rotation vectors are a polynomial: elements of rotation matrices have higher orders of a large turn.
    vectors = Rotation.from_matrix(rotation @ middle.T).as_rotvec()
    vectors = powers @ np.linalg.lstsq(powers[frames], vectors[frames], rcond=None)[0]
    relative = Rotation.from_rotvec(vectors).as_matrix()
    pivot = place.mean(axis=0)
    angle = np.degrees(np.arccos(np.clip((np.trace(relative, axis1=1, axis2=2) - 1) / 2, -1, 1))).max()
    way = 1e3 * np.linalg.norm(np.ptp(place, axis=0))
    words = (
        f"the hinge moves slowly, by {way:.3g} mm and {angle:.2g} deg; this motion, a polynomial over time, was removed"
    )
    return BodyMotion(relative, place - relative @ pivot, words, STEADY)


def order_of(times: Array, flapping: Flapping) -> int:
    """Return the order of the polynomial over ``times`` [T] (s) that the flapping allows; 0 for less than 0.4 beats."""
    return min(_MOST_ORDER, int(flapping.frequency * float(times[-1] - times[0]) + 0.6))


def _nearest(matrices: Array) -> Array:
    """Rotations [T, 3, 3] nearest to ``matrices``."""
    U, _, Vt = np.linalg.svd(matrices)
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
    return np.asarray(U @ Vt)


def without_slow_motion(times: Array, positions: Array, frames: Index) -> tuple[Array, list[str], int]:
    """Return ``positions`` [T, K, 3] without slow common motion, what was removed in words, and its order (0: none).

    The motion is estimated from ``frames`` [F].
    """
    words, order = list[str](), 0
    for _ in range(_ROUNDS):
        motion = rigid_motion(positions[frames])
        frequency = strongest(times, motion.angles_of(positions)) if len(times) > MOST_FRAMES else None
        flapping = flapping_of(times[frames], motion.angle, trend=2, known=frequency)
        found = slow(times, frames, motion, flapping, surely=bool(words))
        if found is None:
            break
        positions, words = found.removed(positions), words or [found.words]
        order = order_of(times, flapping)
        if np.abs(found.rotation - np.eye(3)).max() < _SETTLED:
            break
    return positions, words, order
