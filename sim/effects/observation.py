"""A simulated beat on its way into a recording: what faults of cameras, clocks and balances act on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from records import Gene, Recording, Vehicle, Wing
from sim.effects.contract import Effect

Array = npt.NDArray[np.float64]


@dataclass
class Sampling:
    """One beat of B individuals, and when it is looked at. Effects change it in place.

    Attributes:
        rig: what was recorded.
        recording: the conditions and the instants.
        beat: what is measured over one beat at n equal steps from drive phase 0 (a period). Of tracks [B, n, M, 3], in
            m, all markers of the wing in its order; of forces [B, n, C], in N, along the recording's axes.
        times: [B, T], s: instants at which it is sampled; at first those of the recording.
        added: [B, T, C] is added to what was sampled; C as in the recording. At first zero.
    """

    rig: Wing | Vehicle
    recording: Recording
    beat: Array
    times: Array
    added: Array

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


def observed(effects: Iterable[Effect], genes: tuple[Gene, ...], genomes: Array, kind: str) -> list[Effect]:
    """Effects that act on the observation of some of ``genomes`` [B, G]."""
    return [e for e in effects if e.observe and kind in e.observed and not e.off(e.values(genes, genomes)).all()]


def apply(effects: Iterable[Effect], genes: tuple[Gene, ...], genomes: Array, sampling: Sampling) -> None:
    """Let each effect act on those of ``genomes`` [B, G] for which it is on: nobody's numbers depend on others."""
    for effect in effects:
        values = effect.values(genes, genomes)
        on = np.flatnonzero(~effect.off(values))
        if effect.observe is None or not len(on):
            continue
        part = Sampling(
            sampling.rig, sampling.recording, sampling.beat[on], sampling.times[on].copy(), sampling.added[on].copy()
        )
        effect.observe(part, {name: value[on] for name, value in values.items()})
        sampling.beat[on], sampling.times[on], sampling.added[on] = part.beat, part.times, part.added
