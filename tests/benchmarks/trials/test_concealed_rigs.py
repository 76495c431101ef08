"""Rigs of other size and layout, descriptions with the errors of a laboratory, and wings that drift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.common.svg import svg
from benchmarks.concealed.answer import Group
from benchmarks.concealed.benches.bench import Bench
from benchmarks.concealed.benches.choose import bench_of
from benchmarks.concealed.benches.continuous import ContinuousBench
from benchmarks.concealed.benches.drifting import drifting
from benchmarks.concealed.benches.vehicle import VehicleBench
from benchmarks.concealed.benches.vortex_lattice import VortexLatticeBench
from benchmarks.concealed.benches.wing import WingBench
from benchmarks.concealed.calibration import bins_of, verdict_is_right
from benchmarks.concealed.plant.law import Concealed, strength
from benchmarks.concealed.plant.vortex_lattice.simulate import VARIABLE
from benchmarks.concealed.rigs import BY_HAND, VEHICLES, WINGS, as_described, size_of
from benchmarks.concealed.score import Mark
from benchmarks.concealed.table import Table, figures_of
from benchmarks.concealed.trials import DRIFTS, FOUR_ROD, VORTICES, Build, chamber, flight, tunnel
from docs.generate.reliability_figure import panel
from wingfit.records import Recording
from wingfit.sim.model import Array
from wingfit.sim.virtual_rigs.campaign import blank_recording


@pytest.mark.parametrize("name", WINGS)
def test_plant_and_model_of_every_wing_agree(name: str) -> None:
    """Two simulators of the same bodies: the markers differ by far less than cameras see."""
    wing, grid = WINGS[name]
    bench = WingBench(Build("wing", "4", "4", body=name))
    genome = {gene.name: gene.nominal for gene in bench.model.genes}
    for condition in (chamber(1000.0, 0.05, grid.frequencies[2]), tunnel(0.05, grid.frequencies[1], grid.speeds[2])):
        beat = bench.simulated(condition, genome, {})
        times = np.arange(len(beat.tracks)) / len(beat.tracks) / condition.flap_frequency
        values = np.roll(beat.tracks, -round(beat.crossing / (2 * np.pi) * len(times)), axis=0)
        seen = Recording("a", "vacuum_chamber", condition, times, blank_recording(wing, condition).markers,
                         values.reshape(len(times), -1))  # fmt: skip
        found = bench.model.observe(np.array([list(genome.values())]), seen)
        assert found.reasons == (None,)
        assert np.sqrt(np.mean((found.channels[0] - seen.values) ** 2)) < 2e-4 * size_of(wing)


@pytest.mark.parametrize("name", VEHICLES)
def test_plant_and_model_of_every_vehicle_agree(name: str) -> None:
    bench = VehicleBench(Build("vehicle", body=name))
    genome = bench.genome(np.random.default_rng(1))
    condition = flight(*VEHICLES[name][1].flights[2])
    forces: Array = bench.simulated(condition, genome, {})
    blank = Recording(
        "a", "wind_tunnel", condition, np.arange(4) / 40.0, (), np.full((4, 2), np.nan), forces=("x", "z")
    )
    model = bench.model
    own = np.asarray(model.beat([list(genome.values())], blank)[0])  # type: ignore[attr-defined]
    apart = np.array(
        [np.interp(np.arange(len(own)) / len(own), np.arange(len(forces)) / len(forces), c) for c in forces.T]
    )
    assert np.sqrt(np.mean((apart.T - own) ** 2)) < 0.02 * np.sqrt(np.mean(own**2))


def test_a_continuous_wing_is_filmed_and_its_changes_are_those_of_the_bodies() -> None:
    bench = bench_of(replace(FOUR_ROD, division="8x1"))
    assert isinstance(bench, ContinuousBench)
    assert type(bench.coarse()) is WingBench
    assert "backlash" not in bench.laws
    genome, condition = {gene.name: gene.nominal for gene in bench.model.genes}, chamber(1000.0, 0.05, 2.5)
    hidden = {"hinge_offset": {"strength": 0.01, "direction": 0.6}}
    quality = bench.ideal(bench.quality(np.random.default_rng(1)))

    def values(one: Bench[Any, Any], concealed: Concealed) -> Array:
        made: Array = one.recording(condition, genome, concealed, quality, np.random.default_rng(2)).recording.values
        return made

    rod, bodies = (values(one, hidden) - values(one, {}) for one in (bench, bench.coarse()))
    assert 2e-3 < np.sqrt(np.mean(rod**2)) < 2e-2
    assert np.sqrt(np.mean((rod - bodies) ** 2)) < 0.1 * np.sqrt(np.mean(rod**2))


def test_a_vortex_lattice_has_what_its_model_must_contain(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = bench_of(VORTICES)
    assert isinstance(bench, VortexLatticeBench)
    genome = bench.genome(np.random.default_rng(1))
    assert {"circulation_lag.share", "tip_loss.spacing", "wing_acceleration.share", "C_l"} <= set(genome)
    assert set(genome) == {gene.name for gene in bench.model.genes}
    assert {"C_l", "C_D0", "circulation_lag.share"} <= set(bench.searched)
    assert type(bench.coarse()) is VehicleBench
    assert bench.coarse().simulated(flight(6.0, 4.0, 4.2), genome, {}).shape[1] == 2
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(RuntimeError, match=f"set the environment variable {VARIABLE}"):
        bench.simulated(flight(6.0, 4.0, 4.2), genome, {})


def test_a_description_has_the_errors_of_a_laboratory_in_proportion_to_the_wing() -> None:
    for wing, _ in WINGS.values():
        off = []
        for seed in range(20):
            described = as_described(wing, np.random.default_rng(seed))
            places = [[m.position for m in one.markers] for one in (wing, described)]
            off.append(float(np.std(np.array(places[0]) - np.array(places[1]))) / size_of(wing))
            assert described.materials != wing.materials
            assert described.stations == wing.stations
        assert BY_HAND[0] * 0.8 < min(off) < max(off) < BY_HAND[1] * 1.2
        assert np.mean(off) == pytest.approx(np.mean(BY_HAND), rel=0.2)


def test_a_wing_drifts_between_its_stiffest_and_its_softest_motion() -> None:
    """And one whose motor drifts between its largest and its smallest stroke; what else is hidden stays."""
    blank = Recording("a", "vacuum_chamber", chamber(1e3, 0.0, 3.0), np.arange(41) / 30.0, ("m",), np.zeros((41, 3)))

    def record(genome: Mapping[str, float], hidden: Concealed, rng: np.random.Generator) -> Recording:
        assert set(hidden) <= {"backlash", "stroke_amplitude"}
        noise = 1e-3 * rng.standard_normal((41, 3))
        value = genome["E_f"] * (1.0 + strength(hidden, "stroke_amplitude"))
        return Recording("a", blank.rig, blank.condition, blank.times, ("m",), np.full((41, 3), value) + noise)

    for name in DRIFTS:
        hidden = {name: {"strength": 0.2}, "backlash": {"strength": 1.0}}
        found = drifting(record, {"E_f": 10.0, "L_a": 3.0}, hidden, np.random.default_rng(5)).values
        noise = 1e-3 * np.random.default_rng(5).standard_normal((41, 3))
        np.testing.assert_allclose(found - noise, np.tile(np.linspace(11.0, 9.0, 41)[:, None], (1, 3)), atol=1e-12)


def test_a_verdict_is_right_if_all_that_it_names_is_hidden() -> None:
    def scored(group: Group, verdict: str, truth: tuple[str, ...], named: tuple[str, ...] = ()) -> Mark:
        return Mark(
            "t", group, "wing", truth, 3.0, 3.0, verdict, named, wrong=not set(named) <= set(truth), probability=0.97,
            found=len(set(named) & set(truth)), alarm=verdict != "adequate", body="bird", division="4", plant="9x1",
        )  # fmt: skip

    marks = (
        scored("null", "adequate", ()),
        scored("listed", "named", ("a",), ("a",)),
        scored("listed", "named", ("a",), ("b",)),
        scored("pairs", "named", ("a", "b"), ("a",)),
        scored("smooth", "unnamed", ("c",)),
        scored("drift", "adequate", ("stiffness_drift",)),
        scored("listed", "adequate", ("a",)),
    )
    assert [verdict_is_right(one) for one in marks] == [True, True, False, True, True, False, False]
    drifts = [scored("drift", "named", ("stiffness_drift",), (name,)) for name in ("stiffness_drift", "strobe_rate")]
    drifts.append(scored("drift", "unnamed", ("stiffness_drift",)))
    assert [verdict_is_right(one) for one in drifts] == [True, False, True]
    table = Table(marks, (), 0, 1.0).as_json()
    together = {"n": 7, "said_percent": 97.0, "right_percent": 57.1}
    assert table["calibration"] == {"said_95": 7, "right_percent": 57.1, "bins": [together]}
    certain = [replace(one, probability=1.0) for one in marks[:2]]
    found = bins_of([*marks, *certain, replace(marks[2], probability=0.5)])
    assert found == [
        {"n": 1, "said_percent": 50.0, "right_percent": 0.0},
        together,
        {"n": 2, "said_percent": 100.0, "right_percent": 100.0},
    ]
    assert "Reliability of verdicts" in svg([panel(found)])
    assert table["drift"] == {"n": 1, "adequate_percent": 100.0}
    assert table["smooth_unlisted"] == {"n": 1, "wrong_percent": 0.0, "unnamed_percent": 100.0}
    assert table["by_plant"] == {"bird: wing 4 of 9x1": figures_of(marks)}
    assert figures_of(marks)["wrong_name_percent"] == pytest.approx(14.3)
