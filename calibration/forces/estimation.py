"""Computes the result of a calibration on forces: estimates with errors, a global model, agreements, predictions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wingfit.calibration.effects import absent, is_measured
from wingfit.calibration.estimates.changing_beat import changing_beat_remarks
from wingfit.calibration.estimates.likelihood import STEP, at_bounds, iterate
from wingfit.calibration.estimates.linearised import free_genes
from wingfit.calibration.estimates.uncertainty import IDENTIFIABLE, Standing, Uncertainty, uncertainty
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.agreement import POINTS, agreements, comparison, quantities
from wingfit.calibration.forces.disagreement import disagreement_remarks, disagreements
from wingfit.calibration.forces.global_model import at, average, fit_global
from wingfit.calibration.forces.result import (
    Agreement,
    ForceComparison,
    ForceResult,
    GlobalModel,
    LocalEstimate,
    Quantity,
    Source,
)
from wingfit.calibration.forces.split_beats import Cut
from wingfit.calibration.preparation import Stage, as_fitted, prepare
from wingfit.calibration.problem import Problem, base_genome, compared
from wingfit.calibration.result import ADEQUATE, GeneResult
from wingfit.calibration.search import found as found_by_stage
from wingfit.calibration.spec import CalibrationSpec, resolved, vehicle_model
from wingfit.inference.noise.between_beats import FEWEST_MEAN, without_mean_beat
from wingfit.records import Condition, Dataset, Genome, Recording
from wingfit.records.array_types import Array, Mask
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing


@dataclass(frozen=True)
class Prediction:
    """Forces that a global model predicts for a condition, over one beat and unfiltered.

    ``phase`` [n] is t*, the time in beats; ``forces`` [n] in N, by quantity; ``values`` are the coefficients under the
    condition, by gene; ``remarks`` warn of extrapolation.
    """

    phase: Array
    forces: Mapping[Quantity, Array]
    values: Mapping[str, float]
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class _Judged:
    """A stage with its best genome, the uncertainty ``known`` of this genome, and the estimate made of both."""

    stage: Stage
    genome: Genome
    known: Uncertainty
    estimate: LocalEstimate


@dataclass(frozen=True)
class _Compared:
    """One recording compared with models: agreements, and RMS difference (N) of the fitted axes by source of the model.

    ``samples`` counts the values compared. ``scatter`` is the RMS (N) of the noise in these axes, the part of the
    forces that does not repeat from beat to beat; None with too few beats.
    """

    recording: Recording
    agreements: tuple[Agreement, ...]
    rms: Mapping[Source, float]
    samples: int
    scatter: float | None


@one_blas_thread
def summarise_forces(
    spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any]
) -> ForceResult:
    """Compare the estimates of a calibration with every recording of the dataset, held-out ones included.

    ``checkpoint`` is that of the last generation. A global model is fitted to local estimates (mode "local"). A
    recording that was not fitted is predicted by the global model or, without one, by the joint estimate or the average
    of the local estimates.
    """
    ready = prepare(spec, dataset)
    spec, model, best = ready.spec, vehicle_model(dataset, spec), found_by_stage(spec, dataset, checkpoint)
    judged = [
        _judge(stage, model, base_genome(model, best[stage.name]), spec, evaluator)
        for stage in ready.stages
        if stage.name in best
    ]
    law, remarks = _global(spec, dataset, [one.estimate for one in judged])
    nominal = base_genome(model, spec.fixed)
    everywhere = []
    for recording in dataset.recordings:
        genomes, warnings = _sources(spec, model, nominal, judged, law, recording)
        everywhere.append(_compare(model, as_fitted(spec, recording), genomes, spec.axes))
        remarks = (*remarks, *warnings)
    misfits = [_misfit_remark(one, everywhere) for one in judged]
    drift = changing_beat_remarks((as_fitted(spec, recording) for recording in dataset.recordings), spec.axes)
    apart = disagreement_remarks([one.estimate for one in judged])
    remarks = (*apart, *remarks, *(remark for remark in misfits if remark), *drift, *_filtered_before(spec, dataset))
    names = {name for one in judged for name in one.estimate.recordings}
    left_out, warnings = _left_out(model, spec, dataset, nominal, [one.estimate for one in judged]) if law else ((), ())
    fitted = [one for one in everywhere if one.recording.name in names]
    held_out = [one for one in everywhere if one.recording.name in dataset.held_out]
    return ForceResult(
        genes=_genes(model, nominal, judged, not any(misfits)),
        estimates=tuple(one.estimate for one in judged),
        global_model=law,
        agreements=tuple(agreement for one in everywhere for agreement in one.agreements),
        left_out=left_out,
        held_out=dataset.held_out,
        before=_rms(fitted, ("nominal",)) or np.nan,
        after=_rms(fitted, ("local", "joint")) or np.nan,
        held_out_before=_rms(held_out, ("nominal",)),
        held_out_after=_rms(held_out, ("global", "joint", "average")),
        noise=_noise(everywhere),
        remarks=tuple(dict.fromkeys((*remarks, *warnings))),
    )


@one_blas_thread
def compare_forces(
    spec: CalibrationSpec, dataset: Dataset, recording: str, source: Source, genome: Mapping[str, float]
) -> ForceComparison:
    """Compare forces of ``genome`` (all genes, by name) with the recording called ``recording``, both low-passed."""
    spec = resolved(spec, dataset)
    model, record = vehicle_model(dataset, spec), as_fitted(spec, dataset.recording(recording))
    return comparison(record, _observed(model, record, [base_genome(model, genome)])[0], source)


@one_blas_thread
def predict(
    spec: CalibrationSpec, dataset: Dataset, law: GlobalModel, condition: Condition, points: int = POINTS
) -> Prediction:
    """Predict the forces over one beat under any ``condition``, at ``points`` instants, from the global model ``law``.

    Coefficients are limited to the bounds of their genes. The forces are those on the vehicle: estimated faults of the
    measurement are not added.
    """
    spec = resolved(spec, dataset)
    model = vehicle_model(dataset, spec)
    law = replace(law, genes=tuple(gene for gene in law.genes if not is_measured(gene.name)))
    fixed = {name: value for name, value in spec.fixed.items() if not is_measured(name)}
    values, remarks = _by_law(model, law, condition)
    times = np.arange(points) / (points * condition.flap_frequency)
    blank = Recording(
        "prediction", "wind_tunnel", condition, times, (), np.full((points, 2), np.nan), forces=("x", "z")
    )
    forces = _observed(model, blank, [base_genome(model, fixed).replace(values)])[0]
    phase = np.arange(points) / points
    return Prediction(phase, quantities(blank, forces), values, remarks)


def _by_law(
    model: BladeElementWing, law: GlobalModel, condition: Condition
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Evaluate the global model ``law`` under ``condition``; return the coefficients by name, and remarks.

    A coefficient outside the bounds of its gene is set to the nearest bound, with a remark.
    """
    found = at(law, condition)
    values, remarks = dict(found.values), list(found.remarks)
    for gene in model.genes:
        if gene.name in values and not gene.lower <= values[gene.name] <= gene.upper:
            held = min(max(values[gene.name], gene.lower), gene.upper)
            remarks.append(
                f"the global model gives {gene.name} = {values[gene.name]:.4g} here, outside [{gene.lower:g}, "
                f"{gene.upper:g}]; {held:g} is taken: the condition is too far from those fitted to be believed"
            )
            values[gene.name] = held
    return values, tuple(remarks)


def _observed(model: BladeElementWing, recording: Recording, genomes: list[Genome]) -> Array:
    """Simulate ``recording`` with B ``genomes``; return forces [B, T, C] in N. ValueError if one of them fails."""
    observed = model.observe([genome.values for genome in genomes], recording)
    for reason in observed.reasons:
        if reason is not None:
            raise ValueError(f"the forces under {recording.name!r} cannot be computed: {reason}")
    return observed.channels


def _judge(
    stage: Stage, model: BladeElementWing, genome: Genome, spec: CalibrationSpec, evaluator: Evaluator
) -> _Judged:
    problem = Problem(model, stage.recordings, stage.free, genome, spec.axes)
    known = uncertainty(problem, evaluator)
    values = {name: genome[name] for name in stage.free}
    last = next(iterate(problem, evaluator, values))
    estimate = LocalEstimate(
        name=stage.name,
        recordings=tuple(recording.name for recording in stage.recordings),
        values=values,
        standard_errors=known.standard_errors,
        correlation=tuple(tuple(row) for row in known.correlation.tolist()),
        noise=tuple(tuple(tuple(row) for row in matrix.tolist()) for matrix in known.noise),
        cost=known.cost,
        converged=last.step <= STEP,
        remarks=(
            *at_bounds(free_genes(problem), values),
            *absent(genome.as_dict(), stage.free),
            *known.remarks,
        ),
    )
    return _Judged(stage, genome, known, estimate)


def _global(
    spec: CalibrationSpec, dataset: Dataset, estimates: list[LocalEstimate]
) -> tuple[GlobalModel | None, tuple[str, ...]]:
    """Fit the global model (Armanini et al. 2016, Eq. 23) to local estimates; return it and remarks.

    No model if the mode is not "local" or, with a remark that says why, if the estimates do not determine one.
    """
    if spec.mode != "local":
        return None, ()
    try:
        law = fit_global(estimates, [dataset.recording(e.recordings[0]).condition for e in estimates])
    except ValueError as error:
        return None, (f"no global model: {error}",)
    return law, law.remarks


def _sources(
    spec: CalibrationSpec,
    model: BladeElementWing,
    nominal: Genome,
    judged: list[_Judged],
    law: GlobalModel | None,
    recording: Recording,
) -> tuple[dict[Source, Genome], tuple[str, ...]]:
    """Return the genomes to compare with ``recording``, by source, and warnings about the global model there."""
    found: dict[Source, Genome] = {"nominal": nominal}
    warnings: tuple[str, ...] = ()
    for one in judged:
        if spec.mode != "local":
            found["joint"] = one.genome
        elif recording.name in one.estimate.recordings:
            found["local"] = one.genome
    if law is not None:
        values, said = _by_law(model, law, recording.condition)
        found["global"] = nominal.replace(values)
        warnings = tuple(f"recording {recording.name!r}: {remark}" for remark in said)
    if spec.mode == "local":
        found["average"] = nominal.replace(average([one.estimate for one in judged]))
    return found, warnings


def _compare(
    model: BladeElementWing, recording: Recording, genomes: dict[Source, Genome], axes: tuple[str, ...]
) -> _Compared:
    forces = dict(zip(genomes, _observed(model, recording, list(genomes.values())), strict=True))
    fitted = np.zeros(recording.values.shape, bool)
    if set(axes) <= set(recording.forces):  # one that is only predicted may have others
        fitted = compared(recording, axes)
    differences = {source: (found - recording.values)[fitted] for source, found in forces.items()}
    rms: dict[Source, float] = {s: float(np.sqrt(np.mean(d**2))) for s, d in differences.items() if d.size}
    found = tuple(a for source, modelled in forces.items() for a in agreements(recording, modelled, source))
    return _Compared(recording, found, rms, int(fitted.sum()), _scatter(recording, fitted))


def _scatter(recording: Recording, fitted: Mask) -> float | None:
    beats = len(Cut.of(recording).gapless)
    if beats < FEWEST_MEAN or not fitted.any():
        return None
    noise = without_mean_beat(recording, np.where(fitted, recording.values, 0.0), beats)
    return float(np.sqrt(np.mean(noise[fitted] ** 2)))


def _misfit_remark(judged: _Judged, everywhere: list[_Compared]) -> str | None:
    """Return a remark if the residual of an estimate is larger than noise explains, else None."""
    mine = [c for c in everywhere if c.recording.name in judged.estimate.recordings and c.scatter is not None]
    left = _rms(mine, ("local", "joint"))
    if left is None:
        return None
    noise = _noise(mine) or 0.0
    if left <= ADEQUATE * noise:
        return None
    ratio = f"{left / noise:.2g} times the scatter from beat to beat" if noise > 0 else "with no scatter between beats"
    return (
        f"{judged.estimate.name}: the residual of the best coefficients is {left * 1e3:.3g} mN, {ratio}: the model or "
        f"its motion misses physics ('wingfit effects' lists what can be added), or the search was cut short. Standard "
        f"errors assume at most {ADEQUATE:g} times the scatter, so no coefficient counts as identifiable"
    )


def _noise(some: list[_Compared]) -> float | None:
    """Return the RMS (N) of the noise over all samples of the recordings ``some``; None if it is known of none."""
    known = [(one.scatter, one.samples) for one in some if one.scatter is not None and one.samples]
    if not known:
        return None
    return float(np.sqrt(np.sum([scatter**2 * count for scatter, count in known]) / sum(count for _, count in known)))


def _rms(some: list[_Compared], order: tuple[Source, ...]) -> float | None:
    """Return the RMS difference (N) over all samples of the recordings ``some``; None if none has the fitted axes.

    Each recording is compared with the first source in ``order`` for which it has a difference.
    """
    usable = [one for one in some if one.samples]
    if not usable:
        return None
    squares = [next((one.rms[s] for s in order if s in one.rms), np.nan) ** 2 * one.samples for one in usable]
    return float(np.sqrt(np.sum(squares) / sum(one.samples for one in usable)))


def _left_out(
    model: BladeElementWing,
    spec: CalibrationSpec,
    dataset: Dataset,
    nominal: Genome,
    estimates: list[LocalEstimate],
) -> tuple[tuple[Agreement, ...], tuple[str, ...]]:
    """Leave out each fitted recording in turn, fit the global model to the others, and compare it with the recording.

    Returns the agreements, and remarks on these models. A recording is skipped if the others determine no model.
    """
    found: list[Agreement] = []
    remarks: list[str] = []
    for one in estimates:
        law, said = _global(spec, dataset, [other for other in estimates if other is not one])
        if law is None:
            remarks += [f"with a recording left out: {remark}" for remark in said]
            continue
        recording = as_fitted(spec, dataset.recording(one.recordings[0]))
        values, said = _by_law(model, law, recording.condition)
        remarks += [f"recording {recording.name!r} left out: {remark}" for remark in said]
        found += agreements(recording, _observed(model, recording, [nominal.replace(values)])[0], "global")
    return tuple(found), tuple(remarks)


def _filtered_before(spec: CalibrationSpec, dataset: Dataset) -> tuple[str, ...]:
    """Return remarks on recordings to which the requested low-pass was not applied, as they have another one."""
    return tuple(
        f"recording {recording.name!r} says that it has been low-passed at {recording.low_pass.cutoff:g} Hz; "
        f"{spec.low_pass:g} Hz was not applied to it"
        for recording in dataset.recordings
        if spec.low_pass and recording.low_pass is not None and recording.low_pass.cutoff != spec.low_pass
    )


def _genes(model: BladeElementWing, nominal: Genome, judged: list[_Judged], adequate: bool) -> tuple[GeneResult, ...]:
    """Summarise each gene over all estimates: mean value, largest standard error, whether identifiable in all of them.

    Where the estimates of a gene disagree (:func:`disagreements`), its error is at least their standard deviation.
    ``adequate``: noise explains the residual of every estimate; otherwise no gene counts as identifiable.
    """
    apart = disagreements([one.estimate for one in judged])
    best = nominal.replace(average([one.estimate for one in judged]))
    results = []
    for gene in model.genes:
        standings = [one.known.standing[gene.name] for one in judged if gene.name in one.known.standing]
        inside = all(0.0 < float(gene.to_unit(one.genome[gene.name])) < 1.0 for one in judged)
        worst = None
        if standings:
            identifiable = adequate and all(s.identifiable for s in standings) and inside
            largest, absolute = max(s.standard_error for s in standings), max(s.absolute for s in standings)
            worst = Standing(largest, identifiable, absolute)
            if gene.name in apart and absolute < apart[gene.name]:
                relative = largest * apart[gene.name] / absolute
                worst = Standing(relative, identifiable and relative <= IDENTIFIABLE, apart[gene.name])
        results.append(GeneResult.of(gene, nominal[gene.name], best[gene.name], worst))
    return tuple(results)
