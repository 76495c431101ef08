"""Simulates a planned recording, and what each gene and each effect would change in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.inference.campaign.noise_level import NoiseLevel
from wingfit.inference.campaign.sampling import Sampling
from wingfit.inference.design import Information
from wingfit.records import Recording, Wing
from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.sim.wing.alignment import REFERENCE_HARMONICS, recorded_crossing


@dataclass(frozen=True, eq=False)
class Response:
    """Changes of one simulated recording, as Fourier coefficients over the grid of its instants.

    Attributes:
        recording: the simulated recording, at T instants.
        base: [n, C] coefficients of its C channels: an orthonormal basis of cosines and sines.
        changes: [n, C, P] by one unit of each of P parameters.
        cycles: [n] frequency of each coefficient, cycles per beat.
        shift: (u, w), [n, C] each: change by the phase, and the weight of noise in the phase that is found in tracks;
            None for forces.
    """

    recording: Recording
    base: Float[Array, "n C"]
    changes: Float[Array, "n C P"]
    cycles: Float[Array, " n"]
    shift: tuple[Array, Array] | None

    @classmethod
    def of(cls, recording: Recording, changes: Float[Array, "T C P"], wing: Wing | None) -> Response:
        """Transform ``changes`` [T, C, P] of ``recording``, whose values are simulated."""
        base, cycles = coefficients(recording.values), _cycles(recording)
        shift = None if wing is None else _shift(wing, recording)
        return cls(recording, base, coefficients(changes), cycles, shift)

    @property
    def beats(self) -> float:
        """Beats on the grid."""
        return len(self.recording.times) / self.frames

    @property
    def frames(self) -> float:
        """Instants of a beat on the grid."""
        times = self.recording.times
        return 1.0 / (float(times[1] - times[0]) * self.recording.condition.flap_frequency)

    def information(
        self, noise: NoiseLevel, sampling: Sampling, channels: Bool[Mask, " C"] | None = None
    ) -> Information:
        """Return the information of a recording with ``sampling`` and ``noise``, of these ``channels`` [C] only."""
        kept = np.ones(self.base.shape[1], bool) if channels is None else channels
        usable = self.cycles <= 0.5 * sampling.frames
        deviation = noise.deviation[_axes(self.recording)][kept]
        variance = np.repeat(noise.density(self.cycles[usable] / sampling.frames)[:, None], len(deviation), axis=1)
        changes = (self.changes[usable][:, kept] / deviation[:, None]).reshape(variance.size, -1)
        shift = None
        if self.shift is not None:
            along, offset = (one[usable][:, kept] for one in self.shift)
            shift = (along / deviation).ravel(), (offset * deviation).ravel()
        weight = np.repeat((deviation**2 / self._assumed(noise, sampling, kept))[None], len(variance), axis=0)
        beats, zero = (np.moveaxis(one[usable][:, kept] / deviation[:, None], -1, 0) for one in self._disturbed(noise))
        beats = beats * np.sqrt(sampling.frames / (self.frames * self.beats))
        return Information.of(
            changes,
            variance.ravel(),
            beats.reshape(len(beats), variance.size).T,
            shift,
            weight.ravel(),
            zero.reshape(len(zero), variance.size).T,
            sampling.samples / len(self.recording.times),
        )

    def _disturbed(self, noise: NoiseLevel) -> tuple[Float[Array, "n C K"], Float[Array, "n C L"]]:
        """Return changes that differ from beat to beat, and changes that are constant in a recording.

        Both by one standard deviation: of the amplitude and the start of a beat, and of the zero of each axis.
        """
        shape = self.base.shape
        if self.recording.kind == "tracks":
            return np.zeros((*shape, 0)), np.zeros((*shape, 0))
        rate = _rate(self.recording)
        beats = np.stack([noise.scatter_of_mean * self.base, noise.timing * coefficients(rate)], axis=-1)
        zero = np.zeros((*shape, shape[1]))
        zero[0] = np.diag(np.full(shape[1], noise.zero * np.sqrt(shape[0])))
        return beats, zero

    def _assumed(self, noise: NoiseLevel, sampling: Sampling, kept: Mask) -> Float[Array, " c"]:
        """Return the variances of a sample that a fit will find: noise that a low-pass lets pass, and scatter."""
        square = noise.deviation[_axes(self.recording)][kept] ** 2
        through = self.recording.low_pass
        if through is not None:
            rate = sampling.frames * self.recording.condition.flap_frequency
            square = square * min(2.0 * through.cutoff / rate, 1.0)
        return np.asarray(square + noise.scatter**2 * np.mean(self.recording.values[:, kept] ** 2, axis=0))


def coefficients(values: Array) -> Array:
    """Return the coefficients [T, ...] of ``values`` [T, ...] in an orthonormal basis: mean, cosines, sines."""
    count = len(values)
    wave = np.fft.rfft(values, axis=0) * np.sqrt(2.0 / count)
    wave[0] /= np.sqrt(2.0)
    if count % 2 == 0:
        wave[-1] /= np.sqrt(2.0)
    return np.concatenate([wave.real, -wave.imag[1 : (count + 1) // 2]])


def _cycles(recording: Recording) -> Array:
    count = len(recording.times)
    step = float(recording.times[1] - recording.times[0]) * recording.condition.flap_frequency
    order = np.arange(count // 2 + 1)
    return np.concatenate([order, order[1 : (count + 1) // 2]]) / (count * step)


def _axes(recording: Recording) -> Array:
    """Return the index of the axis of each channel: x, y, z of markers; x, z of forces."""
    if recording.kind == "forces":
        return np.array(["xz".index(axis) for axis in recording.forces])
    return np.tile(np.arange(3), len(recording.markers))


def _rate(recording: Recording) -> Array:
    """Return the derivative [T, C] of the values of ``recording`` by the time in beats."""
    count = len(recording.times)
    beats = count * float(recording.times[1] - recording.times[0]) * recording.condition.flap_frequency
    wave = np.fft.rfft(recording.values, axis=0) * (2j * np.pi * np.arange(count // 2 + 1))[:, None]
    return np.asarray(np.fft.irfft(wave, n=count, axis=0) / beats)


def _shift(wing: Wing, recording: Recording) -> tuple[Array, Array]:
    """Return the change of each coefficient by the phase (rad), and what its noise adds to the phase that is found.

    Both are [n, C]. Noise of the heights of the reference markers moves the instant at which their mean, a Fourier
    series of a few harmonics, crosses the hinge (:mod:`wingfit.sim.wing.alignment`).
    """
    count = len(recording.times)
    psi = 2 * np.pi * recording.condition.flap_frequency * recording.times
    along = _rate(recording) / (2 * np.pi)
    start = recorded_crossing(wing, recording)
    order = np.arange(1, REFERENCE_HARMONICS + 1)
    window = (1.0 + 2.0 * np.cos(np.outer(psi - start, order)).sum(axis=1)) / count
    columns = [3 * k + 2 for k, name in enumerate(recording.markers) if name in wing.reference_markers]
    weight = np.zeros(recording.values.shape)
    weight[:, columns] = window[:, None] / len(columns)
    slope = float((weight * along).sum())
    return coefficients(along), coefficients(-weight / slope)


def kept_channels(recording: Recording, markers: Sequence[str]) -> Mask:
    """Return True [C] for the channels of ``recording`` that belong to ``markers``; for forces, to these axes."""
    if recording.kind == "forces":
        return np.array([axis in markers for axis in recording.forces])
    return np.repeat([name in markers for name in recording.markers], 3)
