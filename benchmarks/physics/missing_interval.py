"""Locates the interval of the wing beat in which physics is missing from a fitted model of forces."""

from __future__ import annotations

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, linearise, unit_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.agreement import whole_beats
from wingfit.calibration.forces.result import Quantity
from wingfit.calibration.problem import Problem
from wingfit.records import Recording
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread

SHARE = 0.9
"""Fraction of the excess squared misfit that the interval of :func:`located` must explain.

With a larger fraction the interval would also include the ringing of the low-pass filter around an event; with a
smaller one it would shrink to the core of the event.
"""
SIGNIFICANCE = 0.01
FEWEST_BEATS = 5  # needed to estimate the noise from the scatter between beats
FLIPS = 999


@one_blas_thread
def located(
    recording: Recording, residual: Array, sensitivities: Array | None = None, quantity: Quantity = "x"
) -> tuple[float, float] | None:
    """Find where in the beat a model misses physics: start and end of the interval, as fractions of the beat.

    ``residual`` [n]: modelled minus recorded mean beat (N) at n equal steps of the beat; ``sensitivities`` [n, F]: its
    derivatives by the F coefficients that were fitted; ``quantity``: the recorded force axis.

    The excess is the squared misfit minus the part that random variation between beats explains. The result is the
    shortest interval such that the model, fitted again to the rest of the beat only, has at most 1 - SHARE of the
    excess there. This second fit is needed because a fit to the whole beat adapts the coefficients to the missing
    physics, which creates misfit in parts of the beat where the model is right. Without ``sensitivities`` the result is
    the shortest interval that contains SHARE of the excess.

    An interval that continues over the end of the beat has an end above 1. None if the misfit is not significant by a
    wild bootstrap (Wu 1986): each of FLIPS samples averages the beats' deviations from their mean with random signs,
    and the mean square reaches that of the residual in more than SIGNIFICANCE of them. Also None with fewer than
    FEWEST_BEATS beats.
    """
    samples = whole_beats(recording, points=len(residual)).samples[quantity]
    if len(samples) < FEWEST_BEATS or not _significant(samples, residual):
        return None
    noise = samples.var(axis=0, ddof=1) / len(samples)
    slopes = np.empty((len(residual), 0)) if sensitivities is None else sensitivities
    return _shortest(residual, slopes, noise)


@one_blas_thread
def missing_interval(problem: Problem, evaluator: Evaluator, recording: int = 0) -> tuple[float, float] | None:
    """Find the interval of the beat in which the model of ``problem`` misses physics, as :func:`located` does.

    Returns start and end as fractions of the beat, or None. The gene values are ``problem.base``; ``recording``: number
    of the recording, whose first fitted force axis is used.
    """
    genes, record = free_genes(problem), problem.recordings[recording]
    assert isinstance(record, Recording)  # noqa: S101 - of a vehicle
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
    """Return the shortest cyclic interval outside of which a new fit has at most 1 - SHARE of the excess.

    ``residual`` [n] and its variance ``noise`` [n]; ``slopes`` [n, F]: derivatives by the fitted coefficients. The
    interval is (start, end) as fractions of the beat; None if the squared residual does not exceed the noise.
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
    """Return the residual sums of squares [K] after K least-squares fits, from their normal equations.

    ``products`` [K, F + 1, F + 1]: sums of products of the F basis functions and, last, the residual.
    """
    inner, cross, square = products[:, :-1, :-1], products[:, :-1, -1], products[:, -1, -1]
    solved = np.einsum("kpq,kq->kp", np.linalg.pinv(inner, rcond=1e-9, hermitian=True), cross)
    return np.asarray(square - np.einsum("kp,kp->k", cross, solved))
