from __future__ import annotations

import time

import numpy as np
import pytest

from benchmarks.physics.random_genomes import (
    CAMPAIGN,
    CHECKED,
    DIVISIONS,
    Ended,
    Task,
    draw,
    run,
    simulate,
    summary,
    tasks,
)
from wingfit.records import Condition
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

GENES = FlexibleWing(robird_wing()).genes
VACUUM, AIR = vacuum(10.0, 0.0, 3.0), tunnel(0.0, 3.0, 6.0)
FLUTTER = "not periodic after 24 beats: still more than 0.025 mm from a periodic motion; it may flutter"


def silent(done: int, of: int) -> None:
    assert 0 < done <= of


def hang(task: Task) -> Ended:
    time.sleep(600.0)
    raise AssertionError(f"{task} should have been ended")


def test_genomes_fill_the_box_log_uniformly() -> None:
    genomes = draw(GENES, 2000, 3)
    lower, upper = np.array([(gene.lower, gene.upper) for gene in GENES]).T
    units = np.log(genomes / lower) / np.log(upper / lower)
    assert units.min() >= 0
    assert units.max() <= 1
    np.testing.assert_allclose(np.quantile(units, [0.05, 0.5, 0.95], axis=0).T, [[0.05, 0.5, 0.95]] * 18, atol=0.05)
    assert np.array_equal(genomes, draw(GENES, 2000, 3))
    assert not np.array_equal(genomes, draw(GENES, 2000, 4))


def test_every_genome_is_simulated_once_and_every_condition_is_used() -> None:
    genomes = draw(GENES, 1000, 1)
    todo = tasks(genomes)
    everyone = np.concatenate([task.genomes for task in todo])
    assert np.array_equal(np.sort(everyone[:, 0]), np.sort(genomes[:, 0]))
    assert {(task.division, task.condition) for task in todo} == {(d, c) for d in DIVISIONS for c in CAMPAIGN}
    assert {task.division for task in todo if task.checked} == set(DIVISIONS)
    assert sum(task.checked for task in todo) == -(-len(todo) // CHECKED)


def ended(division: str, condition: Condition, reasons: list[str | None], errors: list[float]) -> Ended:
    genomes = draw(GENES, len(reasons), 1)
    return Ended(Task(division, condition, genomes), reasons, [5] * len(reasons), 0.5, errors)


def test_summary_counts_outcomes() -> None:
    nan = float("nan")
    done = [
        ended("11", VACUUM, [None, None, FLUTTER], [nan, nan, nan]),
        ended("24", AIR, [None, "diverged in beat 1: ..."], [2e-4, nan]),
        ended("24", VACUUM, [None], [4e-5]),
    ]
    hung = Task("24", AIR, draw(GENES, 2, 1))
    found = summary([*(one.task for one in done), hung], done)
    assert found["finished_percent"] == pytest.approx(50.0)
    assert found["not_ended_percent"] == pytest.approx(25.0)
    assert found["given_up"] == {"not periodic": 1, "diverged": 1}
    assert found["finished_percent_by"]["air"] == 50.0
    assert found["finished_percent_by"]["11 bodies"] == 66.7
    assert found["checked"] == 2
    assert found["checked_within_accuracy_percent"] == 50.0
    assert found["checked_largest_error_mm"] == pytest.approx(0.2)
    assert [case["error_mm"] for case in found["checked_beyond_accuracy_cases"]] == pytest.approx([0.2])
    assert [case["division"] for case in found["given_up_cases"]] == ["11", "24"]
    assert found["ms_per_genome"] == pytest.approx(250.0)


def test_hung_tasks_are_killed_and_counted() -> None:
    todo = [Task("11", VACUUM, draw(GENES, 1, 1))]
    start = time.monotonic()
    done = run(todo, 1, silent, limit=0.5, work=hang)
    assert time.monotonic() - start < 60
    assert summary(todo, done)["not_ended_percent"] == 100.0


def test_checked_genomes_are_compared_with_converged_motions() -> None:
    nominal = np.array([[gene.nominal for gene in GENES]])
    found = simulate(Task("4", VACUUM, nominal, checked=True))
    assert found.reasons == [None]
    assert 0 < found.errors[0] < 1e-4
    assert np.isnan(simulate(Task("4", VACUUM, nominal)).errors[0])
