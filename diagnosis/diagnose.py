"""A diagnosis from beginning to end: recordings and a model in, a finding out."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from calibration.evaluator import Evaluator
from calibration.plan import plan, prepared
from diagnosis import maps
from diagnosis.advise import advised
from diagnosis.assess import Assessment, assess
from diagnosis.conclude import all_genes, decided, hypotheses, summary
from diagnosis.finding import Finding, Floors, Proof
from diagnosis.nominal import Nominal
from diagnosis.proof import Predicted, predicted, proof, recording_misfits
from diagnosis.refit import Refit
from diagnosis.rigs import subject_of
from diagnosis.spec import DiagnosisSpec, Progress
from diagnosis.stack import Stack
from diagnosis.subject import Subject
from diagnosis.where import where
from records import Dataset, Recording


def check(dataset: Dataset, spec: DiagnosisSpec) -> None:
    """ValueError, for the user, where ``spec`` does not fit ``dataset``; nothing is simulated."""
    subject, fitted, _, _ = _prepared(dataset, spec)
    Stack.of(fitted, _axes(dataset, spec))
    known = {suspect.name for suspect in subject.suspects}
    for name in spec.suspects:
        if name not in known:
            raise ValueError(f"unknown suspect {name!r}; for this rig there are {', '.join(sorted(known))}")


def diagnose(dataset: Dataset, spec: DiagnosisSpec, evaluator: Evaluator) -> Iterator[Progress]:
    """Diagnose ``dataset``; the last report has the finding. ValueError where ``spec`` does not fit."""
    subject, fitted, held_out, free = _prepared(dataset, spec)
    yield from diagnose_subject(
        subject, dataset.name, fitted, held_out, spec, evaluator, free=free, axes=_axes(dataset, spec)
    )


def diagnose_subject(
    subject: Subject,
    name: str,
    fitted: Sequence[Recording],
    held_out: Sequence[Recording],
    spec: DiagnosisSpec,
    evaluator: Evaluator,
    *,
    free: tuple[str, ...] = (),
    axes: tuple[str, ...] = (),
) -> Iterator[Progress]:
    """Diagnose any rig that meets the protocol; ``free`` are the nominal genes to fit (default: those searched)."""
    began = time.monotonic()
    yield Progress(0.0, "reading the recordings", 0)
    state = Assessment(subject, Stack.of(fitted, axes))
    for fraction, stage in assess(state, spec, free or tuple(subject.model.searched), evaluator):
        yield Progress(fraction, stage, state.evaluations)
    yield Progress(0.92, "predicting the held-out recordings", state.evaluations)
    finding = _finding(state, name, held_out, evaluator)
    yield Progress(
        1.0,
        "done",
        state.evaluations,
        replace(finding, seconds=time.monotonic() - began, evaluations=state.evaluations),
    )


def _prepared(
    dataset: Dataset, spec: DiagnosisSpec
) -> tuple[Subject, tuple[Recording, ...], tuple[Recording, ...], tuple[str, ...]]:
    """Subject, recordings that are fitted and held out, as they are fitted, and the free genes."""
    calibration = replace(spec.calibration, mode="joint", axes=_axes(dataset, spec) or spec.calibration.axes)
    (stage,) = plan(calibration, dataset)
    held_out = tuple(prepared(calibration, r) for r in dataset.recordings if r.name in dataset.held_out)
    return subject_of(dataset, calibration), stage.recordings, held_out, stage.free


def _axes(dataset: Dataset, spec: DiagnosisSpec) -> tuple[str, ...]:
    if dataset.kind == "tracks":
        return ()
    shared = [axis for axis in ("x", "z") if all(axis in one.forces for one in dataset.recordings)]
    return spec.axes or tuple(shared)


def _finding(state: Assessment, name: str, held_out: Sequence[Recording], evaluator: Evaluator) -> Finding:
    subject, stack, nominal, weighed = state.subject, state.stack, state.nominal, state.weighed
    if nominal is None or weighed is None:
        raise ValueError("a finding needs an assessment that has ended")
    decision = decided(weighed)
    best = nominal.refit if decision.verdict == "adequate" else decision.best
    own = Predicted(stack, nominal.refit.fit.residuals, best.fit.residuals)
    division = _division(state)
    rows = recording_misfits(own, held_out=False, floor=division)
    proved, shown = None, list(maps.overlays(subject, stack, own.before, own.after, held_out=False))
    remarks = [*nominal.remarks, *_doubts(state)]
    if held_out:
        other = Stack.of(held_out, stack.axes)
        seen = predicted(other, evaluator, nominal.refit.fit, best.fit)
        rows += recording_misfits(seen, held_out=True, floor=division)
        unit = "m" if stack.recordings[0].kind == "tracks" else "N"
        proved = proof(seen, division, unit)
        if not seen.failed:
            shown += maps.overlays(subject, other, seen.before, seen.after, held_out=True)
    before, after = (maps.pieces(subject, stack, one.fit.coefficients) for one in (nominal.refit, best))
    lacks = where(stack, before, nominal.refit.fit.coefficients)
    return Finding(
        dataset=name,
        kind=stack.recordings[0].kind,
        unit="m" if stack.recordings[0].kind == "tracks" else "N",
        model=subject.told,
        verdict=decision.verdict,
        summary=summary(
            decision,
            {s.name: s for s in subject.suspects},
            _told(stack, nominal.refit, best, lacks.words, proved),
        ),
        probabilities=decision.probabilities,
        named=decision.named,
        strength=_strength(stack, nominal.refit.excess),
        floors=_floors(state, nominal),
        hypotheses=hypotheses(stack, weighed, state.trials),
        alike=decision.alike,
        where=lacks,
        markers=maps.markers(before, after),
        phase_map=maps.phase_map(before, after),
        missing=(),
        recordings=rows,
        proof=proved,
        overlays=tuple(shown),
        genes=all_genes(stack, best),
        law=None,
        advice=advised(subject, stack, weighed, evaluator),
        outline=subject.outline,
        remarks=tuple(remarks),
    )


def _division(state: Assessment) -> float:
    """Misfit that the model's division leaves: what a finer one says, but no more than the best explanation leaves."""
    if state.nominal is None or state.weighed is None or state.nominal.division is None:
        return 0.0
    least = min(one.excess for one in state.weighed.refits)
    return min(state.nominal.division, float(np.sqrt(max(least, 0.0))))


def _strength(stack: Stack, excess: float) -> float:
    return float(np.sqrt(1.0 + max(excess, 0.0) / stack.noise**2))


def _floors(state: Assessment, nominal: Nominal) -> Floors:
    stack = state.stack
    memory = float(np.median([view.memory for view in stack.views]))
    total = float(np.sqrt(stack.noise**2 + _division(state) ** 2 + stack.tolerance**2))
    return Floors(stack.noise, memory, nominal.division, nominal.finer, stack.tolerance, total)


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
        "held_out": f"On {proved.words}." if proved else "No recording is held out, so that nothing proves it.",
    }


def _doubts(state: Assessment) -> list[str]:
    remarks = []
    untold = [r.name for r, v in zip(state.stack.recordings, state.stack.views, strict=True) if not v.told]
    if untold:
        remarks.append(
            f"{', '.join(untold)}: less than two beats in the order of the frames, so that noise is known only from "
            "what no harmonic of the beat explains; slow noise may pass for misfit"
        )
    return remarks
