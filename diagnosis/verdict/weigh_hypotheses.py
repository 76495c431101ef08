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
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.policy import POLICY, Policy

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Weighed:
    """Hypotheses with probabilities: of each refit (the first is the nominal model), and of an unknown law."""

    refits: tuple[Refit, ...]
    evidence: Array
    probabilities: Array
    unknown: float
    left: Array
    policy: Policy = POLICY


def weighed(stack: Stack, nominal: Refit, refits: Sequence[Refit], floor: float, suspects: int) -> Weighed:
    """Weigh ``refits`` against the nominal model.

    ``floor`` (m or N) is what the model's division leaves; ``suspects`` how many were considered: each of them is as
    unlikely beforehand as they are many.
    """
    policy = stack.policy
    every = (nominal, *refits)
    unit = stack.noise**2
    tau = tolerated(stack, nominal.excess, floor) / unit
    left = np.array([_misfit(stack, one, tau * unit) / unit for one in every])
    genes = np.array([one.freedom for one in every], float)
    named = np.array([len(one.trials) for one in every], float)
    log = _evidence(stack, tau + left, genes, named, suspects)
    unknown = (
        -0.5 * stack.pieces * np.log(tau + policy.unknown_residual**2 * left[0])
        - policy.gene_cost * policy.unknown_genes
    )
    top = max(log.max(), unknown)
    weight, other = np.exp(log - top), np.exp(unknown - top)
    if refuted(stack, nominal.excess, floor):
        weight[0] = 0.0
    total = weight.sum() + other
    return Weighed(every, log - log[0], weight / total, float(other / total), left, stack.policy)


def refuted(stack: Stack, excess: float, floor: float) -> bool:
    """Whether the nominal model leaves so much that neither noise nor a division (m or N) can be what makes it.

    However few the pieces of it are: it is not known what is lacking then, but that something is.
    """
    made = (stack.policy.negligible * stack.noise) ** 2 + floor**2
    return excess - made > stack.policy.refuted * stack.uncertainty


def _evidence(stack: Stack, left: Array, genes: Array, named: Array, suspects: int) -> Array:
    """Logarithm of the evidence, for mean squares ``left`` in parts of the noise's, the floor included."""
    return np.asarray(
        -0.5 * stack.pieces * np.log(left) - stack.policy.gene_cost * genes - np.log(max(suspects, 2)) * named
    )


def beyond_doubt(stack: Stack, nominal: Refit, suspects: int) -> bool:
    """Whether the nominal model leaves so little that no explanation could be worth its price, were it perfect."""
    if refuted(stack, nominal.excess, 0.0):
        return False
    tau = tolerated(stack, nominal.excess, 0.0)
    left = _misfit(stack, nominal, tau)
    ends = _evidence(stack, np.array([tau + left, tau]) / stack.noise**2, np.arange(2.0), np.arange(2.0), suspects)
    return bool(ends[1] < ends[0] - stack.policy.least_evidence)


def tolerated(stack: Stack, excess: float, floor: float) -> float:
    """Mean square (m^2 or N^2) that a right explanation may leave of the nominal model's ``excess``."""
    policy = stack.policy
    return (
        (policy.negligible * stack.noise) ** 2
        + floor**2
        + policy.form**2 * max(excess, 0.0)
        + policy.allowance * stack.uncertainty
    )


def _misfit(stack: Stack, refit: Refit, tau: float) -> float:
    """Mean square beyond the noise: fitted and predicted, averaged in their logarithms (`Policy.predicted_weight`).

    What a linearised model foretells of a recording left out may be wrong by any factor.
    """
    policy = stack.policy
    fitted = max(refit.excess, 0.0)
    predicted = fitted if refit.predicted is None else max(refit.predicted, 0.0)
    return float((tau + fitted) ** (1.0 - policy.predicted_weight) * (tau + predicted) ** policy.predicted_weight - tau)
