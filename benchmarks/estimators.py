"""Search methods on the example wing: cost until the misfit is as good as the best of all methods.

``python -m benchmarks.estimators [--json] [--evaluator KIND] [--starts N]``. All genes are fitted at once to all
recordings of examples/robird that are not held out, with 11 bodies. The floor is the best misfit (a sum of squares, Eq.
14 of van der Grinten's thesis) that any method reaches.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.common.files import EXAMPLES
from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show
from wingfit.calibration.estimates.likelihood import iterate
from wingfit.calibration.estimates.linearised import free_genes, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.search import CalibrationSpec, calibrate, model_for, prepare
from wingfit.records import Dataset, load_dataset, wing_or_vehicle
from wingfit.workers import EvaluatorKind, make_evaluator

EXAMPLE = EXAMPLES / "robird"
AS_GOOD = 1.01  # ratio to the floor below which a misfit counts as equal
SPEC = CalibrationSpec(division="11", mode="joint")
SEARCHES = {
    "genetic": replace(SPEC, method="genetic"),
    "CMA-ES": replace(SPEC, method="cma_es", population=16, stall=40, max_generations=150),
    "genetic, 5 generations, then Gauss-Newton": replace(SPEC, method="genetic", max_generations=5, finish=True),
    "Gauss-Newton from the estimates": replace(SPEC, method="gauss_newton"),
}


@dataclass(frozen=True)
class Point:
    """State of a search: individuals evaluated and seconds so far, and the least sum of squares so far (m^2)."""

    evaluations: int
    seconds: float
    squares: float


def trace(label: str, states: Iterable[tuple[int, float]]) -> list[Point]:
    """Run a search to its end and return its states.

    ``states``: the search, which yields the number of individuals evaluated so far and a sum of squares (m^2);
    ``label``: its name for the progress line.
    """
    start, points, best = time.perf_counter(), list[Point](), np.inf
    for evaluations, squares in states:
        best = min(best, squares)
        points.append(Point(evaluations, time.perf_counter() - start, best))
        show(f"{label}: {evaluations} evaluations, {best:.6g} m2")
    print(file=sys.stderr)
    return points


def from_random(
    spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, seed: int
) -> Iterable[tuple[int, float]]:
    """Search by Gauss-Newton from a random start, uniform over the genes' ranges (in unit coordinates).

    Yields the number of individuals evaluated so far and the present sum of squares (m^2).
    """
    (stage,), model = prepare(spec, dataset).stages, model_for(dataset, spec)
    problem = Problem(model, stage.recordings, stage.free, base_genome(model))
    genes = free_genes(problem)
    unit = np.random.default_rng([seed, 3]).uniform(size=(1, len(genes)))
    start = dict(zip(problem.free, values_at(genes, unit)[0].tolist(), strict=True))
    evaluations = 0
    for step in iterate(problem, evaluator, start):
        evaluations += step.evaluations
        yield evaluations, step.fitness


def reached(points: list[Point], floor: float) -> Point | None:
    """Return the first point whose sum of squares is at most AS_GOOD times ``floor``; None if there is none."""
    return next((point for point in points if point.squares <= AS_GOOD * floor), None)


def row(method: str, points: list[Point], floor: float) -> dict[str, Any]:
    """Return a row of the table: cost of ``method`` until the floor is reached (None: never), and until its end."""
    first = reached(points, floor)
    return {
        "method": method,
        "evaluations": None if first is None else first.evaluations,
        "seconds": None if first is None else round(first.seconds, 1),
        "misfit_over_floor": round(points[-1].squares / floor, 4),
        "evaluations_in_all": points[-1].evaluations,
        "seconds_in_all": round(points[-1].seconds, 1),
    }


def estimators(kind: EvaluatorKind = "processes", starts: int = 4, seed: int = 1) -> list[dict[str, Any]]:
    """Run all methods and return one row per method.

    ``kind``: of the evaluator; ``starts``: number of random starts of Gauss-Newton, which have one row: the median of
    those that reach the floor, with their number.
    """
    dataset, evaluator = wing_or_vehicle(load_dataset(EXAMPLE)), make_evaluator(kind)
    try:
        _warm(dataset, evaluator)
        traces = {
            name: trace(
                name, ((g.evaluations, g.best) for g in calibrate(replace(spec, seed=seed), dataset, evaluator))
            )
            for name, spec in SEARCHES.items()
        }
        drawn = [_started(dataset, evaluator, seed + k) for k in range(starts)]
    finally:
        evaluator.close()
    floor = min(points[-1].squares for points in (*traces.values(), *(d for d in drawn if d)))
    rows = [row(name, points, floor) for name, points in traces.items()]
    return [*rows, _random_row(drawn, floor)] if starts else rows


def _warm(dataset: Dataset, evaluator: Evaluator) -> None:
    """Simulate once before anything is timed, so that the kernels are compiled and the wing is built."""
    (stage,), model = prepare(SPEC, dataset).stages, model_for(dataset, SPEC)
    problem = Problem(model, stage.recordings, stage.free, base_genome(model))
    genes = free_genes(problem)
    evaluator.evaluate(problem, np.tile([gene.nominal for gene in genes], (16, 1)))


def _started(dataset: Dataset, evaluator: Evaluator, seed: int) -> list[Point]:
    """Return the points of a search from a random start; empty if the start cannot be simulated."""
    try:
        return trace(f"Gauss-Newton from random start {seed}", from_random(SPEC, dataset, evaluator, seed))
    except ValueError as error:
        print(error, file=sys.stderr)
        return []


def _random_row(drawn: list[list[Point]], floor: float) -> dict[str, Any]:
    good = [points for points in drawn if points and reached(points, floor)]
    middle = sorted(good, key=lambda points: points[-1].evaluations)[len(good) // 2] if good else None
    name = f"Gauss-Newton from random starts ({len(good)} of {len(drawn)} reach the floor; the median of those)"
    empty = {"evaluations": None, "seconds": None, "misfit_over_floor": None}
    found = row(name, middle, floor) if middle else {"method": name, **empty}
    return found | {"starts": len(drawn), "starts_that_reach_the_floor": len(good)}


def main() -> None:
    """Parse the command line, run all methods, and print the rows."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.estimators", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print only the JSON object")
    parser.add_argument("--evaluator", choices=("in_process", "processes", "ray"), default="processes")
    parser.add_argument("--starts", type=int, default=4, help="random starts of Gauss-Newton")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rows = estimators(arguments.evaluator, arguments.starts, arguments.seed)
    if not arguments.json:
        for each in rows:
            print(" | ".join(f"{key}: {value}" for key, value in each.items()))
    print(json.dumps({"estimators": rows, "seed": arguments.seed, "cpu": cpu(), "commit": commit()}))


if __name__ == "__main__":
    main()
