from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.concealed.strength import Refit, rms, strength_for
from wingfit.records import Condition, Gene, Recording
from wingfit.sim.model import Observation

CONDITION = Condition(3.0, 0.05, 1e5, 293.15)


class Line:
    """Two genes: height and slope; the second is bounded closely."""

    genes = (
        Gene("height", "m", 0.0, -10.0, 10.0, "linear", ""),
        Gene("slope", "m", 1.0, 0.5, 1.5, "linear", ""),
    )
    searched = ("height", "slope")

    def observe(self, genomes: np.ndarray, recording: Recording) -> Observation:
        x = recording.times
        values = genomes[:, :1] + genomes[:, 1:] * x + 0.1 * genomes[:, 1:] ** 2
        return Observation(np.repeat(values[:, :, None], 3, axis=2), (None,) * len(genomes))


def line(start: Mapping[str, float] | None = None) -> tuple[Refit, np.ndarray]:
    x = np.linspace(-1.0, 1.0, 41)
    recording = Recording("r", "vacuum_chamber", CONDITION, x, ("m",), np.zeros((41, 3)))
    return Refit(Line(), start or {"height": 1.0, "slope": 1.0}, (recording,)), x


def test_a_change_within_reach_of_the_genes_has_no_strength() -> None:
    refit, x = line()
    change = np.repeat(0.3 + 0.2 * x, 3)
    assert refit.linear(change) == pytest.approx(0.0, abs=1e-6)
    assert refit.full(change)[0] == pytest.approx(0.0, abs=1e-6)


def test_strength_is_the_residual_and_a_refit_stops_at_the_bounds() -> None:
    refit, x = line()
    beyond = x**2 - np.mean(x**2) - 0.0 * x
    assert refit.linear(np.repeat(beyond, 3)) == pytest.approx(rms(beyond), rel=1e-6)
    assert refit.full(np.repeat(beyond, 3))[0] == pytest.approx(rms(beyond), rel=1e-6)
    steep = np.repeat(2.0 * x, 3)  # the slope may go up by one half only
    assert refit.linear(steep) == pytest.approx(rms(1.5 * x), rel=0.02)
    left, end = refit.full(steep, rounds=2)
    assert left == pytest.approx(rms(1.5 * x), rel=0.02)
    assert end[1] == pytest.approx(1.0)


class Fluttering(Line):
    """It has no motion where the height is not near 1."""

    def observe(self, genomes: np.ndarray, recording: Recording) -> Observation:
        seen = super().observe(genomes, recording)
        reasons = tuple("it flutters" if abs(height - 1) > 0.9 else None for height in genomes[:, 0])
        return Observation(seen.channels, reasons)


def test_a_refit_avoids_genomes_that_cannot_be_simulated() -> None:
    refit, x = line()
    change = np.repeat(1.2 + 0.2 * x, 3)
    there = replace(refit, model=Fluttering())
    assert refit.full(change, rounds=3)[0] == pytest.approx(0.0, abs=1e-6)
    left, end = there.full(change, rounds=3)
    assert 0.25 < left < 1.0  # as near as it gets: 0.3 of the height are out of reach
    assert there.genes[0].from_unit(end[0]) < 1.9
    nowhere = replace(there, start={"height": 3.0, "slope": 1.0})
    with pytest.raises(RuntimeError, match="no periodic motion"):
        nowhere.full(change)


def test_a_refit_starts_from_a_given_genome_if_that_is_better() -> None:
    refit, x = line()
    change = np.repeat(2.0 + 0.3 * x, 3)
    _, end = refit.full(change, rounds=3)
    calls: list[int] = []
    watched = replace(refit, model=Counting(calls))
    assert watched.full(change, near=[end])[0] == pytest.approx(0.0, abs=1e-6)
    again = len(calls)
    calls.clear()
    watched.full(change)
    assert again < len(calls)


class Counting(Line):
    """Counts the individuals of every request."""

    def __init__(self, calls: list[int]) -> None:
        self.calls = calls

    def observe(self, genomes: np.ndarray, recording: Recording) -> Observation:
        self.calls.append(len(genomes))
        return super().observe(genomes, recording)


def test_missing_samples_are_ignored() -> None:
    refit, x = line()
    change = np.repeat(x**2, 3)
    change[::4] = np.nan
    assert np.isfinite(refit.linear(change))
    assert refit.full(change)[0] == pytest.approx(refit.linear(change), rel=1e-3)


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_the_strength_search_reaches_the_target(power: float) -> None:
    calls = []

    def misfit(strength: float) -> float:
        calls.append(strength)
        return float(0.7 * strength**power)

    found, there = strength_for(3.0, misfit, 1.0, (1e-3, 1e3), tries=5)
    assert there == pytest.approx(3.0, rel=0.2)
    assert there == pytest.approx(0.7 * found**power)
    assert len(calls) <= 6


def test_a_strength_stays_within_its_limits() -> None:
    assert strength_for(3.0, lambda s: 0.1 * s, 1.0, (0.1, 2.0)) == pytest.approx((2.0, 0.2))


def test_the_strength_search_retreats_where_the_plant_fails() -> None:
    def misfit(strength: float) -> float:
        if strength > 3.0:
            raise ArithmeticError("no periodic motion")
        return 0.5 * math.sqrt(strength)

    found, there = strength_for(3.0, misfit, 1.0, (1e-3, 1e3))
    assert 1.5 < found <= 3.0
    assert there == pytest.approx(0.5 * found**0.5)
