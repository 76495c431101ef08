"""What is known so far in the search for what is lacking."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.diagnosis.evidence.fit import COST_TOLERANCE, Fit
from wingfit.diagnosis.evidence.nominal import Nominal
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.screen import Trial
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.subject import Subject
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights, tolerated_excess


@dataclass
class SearchState:
    """What is known so far; ``evaluations`` counts individuals.

    ``begun`` is the nominal model at the estimates.
    """

    subject: Subject
    data: WhitenedData
    nominal: Nominal | None = None
    trials: list[list[Trial]] = field(default_factory=list)
    refits: list[Refit] = field(default_factory=list)
    weights: HypothesisWeights | None = None
    evaluations: int = 0
    initial_fit: tuple[Subject, Fit] | None = None

    @property
    def fitted_nominal(self) -> Nominal:
        """The nominal model; ValueError before it has been fitted."""
        if self.nominal is None:
            raise ValueError("the nominal model has not been fitted")
        return self.nominal

    def restart_from(self, nominal: Nominal) -> None:
        """Go on with a nominal fit; nothing is known of suspects beside it yet."""
        self.nominal, self.subject = nominal, nominal.subject
        self.trials, self.refits = [], []

    def add(self, refit: Refit | None) -> None:
        """Keep ``refit``, or the better of two with the same suspects."""
        if refit is None:
            return
        for k, fitted_nominal in enumerate(self.refits):
            if set(fitted_nominal.names) == set(refit.names):
                self.refits[k] = min(
                    fitted_nominal, refit, key=lambda one: one.fit.cost - COST_TOLERANCE * one.fit.converged
                )
                return
        self.refits.append(refit)

    def partner_threshold(self, nominal: Nominal) -> float:
        """What an explanation may leave that needs no partner, m^2 or N^2."""
        return tolerated_excess(self.data, self.data.policy.partner_form * nominal.refit.excess, 0.0)

    def is_explained(self, nominal: Nominal) -> bool:
        """Whether nothing more is to be gained: an explanation leaves what one may, or there is none."""
        return not self.refits or min(one.excess for one in self.refits) <= self.partner_threshold(nominal)

    @property
    def beats_unknown_law(self) -> bool:
        """Whether an explanation leaves less than a law would that is not in the library."""
        least = min((one.excess for one in self.refits), default=np.inf)
        return least <= self.data.policy.unknown_residual**2 * self.fitted_nominal.refit.excess


@dataclass(frozen=True)
class CountingEvaluator:
    """An evaluator that counts the individuals it is given in ``of``."""

    inner: Evaluator
    of: SearchState

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        """As the inner one."""
        self.of.evaluations += len(np.atleast_2d(values))
        return self.inner.evaluate(problem, values, residuals=residuals)

    def close(self) -> None:
        """Nothing: the inner one is its owner's."""
