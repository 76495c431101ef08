"""Initial states are estimated from the first samples of a recording, which keeps fits out of local minima."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from tests.calibration.series.swing import RIG, STARTS, TRUTH, dataset, recorded
from tests.rigs.oscillator import RIG as OSCILLATOR
from tests.rigs.oscillator import blank
from tests.rigs.oscillator import dataset as oscillations
from wingfit import CalibrationSpec, SeriesResult, calibrate
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.series.beginnings import Beginnings, from_beginnings
from wingfit.records import Channel, Gene, Series
from wingfit.records.array_types import Array
from wingfit.rigs.dataset_model import model_of
from wingfit.rigs.rig_model import RigModel
from wingfit.rigs.run import Run
from wingfit.workers import make_evaluator

HERE = make_evaluator("in_process")
OWN = ("start[a]", "speed[a]", "start[b]", "speed[b]")
TIMES = np.linspace(0.0, 12.0, 900)


def problem(*recordings: Series, base: Mapping[str, float] | None = None) -> Problem:
    model = model_of(RIG, dataset(*recordings))
    return Problem(model, recordings, (*OWN, "stiffness"), base_genome(model, base))


def swings(times: Array = TIMES) -> tuple[Series, Series]:
    return recorded("a", times=times, estimates={}), recorded("b", times=times, estimates={})


@pytest.mark.parametrize("last", [12.0, 300.0])
def test_the_first_samples_show_the_initial_state_although_the_stiffness_is_wrong(last: float) -> None:
    """It is 40 N/m instead of 55: the phase is wrong by half a beat after three seconds."""
    found = from_beginnings(problem(*swings(np.arange(0.0, last, 0.0133))), HERE, {}).values
    assert set(found) == set(OWN)
    for name in "ab":
        assert found[f"start[{name}]"] == pytest.approx(STARTS[name], abs=5e-3)


def test_with_the_right_stiffness_more_and_more_samples_count() -> None:
    """The standard errors of 18 samples, the first window, would be 3e-4 m and 3e-3 m/s."""
    found = from_beginnings(problem(*swings(), base=TRUTH), HERE, {}).values
    for name in "ab":
        assert found[f"start[{name}]"] == pytest.approx(STARTS[name], abs=3e-4)
        assert found[f"speed[{name}]"] == pytest.approx(0.1, abs=2e-3)


@pytest.mark.parametrize("wrong", [0.0, 0.29])
def test_wrong_first_samples_are_not_believed(wrong: float) -> None:
    """As of a logger that starts late, or of a spike."""
    one, other = swings()
    values = one.values.copy()
    values[:6] = wrong, 0.0
    found = from_beginnings(problem(replace(one, values=values), other), HERE, {}).values
    assert (found["start[a]"], found["speed[a]"]) == pytest.approx((0.08, 0.0))
    assert found["start[b]"] == pytest.approx(STARTS["b"], abs=5e-3)


def test_genes_that_act_alike_do_not_end_a_calibration() -> None:
    """The start and an offset, with bounds so wide that the prior says nothing."""
    wide = tuple(Gene(name, "m", 0.0, -1e6, 1e6, "linear") for name in ("start", "offset"))

    def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        return {"position": genes["offset"] + genes["start"] * np.cos(np.sqrt(genes["stiffness"]) * run.times)}

    channels = {"position": "m"}
    rig = replace(RIG, genes=RIG.genes[:1], recording_genes=wide, suspects=(), channels=channels, simulate=simulate)
    times = np.linspace(0.0, 1.5, 200)
    values = 0.1 * np.cos(np.sqrt(55.0) * times) + 1e-3 * np.random.default_rng(1).standard_normal(len(times))
    one = Series("a", times, (Channel("position", "m", 1e-3),), values[:, None], settings={"mass": 1.0})
    found = calibrate(dataset(one), CalibrationSpec(method="gauss_newton"), rig=rig)
    assert isinstance(found, SeriesResult)
    assert found.after == pytest.approx(1.0, abs=0.1)


def test_absurd_values_do_not_end_a_calibration() -> None:
    """Their squares are not finite, though they are."""

    def absurd(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        return {name: 1e152 * values for name, values in RIG.simulate(genes, run).items()}

    one = replace(problem(*swings()), model=model_of(replace(RIG, simulate=absurd), dataset(*swings())))
    found = from_beginnings(one, HERE, {}).values
    assert found == pytest.approx({"start[a]": 0.08, "speed[a]": 0.0, "start[b]": 0.08, "speed[b]": 0.0})


def test_individuals_are_counted() -> None:
    found = from_beginnings(problem(*swings()), HERE, {})
    assert found.evaluations > 0
    assert from_beginnings(problem(*swings()), HERE, dict.fromkeys(OWN, 0.0)).evaluations == 0


def test_what_is_known_is_left_alone() -> None:
    one, other = swings()
    known = problem(replace(one, estimates={"start": 0.05}), other)
    assert set(from_beginnings(known, HERE, {"speed[b]": 0.3}).values) == {"speed[a]", "start[b]"}
    everything = dict.fromkeys(OWN, 0.0)
    assert from_beginnings(problem(one, other), HERE, everything) == ({}, 0)


def test_a_simulation_that_fails_leaves_the_estimates() -> None:
    found = from_beginnings(problem(*swings()), HERE, {"stiffness": 150.0}).values
    assert found == pytest.approx({"start[a]": 0.08, "speed[a]": 0.0, "start[b]": 0.08, "speed[b]": 0.0})


def test_missing_samples_at_the_start_are_passed_over() -> None:
    one, other = swings()
    values = one.values.copy()
    values[:20] = np.nan
    found = from_beginnings(problem(replace(one, values=values), other), HERE, {}).values
    assert found["start[a]"] == pytest.approx(STARTS["a"], abs=0.02)


def test_one_recording_does_not_depend_on_the_others() -> None:
    one, other = swings()
    alone = from_beginnings(problem(one, other), HERE, {}).values
    changed = from_beginnings(problem(one, replace(other, values=-2.0 * other.values)), HERE, {}).values
    assert [changed[name] for name in OWN[:2]] == [alone[name] for name in OWN[:2]]
    assert changed["start[b]"] != alone["start[b]"]


HARD = "cubic_stiffness.slide"
TRUE = {"stiffness": 55.0, "damping": 0.1, f"{HARD}.size": 3500.0}
NOISE = (2e-3, 2e-2)  # m, m/s: half a per cent of the range
STATES = {"one": (0.25, 0.0), "two": (-0.2, 1.0), "three": (0.1, -1.5)}


def hardening() -> tuple[Series, ...]:
    """Oscillations on a hardening spring, whose frequency doubles with the amplitude."""
    rng, found = np.random.default_rng(3), []
    for name, (start, speed) in STATES.items():
        one = blank(name, samples=200, last=5.0)
        model = RigModel(OSCILLATOR, (one,), (HARD,))
        genome = base_genome(model, TRUE | {f"start[{name}]": start, f"speed[{name}]": speed})
        values = model.observe(np.array([[genome[gene.name] for gene in model.genes]]), one).channels[0]
        channels = (Channel("position", "m", NOISE[0]), Channel("speed", "m/s", NOISE[1]))
        found.append(replace(one, quantities=channels, values=values + NOISE * rng.standard_normal(values.shape)))
    return tuple(found)


def test_a_calibration_starts_in_the_right_valley(monkeypatch: pytest.MonkeyPatch) -> None:
    data = oscillations(*hardening())
    spec = CalibrationSpec(
        method="gauss_newton", max_generations=12, effects=(HARD,), fixed={f"{HARD}.size": TRUE[f"{HARD}.size"]}
    )
    found = calibrate(data, spec, rig=OSCILLATOR)
    assert isinstance(found, SeriesResult)
    assert found.after == pytest.approx(1.0, abs=0.05)
    monkeypatch.setattr("wingfit.calibration.search.from_beginnings", lambda *_: Beginnings({}, 0))
    without = calibrate(data, spec, rig=OSCILLATOR)
    assert isinstance(without, SeriesResult)
    assert without.after is not None
    assert without.after > 5.0
