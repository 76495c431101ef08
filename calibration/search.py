"""Runs a calibration: searches its stages one after the other, and reports after each generation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from wingfit.calibration import cma, genetic
from wingfit.calibration.estimates.likelihood import ITERATIONS, Step, iterate
from wingfit.calibration.estimates.linearised import free_genes, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.genetic import FAILED
from wingfit.calibration.preparation import Prepared, prepare
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.series.beginnings import from_beginnings
from wingfit.calibration.spec import CalibrationSpec, model_for, resolved
from wingfit.calibration.starts import SEARCHED, START_ERRORS, Ends, apart
from wingfit.records import Dataset, Gene
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.model import Model

__all__ = [
    "CalibrationSpec", "Generation", "calibrate", "calibrate_prepared", "found", "found_of", "model_for", "prepare",
    "resolved",
]  # fmt: skip

EXPECTED_GENERATIONS = 45
EXPECTED_ITERATIONS = 10
FINISHING = 0.2  # part of a stage's progress that belongs to Gauss-Newton after a search
NEWTON = ", Gauss-Newton"

Population = genetic.Population | cma.Distribution


@dataclass(frozen=True)
class Generation:
    """Progress after one generation; a calibration can be resumed from its ``checkpoint`` (JSON).

    A Gauss-Newton iteration is a generation too. It minimises the cost of Armanini et al. 2016, Eq. 22, which weighs
    recordings and channels by their noise, so that ``best`` need not fall in every iteration. With a
    ``search_division``, misfits of the search are those of that model and misfits of iterations those of the wanted
    one: they are not comparable, and ``best`` may rise from the search to the first iteration.

    ``best`` and ``mean`` are sums of squares, m^2 or N^2; ``distance`` is the best individual's misfit, m or N
    (:class:`wingfit.calibration.problem.Misfit`; of series, both are relative to the ranges of the channels);
    ``diversity`` is the standard deviation of the population, genes scaled to 0..1, mean over the free genes (of an
    iteration: the largest move of a gene); ``evaluations`` counts the individuals evaluated since the start (of equal
    ones each counts, and one is simulated); ``failed`` counts the generation's failed individuals, and starts that
    failed since the last, with up to ten different ``reasons``; ``genome`` is the best, all genes by name; ``progress``
    estimates the finished part of the calibration (never decreases, 1 only at the end). In ``checkpoint``, ``found``
    has the best genome by stage.
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


@one_blas_thread
def calibrate(
    spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None = None
) -> Iterator[Generation]:
    """Run the calibration, and yield its progress after each generation; a ``checkpoint`` resumes an earlier run.

    A resumed run gives the same results as an uninterrupted one, bit for bit. ValueError if ``spec`` does not fit
    ``dataset``.
    """
    yield from calibrate_prepared(prepare(spec, dataset), evaluator, checkpoint)


@one_blas_thread
def calibrate_prepared(
    ready: Prepared, evaluator: Evaluator, checkpoint: dict[str, Any] | None = None
) -> Iterator[Generation]:
    """Run the calibration that is ``ready``, as :func:`calibrate`."""
    spec = ready.spec
    state = _begun(ready, evaluator) if checkpoint is None else _State.from_json(checkpoint, spec)
    while state.stage < len(ready.stages):
        run = _Run(ready, state, evaluator)
        if spec.method != "gauss_newton":
            yield from run.search()
        if spec.method == "auto":
            yield from run.starts()
        elif spec.method == "gauss_newton" or spec.finish:
            yield from run.iterations()
        if spec.mode != "local":
            state.base |= {name: state.found[run.stage.name][name] for name in run.stage.free}
        state.stage, state.population, state.newton, state.ends = state.stage + 1, _empty(spec), None, Ends()


def _begun(ready: Prepared, evaluator: Evaluator) -> _State:
    """Return the state before the first generation, with genes that belong to a single series as its beginning shows.

    What the request fixes stays as it is.
    """
    spec = ready.spec
    state = _State.start(spec, ready.model)
    for stage in ready.stages:
        base = base_genome(ready.model, state.base)
        problem = Problem(ready.model, stage.recordings, stage.free, base, spec.axes)
        found = from_beginnings(problem, evaluator, spec.fixed)
        state.base, state.evaluations = state.base | found.values, state.evaluations + found.evaluations
    return state


def found(spec: CalibrationSpec, dataset: Dataset, checkpoint: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Return the best genome (all genes, by name) of each stage in ``checkpoint``, by name of the stage."""
    return found_of(resolved(spec, dataset), checkpoint)


def found_of(spec: CalibrationSpec, checkpoint: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Return the best genomes as :func:`found`, with the ``spec`` of a calibration that is prepared."""
    return _State.from_json(checkpoint, spec).found


@dataclass
class _State:
    """State of a calibration between generations, from which it continues; ``stage`` is the number of the stage.

    ``base`` is the genome from which the stage starts, ``population`` the state of its search, ``found`` the best
    genome of each stage, ``newton`` the checkpoint of its Gauss-Newton iterations (None before the first), ``ends``
    those of a method that has several starts, ``doubts`` why the minimum of a stage is not confirmed, by its name.
    """

    stage: int
    base: dict[str, float]
    population: Population
    evaluations: int = 0
    progress: float = 0.0
    found: dict[str, dict[str, float]] = field(default_factory=dict)
    newton: dict[str, Any] | None = None
    ends: Ends = field(default_factory=Ends)
    doubts: dict[str, str] = field(default_factory=dict)

    @classmethod
    def start(cls, spec: CalibrationSpec, model: Model) -> _State:
        return cls(0, base_genome(model, spec.fixed).as_dict(), _empty(spec))

    @classmethod
    def from_json(cls, state: dict[str, Any], spec: CalibrationSpec) -> _State:
        population = type(_empty(spec))(**state["population"])
        found = {name: dict(genome) for name, genome in state["found"].items()}
        ends = Ends(**state.get("ends", {}))
        own = {"population": population, "base": dict(state["base"]), "found": found, "ends": ends}
        return cls(**dict(state) | own)

    def as_json(self) -> dict[str, Any]:
        found = {name: dict(genome) for name, genome in self.found.items()}
        own = {"population": dict(vars(self.population)), "base": dict(self.base), "ends": dict(vars(self.ends))}
        return vars(self) | own | {"found": found, "doubts": dict(self.doubts)}


def _empty(spec: CalibrationSpec) -> Population:
    return cma.Distribution() if spec.method == "cma_es" else genetic.Population()


class _Run:
    """The search of one stage; ``state`` is updated after every generation.

    The population of a search simulates ``searched``, Gauss-Newton iterates on ``problem``; they may differ in the
    discretisation of the wing. Between the two go values of genes; no misfit of one is compared with one of the other.
    """

    def __init__(self, ready: Prepared, state: _State, evaluator: Evaluator) -> None:
        self.spec, self.stages, self.state, self.evaluator = ready.spec, ready.stages, state, evaluator
        self.stage = ready.stages[state.stage]
        base = base_genome(ready.model, state.base)
        self.problem = Problem(ready.model, self.stage.recordings, self.stage.free, base, ready.spec.axes)
        self.searched = replace(self.problem, model=ready.search_model or ready.model)
        self.genes = free_genes(self.problem)

    def search(self) -> Iterator[Generation]:
        """Yield generations of the genetic search or of CMA-ES until the best fitness no longer improves."""
        while not _ended(self.state.population, self.spec):
            yield self._generation()

    def iterations(self) -> Iterator[Generation]:
        """Yield Gauss-Newton iterations until they converge; start: result of the search or, without one, the base."""
        start = self.state.found.get(self.stage.name, self.state.base)
        limit = ITERATIONS
        if self.spec.method == "gauss_newton":  # after a search, the limit of its generations does not apply
            limit = min(ITERATIONS, self.spec.max_generations)
        try:
            for step in iterate(self.problem, self.evaluator, start, self.state.newton, limit):
                yield self._iteration(step, step.converged or step.index + 1 >= limit)
        except START_ERRORS as error:
            if self.state.newton is not None or self.spec.search_division is None:
                raise
            raise ValueError(
                f"stage {self.stage.name!r}: Gauss-Newton with division {self.spec.division!r} cannot start at the "
                f"best of the search with search_division {self.spec.search_division!r}: {error}; use method 'auto', "
                "which has several starts, or leave search_division out"
            ) from error

    def starts(self) -> Iterator[Generation]:
        """Yield Gauss-Newton iterations from the best individuals of the search until two starts end at one cost.

        The best genome is that of the least cost so far; the checkpoint of a start's last iteration ends it. A start
        that fails is passed over, and its individuals are not counted; the next generation says why, which is one more
        if there is no further start. ValueError if all of them fail.
        """
        population, ends = self.state.population, self.state.ends
        if not isinstance(population, genetic.Population):
            raise TypeError("starts are taken from a genetic search")
        chosen, failures = apart(population), list[str]()  # failures: since the last generation
        while ends.tried < len(chosen) and not ends.agreed:
            try:
                for step in iterate(self.problem, self.evaluator, _named(self.genes, chosen[ends.tried]), ends.newton):
                    ends.add(step, step.converged or step.index + 1 >= ITERATIONS)
                    yield self._start(step, len(chosen), failures)
                    failures = []
            except START_ERRORS as error:
                failures.append(ends.fail(error))
        if not ends.done:
            stage = self.stage.name
            raise ValueError(f"stage {stage!r}: Gauss-Newton failed from every start, the first: {ends.failures[0]}")
        if failures:
            ends.iterations += 1
            yield self._start(None, len(chosen), failures)

    def _generation(self) -> Generation:
        """Compute one generation: draw individuals, simulate them, and update the population."""
        spec, state, name = self.spec, self.state, self.stage.name
        unit = self._drawn()
        evaluation = self.evaluator.evaluate(self.searched, values_at(self.genes, unit))
        outcome = unit, evaluation.fitness, evaluation.distance, spec.tolerance
        if isinstance(state.population, cma.Distribution):
            state.population = cma.learnt(state.population, *outcome)
        else:
            state.population = genetic.survive(state.population, *outcome)
        population, reasons = state.population, [reason for reason in evaluation.reasons if reason]
        fitness, distance, best = _leader(population)
        if fitness >= FAILED:
            raise ValueError(
                f"stage {name!r}: every individual of the first generation failed, the first: {reasons[0]}"
            )
        genome = state.base | _named(self.genes, best)
        return self._seen(
            genome, len(unit), self._progress(), name, population.generation, fitness, population.mean,
            population.diversity, distance, reasons,
        )  # fmt: skip

    def _drawn(self) -> Array:
        spec, state, name = self.spec, self.state, self.stage.name
        if state.population.generation < 0:
            start = [float(gene.to_unit(state.base[gene.name])) for gene in self.genes]
            if isinstance(state.population, genetic.Population):
                return genetic.first_generation(spec.seed, name, spec.population, start)
            state.population = cma.Distribution.about(start)
        if isinstance(state.population, genetic.Population):
            return genetic.offspring(state.population, spec.seed, name, spec.population)
        return cma.drawn(state.population, spec.seed, name, spec.population)

    def _iteration(self, step: Step, last: bool) -> Generation:
        self.state.newton = step.checkpoint
        searched = 1.0 - FINISHING if self.spec.method != "gauss_newton" else 0.0
        part = 1.0 if last else _share(step.index + 1, EXPECTED_ITERATIONS, searched)
        return self._seen(
            self.state.base | step.values, step.evaluations, (self.state.stage + part) / len(self.stages),
            self.stage.name + NEWTON, step.index, step.fitness, step.fitness, step.step, step.distance,
            list(step.reasons),
        )  # fmt: skip

    def _start(self, step: Step | None, starts: int, failures: list[str]) -> Generation:
        """Report an iteration from one of several ``starts``, with the place of the least cost so far.

        ``failures``: why starts failed since the last generation; ``step``: None if no start followed them.
        """
        state, ends, stage = self.state, self.state.ends, self.stage.name
        best, last = ends.best(), ends.agreed or ends.tried == starts
        part = 1.0 if last else _share(ends.iterations, 2 * EXPECTED_ITERATIONS)
        if last:  # an earlier version may have stored a doubt that a further start removes
            others = {name: doubt for name, doubt in state.doubts.items() if name != stage}
            state.doubts = others | ({stage: ends.doubt} if ends.doubt else {})
        evaluated, mean, moved = (step.evaluations, step.fitness, step.step) if step else (0, best.fitness, 0.0)
        return self._seen(
            state.base | best.values, evaluated, (state.stage + part) / len(self.stages), stage + NEWTON,
            ends.iterations - 1, best.fitness, mean, moved, best.distance,
            [*failures, *(step.reasons if step else ())],
        )  # fmt: skip

    def _seen(
        self, genome: dict[str, float], evaluated: int, progress: float, stage: str, index: int,
        best: float, mean: float, diversity: float, distance: float, reasons: list[str],
    ) -> Generation:  # fmt: skip
        """Update the state with the finished generation, and return its progress; ``evaluated``: new individuals."""
        state = self.state
        state.found[self.stage.name] = dict(genome)
        state.evaluations += evaluated
        state.progress = max(state.progress, progress)
        return Generation(
            stage=stage,
            index=index,
            best=best,
            mean=mean,
            diversity=diversity,
            distance=distance,
            evaluations=state.evaluations,
            failed=len(reasons),
            reasons=tuple(sorted(set(reasons))[:10]),
            genome=genome,
            progress=state.progress,
            checkpoint=state.as_json(),
        )

    def _progress(self) -> float:
        """Estimate the finished fraction of the calibration.

        EXPECTED_GENERATIONS generations are assumed, or more if the search cannot end before.
        """
        population, spec = self.state.population, self.spec
        done = population.generation + 1
        left = 0 if _ended(population, spec) else max(spec.stall - population.stall, EXPECTED_GENERATIONS - done)
        total = min(done + left, _most(spec))
        share = 1.0 - FINISHING if spec.finish or spec.method == "auto" else 1.0
        return (self.state.stage + share * (done / total)) / len(self.stages)


def _share(done: int, expected: int, before: float = 1.0 - FINISHING) -> float:
    """Estimate the finished part of a stage with ``done`` of ``expected`` iterations, after the part ``before``."""
    return before + (1.0 - before) * done / max(done + 1, expected)


def _ended(population: Population, spec: CalibrationSpec) -> bool:
    return population.stall >= spec.stall or population.generation + 1 >= _most(spec)


def _most(spec: CalibrationSpec) -> int:
    """Return the largest number of generations of a search."""
    return min(SEARCHED, spec.max_generations) if spec.method == "auto" else spec.max_generations


def _leader(population: Population) -> tuple[float, float, list[float]]:
    """Return fitness, distance and genes (scaled to 0..1) of the best individual."""
    if isinstance(population, cma.Distribution):
        return population.fitness, population.distance, population.unit
    return population.fitness[0], population.distance[0], population.unit[0]


def _named(genes: list[Gene], unit: list[float]) -> dict[str, float]:
    return {gene.name: float(gene.from_unit(u)) for gene, u in zip(genes, unit, strict=True)}
