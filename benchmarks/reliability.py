"""How often a search finds the best genome, over many true wings, and whether fitting in stages helps.

``python -m benchmarks.reliability [--json] [--truths N] [--compared M] [--bodies N] [--log FILE]``. Each true genome is
recorded once in vacuum and once in the wind tunnel, with tracking noise, and calibrated without knowledge of the truth:
by the genetic search and by the method "auto", in stages and (the genetic search: of the first M truths) jointly. The
wing that records has the discretisation of the model. The seed of recording and search is the number of the truth.

The misfit is the same for all: the sum of squares (m^2, Eq. 14 of van der Grinten's thesis) over both recordings, which
a joint search minimises. Its floor for a truth is the least of: that of the true genome, of Gauss-Newton from the true
genome (joint), and of the ends of all searches. A search has reached the floor if it ends at no more than 1.01 times
it. Evaluations count individuals, simulations count individuals times the recordings of their stage. With ``--log``,
one line of JSON is written per truth, and a truth that is in the file with the same number of bodies is not repeated.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show
from wingfit.calibration.estimates.likelihood import iterate
from wingfit.calibration.estimates.linearised import free_genes
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.search import NEWTON, CalibrationSpec, Generation, calibrate, prepare
from wingfit.calibration.spec import Method, Mode
from wingfit.calibration.starts import Ends
from wingfit.records import Dataset, Genome
from wingfit.sim.virtual_rigs.campaign import REFERENCE, Tracking, record, robird_wing, true_genome, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.workers import EvaluatorKind, make_evaluator

AS_GOOD = 1.01  # ratio to the floor up to which it counts as reached
CONFIDENCE = 0.9  # of the intervals of reliabilities (Wilson)
DIVISIONS = {4: "4", 6: "3x2", 8: "4x2", 11: "11", 24: "24"}  # by number of bodies
CONDITIONS = vacuum(10.0, 0.0524, 3.0), tunnel(0.0524, 3.0, 6.0)  # of the thesis, section V-A
SEARCHES: dict[str, tuple[Method, Mode]] = {
    "genetic, staged": ("genetic", "staged"),
    "auto, staged": ("auto", "staged"),
    "auto, joint": ("auto", "joint"),
    "genetic, joint": ("genetic", "joint"),
}
COMPARED = "genetic, joint"  # the search that is run for the first truths only


@dataclass(frozen=True)
class Point:
    """A search when it changed its best genome: individuals and simulations until then, sum of squares (m^2)."""

    evaluations: int
    simulations: int
    squares: float


@dataclass(frozen=True)
class Search:
    """A search of one truth: its cost, and the ``points`` on its way; the last is its end.

    ``starts``: number of Gauss-Newton starts of each stage of "auto"; ``agreed``: whether in each stage two of them
    ended at the least cost; ``error``: why the search failed, which then has no points.
    """

    evaluations: int
    simulations: int
    seconds: float
    points: tuple[Point, ...] = ()
    starts: tuple[int, ...] = ()
    agreed: bool | None = None
    error: str | None = None

    @property
    def end(self) -> float:
        """Sum of squares of the final genome (m^2), inf without one."""
        return self.points[-1].squares if self.points else np.inf

    def first(self, floor: float) -> Point | None:
        """Return the first point at which ``floor`` (m^2) is reached; None if it never is."""
        return next((point for point in self.points if point.squares <= AS_GOOD * floor), None)


@dataclass(frozen=True)
class Trial:
    """One truth: sums of squares (m^2) of the true genome and of Gauss-Newton from it, and the ``searches``.

    ``failure``: why the true wing cannot be simulated, None if it can; without a wing there is nothing to calibrate.
    """

    bodies: int
    seed: int
    truth: float = np.inf
    newton: float = np.inf
    searches: dict[str, Search] = field(default_factory=dict)
    failure: str | None = None

    @property
    def floor(self) -> float:
        """The least sum of squares (m^2) that is known of this truth."""
        return min(self.truth, self.newton, *(search.end for search in self.searches.values()))

    @classmethod
    def of(cls, row: dict[str, Any]) -> Trial:
        """Return the trial of a line of the log."""
        searches = {
            name: Search(**one | {"points": tuple(Point(**p) for p in one["points"]), "starts": tuple(one["starts"])})
            for name, one in row["searches"].items()
        }
        known = {key: row[key] for key in ("bodies", "seed", "truth", "newton", "failure")}
        return cls(**known | {"searches": searches})


def recorded(bodies: int, seed: int) -> tuple[Dataset, Genome]:
    """Draw a true wing and record it; ValueError if it cannot be simulated."""
    model = FlexibleWing(robird_wing(), DIVISIONS[bodies], numerics=REFERENCE)
    truth = true_genome(model, seed)
    recordings = tuple(
        record(model, truth, condition, Tracking(), np.random.default_rng([seed, 2, k]))
        for k, condition in enumerate(CONDITIONS)
    )
    return Dataset(f"truth-{seed}", model.wing, recordings), truth


def joint_problem(bodies: int, dataset: Dataset) -> Problem:
    """Return the problem of a joint calibration: all genes, both recordings."""
    ready = prepare(CalibrationSpec(division=DIVISIONS[bodies], mode="joint"), dataset)
    (stage,) = ready.stages
    return Problem(ready.model, stage.recordings, stage.free, base_genome(ready.model))


def squares(problem: Problem, evaluator: Evaluator, genomes: list[dict[str, float]]) -> list[float]:
    """Return the sum of squares (m^2) of each of ``genomes``, inf for one that cannot be simulated."""
    values = np.array([[genome[name] for name in problem.free] for genome in genomes])
    return [float(one) for one in evaluator.evaluate(problem, values).fitness]


def searched(spec: CalibrationSpec, dataset: Dataset, problem: Problem, evaluator: Evaluator, label: str) -> Search:
    """Calibrate, and then compute the sums of squares of all genomes that were the best for some time.

    ``problem``: the joint one; ``label``: name of the search for the progress line.
    """
    recordings = {stage.name: len(stage.recordings) for stage in prepare(spec, dataset).stages}
    start, simulations, error = time.perf_counter(), 0, None
    changes, lasts = list[tuple[int, int, dict[str, float]]](), dict[str, Generation]()
    evaluations, stage = 0, ""
    try:
        for generation in calibrate(spec, dataset, evaluator):
            stage = generation.stage.removesuffix(NEWTON)
            simulations += (generation.evaluations - evaluations) * recordings[stage]
            evaluations, lasts[stage] = generation.evaluations, generation
            if not changes or changes[-1][2] != generation.genome:
                changes.append((evaluations, simulations, generation.genome))
            show(f"{label}: {generation.stage}, {generation.index}, {generation.distance * 1e3:.3f} mm")
    except ValueError as problem_found:
        error, changes = str(problem_found), []
    seconds = time.perf_counter() - start
    found = squares(problem, evaluator, [genome for *_, genome in changes]) if changes else []
    ends = [Ends(**last.checkpoint["ends"]) for last in lasts.values()] if spec.method == "auto" else []
    return Search(
        evaluations,
        simulations,
        round(seconds, 2),
        tuple(Point(*change[:2], one) for change, one in zip(changes, found, strict=True)),
        tuple(len(one.done) for one in ends),
        all(one.agreed for one in ends) if ends else None,
        error,
    )


def newton(problem: Problem, evaluator: Evaluator, truth: Genome) -> float:
    """Return the sum of squares (m^2) at the end of Gauss-Newton from the true genome; inf if it cannot start."""
    values = None
    try:
        for step in iterate(problem, evaluator, truth.as_dict()):
            values = step.values
    except ValueError as error:
        print(error, file=sys.stderr)
    return squares(problem, evaluator, [values])[0] if values else np.inf


def trial(bodies: int, seed: int, evaluator: Evaluator, names: Iterable[str]) -> Trial:
    """Record the truth with number ``seed``, and run the searches called ``names``."""
    try:
        dataset, truth = recorded(bodies, seed)
    except ValueError as error:
        return Trial(bodies, seed, failure=str(error))
    problem = joint_problem(bodies, dataset)
    searches = {}
    for name in names:
        method, mode = SEARCHES[name]
        spec = CalibrationSpec(division=DIVISIONS[bodies], seed=seed, method=method, mode=mode)
        searches[name] = searched(spec, dataset, problem, evaluator, f"truth {seed}, {name}")
    own = squares(problem, evaluator, [truth.as_dict()])[0]
    return Trial(bodies, seed, own, newton(problem, evaluator, truth), searches)


class Log:
    """Finished trials, of a file if there is one; a line that was cut off by an interruption is ignored."""

    def __init__(self, path: Path | None) -> None:
        self.path, self.trials = path, dict[tuple[int, int], Trial]()
        text = path.read_text(encoding="utf-8") if path and path.exists() else ""
        for line in text.splitlines():
            try:
                found = Trial.of(json.loads(line))
            except (ValueError, KeyError, TypeError):
                continue
            self.trials[found.bodies, found.seed] = found
        if path and text and not text.endswith("\n"):
            self._write("")

    def get(self, bodies: int, seed: int, names: Iterable[str]) -> Trial | None:
        """Return the trial of a truth, if it failed or has all the searches called ``names``."""
        found = self.trials.get((bodies, seed))
        return found if found and (found.failure or set(names) <= set(found.searches)) else None

    def add(self, done: Trial) -> None:
        """Keep a trial, and write it to the file."""
        self.trials[done.bodies, done.seed] = done
        self._write(json.dumps(asdict(done) | {"commit": commit(), "at": time.strftime("%H:%M:%S")}))

    def _write(self, line: str) -> None:
        if self.path:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line + "\n")


def trials(truths: int, compared: int, bodies: int, evaluator: Evaluator, log: Log) -> Iterator[Trial]:
    """Yield the trials of ``truths`` wings that can be simulated, and of those that cannot in between."""
    done, began = 0, time.monotonic()
    for seed in itertools.count(1):
        if done == truths:
            return
        names = [name for name in SEARCHES if name != COMPARED or done < compared]
        found = log.get(bodies, seed, names)
        if found is None:
            found = trial(bodies, seed, evaluator, names)
            log.add(found)
        done += found.failure is None
        show(f"{done} of {truths} truths, {time.monotonic() - began:.0f} s; {_line(found)}", last=True)
        yield found


def _line(one: Trial) -> str:
    ratios = (f"{name} {search.end / one.floor:.4f}" for name, search in one.searches.items())
    return f"truth {one.seed}: " + (one.failure or "; ".join(ratios))


def share(successes: int, of: int) -> dict[str, Any]:
    """Return a share in per cent with its interval."""
    interval = binomtest(successes, of).proportion_ci(CONFIDENCE, "wilson")
    percent = [round(100 * float(one), 1) for one in (interval.low, interval.high)]
    return {"reached": successes, "of": of, "percent": round(100 * successes / of, 1), "interval_percent": percent}


def row(name: str, done: list[Trial]) -> dict[str, Any]:
    """Return the figures of the search called ``name`` over those of the trials ``done`` that have it."""
    pairs = [(one.searches[name], one.floor) for one in done if name in one.searches]
    firsts = [search.first(floor) for search, floor in pairs]
    ratios = [search.end / floor for search, floor in pairs if search.error is None]
    good = [search for search, floor in pairs if search.end <= AS_GOOD * floor]
    found = {"search": name} | share(len(good), len(pairs))
    found |= {
        f"median_{what}": _median(getattr(s, what) for s, _ in pairs)
        for what in ("evaluations", "simulations", "seconds")
    }
    found |= {
        "median_evaluations_until_reached": _median(first.evaluations for first in firsts if first),
        "median_simulations_until_reached": _median(first.simulations for first in firsts if first),
        "ever_reached": sum(first is not None for first in firsts),
        "median_ratio": _rounded(_median(ratios)),
        "worst_ratio": _rounded(max(ratios, default=None)),
        "errors": sum(search.error is not None for search, _ in pairs),
    }
    if SEARCHES[name][0] == "auto":
        found["agreed"] = sum(bool(search.agreed) for search, _ in pairs)
        found["agreed_but_not_reached"] = sum(bool(s.agreed) and s.end > AS_GOOD * floor for s, floor in pairs)
        starts = [search.starts for search, _ in pairs if search.error is None]
        found["mean_starts_of_stages"] = np.round(np.mean(starts, axis=0), 2).tolist() if starts else None
    return found


def staging(method: str, done: list[Trial]) -> dict[str, Any]:
    """Compare the staged with the joint searches of ``method``, on the truths that both have searched.

    A ratio of costs is the median over truths of joint over staged: to the end, and until the floor is reached (of
    truths where both reach it).
    """
    staged, joint = f"{method}, staged", f"{method}, joint"
    both = [one for one in done if {staged, joint} <= set(one.searches)]
    ends = [tuple(one.searches[name].end <= AS_GOOD * one.floor for name in (staged, joint)) for one in both]

    def ratio(cost: Callable[[Search, float], float | None]) -> float | None:
        costs = [(cost(one.searches[staged], one.floor), cost(one.searches[joint], one.floor)) for one in both]
        return _rounded(_median(b / a for a, b in costs if a is not None and b is not None))

    def until(search: Search, floor: float) -> float | None:
        first = search.first(floor)
        return first.simulations if first else None

    return {
        "method": method,
        "truths": len(both),
        "staged": row(staged, both),
        "joint": row(joint, both),
        "both_reach": ends.count((True, True)),
        "only_staged_reaches": ends.count((True, False)),
        "only_joint_reaches": ends.count((False, True)),
        "neither_reaches": ends.count((False, False)),
        "joint_over_staged_evaluations": ratio(lambda search, _: search.evaluations),
        "joint_over_staged_simulations": ratio(lambda search, _: search.simulations),
        "joint_over_staged_seconds": ratio(lambda search, _: search.seconds),
        "joint_over_staged_simulations_until_reached": ratio(until),
    }


def figures(done: list[Trial], compared: int) -> dict[str, Any]:
    """Return all figures of the trials ``done``; the modes are compared on the first ``compared`` of them."""
    good = [one for one in done if one.failure is None]
    rows = {name: row(name, good) for name in SEARCHES if any(name in one.searches for one in good)}
    found: dict[str, Any] = {}
    for method in ("genetic", "auto"):
        staged = rows[f"{method}, staged"]
        found[f"{method}_reliability_percent"] = staged["percent"]
        found[f"{method}_reliability_interval_percent"] = staged["interval_percent"]
    return found | {
        "truths": len(good),
        "truths_that_cannot_be_simulated": len(done) - len(good),
        "newton_from_the_truth_misses_the_floor": sum(one.newton > AS_GOOD * one.floor for one in good),
        "median_truth_over_floor": _rounded(_median(one.truth / one.floor for one in good)),
        "searches": list(rows.values()),
        "staging": [staging(method, good[:compared]) for method in ("genetic", "auto")] if compared else [],
    }


def _median(values: Iterable[float]) -> float | None:
    each = list(values)
    return float(np.median(each)) if each else None


def _rounded(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else round(value, 4)


def measure(kind: EvaluatorKind, truths: int, compared: int, bodies: int, path: Path | None) -> dict[str, Any]:
    """Run all trials that are not in the log at ``path``, and return all figures."""
    evaluator = make_evaluator(kind, None if kind == "in_process" else 2)
    try:
        _warm(bodies, evaluator)
        done = list(trials(truths, compared, bodies, evaluator, Log(path)))
    finally:
        evaluator.close()
    return figures(done, compared) | {"bodies": bodies, "evaluator": kind, "cpu": cpu(), "commit": commit()}


def _warm(bodies: int, evaluator: Evaluator) -> None:
    """Simulate once before anything is timed, so that the kernels are compiled; the truth does not matter."""
    dataset, _ = recorded(bodies, 1)
    problem = joint_problem(bodies, dataset)
    evaluator.evaluate(problem, np.tile([gene.nominal for gene in free_genes(problem)], (32, 1)))


def main() -> None:
    """Parse the command line, measure, and print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reliability", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print only the JSON object")
    parser.add_argument("--truths", type=int, default=50, help="true wings")
    parser.add_argument("--compared", type=int, default=20, help="truths that the genetic search also fits jointly")
    parser.add_argument("--bodies", type=int, choices=tuple(DIVISIONS), default=8)
    parser.add_argument("--log", type=Path, help="file with one line of JSON per truth, from which a run resumes")
    parser.add_argument("--evaluator", choices=("in_process", "processes", "ray"), default="processes")
    arguments = parser.parse_args()
    found = measure(arguments.evaluator, arguments.truths, arguments.compared, arguments.bodies, arguments.log)
    if not arguments.json:
        for key, value in found.items():
            for each in value if isinstance(value, list) and key in ("searches", "staging") else [value]:
                print(f"{key}: {each}")
    print(json.dumps(found))


if __name__ == "__main__":
    main()
