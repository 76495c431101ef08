"""Run a diagnosis: prepare the recordings, search for missing physics, and build the finding."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.preparation import prepare, prepare_rig
from wingfit.calibration.problem import base_genome
from wingfit.calibration.spec import CalibrationSpec
from wingfit.checks import examine
from wingfit.checks.guard import is_finding
from wingfit.checks.mistake import Mistake
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.rig_subject import RigSubject
from wingfit.diagnosis.rigs import subject_of
from wingfit.diagnosis.search import run_search
from wingfit.diagnosis.search_report import PartialFindings
from wingfit.diagnosis.search_state import CountingEvaluator, SearchState
from wingfit.diagnosis.spec import DiagnosisSpec, Progress
from wingfit.diagnosis.subject import Subject, select_suspects
from wingfit.diagnosis.verdict.build_finding import build_finding
from wingfit.diagnosis.verdict.frame import frame_refuted
from wingfit.inference.noise.series_fit import SeriesReduction
from wingfit.records import AnyDataset, AnyRecording, Dataset, FrameError, Series, SeriesDataset
from wingfit.records.blas_threads import one_blas_thread
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel
from wingfit.sim.vehicle.terms import DRAG

MOST_IN_PAIRS = 20  # suspects of which every pair can be fitted
SEARCH_FRACTION = 0.7  # of the work; the rest locates the missing physics and validates the hypothesis
STATED_FRAME = 0.9  # of the search: with the stated errors of the frame; the rest is for where they are refuted


@one_blas_thread
def check(dataset: Dataset, spec: DiagnosisSpec) -> None:
    """Raise ValueError where ``spec`` does not fit ``dataset``; simulates nothing."""
    subject, fitted, held_out, _ = _prepare(dataset, spec)
    axes = _axes(dataset, spec)
    WhitenedData.of(fitted, axes)
    for recording in held_out:
        WhitenedData.of([recording], axes)
    _check_search(subject, spec)


def _check_search(subject: Subject, spec: DiagnosisSpec) -> None:
    suspects = len(select_suspects(subject, spec.suspects))
    if spec.exhaustive and suspects > MOST_IN_PAIRS:
        raise ValueError(
            f"exhaustive fits every pair of suspects, and there are {suspects}: name at most {MOST_IN_PAIRS}"
        )
    base_genome(subject.model, {**spec.start, **spec.calibration.fixed})
    if spec.refits < 1:
        raise ValueError(f"refits is {spec.refits}; at least 1 effect must be refitted: give 1 or more")


@one_blas_thread
def diagnose(dataset: Dataset, spec: DiagnosisSpec, evaluator: Evaluator) -> Iterator[Progress]:
    """Diagnose ``dataset``; yields progress, with the finding last. ValueError where ``spec`` does not fit."""
    subject, fitted, held_out, free = _prepare(dataset, spec)
    _check_search(subject, spec)
    axes, frame = _axes(dataset, spec), dataset.frame_error
    mistakes, noted = _likely_mistakes(dataset, fitted)
    yield from diagnose_subject(
        subject, dataset.name, fitted, held_out, spec, evaluator,
        free=free, axes=axes, frame=frame, mistakes=mistakes, noted=noted,
    )  # fmt: skip


@one_blas_thread
def diagnose_rig(rig: Rig, dataset: SeriesDataset, spec: DiagnosisSpec, evaluator: Evaluator) -> Iterator[Progress]:
    """Diagnose ``dataset`` with the user's simulation ``rig``; as :func:`diagnose`.

    Of ``spec.calibration``, the effects, genes, fixed values and recordings count; settings that describe wings and
    vehicles are refused.
    """
    subject, fitted, held_out, free = _prepare_rig(rig, dataset, spec)
    _check_search(subject, spec)
    series = SeriesReduction.of(dataset.recordings, fitted)
    mistakes, _ = _likely_mistakes(dataset, fitted)
    yield from diagnose_subject(
        subject, dataset.name, fitted, held_out, spec, evaluator, free=free, series=series, mistakes=mistakes
    )


@one_blas_thread
def check_diagnosis_of_rig(rig: Rig, dataset: SeriesDataset, spec: DiagnosisSpec) -> None:
    """Raise ValueError where ``spec`` does not fit ``rig`` and ``dataset``; simulates nothing."""
    subject, fitted, held_out, _ = _prepare_rig(rig, dataset, spec)
    data = WhitenedData.of(fitted, (), spec.policy, SeriesReduction.of(dataset.recordings, fitted))
    for recording in held_out:
        data.like([recording])
    _check_search(subject, spec)


@one_blas_thread
def diagnose_subject(
    subject: Subject,
    name: str,
    fitted: Sequence[AnyRecording],
    held_out: Sequence[AnyRecording],
    spec: DiagnosisSpec,
    evaluator: Evaluator,
    *,
    free: tuple[str, ...] = (),
    axes: tuple[str, ...] = (),
    series: SeriesReduction | None = None,
    frame: FrameError | None = None,
    mistakes: tuple[Mistake, ...] = (),
    noted: tuple[str, ...] = (),
) -> Iterator[Progress]:
    """Diagnose any rig that implements :class:`Subject`; yields progress, the finding with the last report.

    ``name``: of the dataset; ``fitted``, ``held_out``: recordings to fit and to validate with; ``free``: nominal genes
    to fit (empty: all that a calibration searches); ``axes``: force axes to fit (empty: the default); ``series``: how
    recordings without a beat are reduced; ``frame``: errors of the frame of tracks; ``mistakes``: likely ones in the
    fitted recordings; ``noted``: further remarks.
    """
    began = time.monotonic()
    yield Progress(0.0, "reading the recordings", 0)
    held_out, copies = _without_copies(fitted, held_out)
    counted = CountingEvaluator(evaluator)
    context = FitContext(subject, WhitenedData.of(fitted, axes, spec.policy, series), counted)
    genes, refuted, done = free or tuple(subject.model.searched), tuple[str, ...](), 0.0
    for tried in (frame, None) if frame else (None,):
        state, known = SearchState(context, spec, frame_error=tried), PartialFindings()
        until = STATED_FRAME if tried else 1.0
        for fraction, stage in run_search(state, genes):
            part = SEARCH_FRACTION * (done + (until - done) * fraction)
            yield Progress(part, stage, counted.evaluations, partial=known.of(state))
        done, beyond = until, frame_refuted(state)
        if beyond is None:
            break
        refuted = (beyond,)
    finding: Finding | None = None
    for fraction, stage, found in build_finding(state, name, held_out, mistakes):
        finding = found
        yield Progress(SEARCH_FRACTION + (1.0 - SEARCH_FRACTION) * fraction, stage, counted.evaluations)
    if finding is None:
        raise ValueError("the diagnosis ended without a finding")
    spent, evaluations = time.monotonic() - began, counted.evaluations
    remarks = (*refuted, *finding.remarks, *copies, *_repeated(fitted, held_out), *noted)
    finding = replace(finding, remarks=remarks, seconds=spent, evaluations=evaluations, versions=_versions())
    yield Progress(1.0, "done", evaluations, finding)


def _likely_mistakes(
    dataset: AnyDataset, fitted: Sequence[AnyRecording]
) -> tuple[tuple[Mistake, ...], tuple[str, ...]]:
    """Return the likely mistakes in ``dataset`` that the ``fitted`` recordings show, and remarks on the others."""

    def found(examined: AnyDataset) -> tuple[Mistake, ...]:
        return tuple(one for one in examine(examined) if is_finding(one))

    names = {one.name for one in fitted}
    mistakes, others = found(dataset), [one.name for one in dataset.recordings if one.name not in names]
    if not (mistakes and others and isinstance(dataset, Dataset)):
        return mistakes, ()
    alone = replace(dataset, recordings=tuple(one for one in dataset.recordings if one.name in names), held_out=())
    kinds = {one.kind for one in found(alone)}
    shown = tuple(one for one in mistakes if one.kind in kinds)
    unseen = "likely mistake in the dataset that the fitted recordings do not show: "
    return shown, tuple(f"{unseen}{one}" for one in mistakes if one not in shown)


def _without_copies(
    fitted: Sequence[AnyRecording], held_out: Sequence[AnyRecording]
) -> tuple[tuple[AnyRecording, ...], tuple[str, ...]]:
    """Return ``held_out`` without copies of fitted recordings, which validate nothing, and a remark for each copy."""
    known = {one.values.tobytes(): one.name for one in reversed(fitted)}
    copies = {one.name: known[one.values.tobytes()] for one in held_out if one.values.tobytes() in known}
    remarks = [
        f"held-out recording {name} is a copy of {other}, which is fitted: it cannot validate the fit and was ignored"
        for name, other in copies.items()
    ]
    return tuple(one for one in held_out if one.name not in copies), tuple(remarks)


def _repeated(fitted: Sequence[AnyRecording], held_out: Sequence[AnyRecording]) -> tuple[str, ...]:
    """Return a remark on held-out series that repeat fitted experiments; empty if there are none."""
    known = {one.repeats for one in fitted if isinstance(one, Series) and one.repeats}
    names = [one.name for one in held_out if isinstance(one, Series) and one.repeats in known]
    remark = (
        f"held out, but repeats of fitted experiments: {', '.join(names)}; they test the noise and hardly the model: "
        "hold out all repeats of an experiment"
    )
    return (remark,) if names else ()


def _versions() -> dict[str, str]:
    """Return the versions of the installed packages that the numbers depend on, by name."""
    found = {}
    for name in ("wingfit", "numpy", "scipy", "numba"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _prepare(
    dataset: Dataset, spec: DiagnosisSpec
) -> tuple[Subject, tuple[AnyRecording, ...], tuple[AnyRecording, ...], tuple[str, ...]]:
    """Return the rig, the recordings to fit and those held out (all low-passed as for the fit), and the free genes."""
    axes = _axes(dataset, spec) or spec.calibration.axes
    calibration = replace(spec.calibration, mode="joint", axes=axes, search_division=None)  # there is no search
    ready = prepare(calibration, dataset)
    (stage,) = ready.stages
    subject = subject_of(dataset, calibration)
    return subject, stage.recordings, ready.held_out, _with_drag(stage.free, subject, calibration)


def _with_drag(free: tuple[str, ...], subject: Subject, spec: CalibrationSpec) -> tuple[str, ...]:
    """Return the ``free`` genes, with the drag coefficients of a vehicle even if forces along one axis are fitted.

    A calibration of such forces keeps their defaults, which do not describe every wing: then the drag would look like
    missing physics.
    """
    if spec.genes:
        return free
    known = [gene.name for gene in subject.model.genes]
    return tuple(name for name in known if name in free or (name in DRAG and name not in spec.fixed))


def _prepare_rig(
    rig: Rig, dataset: SeriesDataset, spec: DiagnosisSpec
) -> tuple[RigSubject, tuple[Series, ...], tuple[Series, ...], tuple[str, ...]]:
    """Return the rig, the recordings to fit and those held out, and the free genes; as :func:`_prepare`."""
    ready = prepare_rig(spec.calibration, rig, dataset)
    (stage,) = ready.stages
    if not isinstance(ready.model, RigModel):
        raise TypeError("a rig has a model of its own")
    fitted = dataset.select(one.name for one in stage.recordings)
    return RigSubject(ready.model), fitted, dataset.select(dataset.held_out), stage.free


def _axes(dataset: Dataset, spec: DiagnosisSpec) -> tuple[str, ...]:
    if dataset.kind == "tracks":
        return ()
    shared = [axis for axis in ("x", "z") if all(axis in one.forces for one in dataset.recordings)]
    return spec.axes or tuple(shared)
