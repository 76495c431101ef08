"""Compute the probabilities of the fitted hypotheses.

With thousands of samples, chi-squared would reject even a law of the right kind in a slightly different form. So the
residual of a right law in another form counts as noise of unknown size, and the fraction of the residual that a
hypothesis explains decides. Its probability p, up to a common factor, is

    ln p = -nu/2 ln(tau^2 + E) - genes c - effects ln(suspects),

E the excess divided by the noise variance, from the fit and cross-validated; tau^2 the excess that a right hypothesis
may have (:func:`tolerated_excess`), likewise divided; nu the effective number of samples; c the cost of a gene
(`Policy.gene_cost`). The prior probability of each effect is one over the number of suspects. Two hypotheses always
compete with the effects: *no physics is missing*, and *physics outside the library*, which is assumed to explain all
but a fraction of the residual (`Policy.unknown_residual`) at the cost of the genes of a new law. If noise does not
explain the residual of the nominal model, only hypotheses that are worth their genes compete with the second. Those
that are hardly worth them are possible if they explain most of the residual, their sizes cannot all be zero, and there
are recordings to predict. With a beat, a hypothesis that leaves too much is less probable (`Policy.most_left`): almost
any smooth omission is imitated in part by some effect. Several effects together imitate more of it, so they compete
with an unknown law that leaves less (`Policy.several_left`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.diagnosis.evidence.intervals import gene_values
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.policy import POLICY, Policy
from wingfit.diagnosis.verdict.noise_doubt import noise_may_hide, sure_error
from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.rigs.suspect import Suspect

MANY = 3
"""So many effects together imitate almost any law: they are no more probable than one law outside the library."""


@dataclass(frozen=True)
class HypothesisWeights:
    """Evidence and probability of each of H hypotheses, the nominal model first.

    ``evidence``: natural logarithm, relative to the nominal model; ``unknown``: probability of a law outside the
    library; ``excess``: mean square beyond the noise, fitted and cross-validated, divided by the noise variance;
    ``floor`` (m or N): discretisation error with which they were weighed.
    """

    refits: tuple[Refit, ...]
    evidence: Float[Array, " H"]
    probabilities: Float[Array, " H"]
    unknown: float
    excess: Float[Array, " H"]
    policy: Policy = POLICY
    floor: float = 0.0


def weigh(
    data: WhitenedData, nominal: Refit, refits: Sequence[Refit], floor: float, suspects: int
) -> HypothesisWeights:
    """Weigh ``refits`` against the nominal model.

    ``floor`` (m or N): discretisation error; ``suspects``: number of effects considered, which sets their prior.
    """
    policy = data.policy
    hypotheses = (nominal, *refits)
    noise_variance = data.noise**2
    error = noise_error(data, hypotheses)
    tau = tolerated_excess(data, nominal.excess, floor, error) / noise_variance
    excess = np.array([_misfit(data, one, tau * noise_variance) / noise_variance for one in hypotheses])
    genes = np.array([one.freedom for one in hypotheses], float)
    effects = np.array([len(one.trials) for one in hypotheses], float)
    evidence = _evidence(data, tau + excess, genes, effects, suspects)
    unknown = _unknown(data, tau + policy.unknown_residual**2 * excess[0])
    possible, rival = np.ones(len(hypotheses), bool), np.zeros(len(hypotheses), bool)
    drift_alone = only_changes(data, nominal, floor)
    if nominal_refuted(data, beyond_chance(data, nominal), floor, error) or (changes(data) and not drift_alone):
        # A hypothesis that leaves the misfit as it was explains nothing; nor does the nominal model. With few
        # recordings, one that explains most of the misfit may have little evidence; with a single experiment, nothing
        # shows that it predicts.
        possible = evidence - evidence[0] > policy.least_evidence
        for k in np.flatnonzero(~possible & (excess < policy.drift_left * excess[0])):
            possible[k] = hypotheses[k].predicted is not None
            rival[k] = possible[k] and absent(data, hypotheses[k])
    if drift_alone:
        possible &= [not modulated(data) and explains_drift(data, nominal, one) for one in hypotheses]
    imitates = _imitation(data, hypotheses, floor, error)
    weight = np.where(possible, evidence - imitates, -np.inf)
    # One whose size may be zero is no more probable than the best of the others, so that it is never named alone.
    weight[rival] = np.minimum(weight[rival], weight[~rival].max())
    likely = (excess < policy.mechanism_left * excess[0]) & (weight > unknown)
    weight = _beside_mechanisms(hypotheses, weight, likely)
    if data.kind != "series":
        closer = _unknown(data, tau + policy.several_left**2 * excess[0])
        several = _imitation_by_several(hypotheses, weight, unknown, closer)
        rest = _UnknownRest(data, hypotheses, excess, floor, error, suspects, imitates)
        weight = _with_unknown_rest(hypotheses, weight, rest.log_odds) - several
        unknown = max(unknown, weight[effects >= MANY].max(initial=-np.inf))
    top = max(weight.max(), unknown)
    weight, other = np.exp(weight - top), np.exp(unknown - top)
    total = weight.sum() + other
    probabilities, unknown = weight / total, float(other / total)
    if doubtful(data, nominal, floor):
        doubted = max(float(probabilities[0]) - policy.doubted_noise, 0.0)
        probabilities[0], unknown = probabilities[0] - doubted, unknown + doubted
    if data.kind != "series":
        partial = [leaves_a_rest(data, nominal, one, floor) for one in refits]
        imitated = policy.partial_doubt * np.array([0.0, *(probabilities[1:] * partial)])
        probabilities, unknown = probabilities - imitated, unknown + float(imitated.sum())
    return HypothesisWeights(hypotheses, evidence - evidence[0], probabilities, unknown, excess, data.policy, floor)


def _beside_mechanisms(hypotheses: Sequence[Refit], weight: Array, likely: Bool[Mask, " H"]) -> Array:
    """Return the log weights [H], those of descriptive effects at most that of the best mechanism that is like them.

    Any law of the air makes coefficients that seem to vary with flight, and of another form than that of the library.
    ``likely`` [H]: whether a hypothesis leaves so little that this form may be the reason.
    """
    found = weight.copy()
    for k, one in enumerate(hypotheses):
        described = [trial.suspect for trial in one.trials if trial.suspect.descriptive]
        mechanisms = [
            weight[j]
            for j, other in enumerate(hypotheses)
            if likely[j] and len(other.trials) <= len(one.trials) and _is_like(described, other)
        ]
        found[k] = min(weight[k], max(mechanisms, default=weight[k]))
    return found


def _is_like(described: Sequence[Suspect], other: Refit) -> bool:
    """Return whether one of the ``described`` may be confused with one of ``other``, which are all mechanisms."""
    mechanisms = [trial.suspect for trial in other.trials]
    if any(one.descriptive for one in mechanisms):
        return False
    pairs = ((one, that) for one in described for that in mechanisms)
    return any(that.name in one.confused_with or one.name in that.confused_with for one, that in pairs)


def leaves_a_rest(data: WhitenedData, nominal: Refit, refit: Refit, floor: float) -> bool:
    """Return whether ``refit`` leaves more than noise, discretisation and the form of a law explain, or a drift.

    Then something else is missing too, the law is another one, or the effects imitate what is missing. ``floor`` (m or
    N): discretisation error.
    """
    enough = tolerated_excess(data, nominal.excess, floor)
    beyond = refit.excess > enough and nominal_refuted(data, beyond_chance(data, refit), floor)
    return beyond or _drift_may_cause(data, nominal, refit)


def _drift_may_cause(data: WhitenedData, nominal: Refit, refit: Refit) -> bool:
    """Return whether the beat changes slowly by so much that this may cause the misfit, and ``refit`` explains none."""
    if not drifts(data) or explains_drift(data, nominal, refit):
        return False
    change = float(np.mean((data.drift * data.noise_of_recordings) ** 2))
    return change > data.policy.drift_rivals**2 * nominal.excess


@dataclass(frozen=True)
class _UnknownRest:
    """Compares hypotheses that add effects to others with a law outside the library in place of these effects.

    ``excess`` [H]: as in :class:`HypothesisWeights`; ``floor`` (m or N): discretisation error; ``error``: standard
    error of the noise (:func:`noise_error`); ``imitates`` [H]: as of :func:`_imitation`.
    """

    data: WhitenedData
    hypotheses: Sequence[Refit]
    excess: Float[Array, " H"]
    floor: float
    error: float
    suspects: int
    imitates: Float[Array, " H"]

    def log_odds(self, k: int, j: int) -> float:
        """Return the log odds of hypothesis ``j`` beside an unknown law, to ``k``, which has the effects of ``j``.

        The further effects of ``k`` explain what ``j`` leaves; so what they may leave in another form is relative to
        that, as what a first effect may leave is relative to the misfit of the nominal model.
        """
        data, policy, hypotheses, excess = self.data, self.data.policy, self.hypotheses, self.excess
        tau = tolerated_excess(data, hypotheses[j].excess, self.floor, self.error) / data.noise**2
        left = np.array([excess[k], policy.unknown_residual**2 * excess[j]])
        genes = np.array([hypotheses[k].freedom, hypotheses[j].freedom + policy.unknown_genes], float)
        effects = np.array([len(hypotheses[k].trials), len(hypotheses[j].trials)], float)
        known, unknown = _evidence(data, tau + left, genes, effects, self.suspects) - self.imitates[[k, j]]
        return float(unknown - known)


def _with_unknown_rest(hypotheses: Sequence[Refit], weight: Array, log_odds: Callable[[int, int], float]) -> Array:
    """Return the log weights [H], a part of which goes to effects that a law outside the library accompanies.

    Further effects may only imitate such a law. So a hypothesis shares its weight with the best of those whose effects
    it contains, by their ``log_odds`` (:meth:`_UnknownRest.log_odds`).
    """
    found, names = weight.copy(), [set(one.names) for one in hypotheses]
    for k in sorted(np.flatnonzero(np.isfinite(weight)), key=lambda k: -len(names[k])):
        contained = [j for j, other in enumerate(names) if other and other < names[k]]
        if contained:
            odds = {j: log_odds(int(k), j) for j in contained}
            best = max(contained, key=lambda j: odds[j])
            whole, both = found[k], np.logaddexp(0.0, odds[best])
            found[k] = whole - both
            found[best] = np.logaddexp(found[best], whole + odds[best] - both)
    return found


def _imitation_by_several(hypotheses: Sequence[Refit], weight: Array, unknown: float, closer: float) -> Array:
    """Return what [H] to subtract from the log ``weight`` [H] of several effects of which none is probable alone.

    ``unknown``, ``closer``: log weights of an unknown law, and of one that leaves `Policy.several_left`. Several
    effects imitate more than one does; but an effect that is more probable alone than the unknown law lends weight to
    others.
    """
    found, names = np.zeros(len(hypotheses)), [set(one.names) for one in hypotheses]
    for k, own in enumerate(names):
        if len(own) > 1:
            alone = max((weight[j] for j, other in enumerate(names) if other and other < own), default=-np.inf)
            found[k] = min(closer - unknown, max(unknown - alone, 0.0))
    return found


def _imitation(data: WhitenedData, hypotheses: Sequence[Refit], floor: float, error: float) -> Array:
    """Return what [H] to subtract from the log evidence of hypotheses that leave more than `Policy.most_left`.

    Almost any smooth omission is imitated in part by some effect; how much a right effect leaves, and how well effects
    imitate omissions outside the library, was measured (docs/diagnosis.md). Only with a beat. ``floor`` (m or N):
    discretisation error; ``error``: standard error of the noise.
    """
    policy, nominal = data.policy, max(hypotheses[0].excess, 0.0)
    found = np.zeros(len(hypotheses))
    if data.kind == "series" or nominal == 0.0:
        return found
    most = policy.most_left * nominal + tolerated_excess(data, 0.0, floor, error)
    beyond = np.array([max(one.excess, 0.0) / most for one in hypotheses[1:]])
    found[1:] = 0.5 * policy.imitation * data.effective_samples * np.log(np.maximum(beyond, 1.0))
    return found


def noise_error(data: WhitenedData, hypotheses: Sequence[Refit]) -> float:
    """Return the standard error (m^2 or N^2; of series: in scales) of the mean square of the noise.

    The noise of a series may be known badly, because slow noise is not visible. But it is not larger than the residual
    of any hypothesis, cross-validated: slow noise in one recording does not follow from the others.
    """
    error = data.excess_standard_error
    if data.kind != "series":
        return error
    least = min(max(one.excess, one.excess if one.predicted is None else one.predicted, 0.0) for one in hypotheses)
    single = any(one.predicted is None for one in hypotheses)
    return error if single else min(error, sure_error(data) + least)


def beyond_chance(data: WhitenedData, refit: Refit) -> float:
    """Return the excess (m^2 or N^2) of ``refit`` without what errors of rest positions may share by chance."""
    return refit.excess - data.excess_by_chance(refit.fit.coefficients)


def nominal_refuted(data: WhitenedData, excess: float, floor: float, error: float | None = None) -> bool:
    """Return whether the nominal ``excess`` is too large for noise and discretisation error (``floor``, m or N) alone.

    Then physics is missing, even if it is not known which. The criterion does not depend on the number of samples.
    ``error``: standard error of the noise (:func:`noise_error`); None: without a hypothesis.
    """
    explainable = (data.policy.negligible * data.noise) ** 2 + floor**2 + data.accepted**2
    return excess - explainable > data.policy.refuting_excess * (data.excess_standard_error if error is None else error)


def doubtful(data: WhitenedData, nominal: Refit, floor: float) -> bool:
    """Return whether missing physics may hide in the noise, or in a misfit that noise could have made.

    ``floor`` (m or N): discretisation error.
    """
    return noise_may_hide(data, nominal.fit) or large_rest(data, nominal, floor) or bool(missed(data, nominal, floor))


def large_rest(data: WhitenedData, refit: Refit, floor: float) -> bool:
    """Return whether ``refit`` leaves a misfit of recordings with a beat that noise could make, but rarely does.

    The noise of few forces is known so badly that it could make a misfit larger than itself. ``floor`` (m or N):
    discretisation error.
    """
    rest = beyond_chance(data, refit) - floor**2
    return data.kind != "series" and rest > max(data.policy.doubted_rest * data.noise, data.tolerance) ** 2


def missed(data: WhitenedData, nominal: Refit, floor: float) -> dict[str, float]:
    """Return recordings of forces that the ``nominal`` model misses by more than noise usually makes, and by how much.

    That is the misfit beyond the noise over the noise of the recording. What acts in one recording alone is little
    for all of them; of tracks, whose noise is known well, that little refutes a model (:func:`nominal_refuted`).
    ``floor`` (m or N): discretisation error.
    """
    if data.kind != "forces":
        return {}
    noise = np.maximum(data.noise_of_recordings, data.tolerance)
    rest = data.excess_by_recording(nominal.fit.coefficients) - floor**2
    left = np.sqrt(np.maximum(rest, 0.0)) / noise
    return {data.recordings[k].name: float(left[k]) for k in np.flatnonzero(left > data.policy.doubted_recording)}


def drifts(data: WhitenedData) -> bool:
    """Return whether the beat changes slowly in any recording, by more than what counts as none.

    The nominal model is the same in every beat, so something is missing even if the mean beat fits.
    """
    return bool(np.max(data.drift) > data.policy.negligible)


def modulated(data: WhitenedData) -> bool:
    """Return whether the beats of any recording differ periodically, by more than what counts as none."""
    return bool(np.max(data.modulation) > data.policy.negligible)


def changes(data: WhitenedData) -> bool:
    """Return whether the beat changes in any recording, slowly or periodically."""
    return drifts(data) or modulated(data)


def only_changes(data: WhitenedData, nominal: Refit, floor: float) -> bool:
    """Return whether the beat changes and the ``nominal`` model's misfit of the mean beat is within the noise.

    ``floor`` (m or N): discretisation error.
    """
    if not changes(data):
        return False
    return not nominal_refuted(data, data.mean_beat_excess(nominal.fit.coefficients), floor)


def absent(data: WhitenedData, refit: Refit) -> bool:
    """Return whether all size genes of the added effects are compatible with zero, so that the fit shows none of them.

    The interval of such a gene contains zero, or is bounded on neither side.
    """
    if not any(trial.suspect.size_genes for trial in refit.trials):
        return False
    sizes = [gene.value for gene in gene_values(data, refit) if gene.off is not None]
    return all((v.low is None or v.low <= 0.0) and (v.high is None or v.high >= 0.0) for v in sizes)


def explains_drift(data: WhitenedData, nominal: Refit, refit: Refit) -> bool:
    """Return whether ``refit`` explains most of the slow changes that the ``nominal`` model leaves."""
    left, before = (data.change_of_beat(one.fit.coefficients) for one in (refit, nominal))
    return left < data.policy.drift_left * before


def _evidence(data: WhitenedData, excess: Array, genes: Array, effects: Array, suspects: int) -> Array:
    """Return the log evidence [H] for ``excess`` [H], a multiple of the noise variance, with the tolerated part."""
    return np.asarray(
        -0.5 * data.effective_samples * np.log(excess) - data.gene_cost * genes - np.log(max(suspects, 2)) * effects
    )


def _unknown(data: WhitenedData, excess: float) -> float:
    """Return the log evidence for a law outside the library that leaves ``excess``, as in :func:`_evidence`."""
    return float(-0.5 * data.effective_samples * np.log(excess) - data.gene_cost * data.policy.unknown_genes)


def nominal_suffices(data: WhitenedData, nominal: Refit, suspects: int, floor: float = 0.0) -> bool:
    """Return whether the nominal excess is too small for any effect to be worth its genes, even a perfect one.

    ``floor`` (m or N): discretisation error.
    """
    if nominal_refuted(data, beyond_chance(data, nominal), floor) or changes(data) or doubtful(data, nominal, floor):
        return False
    tau = tolerated_excess(data, nominal.excess, floor)
    excess = _misfit(data, nominal, tau)
    ends = _evidence(data, np.array([tau + excess, tau]) / data.noise**2, np.arange(2.0), np.arange(2.0), suspects)
    return bool(ends[1] < ends[0] - data.policy.least_evidence)


def tolerated_excess(data: WhitenedData, excess: float, floor: float, error: float | None = None) -> float:
    """Return the mean square (m^2 or N^2) beyond the noise that a right hypothesis may have.

    ``excess``: of the nominal model; ``floor`` (m or N): discretisation error.
    """
    policy = data.policy
    return (
        (policy.negligible * data.noise) ** 2
        + floor**2
        + data.accepted**2
        + policy.form**2 * max(excess, 0.0)
        + policy.allowance * (data.excess_standard_error if error is None else error)
    )


def _misfit(data: WhitenedData, refit: Refit, tau: float) -> float:
    """Return the excess, fitted and cross-validated, averaged in the logarithm (`Policy.predicted_weight`).

    ``tau`` (m^2 or N^2) is added to both before. A cross-validation by a linearised model may be wrong by any factor.
    """
    policy = data.policy
    fitted = max(refit.excess, 0.0)
    predicted = fitted if refit.predicted is None else max(refit.predicted, 0.0)
    return float((tau + fitted) ** (1.0 - policy.predicted_weight) * (tau + predicted) ** policy.predicted_weight - tau)
