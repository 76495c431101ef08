"""A simulated beat on its way into a recording: what faults of cameras, clocks and balances act on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from wingfit.records import Recording, Vehicle, Wing
from wingfit.sim.effects.contract import Array, Effect

fault_of_tracks = partial(Effect, family="measurement", port="observation", observed=("tracks",))
fault_of_forces = partial(Effect, family="measurement", port="observation", observed=("forces",))
fault_of_recordings = partial(Effect, family="measurement", port="observation", observed=("tracks", "forces"))


@dataclass
class Sampling:
    """One beat of B individuals, and when it is looked at. Effects change it in place.

    Attributes:
        rig: what was recorded.
        recording: the conditions and the instants.
        beat: what is measured over one beat at n equal steps from drive phase 0 (a period). Of tracks [B, n, M, 3], in
            m, all markers of the wing in its order; of forces [B, n, 2], in N, along body x and z, whichever of them
            the recording has: a tilted balance mixes them.
        times: [B, T], s: instants at which it is sampled; at first those of the recording.
        added: [B, T, C] is added to what was sampled; C as in the recording. At first zero.
    """

    rig: Wing | Vehicle
    recording: Recording
    beat: Array
    times: Array
    added: Array

    @property
    def wing(self) -> Wing:
        """The wing; ValueError for a vehicle."""
        if not isinstance(self.rig, Wing):
            raise ValueError(f"vehicle {self.rig.name!r} was recorded as forces; this fault is one of tracks")
        return self.rig

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle; ValueError for a wing."""
        if not isinstance(self.rig, Vehicle):
            raise ValueError(f"wing {self.rig.name!r} was recorded as tracks; this fault is one of forces")
        return self.rig

    @property
    def kind(self) -> str:
        """Tracks or forces."""
        return self.recording.kind

    def filtered(self, gain: npt.NDArray[np.complex128]) -> None:
        """Multiply harmonic k of the beat by ``gain`` [B, K + 1] (K + 1 = n // 2 + 1); gain[:, 0] acts on the mean."""
        n = self.beat.shape[1]
        spectrum = np.fft.rfft(self.beat, axis=1)
        spectrum *= gain.reshape(*gain.shape, *(1,) * (self.beat.ndim - 2))
        self.beat = np.fft.irfft(spectrum, n, axis=1)

    @property
    def harmonics(self) -> Array:
        """Frequencies (Hz) of the harmonics of the beat [n // 2 + 1]."""
        return np.arange(self.beat.shape[1] // 2 + 1) * self.recording.condition.flap_frequency


def between(beat: Array) -> Callable[[Array], Array]:
    """What the periodic ``beat`` [n, M, I] of an individual is at phases [n, M], in beats later than each step.

    Cubic between the steps, through values and slopes: off by (2 pi k / n)^4 / 384 of harmonic k.
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
