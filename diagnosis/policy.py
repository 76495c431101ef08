"""Every threshold that decides a verdict, or what is tried on the way to it: value, unit and reason in one place.

``python -m benchmarks.policy`` halves and doubles each of them on a fixed sample of trials and prints what changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


def _threshold(value: float, unit: str, reason: str) -> Any:
    return field(default=value, metadata={"unit": unit, "reason": reason})


@dataclass(frozen=True)
class Policy:
    """The thresholds of a diagnosis.

    *Excess* is the mean square of a residual beyond the noise; *evidence* a natural logarithm. The first group decides
    which verdict the fitted hypotheses make, the second which hypotheses are fitted, and how far.
    """

    # Verdict
    negligible: float = _threshold(0.3, "noise RMS", "a residual beyond the noise that is no larger does not matter")
    form: float = _threshold(0.15, "nominal residual RMS", "a right law in another functional form leaves as much")
    division_factor: float = _threshold(
        1.5, "change by the next finer discretisation", "the true wing may be finer still than the next discretisation"
    )
    gene_cost: float = _threshold(2.0, "evidence per gene", "half the logarithm of some 50 independent pieces")
    unknown_residual: float = _threshold(
        0.35, "nominal residual RMS", "what a law that is not in the library would leave, were it known"
    )
    unknown_genes: float = _threshold(6.0, "genes", "what such a law would need: size, place, exponents")
    nominal_refuted: float = _threshold(4.0, "standard errors", "excess that refutes the nominal model by itself")
    allowance: float = _threshold(2.0, "standard errors", "excess that noise alone may make")
    predicted_weight: float = _threshold(
        0.25, "fraction", "weight of predicted recordings beside fitted ones: a linearised prediction is rough"
    )
    least_evidence: float = _threshold(2.0, "evidence", "below it no explanation is looked for, and none is put in")
    single: float = _threshold(0.85, "probability", "one explanation has as much of that of all: it is named")
    listed: float = _threshold(
        0.75, "probability", "effects of the library have as much of that of all missing physics: else unnamed"
    )
    possible: float = _threshold(0.05, "probability", "another explanation with as much is reported as possible")
    effective_samples: float = _threshold(6.0, "per recording", "independent pieces of a model's error")
    max_effective_samples: float = _threshold(
        48.0, "pieces", "recordings under similar conditions repeat the same error"
    )
    tolerance: float = _threshold(0.1, "noise RMS", "no model is expected to be better, however long the recording")
    gene_freedom: float = _threshold(
        0.1, "gene box", "standard deviation by which leaving a recording out may move a gene"
    )
    prediction_noise: float = _threshold(
        4.0, "expected noise of a prediction", "a prediction may be worse by as much by chance (chi-squared of one)"
    )

    # Search
    worth_refit: float = _threshold(0.25, "gain of the best score test", "a suspect with less is not refitted")
    weaker: float = _threshold(0.6, "gain of the best score test", "a weaker suspect is not refitted once one solves")
    solved: float = _threshold(0.05, "nominal excess", "an explanation that leaves less needs no weaker rivals")
    hopeful: float = _threshold(0.7, "nominal excess", "a refit that leaves more is not continued")
    partner_gain: float = _threshold(
        0.5, "remaining chi-squared", "what a second effect must be predicted to remove before it is refitted"
    )
    partner_form: float = _threshold(
        0.25, "allowance for form", "an explanation that leaves more of it gets a second effect tried beside it"
    )
    substitute: float = _threshold(0.8, "action of an effect", "another that can do as much is tried in its place")
    astray: float = _threshold(
        1.5, "chi-squared predicted by the score test", "a refit that leaves more is fitted again, its size first"
    )
    rivalry: float = _threshold(3.0, "excess of the best", "an explanation that leaves more is no rival")
    overtake: float = _threshold(10.0, "evidence", "what a fit that has not converged may still gain")
    speed: float = _threshold(3.0, "rate of the last step", "a fit is not expected to go on faster")
    finer_promise: float = _threshold(
        0.1, "excess", "a finer discretisation must be predicted to remove it to be fitted"
    )
    finer_matters: float = _threshold(0.25, "noise RMS", "a discretisation that changes less is fine enough")
    finer_gain: float = _threshold(0.25, "excess", "a finer discretisation must remove it to be worth its cost")
    finer_limit: float = _threshold(0.3, "noise RMS", "a residual below needs no finer discretisation")


POLICY = Policy()
"""The thresholds that are used unless others are given."""


def described() -> list[dict[str, Any]]:
    """Each threshold: name, value, unit, reason."""
    return [{"name": one.name, "value": one.default, **one.metadata} for one in fields(Policy)]
