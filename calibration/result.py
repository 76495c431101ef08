"""The result of a calibration on tracks: genes with their errors, misfits before and after, simulated tracks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.effects import absent
from wingfit.calibration.estimates.changing_beat import changing_beat_remarks
from wingfit.calibration.estimates.uncertainty import Correlations, GeneCovariance, Standing, gene_errors
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.preparation import prepare
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.spec import CalibrationSpec, wing_model
from wingfit.inference.noise.harmonic import noise_distance
from wingfit.records import Dataset, Gene, Genome
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.model import Solution
from wingfit.sim.wing.alignment import recorded_crossing

CONTRADICTION = 0.2  # spans: a larger misfit is no missing physics, but tracks that contradict the description
ADEQUATE = 1.3  # times the tracking noise: the largest misfit that noise is taken to explain


@dataclass(frozen=True)
class GeneResult:
    """One gene after a calibration; weights of a group (``Gene.share_of``) are divided by their sum, bounds 0 and 1.

    ``nominal`` is its value before, ``best`` after. ``standard_error`` is relative to the value
    (:mod:`wingfit.calibration.estimates.uncertainty`), ``absolute_error`` in ``unit``. ``identifiable`` is true for an
    error of at most 7.5 %, a value not at its bounds, and a misfit that noise explains (ADEQUATE). All three are None
    if the gene was not searched.
    """

    name: str
    unit: str
    description: str
    nominal: float
    best: float
    lower: float
    upper: float
    searched: bool
    standard_error: float | None
    identifiable: bool | None
    absolute_error: float | None = None

    @classmethod
    def of(cls, gene: Gene, nominal: float, best: float, found: Standing | None) -> GeneResult:
        """Make the result of ``gene``; ``found`` has its standard error, or is None if the gene was not searched."""
        lower, upper = (gene.lower, gene.upper) if gene.share_of is None else (0.0, 1.0)
        error, identifiable, absolute = (
            (found.standard_error, found.identifiable, found.absolute) if found else [None] * 3
        )
        searched = found is not None
        return cls(
            gene.name, gene.unit, gene.description, nominal, best, lower, upper, searched, error, identifiable, absolute
        )


@dataclass(frozen=True)
class RecordingResult:
    """Misfit to one recording: mean distance per marker (m), ``before`` (nominal genome) and ``after`` (best genome).

    ``stage`` is the stage that fitted the recording, None if none did; ``samples`` counts (frame, marker) pairs.
    """

    name: str
    held_out: bool
    stage: str | None
    samples: int
    before: float
    after: float


@dataclass(frozen=True)
class Result:
    """Outcome of a calibration on tracks; all distances in m, means over recordings weighted by samples.

    ``before`` and ``after`` are the mean distances of the nominal and of the best genome on the fitted recordings,
    ``held_out_before`` and ``held_out_after`` on the held-out ones (None without any). ``noise`` is the mean distance
    by tracking noise alone, from the scatter between beats, None if unknown. ``remarks`` are warnings about the result.
    ``covariance`` is that of the genes whose standard errors are known; those of different stages are independent.
    ``correlations`` are those of the genes that were estimated together, for each stage.
    """

    genes: tuple[GeneResult, ...]
    recordings: tuple[RecordingResult, ...]
    before: float
    after: float
    held_out_before: float | None
    held_out_after: float | None
    noise: float | None
    remarks: tuple[str, ...] = ()
    covariance: GeneCovariance | None = None
    correlations: tuple[Correlations, ...] = ()


@dataclass(frozen=True)
class Comparison:
    """Simulated and recorded tracks of one recording, [T, M, 3] in m: T instants, M markers; NaN where not recorded.

    ``phase`` [T] is the phase of the beat in [0, 1), zero where the reference markers cross the hinge's height on the
    upstroke. ``accuracy`` is the largest numerical error (m) of a marker that the request allows, ``solution`` the
    numerical steps and error of the simulation.
    """

    recording: str
    phase: Array
    markers: tuple[str, ...]
    recorded: Array
    simulated: Array
    accuracy: float
    solution: Solution


@one_blas_thread
def judge(spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, genome: Mapping[str, float]) -> Result:
    """Compare a wing's ``genome`` (all genes, by name) with every recording of ``dataset``, also held-out ones."""
    ready = prepare(spec, dataset)
    model, stages = wing_model(dataset, spec), ready.stages
    nominal, best = base_genome(model, spec.fixed), base_genome(model, genome)
    both = evaluator.evaluate(
        Problem(model, dataset.recordings, tuple(g.name for g in model.genes), nominal),
        np.array([nominal.values, best.values]),
    )
    recordings = tuple(
        RecordingResult(
            recording.name,
            recording.name in dataset.held_out,
            next((stage.name for stage in stages if recording in stage.recordings), None),
            part.samples,
            float(part.distance[0]),
            float(part.distance[1]),
        )
        for recording, part in zip(dataset.recordings, both.per_recording, strict=True)
    )
    fitted = [r for r in recordings if r.stage is not None]
    held_out = [r for r in recordings if r.held_out]
    after, noise = _mean(fitted, "after"), noise_distance(dataset.recordings)
    adequate = noise is None or after <= ADEQUATE * noise
    remarks = [
        f"recording {recording.name!r} cannot be simulated with the best genome: {part.reasons[1]}"
        for recording, part in zip(dataset.recordings, both.per_recording, strict=True)
        if part.reasons[1]
    ]
    drift = changing_beat_remarks(dataset.recordings)
    if after > CONTRADICTION * dataset.wing.span:
        remarks.append(
            f"the residual of the best genome on the fitted recordings is {after * 1e3:.3g} mm, on a wing of "
            f"{dataset.wing.span * 1e3:.3g} mm: tracks and description likely disagree (axes, side of the wing, unit, "
            "flap frequency), and no discretisation or effect repairs that: check the dataset with 'wingfit datasets "
            "check'"
        )
    elif noise is not None and not adequate:
        cause = "the beat drifts (see below), the search" if drift else "the search"
        remarks.append(
            f"the residual of the best genome on the fitted recordings is {after * 1e3:.2f} mm, {after / noise:.1f} "
            f"times the tracking noise: {cause} was cut short, or the model misses physics: try a finer "
            f"discretisation, or effects ('wingfit effects' lists them). Standard errors assume at most "
            f"{ADEQUATE:g} times the noise, so no gene counts as identifiable"
        )
    remarks += drift
    remarks += absent(best.as_dict(), ready.searched)
    found = [gene_errors(Problem(model, stage.recordings, stage.free, best), evaluator) for stage in stages]
    known = {name: one for errors in found for name, one in errors.standing.items()}
    return Result(
        genes=gene_results(known, nominal, best, adequate),
        recordings=recordings,
        before=_mean(fitted, "before"),
        after=after,
        held_out_before=_mean(held_out, "before") if held_out else None,
        held_out_after=_mean(held_out, "after") if held_out else None,
        noise=noise,
        remarks=tuple(remarks),
        covariance=GeneCovariance.of_independent([one.covariance for one in found if one.covariance]),
        correlations=tuple(one.correlations for one in found if one.correlations),
    )


@one_blas_thread
def compare(spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str) -> Comparison:
    """Simulate the recording called ``recording`` with ``genome`` (values by name); ValueError if it fails."""
    model = wing_model(dataset, spec)
    record = dataset.recording(recording)
    observed = model.observe([base_genome(model, genome).values], record)
    if observed.reasons[0] is not None:
        raise ValueError(f"the wing cannot be simulated under {recording!r}: {observed.reasons[0]}")
    turns = record.condition.flap_frequency * record.times - recorded_crossing(dataset.wing, record) / (2 * np.pi)
    tracks = observed.channels[0].reshape(record.positions.shape)
    return Comparison(
        recording, turns % 1.0, record.markers, record.positions, tracks, spec.accuracy, observed.solutions[0]
    )


def gene_results(
    found: Mapping[str, Standing], nominal: Genome, best: Genome, adequate: bool
) -> tuple[GeneResult, ...]:
    """Return the results of all genes; ``found``: standard errors of those that were searched, by name.

    ``adequate``: whether noise explains the misfit; if it does not, no gene counts as identifiable.
    """
    known = dict(found)
    before, after = nominal.normalised(), best.normalised()
    for gene in best.genes:
        if gene.name in known:
            own = known[gene.name]
            absolute = own.absolute if gene.share_of is None else own.standard_error * after[gene.name]
            identifiable = own.identifiable and adequate and not _at_bound(gene, best)
            known[gene.name] = replace(own, identifiable=identifiable, absolute=absolute)
    return tuple(GeneResult.of(g, before[g.name], after[g.name], known.get(g.name)) for g in best.genes)


def _at_bound(gene: Gene, best: Genome) -> bool:
    """Return whether the best value is at a bound: within a hundredth of the range, in the gene's scale."""
    return not 0.01 < float(gene.to_unit(best[gene.name])) < 0.99


def _mean(recordings: list[RecordingResult], which: str) -> float:
    weights = [r.samples for r in recordings]
    return float(np.average([getattr(r, which) for r in recordings], weights=weights))
