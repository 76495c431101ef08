"""The verdict: which explanation holds, if any, with probabilities.

Recordings hold so many samples that noise decides nothing: a law of the right kind, written a little differently than
nature does, is refuted by thousands of units of chi-squared. What decides is how much of the misfit an explanation
takes away. So hypotheses are weighed by the mean square that they leave, above what no model can be expected to
explain: a likelihood in which the misfit of a law that is right but for its form counts as noise of unknown size,

    ln p = -nu/2 ln(tau^2 + E) - genes c,

E the mean square beyond the noise, fitted and predicted of recordings left out, in parts of the noise's; tau the floor;
nu the number of independent pieces that such misfits have (a few for each recording). Beforehand each effect is as
unlikely as the suspects are many. Two hypotheses always compete beside the effects: *nothing is lacking*, and
*something that is not in the library*, which is taken to explain all but a part of the misfit
(`Policy.unknown_residual`) at the price of the genes that a law of its own would need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.policy import POLICY, Policy

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class HypothesisWeights:
    """Hypotheses with probabilities: of each refit (the first is the nominal model), and of an unknown law."""

    refits: tuple[Refit, ...]
    evidence: Array
    probabilities: Array
    unknown: float
    left: Array
    policy: Policy = POLICY


def weigh(
    data: WhitenedData, nominal: Refit, refits: Sequence[Refit], floor: float, suspects: int
) -> HypothesisWeights:
    """Weigh ``refits`` against the nominal model.

    ``floor`` (m or N) is what the model's division leaves; ``suspects`` how many were considered: each of them is as
    unlikely beforehand as they are many.
    """
    policy = data.policy
    every = (nominal, *refits)
    unit = data.noise**2
    tau = tolerated_excess(data, nominal.excess, floor) / unit
    left = np.array([_misfit(data, one, tau * unit) / unit for one in every])
    genes = np.array([one.freedom for one in every], float)
    named = np.array([len(one.trials) for one in every], float)
    log = _evidence(data, tau + left, genes, named, suspects)
    unknown = (
        -0.5 * data.effective_samples * np.log(tau + policy.unknown_residual**2 * left[0])
        - policy.gene_cost * policy.unknown_genes
    )
    top = max(log.max(), unknown)
    weight, other = np.exp(log - top), np.exp(unknown - top)
    if nominal_refuted(data, nominal.excess, floor):
        weight[0] = 0.0
    total = weight.sum() + other
    return HypothesisWeights(every, log - log[0], weight / total, float(other / total), left, data.policy)


def nominal_refuted(data: WhitenedData, excess: float, floor: float) -> bool:
    """Whether the nominal model leaves so much that neither noise nor a division (m or N) can be what makes it.

    However few the pieces of it are: it is not known what is lacking then, but that something is.
    """
    made = (data.policy.negligible * data.noise) ** 2 + floor**2
    return excess - made > data.policy.nominal_refuted * data.excess_standard_error


def _evidence(data: WhitenedData, left: Array, genes: Array, named: Array, suspects: int) -> Array:
    """Logarithm of the evidence, for mean squares ``left`` in parts of the noise's, the floor included."""
    return np.asarray(
        -0.5 * data.effective_samples * np.log(left) - data.policy.gene_cost * genes - np.log(max(suspects, 2)) * named
    )


def nominal_suffices(data: WhitenedData, nominal: Refit, suspects: int) -> bool:
    """Whether the nominal model leaves so little that no explanation could be worth its price, were it perfect."""
    if nominal_refuted(data, nominal.excess, 0.0):
        return False
    tau = tolerated_excess(data, nominal.excess, 0.0)
    left = _misfit(data, nominal, tau)
    ends = _evidence(data, np.array([tau + left, tau]) / data.noise**2, np.arange(2.0), np.arange(2.0), suspects)
    return bool(ends[1] < ends[0] - data.policy.least_evidence)


def tolerated_excess(data: WhitenedData, excess: float, floor: float) -> float:
    """Mean square (m^2 or N^2) that a right explanation may leave of the nominal model's ``excess``."""
    policy = data.policy
    return (
        (policy.negligible * data.noise) ** 2
        + floor**2
        + policy.form**2 * max(excess, 0.0)
        + policy.allowance * data.excess_standard_error
    )


def _misfit(data: WhitenedData, refit: Refit, tau: float) -> float:
    """Mean square beyond the noise: fitted and predicted, averaged in their logarithms (`Policy.predicted_weight`).

    What a linearised model foretells of a recording left out may be wrong by any factor.
    """
    policy = data.policy
    fitted = max(refit.excess, 0.0)
    predicted = fitted if refit.predicted is None else max(refit.predicted, 0.0)
    return float((tau + fitted) ** (1.0 - policy.predicted_weight) * (tau + predicted) ** policy.predicted_weight - tau)
