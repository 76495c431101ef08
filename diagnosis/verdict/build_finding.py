"""From an assessment to a finding: what was decided, where, how sure, the proof, and what to record next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis.evidence.fit import measured
from wingfit.diagnosis.evidence.nominal import Nominal
from wingfit.diagnosis.evidence.refit import Refit, action, again
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.finding import Advice, Finding, Floors, GeneValue, Interval, Proof, RecordingMisfit, Where
from wingfit.diagnosis.location import maps
from wingfit.diagnosis.location.differences import acting, where
from wingfit.diagnosis.location.pulse_phase import pulse
from wingfit.diagnosis.location.unexplained import Unexplained, guesses, largest, missing_forces, unexplained
from wingfit.diagnosis.search_state import Assessment
from wingfit.diagnosis.verdict.next_experiment import advised, separations
from wingfit.diagnosis.verdict.proof import Predicted, predicted, proof, recording_misfits
from wingfit.diagnosis.verdict.verdict import Decision, all_genes, decided, hypotheses, summary
from wingfit.inference.noise.harmonic import still_markers
from wingfit.records import Recording

Array = npt.NDArray[np.float64]
Step = tuple[float, str, Finding | None]

WORSE = 1.1  # times the misfit before: a recording that is fitted worse is told


def concluded(state: Assessment, name: str, held_out: Sequence[Recording], evaluator: Evaluator) -> Iterator[Step]:
    """Make the finding of an assessment that has ended; yields the part of the work done and what comes next."""
    if state.nominal is None or state.weighed is None:
        raise ValueError("a finding needs an assessment that has ended")
    decision = decided(state.weighed)
    best = state.nominal.refit if decision.verdict == "adequate" else decision.best
    yield 0.0, "measuring how well genes are told", None
    best = replace(best, fit=measured(state.subject, state.stack, evaluator, best.fit))
    yield 0.05, "predicting the held-out recordings", None
    seen, failed = predicted(held_out, state.stack.axes, evaluator, state.nominal.refit.fit, best.fit)
    lacking = Unexplained()
    if decision.verdict == "unnamed" or _is_load(decision, best):
        for fraction, stage, told in _lacking(state, evaluator, unnamed=decision.verdict == "unnamed"):
            lacking = told
            yield 0.15 + 0.6 * fraction, stage, None
    advice: tuple[Advice, ...] = ()
    if decision.verdict != "adequate":
        apart = []
        for part, one in separations(state.subject, state.stack, state.weighed, evaluator):
            apart += [one] if one else []
            yield 0.75 + 0.2 * part, "comparing conditions to record next", None
        advice = advised(state.stack, state.weighed, apart)
    lies = _where(state, decision, best, lacking, evaluator)
    found = _finding(state, name, decision, best, seen, lacking, advice, lies)
    yield 1.0, "done", replace(found, remarks=(*found.remarks, *failed))


def _is_load(decision: Decision, best: Refit) -> bool:
    """Whether what was named acts as a load: a drive or a camera that is off moves markers without any."""
    families = {trial.suspect.family for trial in best.trials}
    return decision.verdict in ("named", "ambiguous") and not families & {"actuation", "measurement"}


def _lacking(state: Assessment, evaluator: Evaluator, *, unnamed: bool) -> Iterator[tuple[float, str, Unexplained]]:
    """What is lacking, recording by recording; of what is ``unnamed`` by a finer division as well, and with a law."""
    stack, nominal = state.stack, state.known.refit
    if stack.recordings[0].kind == "forces":
        when = pulse(state.subject, stack, nominal.fit) if unnamed else None
        loads = missing_forces(state.subject, stack, nominal)
        yield 1.0, "locating the missing force", Unexplained(loads, pulse=when)
        return
    models, which = [(state.subject, nominal)], largest(stack, nominal)
    for finer in state.subject.finer()[:1] if unnamed else ():
        yield 0.0, f"fitting a {finer.told}", Unexplained()
        fitted = again(finer, stack, evaluator, nominal)
        models += [(finer, fitted)] if fitted is not None else []
    found = []
    for k, (name, guess) in enumerate(guesses(models, stack, which)):
        yield k / ((len(which) + 1.0) * len(models)), f"probing the wing under {name}", Unexplained()
        found += [guess] if guess is not None else []
    yield 1.0, "locating what is missing", unexplained(found, law=unnamed)


def _where(state: Assessment, decision: Decision, best: Refit, lacking: Unexplained, evaluator: Evaluator) -> Where:
    """Where the misfit lies; of an effect that is named, where this acts: the fit smears a misfit over the beat."""
    stack, coefficients = state.stack, state.known.refit.fit.coefficients
    if decision.verdict in ("named", "measurement fault"):
        acts = action(stack, evaluator, best)
        stack, coefficients = (stack, coefficients) if acts is None else (stack.noiseless, acts)
    found = where(stack, maps.pieces(state.subject, stack, coefficients), coefficients)
    held = state.known.refit if decision.verdict == "unnamed" else best  # the nearest is not what is lacking
    own = {gene.name: gene.value for gene in all_genes(state.stack, held)}
    span, chord = (_placed(held, own, "span") or lacking.span, _placed(held, own, "chord") or lacking.chord)
    phase = lacking.phase if decision.verdict != "measurement fault" else None
    return Where(
        found.words + acting(span, chord, phase, driven=lacking.driven),
        span or found.span,
        chord or found.chord,
        phase or found.phase,
        found.axis,
        found.harmonics,
        found.exponents,
    )


def _placed(best: Refit, genes: Mapping[str, Interval], along: Literal["span", "chord"]) -> Interval | None:
    """Where the effect itself says that it acts, by its own ``genes``; None where it has no place."""
    return next((genes[one.suspect.places[along]] for one in best.trials if along in one.suspect.places), None)


def _finding(
    state: Assessment,
    name: str,
    decision: Decision,
    best: Refit,
    seen: Predicted | None,
    lacking: Unexplained,
    advice: tuple[Advice, ...],
    lies: Where,
) -> Finding:
    subject, stack, weighed = state.subject, state.stack, state.weighed
    if state.nominal is None or weighed is None:
        raise ValueError("a finding needs an assessment that has ended")
    nominal, division = state.nominal.refit, _division(state)
    own = Predicted(stack, nominal.fit.residuals, best.fit.residuals)
    rows = recording_misfits(own, held_out=False, floor=division)
    shown = list(maps.overlays(subject, stack, own.before, own.after, held_out=False))
    kind = stack.recordings[0].kind
    unit: Literal["m", "N"] = "m" if kind == "tracks" else "N"
    proved = None
    if seen is not None:
        rows += recording_misfits(seen, held_out=True, floor=division)
        proved = proof(seen, division, unit, put_in=bool(best.names))
        shown += maps.overlays(subject, seen.stack, seen.before, seen.after, held_out=True)
    before, after = (maps.pieces(subject, stack, one.fit.coefficients) for one in (nominal, best))
    suspects, genes = {suspect.name: suspect for suspect in subject.suspects}, all_genes(stack, best)
    told = replace(weighed, refits=tuple(best if one.names == best.names else one for one in weighed.refits))
    return Finding(
        dataset=name,
        kind=kind,
        unit=unit,
        model=subject.told,
        verdict=decision.verdict,
        summary=summary(decision, suspects, _told(stack, nominal, best, lies.words, proved)),
        probabilities=decision.probabilities,
        named=decision.named,
        put_in=best.names,
        strength=float(np.sqrt(1.0 + max(nominal.excess, 0.0) / stack.noise**2)),
        floors=_floors(state, division),
        hypotheses=hypotheses(stack, told, state.trials),
        alike=decision.alike,
        where=lies if decision.verdict != "adequate" else None,
        markers=maps.markers(before, after),
        phase_map=maps.phase_map(before, after),
        missing=lacking.loads,
        recordings=rows,
        proof=proved,
        overlays=tuple(shown),
        genes=genes,
        law=lacking.law,
        advice=advice,
        outline=subject.outline,
        remarks=(
            *state.nominal.remarks,
            *_innocence(state.nominal),
            *_doubts(stack),
            *_untold(genes, best),
            *_worsened(rows, best, unit),
        ),
    )


def _division(state: Assessment) -> float:
    """Misfit that the model's division leaves: what a finer one says, but no more than the best explanation leaves.

    None of it where a finer division fits no better.
    """
    if state.nominal is None or state.weighed is None or state.nominal.division is None or state.nominal.innocent:
        return 0.0
    least = min(one.excess for one in state.weighed.refits)
    return min(state.nominal.division, float(np.sqrt(max(least, 0.0))))


def _floors(state: Assessment, division: float) -> Floors:
    stack, nominal = state.stack, state.known
    memory = float(np.median([view.lag1 for view in stack.views]))
    total = float(np.sqrt(stack.noise**2 + division**2 + stack.tolerance**2))
    left = None if nominal.division is None else division
    return Floors(stack.noise, memory, left, nominal.finer, stack.tolerance, total)


def _told(stack: Stack, nominal: Refit, best: Refit, place: str, proved: Proof | None) -> Mapping[str, str]:
    """What the summary is made of, in words."""
    unit = "mm" if stack.recordings[0].kind == "tracks" else "mN"

    def size(excess: float) -> str:
        return f"{1e3 * np.sqrt(stack.noise**2 + max(excess, 0.0)):.3g} {unit}"

    return {
        "before": size(nominal.excess),
        "after": size(best.excess),
        "noise": f"{1e3 * stack.noise:.3g} {unit}",
        "where": place,
        "held_out": f"On {proved.words}."
        if proved
        else "No held-out recording could be predicted, so that nothing proves it.",
    }


def _innocence(nominal: Nominal) -> tuple[str, ...]:
    if not nominal.innocent:
        return ()
    return (f"a finer division ({nominal.innocent}) was fitted and hardly did better: the division is not what limits",)


def _doubts(stack: Stack) -> tuple[str, ...]:
    untold = [r.name for r, v in zip(stack.recordings, stack.views, strict=True) if not v.between_beats]
    still = {r.name: still_markers(r) for r in stack.recordings}
    doubts = [
        f"{name}: the recorded place of {', '.join(markers)} never changes; left out: check how tracks are exported"
        for name, markers in still.items()
        if markers
    ]
    if untold:
        doubts.append(
            f"{', '.join(untold)}: less than two beats in the order of the frames, so that noise is known only from "
            "what no harmonic of the beat explains; slow noise may pass for misfit"
        )
    return tuple(doubts)


def _untold(genes: Sequence[GeneValue], best: Refit) -> tuple[str, ...]:
    """Sizes of what was put in that may lie anywhere in their boxes."""
    sizes = {name for trial in best.trials for name in trial.suspect.sizes}
    open_ = [one.name for one in genes if one.name in sizes and one.value.low is None and one.value.high is None]
    return (f"these recordings do not tell how large {', '.join(open_)} is",) if open_ else ()


def _worsened(rows: Sequence[RecordingMisfit], best: Refit, unit: str) -> tuple[str, ...]:
    """Recordings that what was put in makes worse."""
    name = "mm" if unit == "m" else "mN"
    worse = [
        f"{row.name} from {1e3 * row.before.value:.3g} to {1e3 * row.after.value:.3g} {name}"
        for row in rows
        if best.names and row.after.value > WORSE * row.before.value
    ]
    return (f"with what was found the misfit grows in {', '.join(worse)}",) if worse else ()
