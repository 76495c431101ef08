"""State of the search for missing physics."""

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
    """Results so far. ``trials``: score tests by suspect; ``initial_fit``: nominal model at the estimates."""

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
        """The fitted nominal model; ValueError before it has been fitted."""
        if self.nominal is None:
            raise ValueError("the nominal model has not been fitted")
        return self.nominal

    def restart_from(self, nominal: Nominal) -> None:
        """Continue with another nominal fit; earlier score tests and refits no longer hold."""
        self.nominal, self.subject = nominal, nominal.subject
        self.trials, self.refits = [], []

    def add(self, refit: Refit | None) -> None:
        """Store ``refit``; of two with the same suspects, store the one with the lower cost."""
        if refit is None:
            return
        for k, stored in enumerate(self.refits):
            if set(stored.names) == set(refit.names):
                self.refits[k] = min(stored, refit, key=lambda one: one.fit.cost - COST_TOLERANCE * one.fit.converged)
                return
        self.refits.append(refit)

    def partner_threshold(self, nominal: Nominal) -> float:
        """Excess (m^2 or N^2) of a hypothesis above which a second effect is tried."""
        return tolerated_excess(self.data, self.data.policy.partner_form * nominal.refit.excess, 0.0)

    def is_explained(self, nominal: Nominal) -> bool:
        """Whether no second effect is needed: the best hypothesis is below the threshold, or there is none."""
        return not self.refits or min(one.excess for one in self.refits) <= self.partner_threshold(nominal)

    @property
    def beats_unknown_law(self) -> bool:
        """Whether a hypothesis has less excess than the assumed law outside the library."""
        least = min((one.excess for one in self.refits), default=np.inf)
        return least <= self.data.policy.unknown_residual**2 * self.fitted_nominal.refit.excess


@dataclass(frozen=True)
class CountingEvaluator:
    """An evaluator that adds the number of individuals to the state ``of``."""

    inner: Evaluator
    of: SearchState

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Evaluate ``values`` with the inner evaluator."""
        self.of.evaluations += len(np.atleast_2d(values))
        return self.inner.evaluate(problem, values, residuals=residuals)

    def close(self) -> None:
        """Do nothing: the owner closes the inner evaluator."""
