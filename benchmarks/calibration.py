"""Accuracy and cost of the staged calibration of the example campaign, without knowledge of the true genome.

``python -m benchmarks.calibration [--json] [--joint] [--evaluator KIND]``. The misfit floor is the misfit of the true
genome on the same recordings. It is caused by tracking noise, and by the error in the start of the beat, which is
estimated from noisy tracks.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.common.files import EXAMPLES
from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.result import Result, judge
from wingfit.calibration.search import CalibrationSpec, Generation, calibrate, model_for, prepare
from wingfit.records import Dataset, Genome, load_dataset, wing_or_vehicle
from wingfit.sim.virtual_rigs.campaign import (
    REFERENCE,
    Tracking,
    read_truth,
    record,
    robird_wing,
    true_genome,
    tunnel,
    vacuum,
)
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.workers import EvaluatorKind, make_evaluator

EXAMPLE = EXAMPLES / "robird"
TRUTH = EXAMPLE.with_name("robird.truth.json")
WITHIN = 0.15  # relative error up to which a gene counts as correct
# Evaluators that must agree: kind, workers, and BLAS threads in this process (None: unchanged).
RUNS: tuple[tuple[EvaluatorKind, int | None, int | None], ...] = (
    ("in_process", None, None),
    ("in_process", None, 1),
    ("in_process", None, 2),
    ("in_process", None, 4),
    ("processes", 1, None),
    ("processes", 2, None),
    ("ray", 2, None),
)


@dataclass(frozen=True)
class Outcome:
    """One finished calibration: its last generation, its result, and its duration (s)."""

    last: Generation
    result: Result
    seconds: float


def run(spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, label: str) -> Outcome:
    """Calibrate, and compute the misfits and standard errors of the result; progress goes to standard error.

    ``label``: name of the calibration for the progress line.
    """
    start, last = time.perf_counter(), None
    for last in calibrate(spec, dataset, evaluator):
        note = f"{label}: {last.stage}, generation {last.index}, {last.distance * 1e3:.3f} mm"
        show(f"{note}, {time.perf_counter() - start:.0f} s")
    print(file=sys.stderr)
    if last is None:
        raise RuntimeError("the calibration had no generation")
    return Outcome(last, judge(spec, dataset, evaluator, last.genome), time.perf_counter() - start)


def floor(spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, truth: Genome) -> tuple[float, float]:
    """Return the mean distances (m) between markers simulated with the true genes and recorded ones.

    The first is over the recordings that are fitted, the second over those that are held out.
    """
    found = judge(spec, dataset, evaluator, truth.as_dict())
    if found.held_out_after is None:
        raise ValueError("the campaign has no held-out recording")
    return found.after, found.held_out_after


def gene_table(result: Result, truth: Genome) -> list[dict[str, Any]]:
    """Return one row per gene: estimate, true value, error and standard error (per cent), whether identifiable.

    Genes that are shares of one quantity are normalised to sum to 1.
    """
    true = truth.normalised()
    return [
        {
            "gene": gene.name,
            "best": gene.best,
            "true": true[gene.name],
            "error_percent": round(100 * (gene.best / true[gene.name] - 1), 2),
            "standard_error_percent": None if gene.standard_error is None else round(100 * gene.standard_error, 2),
            "identifiable": gene.identifiable,
        }
        for gene in result.genes
    ]


def thesis_campaign() -> Dataset:
    """Simulate recordings as in van der Grinten's thesis (section V-A), and return them as a dataset.

    A wing of 24 bodies, one recording in the vacuum chamber and one in the wind tunnel.
    """
    model = FlexibleWing(robird_wing(), "24", numerics=REFERENCE)
    truth, conditions = true_genome(model, 2), (vacuum(10.0, 0.0524, 3.0), tunnel(0.0524, 3.0, 6.0))
    recordings = tuple(
        record(model, truth, condition, Tracking(), np.random.default_rng(k)) for k, condition in enumerate(conditions)
    )
    return Dataset("thesis", model.wing, recordings)


def resume_is_identical(dataset: Dataset, evaluator: Evaluator) -> bool:
    """Return whether a short calibration resumed from checkpoints gives the same generations as without.

    It is resumed after its first and fourth generation, from checkpoints converted to JSON and back.
    """
    spec = CalibrationSpec(division="11", population=16, max_generations=3, seed=5)
    whole = list(calibrate(spec, dataset, evaluator))
    return all(
        list(calibrate(spec, dataset, evaluator, json.loads(json.dumps(whole[cut].checkpoint)))) == whole[cut + 1 :]
        for cut in (0, 3)
    )


def evaluators_are_identical(dataset: Dataset) -> bool:
    """Return whether all evaluators in RUNS return bit-identical results for the same individuals."""
    spec = CalibrationSpec(division="11")
    model, stage = model_for(dataset, spec), prepare(spec, dataset).stages[1]
    problem = Problem(model, stage.recordings, stage.free, base_genome(model))
    rng = np.random.default_rng(0)
    genes = [g for g in model.genes if g.name in stage.free]
    values = np.array([[float(g.from_unit(rng.uniform())) for g in genes] for _ in range(19)])
    seen = set()
    for kind, workers, threads in RUNS:
        evaluator = make_evaluator(kind, workers)
        try:
            with threadpool_limits(threads, user_api="blas"):
                found = evaluator.evaluate(problem, values, residuals=True)
            seen.add(b"".join(p.squares.tobytes() + np.asarray(p.residuals).tobytes() for p in found.per_recording))
        finally:
            evaluator.close()
    return len(seen) == 1


def measure(kind: EvaluatorKind, seed: int, joint: bool) -> dict[str, Any]:
    """Calibrate by each variant and return all figures of the benchmark.

    ``kind``: of the evaluator; ``joint``: whether to search all genes at once too.
    """
    dataset = wing_or_vehicle(load_dataset(EXAMPLE))
    truth = read_truth(TRUTH)
    spec = CalibrationSpec(division="11", seed=seed)
    evaluator = make_evaluator(kind)
    try:
        outcome = run(spec, dataset, evaluator, "11 bodies, staged")
        floor_fitted, floor_held_out = floor(spec, dataset, evaluator, truth)
        rows = gene_table(outcome.result, truth)
        known = [row for row in rows if row["identifiable"]]
        big = run(CalibrationSpec(division="24", seed=seed), thesis_campaign(), evaluator, "24 bodies, two recordings")
        figures: dict[str, Any] = {
            "mm_before": outcome.result.before * 1e3,
            "mm_after": outcome.result.after * 1e3,
            "mm_floor": floor_held_out * 1e3,
            "mm_floor_fitted": floor_fitted * 1e3,
            "heldout_mm_before": (outcome.result.held_out_before or 0) * 1e3,
            "heldout_mm_after": (outcome.result.held_out_after or 0) * 1e3,
            "noise_mm_from_data": (outcome.result.noise or 0) * 1e3,
            "genes_within_15_percent": sum(abs(row["error_percent"]) <= 100 * WITHIN for row in known),
            "genes_identifiable": len(known),
            "evaluations": outcome.last.evaluations,
            "seconds": outcome.seconds,
            "seconds_24_bodies": big.seconds,
            "mm_after_24_bodies": big.result.after * 1e3,
            "genes": rows,
        }
        if joint:
            both = run(CalibrationSpec(division="11", seed=seed, mode="joint"), dataset, evaluator, "11 bodies, joint")
            right = [r for r in gene_table(both.result, truth) if r["identifiable"]]
            figures["joint"] = {
                "mm_after": both.result.after * 1e3,
                "heldout_mm_after": (both.result.held_out_after or 0) * 1e3,
                "genes_within_15_percent": sum(abs(row["error_percent"]) <= 100 * WITHIN for row in right),
                "genes_identifiable": len(right),
                "evaluations": both.last.evaluations,
                "seconds": both.seconds,
            }
        figures["resume_identical"] = resume_is_identical(dataset, evaluator)
    finally:
        evaluator.close()
    figures["evaluators_identical"] = evaluators_are_identical(dataset)
    return figures | {"seed": seed, "evaluator": kind, "cpu": cpu(), "commit": commit()}


def main() -> None:
    """Parse the command line, measure, and print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calibration", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print only the JSON object")
    parser.add_argument(
        "--joint", action="store_true", help="also search all genes at once, for comparison with stages"
    )
    parser.add_argument("--evaluator", choices=("in_process", "processes", "ray"), default="ray")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    figures = measure(arguments.evaluator, arguments.seed, arguments.joint)
    if not arguments.json:
        for key, value in figures.items():
            if key != "genes":
                print(f"{key}: {value}")
        for row in figures["genes"]:
            print(row)
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
