"""All thresholds that decide a verdict or which hypotheses are fitted: value, unit and reason of each.

``python -m benchmarks.policy`` halves and doubles each threshold on a fixed sample of trials and prints what changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


def _threshold(value: float, unit: str, reason: str) -> Any:
    return field(default=value, metadata={"unit": unit, "reason": reason})


@dataclass(frozen=True)
class Policy:
    """The thresholds of a diagnosis.

    *Excess* is the mean square of a residual minus that of the noise; *evidence* is a natural log-likelihood minus the
    cost of the genes. The first group decides the verdict from the fitted hypotheses; the second decides which
    hypotheses are fitted, and for how many steps.
    """

    # Verdict
    negligible: float = _threshold(0.3, "noise RMS", "a residual this small beyond the noise counts as none")
    form: float = _threshold(0.15, "nominal residual RMS", "residual of the right effect in a slightly wrong form")
    discretisation_factor: float = _threshold(
        1.5, "change by the next finer discretisation", "the exact solution may lie beyond the next discretisation"
    )
    gene_cost: float = _threshold(2.0, "evidence per gene", "half the logarithm of about 50 independent samples (BIC)")
    unknown_residual: float = _threshold(0.35, "nominal residual RMS", "assumed residual of a law outside the library")
    unknown_genes: float = _threshold(6.0, "genes", "assumed genes of such a law: size, location, exponents")
    refuting_excess: float = _threshold(4.0, "standard errors", "excess that alone refutes the nominal model")
    allowance: float = _threshold(2.0, "standard errors", "excess that noise alone may produce")
    predicted_weight: float = _threshold(
        0.25, "fraction", "weight of cross-validated against fitted residuals: the cross-validation is linearised"
    )
    drift_left: float = _threshold(
        0.5,
        "slow change of the beat, or excess",
        "a hypothesis that leaves more does not explain a drift of the rig, nor, if hardly worth its genes, a misfit",
    )
    drift_rivals: float = _threshold(
        0.33,
        "nominal residual RMS",
        "a slow change of the beat this large may be the cause: it moves the mean beat by as much as it changes it",
    )
    shared: float = _threshold(
        0.12,
        "power of the noise",
        "a motion that markers share with more is no noise: something changes between beats",
    )
    doubted_noise: float = _threshold(
        0.6, "probability", "most that a model is adequate where missing physics may hide in the noise"
    )
    doubted_rest: float = _threshold(
        0.6,
        "noise RMS",
        "recordings with a beat: a misfit beyond the noise that noise could make, but rarely does: missing physics may "
        "hide in it",
    )
    doubted_recording: float = _threshold(
        1.2, "noise RMS of the recording", "the same for one recording of forces, which has more by chance"
    )
    unpredicted: float = _threshold(
        2.0,
        "floor",
        "lower end of the held-out misfit from which a model does not predict; of effects named with more, one in six "
        "was wrong",
    )
    least_evidence: float = _threshold(2.0, "evidence", "no effect is searched for, or added to the model, for less")
    most_left: float = _threshold(
        0.14,
        "nominal excess",
        "recordings with a beat: most right effects leave less, and many imitations of another cause leave more",
    )
    mechanism_left: float = _threshold(
        0.05,
        "nominal excess",
        "an effect that only describes how recordings differ is no more probable than a mechanism that is like it and "
        "leaves no more",
    )
    imitation: float = _threshold(
        2.0, "effective samples, relative", "how steeply a hypothesis that leaves more becomes improbable"
    )
    several_left: float = _threshold(
        0.25,
        "nominal residual RMS",
        "recordings with a beat: several effects, none of which is probable alone, compete with an unknown law that "
        "leaves this little, since together they imitate more than one does; right ones leave less",
    )
    partial_doubt: float = _threshold(
        0.2,
        "probability",
        "recordings with a beat: of effects that leave more than noise and the form of a law explain, about one in "
        "five imitated a law outside the library; so for effects that do not predict",
    )
    single: float = _threshold(
        0.885,
        "probability",
        "share of all effects from which one hypothesis is named: above that of two that fit alike, and of which one "
        "has a gene more (0.88), so that the cost of a gene alone never decides",
    )
    listed: float = _threshold(
        0.75, "probability", "share of the library in all missing physics, below which the verdict is unnamed"
    )
    possible: float = _threshold(0.05, "probability", "share from which another hypothesis is reported as possible")
    effective_samples: float = _threshold(6.0, "per recording", "independent samples of a model's error")
    max_effective_samples: float = _threshold(
        48.0, "samples", "recordings under similar conditions repeat the same error"
    )
    tolerance: float = _threshold(0.1, "noise RMS", "no model is required to be more exact, however long the recording")
    solver_error: float = _threshold(
        3e-4, "largest force", "an independent solver of the same law differed by a sixth of it (RMS), without noise"
    )
    gene_freedom: float = _threshold(
        0.1, "gene box", "standard deviation of a gene's move when a recording is left out"
    )
    prediction_noise: float = _threshold(
        4.0,
        "expected noise of a prediction",
        "what the cross-validated residual may gain by chance (chi-squared of one)",
    )

    # Search
    worth_refit: float = _threshold(0.25, "gain of the best score test", "suspects with less are not refitted")
    weak_after_success: float = _threshold(
        0.6, "gain of the best score test", "once no second effect is needed, weaker suspects are skipped"
    )
    worth_continuing: float = _threshold(0.7, "nominal excess", "a refit with more is not continued")
    partner_gain: float = _threshold(
        0.5, "remaining chi-squared", "a second effect must be predicted to explain as much to be refitted"
    )
    partner_form: float = _threshold(
        0.25, "allowance for form", "fraction of the allowance above which a second effect is tried"
    )
    substitute: float = _threshold(
        0.8, "contribution of an effect", "another that can reproduce as much is tried in its place"
    )
    diverged: float = _threshold(
        1.5, "chi-squared predicted by the score test", "a refit with more is repeated, fitting the effect's size first"
    )
    rivalry: float = _threshold(3.0, "excess of the best", "a hypothesis with more is no rival")
    overtake: float = _threshold(10.0, "evidence", "largest expected gain of a fit that has not converged")
    acceleration: float = _threshold(3.0, "rate of the last step", "fastest expected progress of a fit")
    finer_predicted_gain: float = _threshold(
        0.1, "excess", "a finer discretisation must be predicted to remove as much to be fitted"
    )
    finer_gain: float = _threshold(0.25, "excess", "a finer discretisation must remove as much to be worth its cost")


POLICY = Policy()
"""The thresholds that are used unless others are given."""


def described() -> list[dict[str, Any]]:
    """Return name, value, unit and reason of each threshold."""
    return [{"name": one.name, "value": one.default, **one.metadata} for one in fields(Policy)]
