"""Find one recording without which the nominal model fits all others.

Then what is missing shows in that recording alone: a mistake in it, such as a wrong condition or an axis, or physics
that is small in the others. A condition with which the model fits that recording, too, is the most likely mistake.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wingfit.diagnosis.evidence.fit import FIT_ERRORS, PRIOR_SD, Fit, gauss_newton_fit
from wingfit.diagnosis.evidence.refit import make_refit
from wingfit.diagnosis.finding import amount
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.verdict.held_out import covariance_of_fit
from wingfit.diagnosis.verdict.mistakes import LIKELY
from wingfit.diagnosis.verdict.proof import misfit_to_floor, predicted_residuals
from wingfit.diagnosis.verdict.reservations import CLAIMING, without_names
from wingfit.diagnosis.verdict.verdict import Decision
from wingfit.diagnosis.verdict.weigh_hypotheses import beyond_chance, large_rest, missed, nominal_refuted
from wingfit.inference.gauss_newton import Quadratic
from wingfit.records import AnyRecording, Recording
from wingfit.records.array_types import Array, Float

FEWEST_OTHERS = 3  # recordings that are fitted without the odd one; two agree with almost any genes
PROMISING = 0.5  # of the excess: a recording without which the linearised model leaves more is not tried
MOST_TRIED = 3
STEPS = 8  # of a fit without one recording
FITS = 1.25  # misfit over the expected one, up to which a condition fits
ODD = 1.4  # misfit over that of what is predicted worst
DETERMINED = 4.0  # least misfit over what errors of the genes make
CONDITION_STEPS, DIFFERENCE, LARGEST_STEP = 5, 0.02, 0.3  # of the fit of a condition, of the largest value or rad

Name = Literal["airspeed", "angle_of_attack", "pressure", "phase_lag"]
LABELS: dict[Name, tuple[str, str, float]] = {
    "airspeed": ("an airspeed", "m/s", 1.0),
    "angle_of_attack": ("an angle of attack", "deg", 180.0 / np.pi),
    "pressure": ("an air pressure", "mbar", 0.01),
    "phase_lag": ("a phase lag", "deg", 180.0 / np.pi),
}
POSITIVE: tuple[Name, ...] = ("airspeed", "pressure")
UNITS = (0.01, 0.1, 1 / 3.6, 0.514, 0.75, 1.33, 1 / 0.514, 3.6, 10.0, 100.0)  # km/h, knots, mmHg, lost digits


@dataclass(frozen=True)
class OddRecording:
    """A recording ``name`` without which the model fits all others, which predict it with a ``misfit`` (m or N).

    ``would_fit``: in words, each condition with which the model fits it, too.
    """

    name: str
    misfit: float
    would_fit: tuple[str, ...]

    def sentence(self, unit: str) -> str:
        """Return what the summary says of it; ``unit``: of the misfit."""
        found = (
            f" Without {self.name} the model fits all other recordings, and misses it by {amount(self.misfit, unit)}"
        )
        if self.would_fit:
            return f"{found}: it would fit with {' or '.join(self.would_fit)}. Check the condition of that recording."
        return (
            f"{found}: what is missing shows there alone, or that recording is wrong (condition, axes, scale, start)."
        )


def doubted_by_odd(decision: Decision, odd: Sequence[OddRecording]) -> Decision:
    """Return ``decision`` without names where another condition of a single recording would explain all instead."""
    wrong = any(one.would_fit for one in odd)
    return without_names(decision, LIKELY) if wrong and decision.verdict in CLAIMING else decision


def odd_sentences(odd: Sequence[OddRecording], unit: str, *, withheld: bool) -> str:
    """Return what the summary says of ``odd`` recordings; ``unit``: of misfits; ``withheld``: names were."""
    return "".join(one.sentence(unit) for one in odd) + (" No effect is named until then." if withheld else "")


def odd_recordings(
    state: SearchState, held_out: Sequence[AnyRecording]
) -> Iterator[tuple[str, tuple[OddRecording, ...]]]:
    """Yield what is done and the recordings found so far, each of which may be the odd one.

    ``held_out`` recordings must be predicted, too. None is found where the recordings are series.
    """
    found: tuple[OddRecording, ...] = ()
    data, nominal = state.data, state.fitted_nominal.refit
    if data.kind == "series" or len(data.recordings) <= FEWEST_OTHERS:
        return
    moves = [_move(state, r) for r in range(len(data.recordings))]
    left = np.array([_left(state, r, move) for r, move in enumerate(moves)])
    for r in np.argsort(left)[:MOST_TRIED].tolist():
        if left[r] > PROMISING * nominal.excess:
            break
        one = data.recordings[r]
        yield f"fitting without {one.name}", found
        others = _without(state, r, nominal.fit.unit + moves[r])
        if others is not None and isinstance(one, Recording):
            found = (*found, *_judged(*others, one, held_out, _by_genes(state, r, *others)))
    yield "fitted without single recordings", found


def _move(state: SearchState, r: int) -> Float[Array, " F"]:
    """Return the move [F] of the nominal genes in unit coordinates that fits all recordings but ``r`` (linearised)."""
    data, fit = state.data, state.fitted_nominal.refit.fit
    white, slopes = data.whiten(fit.coefficients), data.whitened_slopes(fit.jacobian)
    kept = np.ones(len(white), bool)
    kept[data.recording_slices[r]] = False
    prior = np.eye(len(fit.unit)) / PRIOR_SD**2
    gram, score = slopes[kept].T @ slopes[kept], slopes[kept].T @ white[kept]
    return Quadratic(gram + prior, score + prior @ (fit.unit - 0.5)).step(fit.unit, np.zeros(len(fit.unit)))


def _left(state: SearchState, r: int, move: Float[Array, " F"]) -> float:
    """Return the excess (m^2 or N^2) of all recordings but ``r`` after the ``move`` [F] of the linearised model."""
    data, fit = state.data, state.fitted_nominal.refit.fit
    every = data.excess_by_recording(fit.coefficients + fit.jacobian @ move)
    share = np.delete(data.recording_weights, r)
    return float(share @ np.delete(every, r) / share.sum())


def _without(state: SearchState, r: int, start: Float[Array, " F"]) -> tuple[SearchState, Fit] | None:
    """Fit the nominal model to all recordings but ``r``, from ``start`` [F]; None if it leaves more than noise does."""
    data, problem = state.data, state.fitted_nominal.refit.fit.problem
    kept = tuple(one for k, one in enumerate(data.recordings) if k != r)
    context = replace(state.context, data=data.like(kept))
    part = replace(state, context=context, position_errors=None, initial_fit=None)
    try:
        *_, fit = gauss_newton_fit(context, replace(problem, recordings=kept), np.clip(start, 0.0, 1.0), STEPS)
    except FIT_ERRORS:
        return None
    if part.allow_for_position_errors(fit):
        fit = part.fitted_again(fit)
    refit, floor = make_refit(part.data, fit), part.proven_floor
    refuted = nominal_refuted(part.data, beyond_chance(part.data, refit), floor)
    return None if refuted or large_rest(part.data, refit, floor) or missed(part.data, refit, floor) else (part, fit)


def _by_genes(state: SearchState, r: int, part: SearchState, fit: Fit) -> float:
    """Return the mean square (m^2 or N^2) that errors of the genes of ``fit`` make in recording ``r`` (linearised)."""
    data, rows = state.data, state.data.recording_slices[r]
    own = state.fitted_nominal.refit.fit.jacobian[rows]
    moved = data.weight[rows] @ np.einsum("df,fg,dg->d", own, covariance_of_fit(part.data, fit), own, optimize=True)
    return float(moved / data.recording_weights[r])


def _judged(
    part: SearchState, fit: Fit, one: Recording, held_out: Sequence[AnyRecording], by_genes: float
) -> list[OddRecording]:
    """Return ``one`` if the ``fit`` to the others of ``part`` predicts those held out, and misses it; else nothing.

    ``by_genes`` (m^2 or N^2): what errors of the genes make in it. Where they could make the misfit, as with the only
    recording in air, the others do not say what it should be.
    """
    worst = max((_ratio(part, fit, other)[0] for other in held_out), default=1.0)
    ratio, misfit = _ratio(part, fit, one)
    if not np.isfinite(misfit) or worst > part.data.policy.unpredicted or ratio < ODD * max(worst, 1.0):
        return []
    if DETERMINED**2 * by_genes > misfit**2:
        return []
    return [OddRecording(one.name, misfit, tuple(_would_fit(part, fit, one, max(worst, FITS))))]


def _ratio(part: SearchState, fit: Fit, recording: AnyRecording) -> tuple[float, float]:
    """Return the misfit of ``recording`` over the one to be expected, and itself (m or N); infinite if it fails."""
    one = part.data.like([recording])
    residuals, reason = predicted_residuals(one, part.context, part.position_errors, fit)
    return (np.inf, np.inf) if reason else misfit_to_floor(one, residuals, part.proven_floor)


def _would_fit(part: SearchState, fit: Fit, one: Recording, most: float) -> Iterator[str]:
    """Yield each condition, in words, with which the ``fit`` to the others of ``part`` predicts ``one``.

    ``most``: misfit over the expected one, up to which it does.
    """
    for name, (label, unit, factor) in LABELS.items():
        changed = _with_condition(part, fit, one, name)
        if changed is not None and _ratio(part, fit, changed)[0] <= most:
            found, stated = (factor * getattr(rec.condition, name) for rec in (changed, one))
            yield f"{label} of {found:.3g} {unit} (stated: {stated:.3g})"


def _with_condition(part: SearchState, fit: Fit, one: Recording, name: Name) -> Recording | None:
    """Return ``one`` with the value of the condition ``name`` that fits best; None where none can be simulated."""
    data, stated = part.data.like([one]), float(getattr(one.condition, name))
    usual = [float(getattr(other.condition, name)) for other in part.data.beat_recordings]
    size, positive = (max(map(abs, (stated, *usual))), True) if name in POSITIVE else (1.0, False)
    if size == 0.0:  # no recording has an airspeed
        return None

    def white(value: float) -> Array | None:
        """Whitened coefficients of the residual at a value; None where it cannot be simulated."""
        changed = replace(data, recordings=(_changed(one, name, value),))
        try:
            residuals, reason = predicted_residuals(changed, part.context, part.position_errors, fit)
        except (ValueError, ArithmeticError):  # an invented condition must not end the diagnosis
            return None
        return None if reason else data.whiten(data.coefficients_of([residuals]))

    tried = {value: white(value) for value in _first_values(stated, usual, positive=positive)}
    known = {value: found for value, found in tried.items() if found is not None}
    if not known:
        return None
    for _ in range(CONDITION_STEPS):
        value = min(known, key=lambda one: float(known[one] @ known[one]))
        beside = white(value + DIFFERENCE * size)
        if beside is None:
            break
        slope = (beside - known[value]) / (DIFFERENCE * size)
        move = -float(slope @ known[value]) / max(float(slope @ slope), 1e-300)
        after = value + float(np.clip(move, -LARGEST_STEP * size, LARGEST_STEP * size))
        after = max(after, 0.0) if positive else after
        found = white(after)
        if found is None or float(found @ found) >= float(known[value] @ known[value]):
            break
        known[after] = found
    best = min(known, key=lambda one: float(known[one] @ known[one]))
    return _changed(one, name, best) if best != stated else None


def _first_values(stated: float, usual: Sequence[float], *, positive: bool) -> list[float]:
    """Return values with which a condition is tried first: of other recordings, of another unit or sign."""
    if positive:
        return list(dict.fromkeys([stated, *usual, *(stated * factor for factor in UNITS)]))
    angles = [stated, *usual, -stated, np.radians(stated), np.degrees(stated), 0.5 * np.pi - stated]
    return list(dict.fromkeys(one for one in angles if abs(one) <= np.pi))


def _changed(one: Recording, name: Name, value: float) -> Recording:
    return replace(one, condition=replace(one.condition, **{name: value}))
