"""Whether held-out recordings refute a model: noise and errors of the genes must not explain their misfit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, residuals_of, unit_at, values_at
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import FIT_ERRORS, PRIOR_SD, Fit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.proof import ResidualPair, with_own_genes
from wingfit.diagnosis.verdict.weigh_hypotheses import nominal_refuted
from wingfit.inference.differences import Outputs, differences
from wingfit.records.array_types import Array

GENE_ERRORS = 4.0  # times the mean square that the errors of the genes make on average: two standard deviations


def held_out_refutes(context: FitContext, nominal: Fit, predicted: ResidualPair, floor: float) -> bool:
    """Return whether the ``nominal`` model misses held-out series by more than noise and errors of its genes explain.

    ``predicted``: its residuals there; ``floor``: as in
    :func:`wingfit.diagnosis.verdict.weigh_hypotheses.nominal_refuted`.
    """
    data = predicted.data
    excess = data.excess(data.coefficients_of(predicted.before))
    if data.kind != "series" or not nominal_refuted(data, excess, floor):
        return False
    by_genes = 0.0
    for recording, share in zip(data.recordings, data.recording_weights, strict=True):
        own = _by_genes(data.like([recording]), context, nominal)
        if own is None:
            return False
        by_genes += float(share) * own
    return nominal_refuted(data, excess - GENE_ERRORS * by_genes, floor)


def _by_genes(one: WhitenedData, context: FitContext, nominal: Fit) -> float | None:
    """Return the mean square that errors of the nominal genes make in the only recording of ``one``; None if it fails.

    What the genes of this recording alone would make up for is left out.
    """
    try:
        problem, values = with_own_genes(one, context, nominal)
    except FIT_ERRORS:
        return None
    own = () if problem.free == nominal.problem.free else problem.free
    base = problem.base.replace(dict(zip(problem.free, values[0].tolist(), strict=True)))
    problem = replace(problem, free=(*nominal.problem.free, *own), base=base)
    genes = free_genes(problem)

    def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        evaluation = context.evaluator.evaluate(problem, values_at(genes, units), residuals=True)
        return residuals_of(evaluation), evaluation.reasons

    unit = unit_at(genes, np.array([base[gene.name] for gene in genes]))
    try:
        found = differences(simulate, unit, np.arange(len(unit)))
    except ValueError:
        return None
    slopes = one.coefficients_of([np.moveaxis(found.slopes[0], -1, 0)]).T  # [D, F]
    of_model, of_recording = np.split(slopes, [len(nominal.unit)], axis=1)
    if own:
        absorbed, *_ = np.linalg.lstsq(one.whitened_slopes(of_recording), one.whitened_slopes(of_model), rcond=None)
        of_model = of_model - of_recording @ absorbed
    return float(one.weight @ np.einsum("df,fg,dg->d", of_model, covariance_of_fit(context.data, nominal), of_model))


def covariance_of_fit(data: WhitenedData, fit: Fit) -> Array:
    """Return the covariance [F, F] of the genes of ``fit`` in unit coordinates, by noise and the prior alone."""
    white = data.whitened_slopes(fit.jacobian)
    weight = data.likelihood_weight(fit.coefficients)
    return np.asarray(np.linalg.inv(weight * white.T @ white + np.eye(len(fit.unit)) / PRIOR_SD**2))
