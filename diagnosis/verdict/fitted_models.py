"""Keep the refitted hypotheses of a finding as models that can be simulated elsewhere."""

from __future__ import annotations

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes
from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.fitted_model import FittedModel
from wingfit.diagnosis.evidence.intervals import covariance, freedom, standard_errors
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import Table, table
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.wing.flexible_wing import FlexibleWing

PROBABLE = 0.01  # probability from which a hypothesis has its covariance: those of all would double a finding


def fitted_models(data: WhitenedData, weights: HypothesisWeights, best: Refit) -> tuple[FittedModel, ...]:
    """Return ``best``, the model with the added effects, then the other refitted hypotheses of ``weights``."""
    pairs = zip(weights.refits, weights.probabilities.tolist(), strict=True)
    others = [(one, chance) for one, chance in pairs if one.names != best.names]
    return tuple(_fitted(data, one, probable=chance >= PROBABLE) for one, chance in [(best, 1.0), *others])


def _fitted(data: WhitenedData, refit: Refit, *, probable: bool) -> FittedModel:
    fit = refit.fit
    model = fit.problem.model
    return FittedModel(
        effects=tuple(getattr(model, "effects", ())),
        added=refit.names,
        values=dict(zip((gene.name for gene in model.genes), fit.genome.tolist(), strict=True)),
        free=fit.problem.free,
        covariance=_covariance(data, fit) if probable else (),
        division=model.division if isinstance(model, FlexibleWing) else "",
        elements=model.elements if isinstance(model, BladeElementWing) else 0,
        instants=model.instants if isinstance(model, BladeElementWing) else 0,
    )


def _covariance(data: WhitenedData, fit: Fit) -> Table:
    """Return the covariance [F][F] of the values of the free genes; () where it is not finite."""
    found = covariance(data, fit)
    genes = free_genes(fit.problem)
    slopes = np.array(
        [
            value * np.log(gene.upper / gene.lower) if gene.scale == "log" else gene.upper - gene.lower
            for gene, value in zip(genes, fit.individual[0], strict=True)
        ]
    )
    slopes *= np.array([standard_errors(one) for one in freedom(data, fit, np.diag(found))]) / standard_errors()
    scaled = found * slopes * slopes[:, None]
    return table(0.5 * (scaled + scaled.T)) if np.isfinite(scaled).all() else ()
