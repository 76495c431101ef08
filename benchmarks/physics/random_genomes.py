"""Simulations of random gene values from the whole search range: whether they succeed, and how accurate they are."""

from __future__ import annotations

import multiprocessing
import re
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.physics.convergence import largest_distance
from wingfit.records import Condition, Gene
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import VACUUM, WIND_TUNNEL, blank_recording, name_of, robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]

DIVISIONS = ("11", "24")
CAMPAIGN = (*VACUUM, *WIND_TUNNEL)
LIMIT = 300.0  # s without any result after which the remaining tasks count as hung
KINDS = ("not periodic", "diverged", "not accurate")
CHECKED = 7  # every seventh task is repeated with REFERENCE; coprime to the campaign's size
REFERENCE = Numerics(steps=1024, periodic=1e-6, max_beats=120)


class Task(NamedTuple):
    """Genomes [B, G] (B sets of G gene values) to simulate in one discretisation (``division``) under one condition.

    ``checked``: whether the motions are also compared with converged ones.
    """

    division: str
    condition: Condition
    genomes: Array
    checked: bool = False


class Ended(NamedTuple):
    """Results of a task.

    ``reasons``: of failure of each genome, None if it succeeded; ``beats``: simulated beats of each; ``seconds``:
    processor time of all; ``errors``: largest error (m) of a marker for each, NaN if it was not checked or if either
    simulation failed.
    """

    task: Task
    reasons: list[str | None]
    beats: list[int]
    seconds: float
    errors: list[float]


def draw(genes: tuple[Gene, ...], count: int, seed: int) -> Array:
    """Draw ``count`` random genomes [count, G] over the search ranges of the G ``genes``.

    Values are uniform on the gene's scale, which is linear or logarithmic.
    """
    units = np.random.default_rng(seed).uniform(size=(count, len(genes)))
    return np.stack([gene.from_unit(units[:, k]) for k, gene in enumerate(genes)], axis=1)


def tasks(genomes: Array, campaign: tuple[Condition, ...] = CAMPAIGN) -> list[Task]:
    """Split ``genomes`` [n, G] into tasks, cycling through the conditions of ``campaign`` and the discretisations."""
    found = []
    for c, condition in enumerate(campaign):
        rounds = genomes[c :: len(campaign)]
        parts = [(division, rounds[d :: len(DIVISIONS)]) for d, division in enumerate(DIVISIONS)]
        found += [Task(division, condition, part) for division, part in parts if len(part)]
    return [task._replace(checked=k % CHECKED == 0) for k, task in enumerate(found)]


def simulate(task: Task) -> Ended:
    """Simulate the genomes of ``task`` at the default accuracy, and if it is checked also at that of REFERENCE."""
    model = FlexibleWing(robird_wing(), task.division)
    blank = blank_recording(model.wing, task.condition)
    start = time.thread_time()
    ended = model.beats(task.genomes, blank)
    seconds = time.thread_time() - start
    errors = [np.nan] * len(ended)
    if task.checked:
        converged = replace(model, numerics=REFERENCE).beats(task.genomes, blank)
        errors = [largest_distance(a.tracks, b.tracks) for a, b in zip(ended, converged, strict=True)]
    return Ended(task, [beat.reason for beat in ended], [beat.beats for beat in ended], seconds, errors)


def run(
    todo: list[Task],
    workers: int,
    progress: Callable[[int, int], None],
    *,
    limit: float = LIMIT,
    work: Callable[[Task], Ended] = simulate,
) -> list[Ended]:
    """Run the tasks ``todo`` in ``workers`` processes; return the results of those that finished, in any order.

    If no task finishes for ``limit`` seconds, the processes are killed. ``progress`` is called with the numbers of
    finished and of all tasks; ``work``: function that simulates one task.
    """
    done: list[Ended] = []
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        results = pool.imap_unordered(work, todo)
        for _ in todo:
            try:
                done.append(results.next(timeout=limit))
            except multiprocessing.TimeoutError:
                break
            progress(len(done), len(todo))
    return done


def summary(todo: list[Task], done: list[Ended]) -> dict[str, Any]:
    """Return the figures for the report: percentage of genomes that succeeded, reasons of failures, accuracy, cost.

    ``todo``: all tasks; ``done``: results of those that finished.
    """
    total, ended = sum(len(task.genomes) for task in todo), sum(len(one.reasons) for one in done)
    if total == 0:
        raise ValueError("the number of genomes is 0; give at least 1")
    accuracy = Numerics().accuracy
    given_up = [_case(one, k) for one in done for k, reason in enumerate(one.reasons) if reason is not None]
    wrong = [_case(one, k) for one in done for k, error in enumerate(one.errors) if error > accuracy]
    beats, errors = [count for one in done for count in one.beats], np.array([e for one in done for e in one.errors])
    errors = errors[np.isfinite(errors)]
    return {
        "finished_percent": 100 * (ended - len(given_up)) / total,
        "not_ended_percent": 100 * (total - ended) / total,
        "genomes": total,
        "given_up": dict(Counter(kind(case["reason"]) for case in given_up)),
        "given_up_cases": given_up,
        "finished_percent_by": _shares(done),
        "beats_median": float(np.median(beats)) if beats else None,
        "beats_most": max(beats, default=None),
        "ms_per_genome": 1e3 * sum(one.seconds for one in done) / max(1, ended),
        "longest_group_seconds": max((one.seconds for one in done), default=None),
        "checked": len(errors),
        "checked_within_accuracy_percent": 100 * float(np.mean(errors <= accuracy)) if len(errors) else None,
        "checked_largest_error_mm": 1e3 * float(errors.max()) if len(errors) else None,
        "checked_beyond_accuracy_cases": wrong,
    }


def _case(one: Ended, k: int) -> dict[str, Any]:
    """Describe genome number ``k`` of a task for the report, sufficiently to simulate it again."""
    nominal = np.array([gene.nominal for gene in FlexibleWing(robird_wing()).genes])
    return {
        "division": one.task.division,
        "condition": name_of(one.task.condition),
        "reason": one.reasons[k],
        "error_mm": 1e3 * one.errors[k] if np.isfinite(one.errors[k]) else None,
        "genes_over_nominal": [round(float(x), 3) for x in one.task.genomes[k] / nominal],
    }


def _shares(done: list[Ended]) -> dict[str, float]:
    """Return the percentage of genomes that succeeded, by discretisation, medium, and airspeed or pressure."""
    finished: Counter[str] = Counter()
    ended: Counter[str] = Counter()
    for one in done:
        for label in _labels(one.task):
            finished[label] += sum(reason is None for reason in one.reasons)
            ended[label] += len(one.reasons)
    return {label: round(100 * finished[label] / count, 1) for label, count in sorted(ended.items())}


def kind(reason: str) -> str:
    """Return the category of a failure ``reason``: the one of KINDS that it begins with, or its text up to : or ;."""
    return next((known for known in KINDS if reason.startswith(known)), re.split(r"[:;]", reason)[0])


def _labels(task: Task) -> tuple[str, str, str]:
    here = task.condition
    place = f"{here.airspeed:g} m/s" if here.airspeed > 0 else f"{here.pressure / 100:g} mbar"
    return f"{task.division} bodies", "air" if here.airspeed > 0 else "vacuum chamber", place
