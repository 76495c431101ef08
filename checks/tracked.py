"""Tracks of a wing beside its description: rest positions, hinge and drive, and the flap angle of the tracks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wingfit.checks.harmonics import Waves, fit, thin
from wingfit.records import Recording, Wing
from wingfit.records.array_types import Array, Float
from wingfit.sim.wing.drive import RodDrive

FRAMES = 400  # of a recording that are used
HARMONICS = 3
STEEPEST = 1.0  # rad: largest mean flap angle
INNER = 4  # one in so many markers, the nearest to the hinge, shows the motion of the drive


@dataclass(frozen=True, eq=False)
class Tracked:
    """A recording of a wing's markers: ``positions`` [T, M, 3] (m) at ``times`` [T] (s) of at most FRAMES frames.

    ``rest`` [M, 3]: rest positions (m) of the same markers; ``hinge``: a point of the hinge axis, m.
    """

    recording: Recording
    wing: Wing
    times: Float[Array, " T"]
    positions: Float[Array, "T M 3"]
    rest: Float[Array, "M 3"]
    hinge: Float[Array, " 3"]

    @classmethod
    def of(cls, recording: Recording, wing: Wing) -> Tracked:
        """Return the tracks of ``recording``, thinned."""
        rows = thin(len(recording.times), FRAMES)
        rest = np.array([wing.marker(name).position for name in recording.markers], float)
        hinge = np.array([0.0, wing.hinge.y, wing.hinge.z])
        return cls(recording, wing, recording.times[rows], recording.positions[rows], rest, hinge)

    def moved(self, positions: Float[Array, "T M 3"]) -> Tracked:
        """Return the same tracks at other ``positions``."""
        return replace(self, positions=positions)

    @property
    def frequency(self) -> float:
        """The stated flap frequency, Hz."""
        return self.recording.condition.flap_frequency

    @cached_property
    def angle(self) -> Array:
        """Angle [T] (rad) by which the rest positions, turned about the hinge, come nearest to the tracks.

        Its mean is at most STEEPEST: the wing of a right-handed rest position does not flap upside down.
        """
        found = turn(self.positions - self.hinge, self.rest - self.hinge)
        known = found[np.isfinite(found)]
        mean = float(np.angle(np.exp(1j * known).sum())) if known.size else 0.0
        return np.asarray(found - (mean - np.clip(mean, -STEEPEST, STEEPEST)))

    @cached_property
    def deviation(self) -> Array:
        """Distance vectors [T, M, 3] (m) of the tracks from the rest positions turned about the hinge by the angle."""
        return self.positions - self.hinge - turned(self.rest - self.hinge, self.angle)

    @property
    def misfit(self) -> float:
        """Root mean square distance (m) from the turned rest positions; 0 without data."""
        return rms(self.deviation)

    @cached_property
    def flap(self) -> Waves:
        """Harmonics of the flap angle of the markers nearest to the hinge."""
        away = np.hypot(*(self.rest - self.hinge)[:, 1:].T)
        inner = np.argsort(away, kind="stable")[: max(3, len(away) // INNER)]
        angle = turn((self.positions - self.hinge)[:, inner], (self.rest - self.hinge)[inner])
        return fit(self.times, angle[:, None], self.frequency, HARMONICS)

    @cached_property
    def driven(self) -> Array:
        """Complex Fourier coefficients [HARMONICS + 1] (rad) of the described angle of the driving rods."""
        series = RodDrive.of(self.wing.drive, 0.0, 1).series[:, 0, 0]
        return np.asarray(np.pad(series, (0, HARMONICS + 1))[: HARMONICS + 1])


def turn(places: Float[Array, "T M 3"], rest: Float[Array, "M 3"]) -> Array:
    """Angle [T] (rad) about x that brings ``rest`` [M, 3] nearest to ``places`` [T, M, 3]; NaN without markers."""
    y, z = places[..., 1], places[..., 2]
    seen = np.asarray(np.isfinite(places).all(axis=-1))
    sine = np.where(seen, rest[:, 1] * z - rest[:, 2] * y, 0.0).sum(axis=1)
    cosine = np.where(seen, rest[:, 1] * y + rest[:, 2] * z, 0.0).sum(axis=1)
    return np.where(seen.any(axis=1), np.arctan2(sine, cosine), np.nan)


def turned(rest: Float[Array, "M 3"], angle: Float[Array, " T"]) -> Array:
    """Positions [T, M, 3] of ``rest`` [M, 3] turned about x by each ``angle`` [T] (rad)."""
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x = np.broadcast_to(rest[:, 0], (len(angle), len(rest)))
    return np.stack([x, cosine * rest[:, 1] - sine * rest[:, 2], sine * rest[:, 1] + cosine * rest[:, 2]], axis=-1)


def rms(vectors: Float[Array, "T M 3"]) -> float:
    """Root mean square length of ``vectors`` [T, M, 3] without the missing ones; 0 if all are missing."""
    squares = (vectors**2).sum(axis=-1)
    return float(np.sqrt(np.nanmean(squares))) if np.isfinite(squares).any() else 0.0
