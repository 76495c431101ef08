"""Compute confidence intervals of genes from noise and from model error."""

from __future__ import annotations

import numpy as np
import scipy

from wingfit.calibration.estimates.linearised import free_genes
from wingfit.diagnosis.evidence.fit import PRIOR_SD, Fit
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import GeneValue, Interval
from wingfit.records.array_types import Array, Float

CONFIDENCE = 0.9


def standard_errors(freedom: float = np.inf) -> float:
    """Return half the width of a CONFIDENCE interval in standard errors that have ``freedom`` degrees of freedom."""
    return float(scipy.special.stdtrit(freedom, 0.5 + CONFIDENCE / 2))


def covariance(data: WhitenedData, fit: Fit) -> Float[Array, "F F"]:
    """Return the covariance [F, F] of the genes of ``fit`` in unit coordinates (bounds at 0 and 1).

    It includes noise; the model error as a few independent samples (:meth:`WhitenedData.likelihood_weight`), no smaller
    than the tolerance; and the prior. For forces it adds the scatter of the recordings' scores, the gradients of the
    log-likelihood (a sandwich with recordings as clusters: Liang and Zeger 1986). For tracks it adds how far genes move
    if a recording is left out (:func:`_jackknife`), as a misfit that is alike in all markers of a recording is more
    than its few samples show; and how far errors of the description move them that are not integrated out. The weight
    is the share of noise in what moves genes: the jackknife sees the noise too, and only its other share is added.
    """
    slopes, weight = data.whitened_slopes(fit.jacobian), _weight(data, fit)
    known = np.linalg.inv(_information(slopes, weight))
    found = known + disagreement(data, fit)
    if data.rigid_errors is not None:
        moves = known @ (weight * slopes.T @ data.whitened_slopes(data.rigid_errors))
        found = found + moves @ moves.T
    return np.asarray(found)


def _weight(data: WhitenedData, fit: Fit) -> float:
    return min(data.likelihood_weight(fit.coefficients), data.max_likelihood_weight)


def _information(slopes: Float[Array, "D F"], weight: float) -> Float[Array, "F F"]:
    """Return the information [F, F] of the likelihood, with its ``weight``, and of the prior."""
    return np.asarray(weight * slopes.T @ slopes + np.eye(slopes.shape[1]) / PRIOR_SD**2)


def disagreement(data: WhitenedData, fit: Fit) -> Float[Array, "F F"]:
    """Return the part of :func:`covariance` [F, F] that recordings show by their disagreement."""
    if len(data.recordings) < 2 or data.kind not in ("tracks", "forces"):
        return np.zeros((len(fit.unit), len(fit.unit)))
    white, slopes, weight = data.whiten(fit.coefficients), data.whitened_slopes(fit.jacobian), _weight(data, fit)
    if data.kind == "tracks":
        return (1.0 - weight) * _jackknife(data, white, slopes, weight)
    return _sandwich(data, white, slopes, weight)


def _sandwich(data: WhitenedData, white: Array, slopes: Float[Array, "D F"], weight: float) -> Float[Array, "F F"]:
    """Return the covariance [F, F] of genes by the scatter of the recordings' scores; arguments as of `_jackknife`.

    Beats of a force differ in size with all harmonics, so only whole recordings are independent.
    """
    scores = weight * np.array([slopes[part].T @ white[part] for part in data.recording_slices])
    moves = (scores - scores.mean(axis=0)) @ np.linalg.inv(_information(slopes, weight))
    return np.asarray(len(moves) / (len(moves) - 1.0) * moves.T @ moves)


def _jackknife(data: WhitenedData, white: Array, slopes: Float[Array, "D F"], weight: float) -> Float[Array, "F F"]:
    """Return the covariance [F, F] of genes from the fits that leave out one recording each, linearised.

    ``white`` [D]: whitened residual of the fit to all recordings, with ``slopes`` and the ``weight`` of the likelihood
    (Tukey 1958; MacKinnon and White 1985, Sec. 3: it allows for what a fit absorbs).
    """
    grams = [weight * slopes[part].T @ slopes[part] for part in data.recording_slices]
    scores = [weight * slopes[part].T @ white[part] for part in data.recording_slices]
    whole = _information(slopes, weight)
    moves = np.array([np.linalg.solve(whole - gram, score) for gram, score in zip(grams, scores, strict=True)])
    moves -= moves.mean(axis=0)
    return np.asarray((len(moves) - 1.0) / len(moves) * moves.T @ moves)


def gene_values(data: WhitenedData, refit: Refit) -> tuple[GeneValue, ...]:
    """Return values and 90 % intervals of all free genes; ``off`` is 0 for a size gene of an added suspect."""
    fit, variances = refit.fit, np.diag(covariance(data, refit.fit))
    errors = np.sqrt(variances)
    wide = [standard_errors(one) for one in freedom(data, fit, variances)]
    off = {name: 0.0 for trial in refit.trials for name in trial.suspect.size_genes}
    found = []
    for gene, unit, error in zip(free_genes(fit.problem), fit.unit, wide * errors, strict=True):
        low, high = unit - error, unit + error
        ends = [float(gene.from_unit(x)) if 0.0 <= x <= 1.0 else None for x in (low, high)]
        value = Interval(float(gene.from_unit(unit)), ends[0], ends[1])
        found.append(GeneValue(gene.name, gene.unit, gene.description, value, off.get(gene.name)))
    return tuple(found)


def freedom(data: WhitenedData, fit: Fit, variances: Float[Array, " F"]) -> Float[Array, " F"]:
    """Return the degrees of freedom of the ``variances`` [F] of genes: few recordings show a disagreement roughly.

    The parts of a variance that are known have infinitely many (Satterthwaite 1946).
    """
    recordings = max(len(data.recordings) - 1, 1)
    share = np.diag(disagreement(data, fit)) / variances
    return np.asarray(recordings / np.maximum(share, 1e-6) ** 2)
