"""Build the finding from a finished search: verdict, location, validation, and the next experiment."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from wingfit.checks.mistake import Mistake
from wingfit.diagnosis.advice.advise import advise
from wingfit.diagnosis.advice.advised import Advice
from wingfit.diagnosis.evidence.fit import with_measured_jacobian
from wingfit.diagnosis.evidence.intervals import gene_values
from wingfit.diagnosis.evidence.nominal import Nominal
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import CONFIDENT, Finding, Floors, GeneValue, Proof, RecordingMisfit, amount
from wingfit.diagnosis.location.in_series import channel_misfits, series_location, series_overlays
from wingfit.diagnosis.location.located import Located
from wingfit.diagnosis.location.series_law import series_law
from wingfit.diagnosis.rig_subject import RigSubject
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.subject import Subject
from wingfit.diagnosis.verdict.fitted_models import fitted_models
from wingfit.diagnosis.verdict.held_out import held_out_refutes
from wingfit.diagnosis.verdict.locate_in_beat import locate_in_beat
from wingfit.diagnosis.verdict.mistakes import MistakeDoubt
from wingfit.diagnosis.verdict.noise_remarks import drift_sentence, marker_remarks, noise_remarks
from wingfit.diagnosis.verdict.odd_recording import OddRecording, doubted_by_odd, odd_recordings, odd_sentences
from wingfit.diagnosis.verdict.proof import (
    ResidualPair,
    fitted_residuals,
    predict_held_out,
    proof,
    recording_misfits,
)
from wingfit.diagnosis.verdict.reservations import (
    accepted_error_sentence,
    accepted_sentence,
    candidate_sentence,
    discretisation_sentence,
    doubted_by_discretisation,
    doubted_by_held_out,
    held_out_sentence,
    judged_by_accepted_error,
    missed_sentence,
    noise_sentence,
    partly,
    remaining_sentence,
    unpredicted,
)
from wingfit.diagnosis.verdict.series_remarks import series_remarks
from wingfit.diagnosis.verdict.verdict import Decision, decide, hypotheses, summary
from wingfit.diagnosis.verdict.weigh_hypotheses import explains_drift
from wingfit.records import AnyRecording

Step = tuple[float, str, Finding | None]

OUTLYING = 5.0  # times the median misfit of the others, and times the floor: a recording with more gets a remark
LEAST_COMPARED = 2  # recordings with which another one is compared
WORSE_FACTOR = 1.1  # times the misfit before: recordings that fit worse than that get a remark


def build_finding(
    state: SearchState, name: str, held_out: Sequence[AnyRecording], mistakes: tuple[Mistake, ...] = ()
) -> Iterator[Step]:
    """Build the finding of a finished search; yields the fraction of the work done, the stage, and the finding last.

    ``name``: of the dataset; ``held_out``: recordings with which the result is validated; ``mistakes``: likely ones in
    the fitted recordings.
    """
    nominal, weights = state.fitted_nominal.refit, state.final_weights
    floor = state.floor(_discretisation_error(state))
    decision = judged_by_accepted_error(decide(weights), state.data, weights, floor)
    decision = partly(decision, state.data, nominal, floor)
    certain = doubted_by_discretisation(decision, state.data, nominal, state.proven_floor, weights.floor)
    doubt = MistakeDoubt(mistakes, [one.name for one in state.suspects], state.spec.calibration.effects)
    decision = doubt.applied(certain)
    odd: tuple[OddRecording, ...] = ()
    for stage, found_odd in odd_recordings(state, held_out) if decision.verdict != "adequate" else ():
        odd = found_odd
        yield 0.0, stage, None
    named, decision = decision.named, doubted_by_odd(decision, odd)
    best = nominal if decision.verdict == "adequate" else decision.best
    yield 0.03, "computing the intervals of the genes", None
    best = replace(best, fit=with_measured_jacobian(state.context, best.fit))
    yield 0.05, "predicting the held-out recordings", None
    validation, failed = predict_held_out(held_out, state.context, state.position_errors, nominal.fit, best.fit)
    own = fitted_residuals(state.context, state.position_errors, nominal.fit, best.fit)
    refuted = (
        decision.verdict == "adequate"
        and validation is not None
        and held_out_refutes(state.context, best.fit, validation, state.floor(_discretisation_error(state)))
    )
    proved = None if validation is None else _proved(state, validation, best)
    none_predicts = proved is not None and _none_predicts(state, decision, best, held_out, proved)
    located: Located | None = None
    for fraction, stage, found in _locate(state, decision, best, own, validation, refuted=refuted):
        located = found
        yield 0.15 + 0.6 * fraction, stage, None
    if located is None:
        raise ValueError("the misfit was not located")
    advice: tuple[Advice, ...] = ()
    if decision is certain and (decision.verdict != "adequate" or decision.probabilities["adequate"] < CONFIDENT):
        rest = decision.verdict == "partly named"
        for part, ranked in advise(state.context, state.final_weights, floor, rest=rest):
            advice = ranked
            yield 0.75 + 0.2 * part, "comparing what to record next", None
    finding = _finding(
        state, name, decision, best, own, validation, proved, advice, located, odd, named, refuted=refuted,
        none_predicts=none_predicts,
    )  # fmt: skip
    finding = replace(finding, remarks=(*finding.remarks, *failed))
    yield 1.0, "done", doubt.stated(finding, certain, decision)


def _proved(state: SearchState, validation: ResidualPair, model: Refit) -> Proof:
    """Return the misfit of what is held out, which the nominal model and ``model`` predict as in ``validation``."""
    floor = state.floor(_discretisation_error(state))
    return proof(validation, floor, state.data.unit, effects_added=bool(model.names))


def _none_predicts(
    state: SearchState, decision: Decision, best: Refit, held_out: Sequence[AnyRecording], proved: Proof
) -> bool:
    """Return whether none of the effects that recordings cannot distinguish predicts what is held out.

    ``proved``: the prediction by ``best``, one of them.
    """

    def misses(one: Refit) -> bool:
        nominal, errors = state.fitted_nominal.refit.fit, state.position_errors
        validation, _ = predict_held_out(held_out, state.context, errors, nominal, one.fit)
        return validation is None or unpredicted(decision, _proved(state, validation, one), state.data)

    if decision.verdict != "ambiguous" or not unpredicted(decision, proved, state.data):
        return False
    possible = {frozenset(one) for one in decision.alternatives} - {frozenset(best.names)}
    return all(misses(one) for one in state.final_weights.refits if frozenset(one.names) in possible)


def _locate(
    state: SearchState,
    decision: Decision,
    best: Refit,
    fitted: ResidualPair,
    held_out: ResidualPair | None,
    *,
    refuted: bool,
) -> Iterator[tuple[float, str, Located | None]]:
    """Locate the misfit; ``refuted``: by the held-out recordings alone, so that it lies there."""
    if state.data.kind != "series":
        yield from locate_in_beat(state, decision, best, fitted, held_out)
        return
    data, nominal = state.data, state.fitted_nominal.refit.fit
    coefficients = nominal.coefficients
    shown = list(series_overlays(data, fitted.before, fitted.after, held_out=False))
    if held_out is not None:
        shown += series_overlays(held_out.data, held_out.before, held_out.after, held_out=True)
    if refuted and held_out is not None:
        where = series_location(held_out.data, held_out.data.coefficients_of(held_out.before), held_out.before)
    else:
        where = series_location(data, coefficients, fitted.before)
    channels = channel_misfits(data, coefficients, best.fit.coefficients)
    law = series_law(data, nominal, _input_units(state.subject)) if decision.verdict == "unnamed" else None
    yield 1.0, "locating the misfit", Located(where, tuple(shown), law=law, channels=channels)


def _input_units(subject: Subject) -> Mapping[str, str]:
    return subject.model.rig.inputs if isinstance(subject, RigSubject) else {}


def _finding(
    state: SearchState,
    name: str,
    decision: Decision,
    best: Refit,
    fitted: ResidualPair,
    validation: ResidualPair | None,
    proved: Proof | None,
    advice: tuple[Advice, ...],
    located: Located,
    odd: tuple[OddRecording, ...],
    named: tuple[str, ...],
    *,
    refuted: bool,
    none_predicts: bool,
) -> Finding:
    subject, data, weights = state.subject, state.data, state.final_weights
    nominal, floor, unit = state.fitted_nominal.refit, state.floor(_discretisation_error(state)), state.data.unit
    rows = recording_misfits(fitted, held_out=False, floor=floor)
    decided, first = decide(weights), decision
    if validation is not None:
        rows += recording_misfits(validation, held_out=True, floor=floor)
        decision = doubted_by_held_out(decision, proved, data, refuted=refuted, none_predicts=none_predicts)
    suspects, genes = {suspect.name: suspect for suspect in subject.suspects}, gene_values(data, best)
    weights = replace(weights, refits=tuple(best if one.names == best.names else one for one in weights.refits))
    return Finding(
        dataset=name,
        kind=data.kind,
        unit=unit,
        model=subject.description,
        verdict=decision.verdict,
        summary=summary(decision, suspects, _summary_texts(data, nominal, best, located, proved))
        + ("" if data.kind == "series" else _drift_sentence(data, nominal, best))
        + remaining_sentence(data, decision, best, floor, weights.floor)
        + discretisation_sentence(decision, data, nominal, state.proven_floor, weights.floor)
        + missed_sentence(data, decision, nominal, weights.floor)
        + candidate_sentence(data, decision, weights, suspects)
        + accepted_error_sentence(decided, judged_by_accepted_error(decided, data, weights, floor))
        + accepted_sentence(data, decision, nominal, floor)
        + noise_sentence(data, decision, nominal)
        + held_out_sentence(first, proved, data, refuted=refuted, none_predicts=none_predicts)
        + odd_sentences(odd, unit, withheld=bool(named) and not first.named),
        probabilities=decision.probabilities,
        named=decision.named,
        added_effects=best.names,
        strength=float(np.sqrt(1.0 + max(nominal.excess, 0.0) / data.noise**2)),
        floors=_floors(state),
        hypotheses=hypotheses(data, weights, state.trials, decision),
        indistinguishable=decision.alternatives,
        where=located.where if decision.verdict != "adequate" else None,
        markers=located.markers,
        phase_map=located.phase_map,
        missing=located.missing,
        recordings=rows,
        proof=proved,
        overlays=located.overlays,
        genes=genes,
        law=located.law,
        advice=advice,
        outline=located.outline,
        channels=located.channels,
        fitted=fitted_models(data, weights, best),
        remarks=(
            *state.fitted_nominal.remarks,
            *_refinement_remarks(state.fitted_nominal),
            *_noise_remarks(data, nominal, unit, decision),
            *marker_remarks(data, state.position_errors, best.fit),
            *_unidentified_sizes(genes, best),
            *_worsened(rows, best, unit),
            *_outlying(rows, unit, {one.name for one in odd}),
        ),
    )


def _drift_sentence(data: WhitenedData, nominal: Refit, best: Refit) -> str:
    return drift_sentence(data, explained=bool(best.names) and explains_drift(data, nominal, best))


def _noise_remarks(data: WhitenedData, nominal: Refit, unit: str, decision: Decision) -> tuple[str, ...]:
    if data.kind == "series":
        return series_remarks(data, nominal.fit, adequate=decision.verdict == "adequate")
    return noise_remarks(data, unit)


def _discretisation_error(state: SearchState) -> float:
    """Return the misfit (m or N) by the discretisation: at most the best residual, 0 if a finer one fits no better."""
    if state.fitted_nominal.limited:
        return state.fitted_nominal.remaining_error
    least = min(one.excess for one in state.final_weights.refits)
    return min(state.fitted_nominal.possible_error, float(np.sqrt(max(least, 0.0))))


def _floors(state: SearchState) -> Floors:
    data, nominal, discretisation = state.data, state.fitted_nominal, _discretisation_error(state)
    lag1, floor = float(np.median([one.lag1 for one in data.reduced])), state.floor(discretisation)
    total = float(np.sqrt(data.noise**2 + floor**2 + data.tolerance**2 + data.accepted**2))
    error = None if nominal.discretisation_error is None else discretisation
    return Floors(data.noise, lag1, error, nominal.finer, data.tolerance, total, state.floor(0.0))


def _summary_texts(
    data: WhitenedData, nominal: Refit, best: Refit, located: Located, proved: Proof | None
) -> Mapping[str, str]:
    """Return the parts of the summary as text, by the names that :func:`summary` uses."""
    before, after = (np.sqrt(data.noise**2 + max(one.excess, 0.0)) for one in (nominal, best))
    if data.kind == "series":
        noise = ", ".join(f"{one.noise:.3g} {one.unit} in {one.name}" for one in located.channels)
    else:
        noise = amount(data.noise, data.unit)
    return {
        "before": amount(before, data.unit),
        "after": amount(after, data.unit),
        "noise": noise,
        "where": located.where.words,
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


def _bare(value: float, unit: str) -> str:
    """Return ``value`` as :func:`amount` does, without its unit."""
    return amount(value, unit).split(" ")[0]


def _worsened(rows: Sequence[RecordingMisfit], best: Refit, unit: str) -> tuple[str, ...]:
    """Return a remark on recordings that fit worse with the added effects; empty if there are none."""
    worse = [
        f"{row.name} from {_bare(row.before.value, unit)} to {amount(row.after.value, unit)}"
        for row in rows
        if best.names and row.after.value > WORSE_FACTOR * row.before.value
    ]
    return (f"with the added effects the misfit increases in {', '.join(worse)}",) if worse else ()


def _outlying(rows: Sequence[RecordingMisfit], unit: str, odd: Collection[str] = ()) -> tuple[str, ...]:
    """Return a remark on a recording that the model "after" misses far more than the others; empty if there is none.

    A series, whose misfit may depend on what was done in it, gets none; nor do ``odd`` ones, which the summary names.
    """
    *others, worst = sorted(rows, key=lambda row: row.after.value)
    if len(others) < LEAST_COMPARED or worst.flap_frequency_hz is None or worst.name in odd:
        return ()
    usual = float(np.median([row.after.value for row in others]))
    if worst.after.value < OUTLYING * max(usual, worst.floor):
        return ()
    missed = f"{amount(worst.after.value, unit)}, and half of the others by {amount(usual, unit)} or less"
    return (
        f"the model misses {worst.name} by {missed}: something acts there that they do not show, or the recording has "
        "a mistake (axes, signs, unit, start of the beat)",
    )
