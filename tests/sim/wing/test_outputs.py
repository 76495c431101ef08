"""Loads and powers of one beat: Newton and Euler on every body, the first law on every port, the kernels' record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from tests.oracles.newton_euler import newton_euler, rate_of
from wingfit.records import Condition, FourierDrive
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels.arrays import AREA, State
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.simulate import Beat
from wingfit.sim.virtual_rigs.campaign import (
    Tracking,
    blank_recording,
    record,
    robird_wing,
    true_genome,
    tunnel,
    vacuum,
)
from wingfit.sim.wing.drive import flap_angle
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.load_recovery import body_names, from_motion
from wingfit.sim.wing.loads import simulate_outputs
from wingfit.sim.wing.outputs import Outputs

Array = npt.NDArray[np.float64]

FINE = Numerics(steps=1080, max_beats=60, periodic=2e-6)
TUNNEL = tunnel(0.05, 3.0, 6.0)


def model_of(division: str, numerics: Numerics = FINE) -> FlexibleWing:
    return FlexibleWing(robird_wing(), division, numerics=numerics)


def nominal(model: FlexibleWing) -> list[float]:
    return [gene.nominal for gene in model.genes]


def computed(model: FlexibleWing, condition: Condition) -> tuple[Outputs, Beat, State]:
    """Outputs, and the beat they follow from."""
    return of_genome(model, nominal(model), condition)


def of_genome(model: FlexibleWing, genome: list[float], condition: Condition) -> tuple[Outputs, Beat, State]:
    beat = model.beat(genome, blank_recording(model.wing, condition), with_motion=True)
    assert beat.motion is not None, beat.reason
    return from_motion(scene_of(model, genome, condition), beat.motion), beat, beat.motion


def scene_of(model: FlexibleWing, genome: list[float], condition: Condition) -> WingScene:
    return model.scene(genome, condition)


@pytest.fixture(scope="module")
def found() -> tuple[FlexibleWing, Outputs, Beat, State]:
    """Strips of 3, 3, 3 and 2 bodies: spanwise connectors from one body to two, chordwise ones, two rods."""
    model = model_of("11")
    return model, *computed(model, TUNNEL)


Found = tuple[FlexibleWing, Outputs, Beat, State]
SEVERAL = ("viscoelastic", "added_mass", "rotational_circulation", "viscous_drag", "hinge_tilt", "hinge_offset")


def with_effects(model: FlexibleWing, *names: str) -> tuple[FlexibleWing, list[float]]:
    """The model with effects and a genome with all of them at their typical size."""
    model = model.with_effects(*names)
    typical = {name: value for effect in model.chosen for name, value in effect.typical(model.wing).items()}
    return model, [typical.get(gene.name, gene.nominal) for gene in model.genes]


@pytest.fixture(scope="module")
def affected() -> Found:
    """States at every connector, laws of the air, air that moves along, and a true hinge that lies elsewhere."""
    model, genome = with_effects(model_of("11"), *SEVERAL)
    return model, *of_genome(model, genome, TUNNEL)


def recorded_alike(outputs: Outputs, beat: Beat, *, moving_air: bool = False) -> None:
    """Motors, air, energies and powers, from connectors and strips one at a time, equal the record of the whole.

    Air that moves along is inertia there and a load here (the ledger tells whether it is the right one).
    """
    for k, motor in enumerate(outputs.motors):
        np.testing.assert_allclose(motor.power, beat.power[:, 1 + k], atol=1e-12)
    np.testing.assert_allclose(outputs.dissipated, -beat.power[:, 0], atol=1e-12)
    energies = np.stack([outputs.elastic, outputs.gravitational, outputs.kinetic], axis=1)
    kept = 2 if moving_air else 3
    np.testing.assert_allclose(energies[:, :kept], beat.energy[:, [1, 2, 0]][:, :kept], atol=1e-12)
    if not moving_air:
        np.testing.assert_allclose(outputs.air, beat.air, atol=1e-12)
        np.testing.assert_allclose(outputs.air_power, beat.power[:, 3], atol=1e-12)


@pytest.mark.parametrize("which", ["found", "affected"])
def test_agree_with_what_the_integrator_wrote_down(which: str, request: pytest.FixtureRequest) -> None:
    _, outputs, beat, _ = request.getfixturevalue(which)
    recorded_alike(outputs, beat, moving_air=which == "affected")
    for k, motor in enumerate(outputs.motors):
        if which == "found":  # elsewhere the axis is not that of the rods
            np.testing.assert_allclose(motor.torque, -beat.rods[:, k, 0], atol=1e-12)


@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if effect.wing is not None])
def test_every_effect_is_in_the_loads_as_in_the_motion(name: str) -> None:
    """At its typical size."""
    model, genome = with_effects(model_of("2x2", Numerics(steps=96, periodic=1e-3)), name)
    outputs, beat, _ = of_genome(model, genome, TUNNEL)
    recorded_alike(outputs, beat, moving_air=name == "added_mass")


@pytest.mark.parametrize("which", ["found", "affected"])
def test_motors_follow_the_drive(which: str, request: pytest.FixtureRequest) -> None:
    model, outputs, _, _ = request.getfixturevalue(which)
    step = 1 / (TUNNEL.flap_frequency * len(outputs.phase))
    front, rear = outputs.motors
    for motor in outputs.motors:
        np.testing.assert_allclose(motor.rate, rate_of(motor.angle, step), atol=1e-6 * np.abs(motor.rate).max())
    exact_angle = flap_angle(model.wing.drive, 2 * np.pi * outputs.phase)[:, 0]
    np.testing.assert_allclose(front.angle, exact_angle, atol=1e-9)
    late = [float(np.argmax(m.angle)) / len(outputs.phase) for m in (front, rear)]
    assert (late[1] - late[0]) % 1.0 == pytest.approx(TUNNEL.phase_lag / (2 * np.pi), abs=1 / len(outputs.phase))


@pytest.mark.parametrize("which", ["found", "affected"])
def test_wrenches_on_every_body_make_its_motion(which: str, request: pytest.FixtureRequest) -> None:
    """Newton and Euler in world components, written apart from the kernels: air + weight + connectors = inertia."""
    model, outputs, _, motion = request.getfixturevalue(which)
    applied, needed = newton_euler(model, outputs, motion, TUNNEL)
    for part, within in ((slice(0, 3), 0.05), (slice(3, 6), 0.01)):
        error, size = (np.sqrt((x[:, :, part] ** 2).sum(axis=2).mean(axis=0)) for x in (applied - needed, needed))
        assert np.all(error < within * size), "moments are small differences of large ones, forces are not"


@pytest.mark.parametrize("which", ["found", "affected"])
def test_effort_times_flow_is_stored_or_lost_in_every_connector(which: str, request: pytest.FixtureRequest) -> None:
    _, outputs, _, _ = request.getfixturevalue(which)
    step = 1 / (TUNNEL.flap_frequency * len(outputs.phase))
    for load in outputs.connectors:
        entering = -np.einsum("tk,tk->t", load.wrench, load.twist)
        kept = rate_of(load.stored, step) + load.dissipated
        assert np.sqrt(((entering - kept) ** 2).mean()) < 0.01 * np.sqrt((entering**2).mean()), load.name
        assert np.all(load.dissipated >= 0), load.name
        assert np.all(load.stored >= -1e-15), load.name


@pytest.mark.parametrize("condition", [TUNNEL, vacuum(1000.0, 0.05, 3.0)], ids=["tunnel", "still air"])
def test_the_ledger_closes(condition: Condition) -> None:
    """At every instant power through the ports = change of stored energy, and over the beat nothing stays."""
    outputs, _, _ = computed(model_of("11"), condition)
    front, rear = outputs.motors
    ports = front.power + rear.power + outputs.air_power - outputs.dissipated
    stored = outputs.kinetic + outputs.elastic + outputs.gravitational
    change = rate_of(stored, 1 / (condition.flap_frequency * len(outputs.phase)))
    assert np.sqrt(((ports - change) ** 2).mean()) < 0.01 * np.sqrt((change**2).mean())
    balance = outputs.balance
    assert balance.closing == pytest.approx(float(ports.mean()))
    assert abs(balance.relative_closing) < 2e-3
    assert balance.supplied > 0
    assert balance.dissipated > 0
    assert balance.to_air > 0


@pytest.mark.parametrize("condition", [TUNNEL, vacuum(1000.0, 0.05, 3.0)], ids=["tunnel", "still air"])
def test_the_ledger_closes_with_effects(condition: Condition) -> None:
    """At every instant, and over the beat; air that moves along is a load of the air, which takes and gives back."""
    model, genome = with_effects(model_of("11"), *SEVERAL)
    plain, _, _ = computed(model, condition)
    outputs, _, _ = of_genome(model, genome, condition)
    front, rear = outputs.motors
    ports = front.power + rear.power + outputs.air_power - outputs.dissipated
    change = rate_of(outputs.kinetic + outputs.elastic + outputs.gravitational, 1 / (3.0 * len(outputs.phase)))
    assert np.sqrt(((ports - change) ** 2).mean()) < 0.01 * np.sqrt((change**2).mean())
    assert abs(outputs.balance.relative_closing) < 2e-3
    assert np.ptp(outputs.air_power - plain.air_power) > 0.1 * np.ptp(plain.air_power), "air swings with the wing"
    assert outputs.balance.dissipated > 1.1 * plain.balance.dissipated, "and the foam relaxes"


def test_loads_of_a_wing_with_effects_are_simulated_with_them() -> None:
    """The one door: the genome's own effects are on, and one that is off changes nothing."""
    without = model_of("4", Numerics(steps=96))
    model, genome = with_effects(without, "viscoelastic", "rotational_circulation")
    recording = blank_recording(model.wing, TUNNEL)
    on, off = (simulate_outputs(model, g, recording) for g in (genome, nominal(model)))
    bare = simulate_outputs(without, nominal(without), recording)
    assert np.array_equal(off.sections[0].wrench, bare.sections[0].wrench)
    assert not np.allclose(on.sections[0].wrench, bare.sections[0].wrench, rtol=0.01)
    assert on.balance.dissipated != pytest.approx(bare.balance.dissipated, rel=0.01)


def test_every_section_carries_weight_air_and_inertia_of_all_that_is_outboard(found: Found) -> None:
    """All six components, in the mean axes of the strip outboard, about the mean of the places that are held."""
    model, outputs, _, motion = found
    w, n = model.structure.wiring, len(model.structure.bodies)
    R = motion.R.reshape(len(motion.R), -1, 3, 3)[:, :n]
    _, needed = newton_euler(model, outputs, motion, TUNNEL)
    weight = np.array([[0.0], [0.0], [-TUNNEL.gravity]]) * w.mass
    from_outside = outputs.air_wrench + outputs.held
    from_outside[:, :, 3:] += np.einsum("tnji,jn->tni", R, weight)
    through = needed - from_outside
    moment, force = (np.einsum("tnij,tnj->tni", R, through[:, :, part]) for part in (slice(0, 3), slice(3, 6)))
    for s, section in enumerate(outputs.sections):
        start, end = w.strip_start[s], w.strip_start[s + 1]
        entering = [c for c in range(len(w.first)) if start <= w.second[c] < end and not start <= w.first[c] < end]
        places = [motion.p[:, w.second[c]] + np.einsum("tij,j->ti", R[:, w.second[c]], w.b[c]) for c in entering]
        about = np.mean(places, axis=0)
        arm = motion.p[:, start:n] - about[:, None]
        total = moment[:, start:].sum(axis=1) + np.cross(arm, force[:, start:]).sum(axis=1)
        for t in range(0, len(R), 90):
            axes = Rotation.from_matrix(R[t, start:end]).mean(w.weight[start:end]).as_matrix()
            expected = np.concatenate([axes.T @ total[t], axes.T @ force[t, start:].sum(axis=0)])
            size = np.abs(section.wrench).reshape(-1, 2, 3).max(axis=(0, 2)).repeat(3)
            assert np.all(np.abs(section.wrench[t] - expected) < 0.01 * size), (section.name, t)


def test_a_wing_held_still_bends_under_its_weight_alone() -> None:
    """Static limit in vacuum: shear and bending at the root, closed form; nothing moves, nothing is lost."""
    wing = replace(robird_wing(), drive=FourierDrive(0.0, (0.0,), (0.0,)))
    model = FlexibleWing(wing, "11", numerics=Numerics(steps=200, max_beats=60, periodic=1e-9))
    outputs, _, motion = computed(model, vacuum(1e-9, 0.0, 3.0))
    mass = model.structure.wiring.mass
    root = outputs.sections[0]
    held = np.array([c.point for c in model.structure.connectors if c.first < 0]).mean(axis=0)
    arm = motion.p[-1, : len(mass), 1] - held[1]
    weight = mass * vacuum(1.0, 0.0, 3.0).gravity
    assert root.wrench[-1, 5] == pytest.approx(weight.sum(), rel=1e-3)
    assert root.wrench[-1, 0] == pytest.approx((weight * arm).sum(), rel=2e-3), "upward load outboard bends it up: +x"
    torque = sum(motor.torque[-1] for motor in outputs.motors)
    assert torque == pytest.approx((weight * motion.p[-1, : len(mass), 1]).sum(), rel=1e-3)
    assert outputs.balance.supplied == 0


@pytest.mark.parametrize("division", ["4", "11", "24", "2x1"])
def test_names_and_sums(division: str) -> None:
    model = model_of(division, Numerics(steps=80, periodic=1e-3))
    outputs, _, _ = computed(model, TUNNEL)
    names = [load.name for load in outputs.connectors]
    assert len(set(names)) == len(names) == len(model.structure.connectors)
    assert {"front rod", "rear rod"} <= set(names)
    assert all(part in body_names(model.structure) for load in outputs.connectors for part in load.between)
    kinds = [load.kind for load in outputs.connectors]
    chordwise = sum(count - 1 for count in model.structure.division.bodies)
    assert (kinds.count("root"), kinds.count("chordwise")) == (2, chordwise)
    assert outputs.sections[0].name == "root"
    assert len(outputs.sections) == len(outputs.strips) == len(model.structure.division.bodies)
    assert np.all(np.diff([s.span for s in outputs.sections]) > 0)


def test_lift_is_across_the_stream_and_thrust_against_it() -> None:
    """Held still in the stream, forces along the axes are those of the affine law on the strips (thesis Eqs. 8-11)."""
    wing = replace(robird_wing(), drive=FourierDrive(0.0, (0.0,), (0.0,)))
    model = FlexibleWing(wing, "4", numerics=Numerics(steps=200, max_beats=60))
    outputs, _, _ = computed(model, TUNNEL)
    area, alpha = model.structure.wiring.geometry[:, AREA].sum(), TUNNEL.angle_of_attack
    pressure = 0.5 * 1.2041 * TUNNEL.airspeed**2 * area
    assert outputs.air[-1] @ outputs.lift_axis == pytest.approx(pressure * (4.0 * alpha + 0.3), rel=0.1)
    assert outputs.air[-1] @ outputs.thrust_axis == pytest.approx(-pressure * (0.8 * alpha + 0.08), rel=0.1)
    assert outputs.lift_axis @ outputs.thrust_axis == pytest.approx(0, abs=1e-15)
    still, _, _ = computed(model, replace(vacuum(1000.0, 0.05, 3.0), angle_of_attack=0.2))
    np.testing.assert_allclose((still.lift_axis, still.thrust_axis), ([0, 0, 1], [-1, 0, 0]), atol=1e-15)


def test_phase_zero_is_that_of_the_recording() -> None:
    """The crossing found in the simulation is that by which tracks are laid over the recording."""
    model = model_of("4", Numerics(steps=160))
    recording = record(model, true_genome(model, 3), TUNNEL, Tracking(), np.random.default_rng(1))
    outputs = simulate_outputs(model, nominal(model), recording)
    assert outputs.solution is not None
    assert outputs.solution.steps == len(outputs.phase)
    tracks = model.beat(nominal(model), recording).tracks
    before = int(outputs.crossing * len(tracks))
    names = [m.name for m in model.wing.markers]
    height = tracks[:, [names.index(m) for m in model.wing.reference_markers if m in recording.markers], 2].mean(axis=1)
    around = height[[before - 3, before + 3]] - model.wing.hinge.z
    assert around[0] < 0 < around[1]


def test_the_balance_closes_at_the_default_steps() -> None:
    """In vacuum at 2 Hz what the dampers take is a hundredth of what swings to and fro."""
    model, condition = FlexibleWing(robird_wing(), "11"), vacuum(10.0, 0.0, 2.0)
    outputs = simulate_outputs(model, nominal(model), blank_recording(model.wing, condition))
    swinging = np.abs(outputs.motors[0].power).mean()
    assert outputs.balance.supplied < 0.05 * swinging
    assert abs(outputs.balance.relative_closing) < 0.005


def test_a_wing_that_cannot_be_solved_finer_has_the_loads_of_its_tracks(monkeypatch: pytest.MonkeyPatch) -> None:
    model, recording = FlexibleWing(robird_wing(), "4"), blank_recording(robird_wing(), TUNNEL)
    monkeypatch.setattr("wingfit.sim.wing.loads.LOAD_ACCURACY", 1e-13)
    outputs = simulate_outputs(model, nominal(model), recording)
    assert len(outputs.phase) == len(model.beat(nominal(model), recording).tracks)


def test_a_failing_wing_says_why() -> None:
    model = model_of("4", Numerics(steps=80))
    wild = [1e6 if gene.name == "L_a" else gene.nominal for gene in model.genes]
    with pytest.raises(ValueError, match="cannot be simulated under 'blank': "):
        simulate_outputs(model, wild, blank_recording(model.wing, TUNNEL))


def test_balance_closes_where_losses_are_a_thousandth_of_what_swings() -> None:
    """Slow, stiff and lightly damped in near vacuum: steps are raised until the mean power can be believed."""
    model = model_of("4", Numerics())
    stiff = {"E_f": 5.0, "E_r": 5.0, "G_f": 5.0, "D_E": 0.2, "D_G": 0.2}
    genome = [g.nominal * stiff.get(g.name, 1.0) for g in model.genes]
    recording = blank_recording(model.wing, vacuum(10.0, 0.0, 2.0))
    outputs = simulate_outputs(model, genome, recording)
    assert abs(outputs.balance.relative_closing) <= 0.01
    coarse = model.beat(genome, recording, with_motion=True)
    assert coarse.motion is not None
    first = from_motion(scene_of(model, genome, recording.condition), coarse.motion)
    assert abs(first.balance.relative_closing) > 0.01, "already closed: the test shows nothing"
