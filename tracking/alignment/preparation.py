"""Before the search: frames for the estimate, the motion of the body, and a first look at the tracks of the wing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Index
from wingfit.records.errors import fail
from wingfit.records.wing import Wing
from wingfit.tracking.alignment.body_motion import by_markers, without_slow_motion
from wingfit.tracking.alignment.flapping import MOST_FRAMES, Flapping, flapping_of, strongest
from wingfit.tracking.alignment.pose_error import STEADY, Frames, PoseError, polynomials
from wingfit.tracking.alignment.request import LEAST_TRACKS, Known, Tracks
from wingfit.tracking.alignment.rigid_motion import RigidMotion, distance_changes, rigid_motion

_LEAST_AMPLITUDE = np.radians(4.0)
_SIZES = (0.6, 1.7)  # ratio of the tracks' extent to that of the described markers
_FLAT = 0.02  # least spread of the tracks across the line along which they spread most
_LEFT = 1  # higher orders than those removed of which slow motion may be left
_MOST_CHANGE = 0.01  # of the distances between tracks, spans; wings of benchmarks.alignment have up to 0.0017


@dataclass(frozen=True, eq=False)
class Prepared:
    """Tracks without the motion of the body, and the first look at them.

    Attributes:
        tracks: all of the wing's, without the body's.
        frames: [F] those from which the frame is estimated.
        motion: rigid motion of the tracks in these frames.
        angle: [T] turn of the wing in all frames, rad; NaN where too few tracks are seen.
        flapping: in ``frames``.
        shaking: errors of the body's pose.
        slow: [T, D] polynomials of which slow motion may be left; D = 0 where there is none.
        remarks: what was done.
    """

    tracks: Tracks
    frames: Index
    motion: RigidMotion
    angle: Array
    flapping: Flapping
    shaking: PoseError
    slow: Array
    remarks: list[str]

    @property
    def of_frames(self) -> Frames:
        """What is known of ``frames``."""
        return Frames(self.flapping.mean, self.slow[self.frames], self.shaking)

    def flapping_by(self, angle: Array, frequency: float) -> Flapping:
        """Return the flapping by the flap ``angle`` [F] (rad) in ``frames``, with a period near ``frequency`` (Hz)."""
        return flapping_of(self.tracks.times[self.frames], angle, trend=self.slow.shape[1], known=frequency)

    def flap_angles(self, some: Array) -> Array:
        """Return approximate flap angles [T] of all frames by ``some`` [F] of the estimate's frames, rad."""
        turn = self.angle[self.frames]
        both = np.isfinite(turn)
        slope, start = np.polyfit(turn[both], some[both], 1)
        found = start + slope * self.angle
        found[self.frames] = some
        known = np.isfinite(found)
        return np.asarray(np.interp(np.arange(len(found)), np.flatnonzero(known), found[known]))


def described_of(wing: Wing) -> Array:
    """Return the described rest positions [M, 3] of the markers in hinge coordinates, m."""
    rest: Array = np.array([marker.position for marker in wing.markers])
    return np.asarray(rest - np.array([0.0, wing.hinge.y, wing.hinge.z]))


def prepared(tracks: Tracks, wing: Wing, known: Known) -> Prepared:
    """Return ``tracks`` prepared for the search; DatasetError if they cannot be those of ``wing``."""
    remarks, shaking, order = list[str](), STEADY, 0
    if known.body:
        body = by_markers(tracks, known.body)
        tracks = tracks.only(np.array([name not in known.body for name in tracks.names]))
        tracks = Tracks(tracks.file, tracks.times, tracks.names, body.removed(tracks.positions))
        remarks.append(body.words)
        shaking = body.error
    usable = np.flatnonzero(np.isfinite(tracks.positions[..., 0]).sum(axis=1) >= LEAST_TRACKS)
    if len(usable) < LEAST_TRACKS:
        few = f"{len(usable)} frames show {LEAST_TRACKS} or more tracks; track more markers at a time"
        raise fail(tracks.file, len(usable), few)
    _check_extent(tracks, usable)
    frames = _spread(usable)
    _check_distances(tracks, wing, frames)
    if not known.body:
        # All frames are corrected, so that the estimate from some of them holds for all.
        corrected, words, order = without_slow_motion(tracks.times, tracks.positions, frames)
        tracks, remarks = Tracks(tracks.file, tracks.times, tracks.names, corrected), remarks + words
    motion = rigid_motion(tracks.positions[frames])
    _check_size(tracks, wing, motion)
    angle = motion.angles_of(tracks.positions)
    amplitude = float(np.nanmax(motion.angle) - np.nanmin(motion.angle)) / 2
    if amplitude < _LEAST_AMPLITUDE:
        few = (
            f"the wing turns by +-{np.degrees(amplitude):.2g} deg; at least {np.degrees(_LEAST_AMPLITUDE):.2g} deg are"
        )
        raise fail(tracks.file, None, f"too little motion: {few} needed to see its hinge; align a recording that flaps")
    frequency = strongest(tracks.times, angle) if len(usable) > MOST_FRAMES else None
    slow = polynomials(tracks.times, order + _LEFT if order else 0)
    flapping = flapping_of(tracks.times[frames], motion.angle, trend=slow.shape[1], known=frequency)
    return Prepared(tracks, frames, motion, angle, flapping, shaking, slow, remarks)


def _spread(usable: Index) -> Index:
    """Return at most MOST_FRAMES of the ``usable`` frames, from which the frame is estimated.

    The steps are irregular, since a beat may last a whole number of even ones.
    """
    if len(usable) <= MOST_FRAMES:
        return usable
    within = np.random.default_rng(0).uniform(size=MOST_FRAMES)
    return np.asarray(usable[((np.arange(MOST_FRAMES) + within) * len(usable) / MOST_FRAMES).astype(int)])


def _check_extent(tracks: Tracks, usable: Index) -> None:
    """Raise DatasetError if the tracks lie in one place or on one line, so that they have no pose."""
    frame = tracks.positions[usable[np.argmax(np.isfinite(tracks.positions[usable, :, 0]).sum(axis=1))]]
    points = frame[np.isfinite(frame[:, 0])]
    along, across = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[:2] / np.sqrt(len(points))
    if across <= _FLAT * along:
        message = (
            f"the tracks lie on one line: they spread by {1e3 * along:.3g} mm along it and {1e3 * across:.3g} mm "
            f"across; at least {100 * _FLAT:g} % of the length are needed: track markers along the span and the chord"
        )
        raise fail(tracks.file, None, message)


def _check_distances(tracks: Tracks, wing: Wing, frames: Index) -> None:
    change = distance_changes(tracks.positions[frames])
    some = np.isfinite(change).any(axis=0)
    typical = float(np.median(np.nanmedian(change[:, some], axis=0))) if some.any() else 0.0
    limit = _MOST_CHANGE * wing.span
    if typical > limit:
        message = (
            f"the tracks do not move as a wing: distances between them vary by {1e3 * typical:.3g} mm (median); at "
            f"most {1e3 * limit:.3g} mm (1 % of the described span) are accepted: import the tracks of one wing alone, "
            "and check the unit and the description"
        )
        raise fail(tracks.file, f"{1e3 * typical:.3g}", message)


def _check_size(tracks: Tracks, wing: Wing, motion: RigidMotion) -> None:
    shape = motion.shape[np.isfinite(motion.shape[:, 0]) & (motion.weight > 0.3)]
    rest = described_of(wing)
    ratio = float(np.sqrt(shape.var(axis=0).sum() / rest.var(axis=0).sum()))
    if not _SIZES[0] < ratio < _SIZES[1]:
        message = (
            f"the tracks that move together spread {ratio:.3g} times as far as the described markers; the ratio must "
            f"be within {_SIZES[0]:g} to {_SIZES[1]:g}: is the unit right, and is it the described wing?"
        )
        raise fail(tracks.file, f"{ratio:.3g}", message)
