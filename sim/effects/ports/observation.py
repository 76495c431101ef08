"""A simulated beat before it is compared with a recording; faults of cameras, clocks and balances change it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wingfit.records import CameraPose, Recording, Vehicle, Wing
from wingfit.records.array_types import Array, Complex
from wingfit.records.dataset import STANDARD_GRAVITY


@dataclass
class Sampling:
    """One simulated beat of B individuals and the instants at which it is sampled. Effects change it in place.

    Attributes:
        rig: the wing or vehicle that was recorded.
        recording: the recording to compare with, whose conditions and instants apply.
        beat: the measured quantity at n equal steps over one beat from drive phase 0. Tracks: [B, n, M, 3], in m, of
            all M markers of the wing in its order. Forces: [B, n, 2], in N, along body x and z; both, even if the
            recording has one of them, as a tilted balance mixes them.
        times: [B, T], s: T instants at which the beat is sampled, initially those of the recording.
        added: [B, T, C]: values to add after sampling to the C channels of the recording. Initially zero.
        cameras: which the dataset states, two or more; empty: unknown.
    """

    rig: Wing | Vehicle
    recording: Recording
    beat: Array
    times: Array
    added: Array
    cameras: tuple[CameraPose, ...] = ()

    @property
    def wing(self) -> Wing:
        """The recorded wing; ValueError if the rig is a vehicle."""
        if not isinstance(self.rig, Wing):
            raise ValueError(f"vehicle {self.rig.name!r} has recordings of forces, not of tracks: remove the fault")
        return self.rig

    @property
    def vehicle(self) -> Vehicle:
        """The recorded vehicle; ValueError if the rig is a wing."""
        if not isinstance(self.rig, Vehicle):
            raise ValueError(f"wing {self.rig.name!r} has recordings of tracks, not of forces: remove the fault")
        return self.rig

    def along_axes(self, x: Array, z: Array) -> Array:
        """Return forces [B, C] (N) in the recording's channels, from ``x``, ``z`` [B] in weights of the vehicle."""
        weight = self.vehicle.mass * STANDARD_GRAVITY
        return weight * np.stack([x if axis == "x" else z for axis in self.recording.forces], axis=1)

    @property
    def kind(self) -> str:
        """Kind of the recording: "tracks" or "forces"."""
        return self.recording.kind

    def filtered(self, gain: Complex) -> None:
        """Multiply harmonic k of the beat by the complex ``gain[:, k]``, of [B, n // 2 + 1]; k = 0 is the mean."""
        n = self.beat.shape[1]
        spectrum = np.fft.rfft(self.beat, axis=1)
        spectrum *= gain.reshape(*gain.shape, *(1,) * (self.beat.ndim - 2))
        self.beat = np.fft.irfft(spectrum, n, axis=1)

    @property
    def harmonics(self) -> Array:
        """Frequencies [n // 2 + 1] (Hz) of the harmonics of the beat, from 0."""
        return np.arange(self.beat.shape[1] // 2 + 1) * self.recording.condition.flap_frequency


def between(beat: Array) -> Callable[[Array], Array]:
    """Return an interpolator of a periodic ``beat`` [n, M, I]: a function of delays [n, M] (beats) to values [n, M, I].

    n steps, M markers, I coordinates. Element [j, m] of the result is marker m at the time of step j plus its delay.
    Cubic Hermite interpolation with spectral slopes: the error is (2 pi k / n)^4 / 384 of harmonic k.
    """
    n, columns = len(beat), np.arange(beat.shape[1])
    turn = (2j * np.pi / n * np.arange(n // 2 + 1))[:, None, None]
    slope = np.fft.irfft(turn * np.fft.rfft(beat, axis=0), n, axis=0)
    rise, after = np.roll(beat, -1, axis=0) - beat, np.roll(slope, -1, axis=0)
    square, cube = 3.0 * rise - 2.0 * slope - after, slope + after - 2.0 * rise

    def later(beats: Array) -> Array:
        step = np.arange(n)[:, None] + beats * n
        before = np.floor(step)
        u = (step - before)[..., None]
        place = np.nan_to_num(before % n).astype(np.intp)  # of a failed individual u stays NaN
        value, first, second, third = (a[place, columns] for a in (beat, slope, square, cube))
        return np.asarray(value + u * (first + u * (second + u * third)))

    return later
