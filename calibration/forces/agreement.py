"""Compares modelled forces with recorded ones: mean beats, differences and spectra.

A model's forces come from ``Model.observe``, which samples and low-passes them like the recording; all functions here
treat modelled and recorded forces alike. A quantity is "lift", "drag", or the force along a body axis, "x" or "z".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.calibration.forces.result import Agreement, ForceComparison, Quantity, Source
from wingfit.calibration.forces.split_beats import Cut, pieces
from wingfit.records import Recording
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.vehicle.lift_drag import lift_drag

POINTS = 200  # of a mean beat
SEGMENT_BEATS = 4  # per piece of a spectrum: the harmonics of the beat fall on every fourth line
CONSTANT = 1e-9  # of the largest force of a recording: a force that varies less is constant, apart from rounding


@dataclass(frozen=True)
class Beats:
    """The whole beats without gaps of a recording, interpolated at n common instants.

    ``phase`` [n] is t*, the time in beats since the start of the beat; ``samples`` [beats, n] in N, by quantity.
    """

    phase: Array
    samples: Mapping[Quantity, Array]

    @property
    def mean(self) -> dict[Quantity, Array]:
        """Mean over the beats, [n] in N, by quantity."""
        return {name: beats.mean(axis=0) for name, beats in self.samples.items()}

    @property
    def spread(self) -> dict[Quantity, Array]:
        """Standard deviation between beats, [n] in N, by quantity; NaN with a single beat."""
        return {
            name: beats.std(axis=0, ddof=1) if len(beats) > 1 else np.full(len(self.phase), np.nan)
            for name, beats in self.samples.items()
        }


def quantities(recording: Recording, forces: Array) -> dict[Quantity, Array]:
    """Return ``forces`` [T, C] (N, axes of ``recording``) by name of the axis, [T] each, and lift and drag if possible.

    Lift and drag need x and z (Armanini et al. 2016, Eq. 16).
    """
    named: dict[Quantity, Array] = {}
    axes = recording.forces
    if "x" in axes and "z" in axes:
        both = lift_drag(forces[:, [axes.index("x"), axes.index("z")]], recording.condition.angle_of_attack)
        named = {"lift": both[:, 0], "drag": both[:, 1]}
    for k, axis in enumerate(axes):
        named[axis] = forces[:, k]
    return named


def whole_beats(recording: Recording, forces: Array | None = None, points: int = POINTS) -> Beats:
    """Split ``forces`` [T, C] (None: those recorded) into beats, interpolated at ``points`` instants by cubic splines.

    Beats in which the recording misses a sample are left out; ValueError if none is without a gap.
    """
    cut = Cut.of(recording)
    phase = np.arange(points) / points
    values = recording.values if forces is None else forces
    seen = recording.valid.all(axis=1)
    spline = scipy.interpolate.CubicSpline(recording.times[seen], values[seen], axis=0)
    instants = (cut.gapless[:, None] + phase) / recording.condition.flap_frequency
    named = quantities(recording, spline(instants.ravel()))
    return Beats(phase, {name: value.reshape(instants.shape) for name, value in named.items()})


@one_blas_thread
def agreements(recording: Recording, modelled: Array, source: Source) -> tuple[Agreement, ...]:
    """Measure how ``modelled`` forces [T, C] (N) agree with ``recording``; one Agreement per quantity.

    RMS difference and correlation are over all samples of the whole beats without gaps; percentages are of the range of
    the recorded mean beat. For a constant force both are NaN. ``source`` says where the modelled forces come from.
    """
    beats, model_beats = whole_beats(recording).mean, whole_beats(recording, modelled).mean
    cut = Cut.of(recording)
    kept = np.isin(cut.beat, cut.gapless)
    recorded, model = quantities(recording, recording.values[kept]), quantities(recording, modelled[kept])
    least = CONSTANT * max(float(np.abs(recording.values[kept]).max()), float(np.abs(modelled[kept]).max()))
    return tuple(
        Agreement(
            recording=recording.name,
            source=source,
            quantity=name,
            rmse=(rmse := float(np.sqrt(np.mean((model[name] - recorded[name]) ** 2)))),
            rmse_percent=_percent(rmse, beats[name], least),
            correlation=_correlation(model[name], recorded[name], least),
            mean_recorded=float(beats[name].mean()),
            mean_modelled=float(model_beats[name].mean()),
        )
        for name in recorded
    )


@one_blas_thread
def comparison(recording: Recording, modelled: Array, source: Source) -> ForceComparison:
    """Return mean beats and spectra of ``modelled`` forces [T, C] (N) beside those of ``recording``."""
    recorded, model = whole_beats(recording), whole_beats(recording, modelled)
    frequency, spectra = spectrum(recording, recording.values)
    _, model_spectra = spectrum(recording, modelled)
    return ForceComparison(
        recording=recording.name,
        source=source,
        phase=recorded.phase,
        recorded=recorded.mean,
        spread=recorded.spread,
        modelled=model.mean,
        frequency=frequency,
        recorded_spectrum=spectra,
        modelled_spectrum=model_spectra,
    )


def spectrum(recording: Recording, forces: Array) -> tuple[Array, dict[Quantity, Array]]:
    """Compute one-sided power spectral densities of ``forces`` [T, C] (N).

    Returns the frequencies [m] in Hz and, by quantity, the densities [m] in N^2/Hz. The mean is taken of the
    periodograms of pieces of SEGMENT_BEATS beats without overlap or window (so that a harmonic of the beat falls on one
    line), each less its mean: the sum times the width of a line is the mean variance of a piece (Parseval). Pieces
    contain no gaps; if no beat fits between gaps, both results are empty.
    """
    samples = pieces(recording, SEGMENT_BEATS)
    if not len(samples):
        return np.empty(0), {}
    rate = (len(recording.times) - 1) / (recording.times[-1] - recording.times[0])
    frequency, density = np.empty(0), {}
    for name, values in quantities(recording, forces).items():
        frequency, power = scipy.signal.periodogram(values[samples], fs=rate, detrend="constant", axis=1)
        density[name] = power.mean(axis=0)
    return frequency, density


def _percent(rmse: float, beat: Array, least: float) -> float:
    """Return ``rmse`` in per cent of the range (maximum - minimum) of ``beat`` [n]; NaN if it is <= ``least``."""
    span = float(np.ptp(beat))
    return 100 * rmse / span if span > least else float("nan")


def _correlation(a: Array, b: Array, least: float) -> float:
    """Return Pearson's correlation of two series; NaN if the range of one of them is at most ``least``."""
    if min(np.ptp(a), np.ptp(b)) <= least:
        return float("nan")
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))
