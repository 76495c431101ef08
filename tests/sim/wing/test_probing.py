"""A known load on the wing: nothing at size zero, the force it says, the order of the method, what it moves."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.records import Condition
from wingfit.sim.effects.probe import LARGEST, Probe, strip_middles
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.drive import RodDrive
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.loads import simulate_outputs
from wingfit.sim.wing.probing import probed
from wingfit.sim.wing.structure import build

Array = npt.NDArray[np.float64]

WING = robird_wing()
SPAN = WING.stations[-1].y - WING.stations[0].y
NUMERICS = Numerics(steps=80, periodic=1e-6, max_beats=40)
BARE = FlexibleWing(WING, "4", numerics=NUMERICS)
SMALL = Probe((0.0, 0.5, 1.0), 2)


def with_load(probe: Probe, sizes: dict[str, float] | None = None, steps: int = 80) -> tuple[FlexibleWing, Array]:
    """The wing with a probe, and its nominal genome under some of the loads."""
    model = replace(BARE, probe=probe, numerics=replace(NUMERICS, steps=steps))
    values = {gene.name: gene.nominal for gene in model.genes} | {f"probe.{key}": v for key, v in (sizes or {}).items()}
    return model, np.array(list(values.values()))


def test_no_load_is_no_change_in_any_bit() -> None:
    model, genome = with_load(SMALL)
    blank = blank_recording(WING, tunnel(0.05, 3.0, 6.0))
    assert np.array_equal(model.beat(genome, blank).tracks, BARE.beat(genome[: -SMALL.size], blank).tracks)


def test_is_no_suspect_and_goes_with_the_model() -> None:
    assert "probe" not in EFFECTS
    model, _ = with_load(SMALL)
    assert pickle.loads(pickle.dumps(model)).genes == model.genes  # noqa: S301
    assert len(model.genes) == len(BARE.genes) + SMALL.size
    assert model.genes[-1].upper == LARGEST


@pytest.mark.parametrize("division", ["2x1", "4", "11", "24"])
def test_force_and_moment_are_those_of_the_load_whatever_the_division(division: str) -> None:
    structure, probe = build(WING, Division.parse(division)), Probe()
    (on_strips, levers), middles = probe.on_strips(structure), strip_middles(structure)
    span = np.linspace(0.0, 1.0, 4001)
    hats = probe.hats(span)
    np.testing.assert_allclose(on_strips.sum(axis=0), np.trapezoid(hats, span, axis=0) * SPAN, rtol=1e-4)
    np.testing.assert_allclose(
        middles @ on_strips + levers.sum(axis=0) / SPAN,
        np.trapezoid(hats * span[:, None], span, axis=0) * SPAN,
        rtol=1e-3,
        atol=1e-5,
    )


def test_every_strip_is_pushed_along_its_normal_as_the_series_says() -> None:
    """In a perfect vacuum, where the air has no other force."""
    model, genome = with_load(SMALL, {"0_0": 0.3, "1_c1": -0.5, "2_s2": 0.4, "2_c2": 0.1})
    found = simulate_outputs(model, genome.tolist(), blank_recording(WING, Condition(3.0, 0.05, 0.0, 293.15)))
    sizes = genome[-SMALL.size :].reshape(3, -1)
    expected = SMALL.on_strips(model.structure)[0] @ sizes @ SMALL.terms(found.phase).T
    forces = np.array([np.linalg.norm(strip.force, axis=1) for strip in found.strips])
    np.testing.assert_allclose(forces, np.abs(expected), rtol=1e-6, atol=1e-9)
    upward = found.strips[0].force[0, 2]
    assert upward * expected[0, 0] > 0  # the wing is level within half a right angle
    np.testing.assert_allclose(found.balance.relative_closing, 0.0, atol=0.01)


def test_keeps_the_order_of_the_method() -> None:
    """Fourth order: a step half as long leaves about a sixteenth; without the load's own rate of change, a fifth."""
    loads = {"2_c2": 2.0, "1_s2": 2.0}
    blank = blank_recording(WING, vacuum(10.0, 0.0, 2.0))
    tracks = {}
    for steps in (96, 192, 768):
        model, genome = with_load(SMALL, loads, steps)
        bare = model.beat(np.where(np.arange(len(genome)) < len(BARE.genes), genome, 0.0), blank).tracks
        tracks[steps] = (model.beat(genome, blank).tracks - bare)[:: steps // 96]
    coarse, fine = (float(np.abs(tracks[n] - tracks[768]).max()) for n in (96, 192))
    assert coarse / fine > 11.0


def test_answers_are_those_of_any_size_and_motion_is_that_of_the_wing() -> None:
    blank = blank_recording(WING, tunnel(0.05, 3.0, 6.0), frames=30)
    # a recording to place the beat by
    known = replace(blank, values=BARE.observe([g.nominal for g in BARE.genes], blank).channels[0])
    found = probed(BARE, [gene.nominal for gene in BARE.genes], known, SMALL)
    assert found.responses.shape == (*known.values.shape, SMALL.size)
    model, genome = with_load(SMALL, {"2_c1": 0.2, "1_s2": -0.3})
    change = model.observe(genome, known).channels[0] - known.values
    predicted = found.responses @ genome[-SMALL.size :]
    assert np.abs(change - predicted).max() < 0.03 * np.abs(change).max()
    motion = found.motion
    dt = 1.0 / (len(motion.phase) * motion.flap_frequency)
    slope = (np.roll(motion.deflection, -1, axis=1) - np.roll(motion.deflection, 1, axis=1)) / (2 * dt)
    assert np.abs(motion.deflection).max() < 0.1 * SPAN
    assert np.abs(slope).max() < 0.5 * np.abs(motion.velocity).max()
    at_crossing = motion.velocity[-1, 0]  # the tip, on the upstroke
    assert at_crossing > 0.9 * np.abs(motion.velocity[-1]).max() or at_crossing > 1.0
    np.testing.assert_allclose(motion.mass @ np.full(3, SPAN / 3), sum(b.mass for b in BARE.structure.bodies), rtol=0.2)


def test_rods_turn_as_the_series_says() -> None:
    """As the harmonics of a drive do that are an effect of the library, written by itself."""
    blank = blank_recording(WING, tunnel(0.15, 3.0, 6.0))
    effect = replace(BARE, effects=("drive_harmonics",))
    values = {gene.name: gene.nominal for gene in effect.genes} | {
        "drive_harmonics.cos2": 0.03, "drive_harmonics.sin3": -0.02,
    }  # fmt: skip
    amplitude = np.degrees(abs(RodDrive.of(WING.drive, 0.0, 1).series[1, 0, 0]))
    known = effect.beat(np.array(list(values.values())), blank).tracks
    model, genome = with_load(replace(SMALL, driving=True, harmonics=3))
    names = [gene.name for gene in model.genes]
    for rod in ("front", "rear"):
        genome[names.index(f"driving_probe.{rod}_c2")] = 0.03 * amplitude
        genome[names.index(f"driving_probe.{rod}_s3")] = -0.02 * amplitude
    np.testing.assert_allclose(model.beat(genome, blank).tracks, known, atol=1e-9)


@pytest.mark.parametrize("stations", [(0.0,), (0.1, 1.0), (0.0, 0.5), (0.0, 0.6, 0.5, 1.0)])
def test_stations_that_are_none(stations: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="must rise from 0"):
        Probe(stations)


def test_too_many_harmonics() -> None:
    with pytest.raises(ValueError, match="13 harmonics"):
        Probe(harmonics=13)
