"""A calibration from the outside: its specification, its stages, its generations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from calibration.evaluator import Evaluator
from calibration.genetic import FAILED, Population, first_generation, offspring, survive
from calibration.problem import Problem, base_genome
from records import Dataset, Gene, Recording, Wing
from sim.alignment import recorded_crossing
from sim.flexible_wing import FlexibleWing
from sim.numerics import ACCURACY, Numerics
from sim.wing_genes import FACTOR, group

Mode = Literal["staged", "joint"]

VACUUM_LIMIT = 10_000.0  # Pa: still air at no more than this pressure counts as vacuum in a staged calibration
EXPECTED_GENERATIONS = 45


@dataclass(frozen=True)
class CalibrationSpec:
    """What to calibrate and how; the defaults are the thesis's (IV-E).

    Attributes:
        division: preset ("4", "11", "24") or strips as "3,3,3,2" (bodies along the chord of each strip, root first).
        mode: "staged" fits structural genes on vacuum recordings, then aerodynamic ones on the rest; "joint" fits all.
        population: individuals per generation.
        stall: generations without improvement of the best fitness after which a stage ends.
        tolerance: relative improvement that counts as one.
        max_generations: per stage.
        seed: the same seed gives the same numbers, bit for bit.
        bounds_factor: the box is [estimate / factor, estimate * factor].
        accuracy: largest error (m) of any simulated marker at any instant (:class:`sim.numerics.Numerics`).
        recordings: names to fit; empty means all that are not held out.
        genes: names to search; empty means all.
        fixed: values of genes that keep them instead of their estimates.
    """

    division: str = "11"
    mode: Mode = "staged"
    population: int = 50
    stall: int = 10
    tolerance: float = 1e-3
    max_generations: int = 200
    seed: int = 1
    bounds_factor: float = 5.0
    accuracy: float = ACCURACY
    recordings: tuple[str, ...] = ()
    genes: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Generation:
    """One finished generation, what a watcher sees; ``checkpoint`` (JSON) is all that is needed to go on from here.

    ``distance`` is the best individual's mean distance per marker in m; ``diversity`` the mean over the free genes of
    the population's standard deviation in unit coordinates; ``failed`` counts this generation's failed individuals, of
    which ``reasons`` lists up to ten different ones; ``progress`` is a fraction of the whole calibration (an
    estimate, non-decreasing, 1 only at the end).
    """

    stage: str
    index: int
    best: float
    mean: float
    diversity: float
    distance: float
    evaluations: int
    failed: int
    reasons: tuple[str, ...]
    genome: dict[str, float]
    progress: float
    checkpoint: dict[str, Any]


@dataclass(frozen=True)
class Stage:
    """One search: which genes are free, on which recordings."""

    name: str
    free: tuple[str, ...]
    recordings: tuple[Recording, ...]


def model_for(
    dataset: Dataset, division: str, bounds_factor: float = FACTOR, accuracy: float = ACCURACY
) -> FlexibleWing:
    """The model that a dataset asks for, solved to ``accuracy`` (m); ValueError when wing or division is not one."""
    model = FlexibleWing(dataset.wing, division, bounds_factor, Numerics(accuracy=accuracy))
    _ = model.structure, model.genes
    return model


def plan(spec: CalibrationSpec, dataset: Dataset) -> tuple[Stage, ...]:
    """The stages of a calibration; ValueError when the spec does not fit the dataset."""
    model = model_for(dataset, spec.division, spec.bounds_factor, spec.accuracy)
    known = [gene.name for gene in model.genes]
    _refuse_unknown("gene", [*spec.genes, *spec.fixed], known)
    base_genome(model, spec.fixed)
    recordings = dataset.select(spec.recordings) if spec.recordings else dataset.fitted
    if not recordings:
        raise ValueError("every recording of the dataset is held out, and nothing is left to fit; hold out fewer")
    for recording in recordings:
        if recording.name in dataset.held_out:
            raise ValueError(f"recording {recording.name!r} is held out; a calibration must not fit it")
    _refuse_repeated("recording", spec.recordings)
    for recording in dataset.recordings:  # all of them are judged in the end
        _refuse_unusable(dataset.wing, recording)
    free = [name for name in known if (not spec.genes or name in spec.genes) and name not in spec.fixed]
    stages = _joint(free, recordings) if spec.mode == "joint" else _staged(free, recordings)
    if not stages:
        raise ValueError("nothing to calibrate: no recording is left, or every gene is fixed")
    return stages


def _joint(free: list[str], recordings: tuple[Recording, ...]) -> tuple[Stage, ...]:
    return (Stage("joint", tuple(free), recordings),) if free and recordings else ()


def _staged(free: list[str], recordings: tuple[Recording, ...]) -> tuple[Stage, ...]:
    """Vacuum recordings fit the structure, the others then the aerodynamics (thesis Fig. 2)."""
    vacuum = tuple(r for r in recordings if r.condition.airspeed == 0 and r.condition.pressure <= VACUUM_LIMIT)
    air = tuple(r for r in recordings if r not in vacuum)
    structural = tuple(name for name in free if group(name) == "structure")
    aerodynamic = tuple(name for name in free if group(name) == "aerodynamics")
    if (structural and not vacuum) or (aerodynamic and not air):
        lacking, which = ("vacuum", "structural") if structural and not vacuum else ("air", "aerodynamic")
        raise ValueError(
            f"a staged calibration fits the {which} genes on recordings in {lacking}, and there is none "
            f"(vacuum: airspeed 0 and at most {VACUUM_LIMIT / 100:g} mbar); use mode 'joint' or name other genes"
        )
    stages = (Stage("structure", structural, vacuum), Stage("aerodynamics", aerodynamic, air))
    return tuple(stage for stage in stages if stage.free)


def _refuse_unknown(what: str, names: Iterable[str], known: list[str]) -> None:
    for name in names:
        if name not in known:
            raise ValueError(f"unknown {what} {name!r}; there are {', '.join(known)}")


def _refuse_repeated(what: str, names: tuple[str, ...]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{what} {name!r} is named {names.count(name)} times; name it once")


def _refuse_unusable(wing: Wing, recording: Recording) -> None:
    if not np.isfinite(recording.positions).all(axis=2).any():
        raise ValueError(
            f"recording {recording.name!r} has no marker with all of x, y and z in any frame; "
            "there is nothing to compare: leave the recording out of the dataset"
        )
    recorded_crossing(wing, recording)


def calibrate(
    spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None = None
) -> Iterator[Generation]:
    """Run the calibration, yielding after each generation; with ``checkpoint``, go on from there.

    Resumed equals uninterrupted, bit for bit. ValueError when the spec does not fit the dataset.
    """
    stages = plan(spec, dataset)
    model = model_for(dataset, spec.division, spec.bounds_factor, spec.accuracy)
    state = _State.start(spec, model) if checkpoint is None else _State.from_json(checkpoint)
    while state.stage < len(stages):
        stage = stages[state.stage]
        problem = Problem(model, stage.recordings, stage.free, base_genome(model, state.base))
        genes = [gene for gene in model.genes if gene.name in stage.free]
        while not _ended(state.population, spec):
            yield _generation(state, spec, stages, problem, genes, evaluator)
        state.base |= _best(state.population, genes)
        state.stage, state.population = state.stage + 1, Population()


@dataclass
class _State:
    """Everything that the next generation depends on."""

    stage: int
    base: dict[str, float]
    population: Population
    evaluations: int = 0
    progress: float = 0.0

    @classmethod
    def start(cls, spec: CalibrationSpec, model: FlexibleWing) -> _State:
        return cls(0, base_genome(model, spec.fixed).as_dict(), Population())

    @classmethod
    def from_json(cls, state: dict[str, Any]) -> _State:
        fields = dict(state) | {"population": Population.from_json(state["population"]), "base": dict(state["base"])}
        return cls(**fields)

    def as_json(self) -> dict[str, Any]:
        return dict(self.__dict__) | {"population": self.population.as_json(), "base": dict(self.base)}


def _generation(
    state: _State,
    spec: CalibrationSpec,
    stages: tuple[Stage, ...],
    problem: Problem,
    genes: list[Gene],
    evaluator: Evaluator,
) -> Generation:
    """Breed, evaluate and select once; ``state`` moves on."""
    stage = stages[state.stage]
    if state.population.generation < 0:
        start = [float(gene.to_unit(state.base[gene.name])) for gene in genes]
        unit = first_generation(spec.seed, stage.name, spec.population, start)
    else:
        unit = offspring(state.population, spec.seed, stage.name, spec.population)
    values = np.stack([gene.from_unit(column) for gene, column in zip(genes, unit.T, strict=True)], axis=1)
    evaluation = evaluator.evaluate(problem, values)
    state.population = survive(state.population, unit, evaluation.fitness, evaluation.distance, spec.tolerance)
    if state.population.fitness[0] >= FAILED:
        first = next(reason for reason in evaluation.reasons if reason)
        raise ValueError(f"stage {stage.name!r}: every individual of the first generation failed, the first: {first}")
    state.evaluations += len(unit)
    state.progress = max(state.progress, _progress(state, spec, len(stages)))
    population, reasons = state.population, [reason for reason in evaluation.reasons if reason]
    good = [f for f in population.fitness if f < FAILED]
    return Generation(
        stage=stage.name,
        index=population.generation,
        best=population.fitness[0],
        mean=float(np.mean(good)),
        diversity=population.diversity,
        distance=population.distance[0],
        evaluations=state.evaluations,
        failed=len(reasons),
        reasons=tuple(sorted(set(reasons))[:10]),
        genome=state.base | _best(population, genes),
        progress=state.progress,
        checkpoint=state.as_json(),
    )


def _best(population: Population, genes: list[Gene]) -> dict[str, float]:
    return {gene.name: float(gene.from_unit(u)) for gene, u in zip(genes, population.unit[0], strict=True)}


def _ended(population: Population, spec: CalibrationSpec) -> bool:
    return population.stall >= spec.stall or population.generation + 1 >= spec.max_generations


def _progress(state: _State, spec: CalibrationSpec, stages: int) -> float:
    """Fraction done, taking a stage to last EXPECTED_GENERATIONS, or as many more as the stall counter still allows."""
    population = state.population
    done = population.generation + 1
    left = 0 if _ended(population, spec) else max(spec.stall - population.stall, EXPECTED_GENERATIONS - done)
    total = min(done + left, spec.max_generations)
    return (state.stage + done / total) / stages
