"""The state of a search for missing physics, and a counter of simulated individuals."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import COST_TOLERANCE, FIT_ERRORS, Fit, gauss_newton_fit
from wingfit.diagnosis.evidence.nominal import NOMINAL_STEPS, Nominal
from wingfit.diagnosis.evidence.position_errors import PositionErrors, find_position_errors
from wingfit.diagnosis.evidence.refit import Refit, is_in_position
from wingfit.diagnosis.evidence.screen import Trial
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.diagnosis.subject import Subject, beat_subject, select_suspects
from wingfit.diagnosis.verdict.noise_doubt import judged_noise
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights, tolerated_excess
from wingfit.records import FrameError
from wingfit.records.array_types import ArrayLike
from wingfit.rigs.suspect import Suspect


@dataclass
class SearchState:
    """The request, the data and the results so far of a search for missing physics.

    Attributes:
        context: rig, whitened recordings and evaluator.
        nominal: fit of the nominal model.
        trials: score tests, a list for each suspect, best first.
        refits: fits with suspects added.
        weights: evidence and probability of each fit; None until the search ends.
        position_errors: of the described rest positions and of the frame, integrated out of ``data``; None where they
            do not matter.
        frame_error: stated with the dataset.
        initial_fit: the nominal model at the estimates of its genes, before any step of a fit, and the context used for
            it.
    """

    context: FitContext
    spec: DiagnosisSpec = field(default_factory=DiagnosisSpec)
    nominal: Nominal | None = None
    trials: list[list[Trial]] = field(default_factory=list)
    refits: list[Refit] = field(default_factory=list)
    weights: HypothesisWeights | None = None
    position_errors: PositionErrors | None = None
    frame_error: FrameError | None = None
    initial_fit: tuple[FitContext, Fit] | None = None

    @property
    def subject(self) -> Subject:
        """The rig, with the discretisation of the present nominal fit."""
        return self.context.subject

    @property
    def suspects(self) -> list[Suspect]:
        """The suspects that are considered."""
        return select_suspects(self.subject, self.spec.suspects)

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
        """Evidence and probabilities of the hypotheses; ValueError before the search has ended."""
        if self.weights is None:
            raise ValueError("a finding needs a search that has ended")
        return self.weights

    @property
    def by_excess(self) -> list[Refit]:
        """The refits, least excess (mean square of the residual minus that of the noise) first."""
        return sorted(self.refits, key=lambda one: one.excess)

    def restart_from(self, nominal: Nominal) -> None:
        """Replace the nominal fit by ``nominal`` and delete all score tests and refits, which held for the old fit."""
        self.nominal, self.context = nominal, replace(self.context, subject=nominal.subject)
        self.trials, self.refits = [], []

    def judge_noise(self, nominal: Fit) -> None:
        """Find out, at the fit ``nominal``, whether slow noise may explain what the nominal model misses."""
        self.context = replace(self.context, data=judged_noise(self.data, nominal))

    def floor(self, discretisation: float) -> float:
        """Return the misfit (m or N) of a right model beyond noise; ``discretisation``: the part of its discretisation.

        The other part is what errors of the markers' rest positions are expected to share.
        """
        return float(np.hypot(discretisation, self.position_errors.shared if self.position_errors else 0.0))

    @property
    def proven_floor(self) -> float:
        """The :meth:`floor` with what fits of finer discretisations have shown of their error."""
        return self.floor(self.fitted_nominal.remaining_error)

    def allow_for_position_errors(self, nominal: Fit) -> bool:
        """Measure errors of rest positions at the fit ``nominal``; allow for these and those of the frame.

        Returns whether any matter.
        """
        if self.data.kind != "tracks":
            return False
        found = find_position_errors(beat_subject(self.subject), self.data, nominal, self.frame_error)
        if found is None:
            return False
        self.position_errors, data = found
        self.context = replace(self.context, data=data)
        if self.initial_fit:
            context, fit = self.initial_fit
            self.initial_fit = replace(context, data=data), _without_errors(data, fit)
        return True

    def fitted_again(self, nominal: Fit) -> Fit:
        """Return the fit ``nominal`` continued with the present data, or as it was where that cannot be simulated."""
        with suppress(*FIT_ERRORS):
            *_, found = gauss_newton_fit(self.context, nominal.problem, nominal.unit, NOMINAL_STEPS)
            return found
        return _without_errors(self.data, nominal)

    def add(self, refit: Refit | None) -> None:
        """Store ``refit`` unless it is None or has the size of a choice between its positions.

        Of two with the same suspects, only the one with the lower cost is stored; a converged one may cost
        COST_TOLERANCE more.
        """
        if refit is None or not is_in_position(refit):
            return
        for k, stored in enumerate(self.refits):
            if set(stored.names) == set(refit.names):
                self.refits[k] = min(stored, refit, key=lambda one: one.fit.cost - COST_TOLERANCE * one.fit.converged)
                return
        self.refits.append(refit)

    @property
    def partner_threshold(self) -> float:
        """Excess (m^2 or N^2) of a hypothesis above which a second effect is tried with it."""
        return tolerated_excess(self.data, self.data.policy.partner_form * self.fitted_nominal.refit.excess, 0.0)

    @property
    def is_explained(self) -> bool:
        """Whether no second effect is needed: least excess up to :attr:`partner_threshold`, or no refit exists."""
        return not self.refits or self.by_excess[0].excess <= self.partner_threshold

    @property
    def one_effect_explains(self) -> bool:
        """Whether a refit with a single effect needs no second one."""
        return any(one.excess <= self.partner_threshold for one in self.refits if len(one.trials) == 1)

    @property
    def beats_unknown_law(self) -> bool:
        """Whether the best refit explains as much as a law outside the library would (`Policy.unknown_residual`)."""
        least = min((one.excess for one in self.refits), default=np.inf)
        return least <= self.data.policy.unknown_residual**2 * self.fitted_nominal.refit.excess


def _without_errors(data: WhitenedData, fit: Fit) -> Fit:
    """Return ``fit``, whose coefficients contain errors of the description, as that of ``data`` without them."""
    slopes = data.without_errors(fit.jacobian.T).T
    return replace(fit, coefficients=data.without_errors(fit.coefficients), jacobian=slopes)


@dataclass
class CountingEvaluator:
    """An evaluator that passes all work to the evaluator ``inner`` and counts the individuals."""

    inner: Evaluator
    evaluations: int = 0

    def evaluate(self, problem: Problem, values: ArrayLike, *, residuals: bool = False) -> Evaluation:
        """Return what ``inner`` returns for ``values`` [B, F] (B individuals, F free genes), and add B to the count."""
        self.evaluations += len(np.atleast_2d(values))
        return self.inner.evaluate(problem, values, residuals=residuals)

    def close(self) -> None:
        """Do nothing: the owner closes the inner evaluator."""
