"""Propose the next experiment: the condition under which the remaining hypotheses differ most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, residuals_of, values_at
from wingfit.diagnosis.candidate_conditions import settings_beyond
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import PRIOR_SD, Fit
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import Advice, AdvisedCondition
from wingfit.diagnosis.subject import beat_subject
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights, tolerated_excess
from wingfit.inference.differences import Outputs, differences
from wingfit.records import Condition, Recording
from wingfit.records.array_types import Array, Bool, Float, Mask

MIN_PROBABILITY = 0.02  # of a hypothesis that is compared
MAX_RIVALS = 3  # hypotheses that are compared
MAX_ADVICE = 5  # conditions that are reported
NEARLY_CERTAIN = 0.9  # probability from which fewer conditions are compared
MAX_CONDITIONS_IF_CERTAIN = 8  # conditions


def rival_refits(weights: HypothesisWeights) -> list[Refit]:
    """Return the probable hypotheses, most probable first; if it is a single one, also the next; empty if none is."""
    order = np.argsort(-weights.probabilities, kind="stable")
    rivals = [k for k in order if weights.probabilities[k] >= MIN_PROBABILITY]
    return [weights.refits[k] for k in (order[:2] if len(rivals) == 1 else rivals)[:MAX_RIVALS]]


def separations(
    context: FitContext, weights: HypothesisWeights
) -> Iterator[tuple[float, tuple[float, Condition] | None]]:
    """Compute by how much the predictions of the hypotheses differ under candidate conditions (:func:`separation`).

    Yields the fraction done and, where there is one, a result (separation, condition). Conditions are ordered by the
    separation with fixed genes, an upper bound. Then the rivals of the first hypothesis may adapt their genes, until no
    other condition can be among the best MAX_ADVICE. Yields nothing where there are no two hypotheses or no conditions.
    """
    subject = beat_subject(context.subject)
    rivals, conditions = rival_refits(weights), subject.candidate_conditions()
    if len(rivals) < 2:
        return
    if weights.probabilities.max() >= NEARLY_CERTAIN:
        conditions = conditions[:MAX_CONDITIONS_IF_CERTAIN]
    predicted, (first, *others) = list[tuple[float, Recording]](), rivals
    model = subject.with_initial_motion(subject.extended(first.names), first.fit.genome)
    for k, condition in enumerate(conditions):
        recording = subject.simulated_recording(model, first.fit.genome, condition)
        if recording is not None:
            most = _least_separation(context, first, recording, others, adapt=False)
            predicted += [] if most is None else [(most, recording)]
        yield 0.5 * (k + 1) / len(conditions), None
    found = list[float]()
    for k, (most, recording) in enumerate(sorted(predicted, key=lambda pair: -pair[0])):
        if sum(one >= most for one in found) >= MAX_ADVICE:
            return
        least = _least_separation(context, first, recording, others, adapt=True)
        found += [] if least is None else [least]
        yield 0.5 + 0.5 * (k + 1) / len(predicted), None if least is None else (least, recording.condition)


def rank_conditions(
    data: WhitenedData, weights: HypothesisWeights, apart: Sequence[tuple[float, Condition]]
) -> tuple[Advice, ...]:
    """Return conditions to record next, best first, from ``apart``, the results of :func:`separations`."""
    best, rivals = sorted(apart, key=lambda pair: -pair[0])[:MAX_ADVICE], rival_refits(weights)
    return tuple(_advice(data, weights, rivals, size, condition) for size, condition in best)


def _least_separation(
    context: FitContext, first: Refit, recording: Recording, others: Sequence[Refit], *, adapt: bool
) -> float | None:
    """Return the smallest separation of the rivals ``others`` from ``recording``, the prediction of ``first``.

    None where one of them cannot be simulated.
    """
    values = [separation(context, first.fit.genome, recording, one.fit, adapt=adapt) for one in others]
    known = [one for one in values if one is not None]
    return min(known) if len(known) == len(others) else None


def separation(
    context: FitContext, genome: Float[Array, " G"], recording: Recording, rival: Fit, *, adapt: bool
) -> float | None:
    """Return the root mean square difference of a rival's prediction from ``recording``, in noise standard deviations.

    ``recording`` is the prediction of the first hypothesis, whose genes are ``genome`` [G]. With ``adapt`` the rival's
    genes adapt as far as the existing recordings allow. A difference that the genes can compensate would not
    distinguish the hypotheses (T-optimality: Atkinson and Fedorov 1975, with the posterior of the genes). None where
    the rival cannot be simulated.
    """
    model, data = context.subject.with_initial_motion(rival.problem.model, genome), context.data
    problem = replace(rival.problem, model=model, recordings=(recording,))

    def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        evaluation = context.evaluator.evaluate(problem, values_at(free_genes(problem), units), residuals=True)
        return residuals_of(evaluation), evaluation.reasons

    columns = np.arange(len(rival.unit)) if adapt else np.empty(0, np.int64)
    try:
        found = differences(simulate, rival.unit, columns, sides=1)
    except ValueError:
        return None
    seen = np.isfinite(found.outputs[0])
    white, slopes = found.outputs[0][seen] / data.noise, found.slopes[0][seen].T / data.noise
    whole = float(white @ white)
    if adapt:
        lag1 = float(np.mean([beat_fit.lag1 for beat_fit in data.beat_fits]))
        whole -= explained_by_genes(data, rival, white, slopes, lag1=lag1)
    return float(np.sqrt(max(whole, 0.0) / len(white)))


def explained_by_genes(
    data: WhitenedData,
    rival: Fit,
    difference: Float[Array, " n"],
    slopes: Float[Array, "F n"],
    *,
    lag1: float,
    unknown: Bool[Mask, " F"] | None = None,
) -> float:
    """Return the part of the square of ``difference`` [n] that the rival's genes explain, minus the penalty for that.

    ``difference`` is divided by the noise, as are the ``slopes`` [F, n], its derivatives with respect to the genes.
    ``lag1``: correlation of successive samples of the noise; ``unknown`` [F]: genes that have another value in the new
    recording, such as its start, of which only the prior is known.
    """
    lag1 = float(np.clip(lag1, 0.0, 0.99))
    weight = data.likelihood_weight(rival.coefficients)
    counts = weight * (1.0 - lag1) / (1.0 + lag1)  # weight of a sample, less for correlated noise
    known = data.whitened_slopes(rival.jacobian)
    information = weight * known.T @ known + np.eye(len(rival.unit)) / PRIOR_SD**2
    if unknown is not None:
        information = _forgotten(information, unknown)
    score = slopes @ difference
    return float(counts * score @ np.linalg.solve(information + counts * slopes @ slopes.T, score))


def _forgotten(information: Float[Array, "F F"], unknown: Bool[Mask, " F"]) -> Float[Array, "F F"]:
    """Return ``information`` about the other genes whatever the ``unknown`` ones were, and the prior of these."""
    others = ~unknown
    found = np.diag(np.where(unknown, PRIOR_SD**-2, 0.0))
    across = information[np.ix_(others, unknown)]
    lost = across @ np.linalg.solve(information[np.ix_(unknown, unknown)], across.T) if unknown.any() else 0.0
    found[np.ix_(others, others)] = information[np.ix_(others, others)] - lost
    return np.asarray(found)


def resolving_probability(data: WhitenedData, weights: HypothesisWeights, apart: float) -> float:
    """Estimate the probability that a further recording, with predictions ``apart`` by so much, decides."""
    share = 1.0 / (len(data.recordings) + 1.0)
    noise_variance = data.noise**2
    tau = tolerated_excess(data, weights.excess[0] * noise_variance, 0.0) / noise_variance + float(weights.excess.min())
    gain = 0.5 * data.effective_samples / (1.0 - share) * np.log1p(share * apart**2 / tau)
    odds = np.log(data.policy.single / (1.0 - data.policy.single))
    return float(1.0 / (1.0 + np.exp(-(gain - odds))))


def rivals_in_words(rivals: Sequence[Refit]) -> tuple[tuple[str, ...], str]:
    """Return the names of the hypotheses that are compared, and their titles as text."""
    between = tuple(" and ".join(one.names) or "no missing physics" for one in rivals)
    suspects = [[trial.suspect.title.lower() for trial in one.trials] for one in rivals]
    return between, " and ".join(" with ".join(names) or "no missing physics" for names in suspects)


def _advice(
    data: WhitenedData, weights: HypothesisWeights, rivals: Sequence[Refit], apart: float, condition: Condition
) -> Advice:
    lag, incidence = float(np.degrees(condition.phase_lag)), float(np.degrees(condition.angle_of_attack))
    where = f"{condition.flap_frequency:.3g} Hz, {lag:.3g} deg of lag, {condition.pressure / 100.0:.4g} mbar"
    if condition.airspeed > 0:
        where += f", {condition.airspeed:.3g} m/s at {incidence:.3g} deg"
    beyond = settings_beyond(condition, [one.condition for one in data.recordings if isinstance(one, Recording)])
    if beyond:
        where += f" ({' and '.join(beyond)} beyond what was recorded, if the rig allows it)"
    between, titles = rivals_in_words(rivals)
    return Advice(
        words=f"record {where}: there the predictions of {titles} differ by {apart:.2g} sigma",
        separation=apart,
        resolves=resolving_probability(data, weights, apart),
        between=between,
        condition=AdvisedCondition(
            condition.flap_frequency, lag, condition.pressure / 100.0, condition.airspeed, incidence
        ),
    )
