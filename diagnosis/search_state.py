"""What is known so far in the search for what is lacking."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.diagnosis.evidence.fit import SMALLEST, Fit
from wingfit.diagnosis.evidence.nominal import Nominal
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.screen import Trial
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.subject import Subject
from wingfit.diagnosis.verdict.weigh_hypotheses import Weighed, tolerated


@dataclass
class Assessment:
    """What is known so far; ``evaluations`` counts individuals.

    ``begun`` is the nominal model at the estimates.
    """

    subject: Subject
    stack: Stack
    nominal: Nominal | None = None
    trials: list[list[Trial]] = field(default_factory=list)
    refits: list[Refit] = field(default_factory=list)
    weighed: Weighed | None = None
    evaluations: int = 0
    begun: tuple[Subject, Fit] | None = None

    @property
    def known(self) -> Nominal:
        """The nominal model; ValueError before it has been fitted."""
        if self.nominal is None:
            raise ValueError("the nominal model has not been fitted")
        return self.nominal

    def begin(self, nominal: Nominal) -> None:
        """Go on with a nominal fit; nothing is known of suspects beside it yet."""
        self.nominal, self.subject = nominal, nominal.subject
        self.trials, self.refits = [], []

    def add(self, refit: Refit | None) -> None:
        """Keep ``refit``, or the better of two with the same suspects."""
        if refit is None:
            return
        for k, known in enumerate(self.refits):
            if set(known.names) == set(refit.names):
                self.refits[k] = min(known, refit, key=lambda one: one.fit.cost - SMALLEST * one.fit.converged)
                return
        self.refits.append(refit)

    def tolerable(self, nominal: Nominal) -> float:
        """What an explanation may leave that needs no partner, m^2 or N^2."""
        return tolerated(self.stack, self.stack.policy.partner_form * nominal.refit.excess, 0.0)

    def enough(self, nominal: Nominal) -> bool:
        """Whether nothing more is to be gained: an explanation leaves what one may, or there is none."""
        return not self.refits or min(one.excess for one in self.refits) <= self.tolerable(nominal)

    @property
    def leaves_little(self) -> bool:
        """Whether an explanation leaves less than a law would that is not in the library."""
        least = min((one.excess for one in self.refits), default=np.inf)
        return least <= self.stack.policy.unknown_residual**2 * self.known.refit.excess


@dataclass(frozen=True)
class Counted:
    """An evaluator that counts the individuals it is given in ``of``."""

    inner: Evaluator
    of: Assessment

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        """As the inner one."""
        self.of.evaluations += len(np.atleast_2d(values))
        return self.inner.evaluate(problem, values, residuals=residuals)

    def close(self) -> None:
        """Nothing: the inner one is its owner's."""
