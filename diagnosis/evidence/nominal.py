"""Fit the nominal model, and choose a discretisation that does not limit the fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.estimates.likelihood import iterate
from wingfit.calibration.estimates.linearised import free_genes, unit_at
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.series.beginnings import from_beginnings
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import COST_TOLERANCE, FIT_ERRORS, Fit, gauss_newton_fit
from wingfit.diagnosis.evidence.refit import Refit, fit_to_convergence, make_refit, refit_at
from wingfit.diagnosis.evidence.screen import Nuisance
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.subject import Subject
from wingfit.diagnosis.verdict.weigh_hypotheses import tolerated_excess
from wingfit.inference.differences import NotSimulatedError
from wingfit.records.array_types import Array, Float

NOMINAL_STEPS = 20
CALIBRATION_STEPS = 12  # iterations of a calibration, after which a fit goes on
MAX_REFINEMENTS = 3  # successive finer discretisations


@dataclass(frozen=True)
class Nominal:
    """The fitted nominal model.

    Attributes:
        subject: the rig with the discretisation that was chosen.
        refit: the fit.
        discretisation_error: root mean square change (m or N) of the simulation by a finer discretisation, as far as
            the genes cannot compensate it; None where there is no finer one.
        finer: description of that finer discretisation; "" where there is none.
        limited: whether the refinements ended while each still improved the fit; ``discretisation_error`` is then what
            the last of them shows to remain (:func:`error_after`).
        remarks: for the user, on discretisations that were replaced.
        tried_finer: description of a finer discretisation that was fitted with little gain; it shows that
            discretisation is not the cause of the residual. "" where none was fitted.
    """

    subject: Subject
    refit: Refit
    discretisation_error: float | None
    finer: str
    remarks: tuple[str, ...]
    tried_finer: str = ""
    limited: bool = False

    @property
    def remaining_error(self) -> float:
        """The discretisation error (m or N) where refinements ended while they improved the fit; otherwise 0."""
        return (self.discretisation_error or 0.0) if self.limited else 0.0

    @property
    def possible_error(self) -> float:
        """The discretisation error (m or N), except where a finer discretisation hardly fits better; there 0."""
        return self.remaining_error if self.tried_finer else self.discretisation_error or 0.0


def fit_nominal(context: FitContext, free: tuple[str, ...], values: Mapping[str, float]) -> Iterator[Fit]:
    """Fit the genes ``free`` of the nominal model; yields every step, the best last.

    The fit starts with all genes at ``values`` (by name; others at their estimates, those that belong to a single
    series at what its beginning shows). A fit to series that ends beyond the noise is repeated from where the
    iterations of a calibration end. ValueError where the model cannot be simulated.
    """
    model = context.subject.model
    problem = context.problem(model, free, base_genome(model, values))
    shown = from_beginnings(problem, context.evaluator, values).values
    last: Fit | None = None
    for last in gauss_newton_fit(context, problem, _start(problem, shown), NOMINAL_STEPS):
        yield last
    if last is None or context.data.kind != "series" or not _is_beyond_noise(context.data, last):
        return
    found = _calibrated(context, problem, shown)
    if found is not None and found.cost < last.cost - COST_TOLERANCE:
        last = found
    yield last


def _start(problem: Problem, values: Mapping[str, float]) -> Float[Array, " F"]:
    """Return the free genes of ``problem`` scaled to 0..1, at ``values`` (by name) or at the base."""
    base = problem.base.replace(values)
    return unit_at(free_genes(problem), np.array([base[name] for name in problem.free]))


def _is_beyond_noise(data: WhitenedData, fit: Fit) -> bool:
    return data.excess(fit.coefficients) > tolerated_excess(data, 0.0, 0.0)


def _calibrated(context: FitContext, problem: Problem, start: Mapping[str, float]) -> Fit | None:
    """Return the fit that starts where the iterations of a calibration from ``start`` end; None where that fails.

    The iterations estimate the noise from the residual, so that they go on where a fit with the known noise, far above
    it, takes small gains for none.
    """
    try:
        *_, step = iterate(problem, context.evaluator, start, iterations=CALIBRATION_STEPS)
        *_, found = gauss_newton_fit(context, problem, _start(problem, step.values), NOMINAL_STEPS)
    except (*FIT_ERRORS, NotSimulatedError):
        return None
    return found


def choose_discretisation(context: FitContext, fit: Fit, *, refine: bool) -> Nominal:
    """Take finer discretisations while these fit much better; return the last one with its discretisation error.

    ``fit``: of the nominal model of ``context``; without ``refine``, finer ones only serve to estimate the error.
    """
    data, current, remarks = context.data, make_refit(context.data, fit), list[str]()
    remaining: float | None = None
    for _ in range(MAX_REFINEMENTS):
        error, finest, ineffective, better = 0.0, "", "", None
        for finer in context.finer():
            changes, gain = finer_change(finer, current)
            if changes > error:
                error, finest, ineffective = changes, finer.subject.description, ""
            if refine and finer_is_promising(data, changes, gain, current):
                found = refit_at(finer, current)
                if found and improves(data, found, current):
                    better = fit_to_convergence(finer, found)
                    remaining = error_after(changes, current, better)
                    break
                ineffective = finest if found and changes == error else ineffective
        if better is None and finest:
            return Nominal(context.subject, current, error, finest, tuple(remarks), ineffective)
        if better is None:
            break
        remarks.append(
            f"the discretisation limits the model: {finer.subject.description} replaces {context.subject.description} "
            f"and reduces the excess misfit to {100 * max(better.excess, 0.0) / current.excess:.0f} %"
        )
        context, current = finer, better
    return Nominal(context.subject, current, remaining, "", tuple(remarks), limited=remaining is not None)


def error_after(change: float, coarse: Refit, fine: Refit) -> float:
    """Return the discretisation error (m or N) that remains in ``fine``, the fit of a finer model than in ``coarse``.

    ``change`` (m or N) is that of the simulation. Of errors a and b, proportional to one another, b - a is the change
    and b^2 - a^2 the fall of the excess, in which missing physics cancels that is orthogonal to them. So a =
    ((b^2 - a^2) / (b - a) - (b - a)) / 2, of whatever order the models converge; at most the residual.
    """
    fallen = coarse.excess - fine.excess
    return float(np.clip(0.5 * (fallen / change - change), 0.0, np.sqrt(max(fine.excess, 0.0))))


def finer_is_promising(data: WhitenedData, changes: float, gain: float, current: Refit) -> bool:
    """Return whether a finer discretisation is worth a fit.

    ``changes`` (m or N) and ``gain`` are those of :func:`finer_change`, ``current`` the fit with the present
    discretisation. A low predicted gain does not count where the change exceeds the whole residual: the prediction is
    linearised.
    """
    negligible = data.policy.negligible * data.noise
    matters = changes >= negligible and current.excess >= negligible**2
    return matters and (gain > data.policy.finer_predicted_gain or changes**2 >= current.excess)


def finer_change(finer: FitContext, refit: Refit) -> tuple[float, float]:
    """Return how much the ``finer`` model changes the simulation of ``refit``, and the gain predicted from that.

    The change (root mean square, m or N) is the part that the genes cannot compensate. The gain is the fraction of the
    excess that this change would remove in the linearised model. Both are zero where the simulation fails.
    """
    fit, data = refit.fit, finer.data
    found, reasons, _ = finer.evaluate(replace(fit.problem, model=finer.subject.extended(refit.names)), fit.individual)
    if reasons[0] is not None:
        return 0.0, 0.0
    nuisance = Nuisance(data, fit)
    change, residual = nuisance.project_out(found[0] - fit.coefficients), nuisance.residual
    power = float(change @ change)
    amount = float(np.clip(-(change @ residual) / max(power, 1e-300), 0.0, data.policy.discretisation_factor))
    excess = max(float(residual @ residual) - len(residual), 1e-300)
    gain = (float(residual @ residual) - float(np.sum((residual + amount * change) ** 2))) / excess
    return float(np.sqrt(data.weight @ data.whitening.restore(change[: len(data.scale)]) ** 2)), gain


def improves(data: WhitenedData, finer: Refit, coarse: Refit) -> bool:
    """Return whether ``finer`` fits so much better than ``coarse`` that it is worth its cost (`Policy.finer_gain`)."""
    return finer.excess < (1.0 - data.policy.finer_gain) * coarse.excess and coarse.excess > 0.0
