"""How modelled forces agree with recorded ones: mean beats, differences, spectra, and where in the beat a misfit lies.

A model's forces come from ``Model.observe``, which samples and low-passes them like the recording; everything here then
does the same to both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import periodogram

from wingfit.calibration.estimates.linearised import free_genes, linearise, unit_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.result import Agreement, ForceComparison, Quantity, Source
from wingfit.calibration.forces.split_beats import Cut, pieces
from wingfit.calibration.problem import Problem
from wingfit.records import Recording
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.vehicle.lift_drag import lift_drag

POINTS = 200  # of a mean beat
SEGMENT_BEATS = 4  # per piece of a spectrum: the harmonics of the beat fall on every fourth line
SHARE = 0.9
"""Share of the excess squared misfit for which :func:`located` makes its interval answer.

The excess outside may then be a tenth: with more, the ringing of the low-pass, which smears every event over the
beat, counts as misfit too; with less, the interval shrinks to the core of the event.
"""
SIGNIFICANCE = 0.01
FEWEST_BEATS = 5  # for the scatter between beats to say what noise explains
FLIPS = 999
CONSTANT = 1e-9  # of the largest force of a recording: what varies less is constant, but for rounding


@dataclass(frozen=True)
class Beats:
    """The whole, gapless beats of a recording at common instants.

    ``phase`` [n] is t*; ``samples`` holds [beats, n] in N per quantity.
    """

    phase: Array
    samples: Mapping[Quantity, Array]

    @property
    def mean(self) -> dict[Quantity, Array]:
        """Mean beat, [n] in N per quantity."""
        return {name: beats.mean(axis=0) for name, beats in self.samples.items()}

    @property
    def spread(self) -> dict[Quantity, Array]:
        """Standard deviation between beats, [n] in N per quantity; NaN with a single beat."""
        return {
            name: beats.std(axis=0, ddof=1) if len(beats) > 1 else np.full(len(self.phase), np.nan)
            for name, beats in self.samples.items()
        }


def quantities(recording: Recording, forces: Array) -> dict[Quantity, Array]:
    """``forces`` [T, C] in the recording's axes by name, [T] in N each; lift and drag where both axes are there.

    Lift and drag after Armanini et al. 2016, Eq. 16.
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
    """Cut ``forces`` [T, C] (None: those recorded) into beats with ``points`` instants each, by cubic splines.

    Beats in which the recording misses a sample are left out; ValueError when no beat is left.
    """
    cut = Cut.of(recording)
    phase = np.arange(points) / points
    values = recording.values if forces is None else forces
    seen = recording.valid.all(axis=1)
    spline = CubicSpline(recording.times[seen], values[seen], axis=0)
    instants = (cut.gapless[:, None] + phase) / recording.condition.flap_frequency
    named = quantities(recording, spline(instants.ravel()))
    return Beats(phase, {name: value.reshape(instants.shape) for name, value in named.items()})


@one_blas_thread
def agreements(recording: Recording, modelled: Array, source: Source) -> tuple[Agreement, ...]:
    """How ``modelled`` [T, C], in N, agrees with the recording, one entry per quantity.

    Differences and correlation over all samples of the whole beats; percentages of the range of the recorded mean beat.
    Neither percentages nor correlation (NaN) of a force that is constant.
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
    """Lay ``modelled`` [T, C], in N, over the recording: mean beats and spectra."""
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
    """One-sided power spectral densities of ``forces`` [T, C]: frequencies [m] in Hz, and [m] in N^2/Hz per quantity.

    Mean of the periodograms of pieces of SEGMENT_BEATS beats without overlap or window (harmonics of the beat then stay
    in one line), each less its mean: the sum times the width of a line is the mean variance of a piece (Parseval).
    Pieces lie between the gaps; where no beat fits, both are empty.
    """
    samples = pieces(recording, SEGMENT_BEATS)
    if not len(samples):
        return np.empty(0), {}
    rate = (len(recording.times) - 1) / (recording.times[-1] - recording.times[0])
    frequency, density = np.empty(0), {}
    for name, values in quantities(recording, forces).items():
        frequency, power = periodogram(values[samples], fs=rate, detrend="constant", axis=1)
        density[name] = power.mean(axis=0)
    return frequency, density


@one_blas_thread
def located(
    recording: Recording, residual: Array, sensitivities: Array | None = None, quantity: Quantity = "x"
) -> tuple[float, float] | None:
    """Find where in the beat a model misses physics.

    ``residual`` [n] is the modelled minus the recorded mean beat, N, and ``sensitivities`` [n, F] its derivatives by
    the coefficients that were fitted. The answer is the shortest interval of the beat (t*) without which the model,
    fitted anew to the rest of the beat, has no more than 1 - SHARE of the excess left there: of the squared misfit less
    what the scatter between beats leaves in a mean of so many. The new fit is needed because one to the whole beat
    lets its coefficients make up for what is missing, and so carries the misfit into parts of the beat where the model
    is right. Without ``sensitivities`` it is the shortest interval that holds SHARE of the excess.

    The interval may run over the end of the beat: then its end is above 1. None where the misfit is not significant:
    beats are taken as exchangeable about their mean, their deviations get random signs, and the mean square of FLIPS
    such means must reach that of the residual in at most SIGNIFICANCE of the cases (a wild bootstrap, Wu 1986). None
    also with fewer than FEWEST_BEATS beats, too few to decide.
    """
    samples = whole_beats(recording, points=len(residual)).samples[quantity]
    if len(samples) < FEWEST_BEATS or not _significant(samples, residual):
        return None
    noise = samples.var(axis=0, ddof=1) / len(samples)
    slopes = np.empty((len(residual), 0)) if sensitivities is None else sensitivities
    return _shortest(residual, slopes, noise)


@one_blas_thread
def missing_interval(problem: Problem, evaluator: Evaluator, recording: int = 0) -> tuple[float, float] | None:
    """Find where in the beat the model of ``problem`` misses physics, at the problem's base genome.

    On the first fitted axis of its recording number ``recording``; see :func:`located`.
    """
    genes, record = free_genes(problem), problem.recordings[recording]
    unit = unit_at(genes, np.array([problem.base[gene.name] for gene in genes]))
    linear = linearise(problem, evaluator, unit)
    axis = record.forces.index(problem.axes[0] if problem.axes else "x")
    name = record.forces[axis]

    def mean_beat(channel: Array) -> Array:
        whole = np.zeros_like(record.values)
        whole[:, axis] = channel
        return whole_beats(record, whole).mean[name]

    residual = mean_beat(linear.residuals[recording][:, axis])
    slopes = [mean_beat(slope) for slope in linear.sensitivities[recording][:, axis].T]
    return located(record, residual, np.stack(slopes, axis=1), name)


def _significant(samples: Array, residual: Array) -> bool:
    beats = len(samples)
    deviations = (samples - samples.mean(axis=0)) * np.sqrt(beats / (beats - 1))
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(FLIPS, beats))
    by_noise = np.mean((signs @ deviations / beats) ** 2, axis=1)
    return bool(1 + np.sum(by_noise >= np.mean(residual**2)) <= SIGNIFICANCE * (FLIPS + 1))


def _shortest(residual: Array, slopes: Array, noise: Array) -> tuple[float, float] | None:
    """Shortest cyclic interval outside of which a new fit leaves at most 1 - SHARE of the excess; None without excess.

    ``residual`` and ``noise`` (its variance) [n], ``slopes`` [n, F].
    """
    n, basis = len(residual), np.linalg.qr(slopes)[0]
    terms = np.concatenate([basis, residual[:, None]], axis=1)
    products = np.einsum("tp,tq->tpq", terms, terms)
    summed = np.concatenate([np.zeros((1, *products.shape[1:])), np.cumsum(np.tile(products, (2, 1, 1)), axis=0)])
    heard = np.concatenate([[0.0], np.cumsum(np.tile(noise, 2))])
    starts = np.arange(n)
    excess = _left(summed[n][None])[0] - heard[n]
    if excess <= 0:
        return None
    for length in range(1, n):
        outside = _left(summed[n] - (summed[starts + length] - summed[starts]))
        excess_outside = outside - (heard[n] - (heard[starts + length] - heard[starts]))
        start = int(excess_outside.argmin())
        if excess_outside[start] <= (1 - SHARE) * excess:
            return start / n, (start + length) / n
    return None


def _left(products: Array) -> Array:
    """Squares [K] that a fit leaves, from sums of products [K, F + 1, F + 1] of basis and, last, residual."""
    inner, cross, square = products[:, :-1, :-1], products[:, :-1, -1], products[:, -1, -1]
    solved = np.einsum("kpq,kq->kp", np.linalg.pinv(inner, rcond=1e-9, hermitian=True), cross)
    return np.asarray(square - np.einsum("kp,kp->k", cross, solved))


def _percent(rmse: float, beat: Array, least: float) -> float:
    """``rmse`` in per cent of the range of ``beat``; NaN when that is constant: varies by no more than ``least``."""
    span = float(np.ptp(beat))
    return 100 * rmse / span if span > least else float("nan")


def _correlation(a: Array, b: Array, least: float) -> float:
    """Pearson's correlation; NaN when one of them is constant: varies by no more than ``least``."""
    if min(np.ptp(a), np.ptp(b)) <= least:
        return float("nan")
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))
