"""The contract suite of rigs finds every breach of the contract."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.rigs.oscillator import RIG, blank, dataset
from tests.rigs.oscillator import simulate as right
from wingfit.diagnosis.rig_check import CheckResult, check_rig
from wingfit.records.array_types import Array
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run

RNG = np.random.default_rng(0)
Simulate = Callable[[Mapping[str, float], Run], dict[str, Array]]


def recorded() -> Any:
    found = right({"stiffness": 40.0, "damping": 0.2, "start": 0.08, "speed": 0.0} | OFF, _run())
    values = np.stack([found["position"], found["speed"]], axis=1)
    return dataset(blank("one", values=values), blank("two", values=values))


OFF = {"drag.size": 0.0, "drag.power": 2.0}


def _run() -> Run:
    recording = blank()
    return Run("one", recording.times, recording.settings, {}, recording.times)


def failures(rig: Rig) -> dict[str, CheckResult]:
    return {one.name: one for one in check_rig(rig, recorded()) if one.outcome != "pass"}


def broken(change: Simulate) -> Rig:
    return replace(RIG, simulate=change)


def test_a_right_rig_passes() -> None:
    assert failures(RIG) == {}


def test_a_random_simulation_is_found() -> None:
    def noisy(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        return {name: one + 1e-6 * RNG.standard_normal() for name, one in right(genes, run).items()}

    assert "without a fixed seed" in failures(broken(noisy))["is deterministic"].words


def test_a_simulation_that_changes_its_recording_is_found() -> None:
    def careless(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        found = right(genes, run)
        run.times[:] = run.times + 0.0
        run.times[0] += 1e-9
        return found

    assert "copy them" in failures(broken(careless))["leaves its arguments as they are"].words


def test_an_effect_that_is_not_off_at_zero_is_found() -> None:
    def leaky(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        found = right(genes, run)
        return found | {"position": found["position"] * (1.0 + 1e-6 * (genes["drag.power"] - 2.0))}

    result = failures(broken(leaky))["suspect drag is off at zero"]
    assert result.outcome == "fail"
    assert "zero must switch it off exactly" in result.words


def test_an_effect_that_does_nothing_is_found() -> None:
    def deaf(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        return right({**genes, "drag.size": 0.0}, run)

    assert "it changes nothing in this recording" in failures(broken(deaf))["suspect drag is off at zero"].words


def test_a_port_that_is_not_used_is_found() -> None:
    def closed(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        return right(genes, replace(run, laws={}))

    assert "must add run.force('slide', ...)" in failures(broken(closed))["port slide is used"].words


def test_a_gene_without_influence_is_found() -> None:
    def stiff(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        return right({**genes, "damping": 0.2}, run)

    assert failures(broken(stiff))["depends on its genes"].words.startswith("damping changes nothing")


def test_a_simulation_with_jumps_is_found() -> None:
    def jumping(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        return right({**genes, "stiffness": round(2.0 * genes["stiffness"]) / 2.0}, run)

    assert "when its step is halved" in failures(broken(jumping))["is smooth"].words


@pytest.mark.parametrize(
    ("changes", "name", "words"),
    [
        ({"channels": {"position": "mm", "speed": "m/s"}}, "fits the dataset", "in 'm' in dataset 'test'"),
        ({"settings": {"length": "m"}}, "fits the dataset", "needs the setting 'length'"),
        ({"simulate": lambda _genes, _run: {}}, "simulates its nominal genes", "no channel 'position'"),
    ],
)
def test_what_cannot_be_simulated_ends_the_checks(changes: dict[str, Any], name: str, words: str) -> None:
    found = list(check_rig(replace(RIG, **changes), recorded()))
    assert found[-1].name == name
    assert found[-1].outcome == "fail"
    assert words in found[-1].words
