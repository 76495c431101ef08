"""Build the finding from a finished search: verdict, location, validation, and the next experiment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Literal

import numpy as np

from wingfit.diagnosis.evidence.fit import with_measured_jacobian
from wingfit.diagnosis.evidence.intervals import gene_values
from wingfit.diagnosis.evidence.nominal import Nominal
from wingfit.diagnosis.evidence.refit import Refit, contribution, refit_at
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import (
    Advice,
    Finding,
    Floors,
    GeneValue,
    Interval,
    Proof,
    RecordingMisfit,
    Where,
    in_milli,
)
from wingfit.diagnosis.location import maps
from wingfit.diagnosis.location.differences import cause_location, residual_location
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
from wingfit.diagnosis.verdict.next_experiment import rank_conditions, separations
from wingfit.diagnosis.verdict.noise_remarks import drift_sentence, noise_remarks
from wingfit.diagnosis.verdict.proof import ResidualPair, predict_held_out, proof, recording_misfits
from wingfit.diagnosis.verdict.verdict import Decision, decide, hypotheses, summary
from wingfit.records import Recording

Step = tuple[float, str, Finding | None]

WORSE_FACTOR = 1.1  # times the misfit before: recordings that fit worse than that get a remark


def build_finding(state: SearchState, name: str, held_out: Sequence[Recording]) -> Iterator[Step]:
    """Build the finding of a finished search; yields the fraction of the work done, the stage, and the finding last.

    ``name``: of the dataset; ``held_out``: recordings with which the result is validated.
    """
    nominal, weights = state.fitted_nominal.refit, state.final_weights
    decision = decide(weights)
    best = nominal if decision.verdict == "adequate" else decision.best
    yield 0.0, "computing the intervals of the genes", None
    best = replace(best, fit=with_measured_jacobian(state.context, best.fit))
    yield 0.05, "predicting the held-out recordings", None
    validation, failed = predict_held_out(held_out, state.context, nominal.fit, best.fit)
    missing = MissingPhysics()
    if decision.verdict == "unnamed" or _is_load(decision, best):
        for fraction, stage, located in _locate(state, unnamed=decision.verdict == "unnamed"):
            missing = located
            yield 0.15 + 0.6 * fraction, stage, None
    advice: tuple[Advice, ...] = ()
    if decision.verdict != "adequate":
        apart = []
        for part, one in separations(state.context, weights):
            apart += [one] if one else []
            yield 0.75 + 0.2 * part, "comparing conditions to record next", None
        advice = rank_conditions(state.data, weights, apart)
    location = _where(state, decision, best, missing)
    found = _finding(state, name, decision, best, validation, missing, advice, location)
    yield 1.0, "done", replace(found, remarks=(*found.remarks, *failed))


def _is_load(decision: Decision, best: Refit) -> bool:
    """Return whether the named effects act as loads: faults of a drive or camera move markers without a load."""
    families = {trial.suspect.family for trial in best.trials}
    return decision.verdict in ("named", "ambiguous") and not families & {"actuation", "measurement"}


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
    if decision.verdict in ("named", "measurement fault"):
        acts = contribution(state.context, best)
        data, coefficients = (data, coefficients) if acts is None else (data.noiseless, acts)
    found = residual_location(data, maps.recording_residuals(state.subject, data, coefficients), coefficients)
    shown_refit = state.fitted_nominal.refit if decision.verdict == "unnamed" else best
    own = {gene.name: gene.value for gene in gene_values(state.data, shown_refit)}
    span = _effect_location(shown_refit, own, "span") or missing.place.span
    chord = _effect_location(shown_refit, own, "chord") or missing.place.chord
    phase = missing.place.phase if decision.verdict != "measurement fault" else None
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


def _finding(
    state: SearchState,
    name: str,
    decision: Decision,
    best: Refit,
    validation: ResidualPair | None,
    missing: MissingPhysics,
    advice: tuple[Advice, ...],
    location: Where,
) -> Finding:
    subject, data, weights = state.subject, state.data, state.final_weights
    nominal, discretisation = state.fitted_nominal.refit, _discretisation_error(state)
    own = ResidualPair(data, nominal.fit.residuals, best.fit.residuals)
    rows = recording_misfits(own, held_out=False, floor=discretisation)
    shown = list(maps.overlays(subject, data, own.before, own.after, held_out=False))
    kind = data.recordings[0].kind
    unit: Literal["m", "N"] = "m" if kind == "tracks" else "N"
    proved = None
    if validation is not None:
        rows += recording_misfits(validation, held_out=True, floor=discretisation)
        proved = proof(validation, discretisation, unit, effects_added=bool(best.names))
        shown += maps.overlays(subject, validation.data, validation.before, validation.after, held_out=True)
    before, after = (maps.recording_residuals(subject, data, one.fit.coefficients) for one in (nominal, best))
    suspects, genes = {suspect.name: suspect for suspect in subject.suspects}, gene_values(data, best)
    weights = replace(weights, refits=tuple(best if one.names == best.names else one for one in weights.refits))
    return Finding(
        dataset=name,
        kind=kind,
        unit=unit,
        model=subject.description,
        verdict=decision.verdict,
        summary=summary(decision, suspects, _summary_texts(data, nominal, best, location.words, proved))
        + drift_sentence(data),
        probabilities=decision.probabilities,
        named=decision.named,
        added_effects=best.names,
        strength=float(np.sqrt(1.0 + max(nominal.excess, 0.0) / data.noise**2)),
        floors=_floors(state, discretisation),
        hypotheses=hypotheses(data, weights, state.trials),
        indistinguishable=decision.alternatives,
        where=location if decision.verdict != "adequate" else None,
        markers=maps.markers(before, after),
        phase_map=maps.phase_map(before, after),
        missing=missing.loads,
        recordings=rows,
        proof=proved,
        overlays=tuple(shown),
        genes=genes,
        law=missing.law,
        advice=advice,
        outline=subject.outline,
        remarks=(
            *state.fitted_nominal.remarks,
            *_refinement_remarks(state.fitted_nominal),
            *noise_remarks(data, unit),
            *_unidentified_sizes(genes, best),
            *_worsened(rows, best, unit),
        ),
    )


def _discretisation_error(state: SearchState) -> float:
    """Return the misfit (m or N) by the discretisation: at most the best residual, 0 if a finer one fits no better."""
    nominal = state.fitted_nominal
    if nominal.discretisation_error is None or nominal.tried_finer:
        return 0.0
    least = min(one.excess for one in state.final_weights.refits)
    return min(nominal.discretisation_error, float(np.sqrt(max(least, 0.0))))


def _floors(state: SearchState, discretisation: float) -> Floors:
    data, nominal = state.data, state.fitted_nominal
    lag1 = float(np.median([beat_fit.lag1 for beat_fit in data.beat_fits]))
    total = float(np.sqrt(data.noise**2 + discretisation**2 + data.tolerance**2))
    error = None if nominal.discretisation_error is None else discretisation
    return Floors(data.noise, lag1, error, nominal.finer, data.tolerance, total)


def _summary_texts(
    data: WhitenedData, nominal: Refit, best: Refit, place: str, proved: Proof | None
) -> Mapping[str, str]:
    """Return the parts of the summary as text, by the names that :func:`summary` uses; ``place``: of the misfit."""
    unit = "m" if data.recordings[0].kind == "tracks" else "N"
    before, after = (np.sqrt(data.noise**2 + max(one.excess, 0.0)) for one in (nominal, best))
    return {
        "before": in_milli(before, unit),
        "after": in_milli(after, unit),
        "noise": in_milli(data.noise, unit),
        "where": place,
        "held_out": f"On {proved.words}."
        if proved
        else "No held-out recording could be predicted, so the result is not validated.",
    }


def _refinement_remarks(nominal: Nominal) -> tuple[str, ...]:
    remark = f"a finer discretisation ({nominal.tried_finer}) hardly fits better: the discretisation is not the cause"
    return (remark,) if nominal.tried_finer else ()


def _unidentified_sizes(genes: Sequence[GeneValue], best: Refit) -> tuple[str, ...]:
    """Return a remark on size genes of added effects whose interval is not bounded; empty if there are none."""
    sizes = {name for trial in best.trials for name in trial.suspect.size_genes}
    open_ = [one.name for one in genes if one.name in sizes and one.value.low is None and one.value.high is None]
    return (f"these recordings do not identify {', '.join(open_)}: its interval is not bounded",) if open_ else ()


def _worsened(rows: Sequence[RecordingMisfit], best: Refit, unit: str) -> tuple[str, ...]:
    """Return a remark on recordings that fit worse with the added effects; empty if there are none."""
    worse = [
        f"{row.name} from {1e3 * row.before.value:.3g} to {in_milli(row.after.value, unit)}"
        for row in rows
        if best.names and row.after.value > WORSE_FACTOR * row.before.value
    ]
    return (f"with the added effects the misfit increases in {', '.join(worse)}",) if worse else ()
