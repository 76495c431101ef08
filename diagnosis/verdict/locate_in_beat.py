"""Locate the misfit of a rig with a beat: on the wing, in the beat, and as a missing load."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice
from typing import Literal

from wingfit.diagnosis.evidence.intervals import gene_values
from wingfit.diagnosis.evidence.refit import Refit, contribution, refit_at
from wingfit.diagnosis.finding import NAMING, Interval, Where
from wingfit.diagnosis.location import maps
from wingfit.diagnosis.location.differences import cause_location, residual_location
from wingfit.diagnosis.location.located import Located
from wingfit.diagnosis.location.missing_load import LoadPlace
from wingfit.diagnosis.location.missing_physics import (
    MissingPhysics,
    largest_residuals,
    load_estimates,
    missing_forces,
    missing_physics,
)
from wingfit.diagnosis.location.pulse_phase import locate_pulse
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.subject import beat_subject
from wingfit.diagnosis.verdict.proof import ResidualPair
from wingfit.diagnosis.verdict.verdict import Decision, is_measurement_fault
from wingfit.diagnosis.verdict.weigh_hypotheses import only_changes

Step = tuple[float, str, Located | None]

DRIFT = Where("beats differ; the mean beat fits within the noise and shows no place", None, None, None, "", ())


def locate_in_beat(
    state: SearchState, decision: Decision, best: Refit, fitted: ResidualPair, held_out: ResidualPair | None
) -> Iterator[Step]:
    """Locate the misfit of the nominal model, and that of the fit ``best``; yields fraction, stage, the result last.

    ``fitted``, ``held_out``: residuals of both, in the recordings that were fitted and in those that were predicted.
    """
    subject, data, missing = beat_subject(state.subject), state.data, MissingPhysics()
    nominal, drifting = state.fitted_nominal.refit, _only_changes(state, decision)
    if not drifting and (decision.verdict == "unnamed" or _is_load(decision, best)):
        for fraction, stage, found in _locate(state, unnamed=decision.verdict == "unnamed"):
            missing = found
            yield fraction, stage, None
    before, after = (maps.recording_residuals(subject, data, one.fit.coefficients) for one in (nominal, best))
    shown = list(maps.overlays(subject, data, fitted.before, fitted.after, held_out=False))
    if held_out is not None:
        shown += maps.overlays(subject, held_out.data, held_out.before, held_out.after, held_out=True)
    located = Located(
        where=DRIFT if drifting else _where(state, decision, best, missing),
        overlays=tuple(shown),
        markers=maps.markers(before, after),
        phase_map=maps.phase_map(before, after),
        missing=missing.loads,
        law=missing.law,
        outline=subject.outline,
    )
    yield 1.0, "locating the missing physics", located


def _only_changes(state: SearchState, decision: Decision) -> bool:
    """Return whether only a drift speaks against the nominal model: then its misfit shows no place on the wing."""
    nominal = state.fitted_nominal
    floor = state.floor(nominal.possible_error)
    return decision.verdict in ("unnamed", "ambiguous") and only_changes(state.data, nominal.refit, floor)


def _is_load(decision: Decision, best: Refit) -> bool:
    """Return whether the named effects act as loads: faults of a drive or camera move markers without a load."""
    families = {trial.suspect.family for trial in best.trials}
    return decision.verdict in (*NAMING, "ambiguous") and not families & {"actuation", "measurement"}


def _locate(state: SearchState, *, unnamed: bool) -> Iterator[tuple[float, str, MissingPhysics]]:
    """Locate the missing physics; yields the fraction done, the stage, and the result, which is empty until the last.

    If no effect was named (``unnamed``), a finer model is probed too, and a free-form law is fitted.
    """
    data, nominal = state.data, state.fitted_nominal.refit
    if data.recordings[0].kind == "forces":
        when = locate_pulse(state.context, nominal.fit) if unnamed else None
        loads = missing_forces(state.context, nominal)
        yield 1.0, "locating the missing force", MissingPhysics(loads, LoadPlace(phase=when))
        return
    models, which = [(state.subject, nominal)], largest_residuals(data, nominal)
    for finer in islice(state.context.finer(), int(unnamed)):
        yield 0.0, f"fitting a {finer.subject.description}", MissingPhysics()
        fitted = refit_at(finer, nominal)
        models += [(finer.subject, fitted)] if fitted is not None else []
    found = []
    for k, (name, guess) in enumerate(load_estimates(models, data, which)):
        yield k / ((len(which) + 1.0) * len(models)), f"probing the wing under {name}", MissingPhysics()
        found += [guess] if guess is not None else []
    yield 1.0, "locating the missing physics", missing_physics(found, law=unnamed)


def _where(state: SearchState, decision: Decision, best: Refit, missing: MissingPhysics) -> Where:
    """Return where the misfit lies or, for a named effect, where the effect acts (a fit spreads a misfit in time)."""
    data, coefficients = state.data, state.fitted_nominal.refit.fit.coefficients
    if decision.verdict in NAMING:
        plain = replace(data, errors=None)  # what an effect does, also where errors of positions could explain it
        fit = replace(best.fit, coefficients=plain.coefficients_of(best.fit.residuals))
        acts = contribution(replace(state.context, data=plain), replace(best, fit=fit))
        data, coefficients = (data, coefficients) if acts is None else (data.noiseless, acts)
    found = residual_location(
        data, maps.recording_residuals(beat_subject(state.subject), data, coefficients), coefficients
    )
    shown_refit = state.fitted_nominal.refit if decision.verdict == "unnamed" else best
    own = {gene.name: gene.value for gene in gene_values(state.data, shown_refit)}
    span = _effect_location(shown_refit, own, "span") or missing.place.span
    chord = _effect_location(shown_refit, own, "chord") or missing.place.chord
    phase = None if decision.verdict in NAMING and is_measurement_fault(best) else missing.place.phase
    return replace(
        found,
        words=found.words + cause_location(span, chord, phase, drive_error=missing.drive_error),
        span=span or found.span,
        chord=chord or found.chord,
        phase=phase or found.phase,
    )


def _effect_location(best: Refit, genes: Mapping[str, Interval], along: Literal["span", "chord"]) -> Interval | None:
    """Return the location ``along`` the wing from the effect's own ``genes`` (by name); None where it has none."""
    named = (trial.suspect.location_genes for trial in best.trials)
    return next((genes[one[along]] for one in named if along in one), None)
