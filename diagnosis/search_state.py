"""State of the search for missing physics."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import COST_TOLERANCE, Fit
from wingfit.diagnosis.evidence.nominal import Nominal
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.screen import Trial
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.diagnosis.subject import Subject
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights, tolerated_excess
from wingfit.records.array_types import ArrayLike


@dataclass
class SearchState:
    """What is searched for, and the results so far.

    ``trials``: score tests by suspect; ``initial_fit``: nominal model at the estimates, and the context of that fit.
    """

    context: FitContext
    spec: DiagnosisSpec = field(default_factory=DiagnosisSpec)
    nominal: Nominal | None = None
    trials: list[list[Trial]] = field(default_factory=list)
    refits: list[Refit] = field(default_factory=list)
    weights: HypothesisWeights | None = None
    initial_fit: tuple[FitContext, Fit] | None = None

    @property
    def subject(self) -> Subject:
        """The rig with the discretisation of the nominal model."""
        return self.context.subject

    @property
    def data(self) -> WhitenedData:
        """The fitted recordings."""
        return self.context.data

    @property
    def fitted_nominal(self) -> Nominal:
        """The fitted nominal model; ValueError before it has been fitted."""
        if self.nominal is None:
            raise ValueError("the nominal model has not been fitted")
        return self.nominal

    @property
    def final_weights(self) -> HypothesisWeights:
        """The weighed hypotheses; ValueError before the search has ended."""
        if self.weights is None:
            raise ValueError("a finding needs a search that has ended")
        return self.weights

    @property
    def by_excess(self) -> list[Refit]:
        """The refits, that with the least excess first."""
        return sorted(self.refits, key=lambda one: one.excess)

    def restart_from(self, nominal: Nominal) -> None:
        """Continue with another nominal fit; earlier score tests and refits no longer hold."""
        self.nominal, self.context = nominal, replace(self.context, subject=nominal.subject)
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

    @property
    def partner_threshold(self) -> float:
        """Excess (m^2 or N^2) of a hypothesis above which a second effect is tried."""
        return tolerated_excess(self.data, self.data.policy.partner_form * self.fitted_nominal.refit.excess, 0.0)

    @property
    def is_explained(self) -> bool:
        """Whether no second effect is needed: the best hypothesis is below the threshold, or there is none."""
        return not self.refits or self.by_excess[0].excess <= self.partner_threshold

    @property
    def beats_unknown_law(self) -> bool:
        """Whether a hypothesis has less excess than the assumed law outside the library."""
        least = min((one.excess for one in self.refits), default=np.inf)
        return least <= self.data.policy.unknown_residual**2 * self.fitted_nominal.refit.excess


@dataclass
class CountingEvaluator:
    """An evaluator that counts the individuals which it has the ``inner`` one evaluate."""

    inner: Evaluator
    evaluations: int = 0

    def evaluate(self, problem: Problem, values: ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Evaluate ``values`` with the inner evaluator."""
        self.evaluations += len(np.atleast_2d(values))
        return self.inner.evaluate(problem, values, residuals=residuals)

    def close(self) -> None:
        """Do nothing: the owner closes the inner evaluator."""
