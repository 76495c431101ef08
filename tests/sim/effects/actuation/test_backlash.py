"""Play between the driving rods and the wing."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.oracles.plates import loaded
from tests.sim.effects.bench import AIR, Array, beat_of, described, ledger, scene_of
from tests.sim.effects.driving import robird
from tests.sim.kernels.marching import CHORD, DENSITY, LENGTH, THICKNESS, march, plank, vacuum_here
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes, new_work
from wingfit.sim.kernels.integrate import forces
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import Structure, build

B = 0.04
EDGE = 0.02  # of the play, as the page says
EDGES = EDGE * B
# N m/rad and N/m: about z the stiffest by far, as flat foam is; about x as no other
STIFFNESS = np.array([2.0, 0.7, 9.0, 3e3, 2e3, 4e3])


@cache
def board() -> Structure:
    return build(plank(), Division((1,)))


def with_play(b: float, stiffness: Array, damping: float = 0.0, beside: str = "", edge: float = EDGE) -> Lanes:
    """A plank of one body, held by two rods of this ``stiffness`` [6] and ``damping`` (N m s/rad) about x each.

    ``beside``: another effect, as it is typical; ``edge``: of the stops, over the play.
    """
    scene = WingScene.of(board(), AIR, loaded(board(), {}))
    scene.lanes.stiffness[:] = stiffness[:, None]
    scene.lanes.damping[:] = 0.0
    scene.lanes.damping[:, 0] = damping
    for name, values in ((beside, {}), ("backlash", {"b": b, "edge": edge})):
        if name and values.get("b") != 0.0:
            act = EFFECTS[name].wing
            assert act is not None
            act(scene, {key: np.full(LANES, value) for key, value in described(name, plank(), values).items()})
    return scene.frozen()


class Held(NamedTuple):
    """What the springs of both rods make of a pose: moment and force [6] on the plank in its frame at the root, J."""

    moment: Array
    energy: float
    added: Array  # stiffness [6] that the play adds to one of them


def held(b: float, turn: Array, beside: str = "", memory: float = 0.0, edge: float = EDGE) -> Held:
    """The plank turned by the rotation vector ``turn`` about its root, where the rods hold it.

    ``memory``: all states of the effect ``beside``.
    """
    structure, lanes = board(), with_play(b, STIFFNESS, beside=beside, edge=edge)
    here, state = vacuum_here(1e-3), at_rest(structure)
    work = new_work(structure.wiring, here, lanes)
    R = Rotation.from_rotvec(turn)
    middle = structure.wiring.a.mean(axis=0)  # between the rods, from the hinge
    work.R[:], work.p[:] = state.R, state.p
    work.R[0] = R.as_matrix().reshape(9, 1)
    work.p[0] = (middle + R.apply(structure.bodies[0].centre - middle))[:, None]
    work.V[:], work.z[:] = 0.0, memory
    forces(structure.wiring, here, lanes, work)
    tau, force = work.wrench[0, :3, 0], work.wrench[0, 3:, 0]
    lever = R.inv().apply(middle) - R.inv().apply(work.p[0, :, 0])
    added = work.more_k[0, :, 0] if b > 0 else np.zeros(6)
    return Held(tau - np.cross(lever, force), float(work.stored[0]), added.copy())


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_moment_over_angle_is_zero_within_the_play_and_the_springs_beyond(sign: float) -> None:
    """-2 k sin(phi -+ b / 2) beyond, of two rods; within EDGE of a stop a parabola between the two."""
    x = np.array([1.0, 0.0, 0.0])
    for phi in (0.0, 0.2 * B, (0.5 - EDGE) * B):
        assert abs(held(B, sign * phi * x).moment[0]) < 1e-13
    edge = held(B, sign * 0.5 * B * x).moment[0]
    assert edge == pytest.approx(-sign * 2 * STIFFNESS[0] * EDGES / 4, rel=1e-6)
    for phi in ((0.5 + EDGE) * B, 0.8 * B, 3 * B, 20 * B):
        expected = -sign * 2 * STIFFNESS[0] * np.sin(phi - 0.5 * B)
        assert held(B, sign * phi * x).moment[0] == pytest.approx(expected, rel=2e-3)
        assert abs(expected) < abs(held(0.0, sign * phi * x).moment[0])


@pytest.mark.parametrize("soft", [0.01, 0.03, 0.06])
def test_an_edge_describes_stops_of_another_soft_law(soft: float) -> None:
    """Of log(1 + exp) with the width ``soft`` b, closer than sharp stops of the same play.

    An edge of pi soft has the same variance of the stiffness about the stop: edge^2 / 3 of a uniform distribution, and
    (pi soft)^2 / 3 of the logistic one.
    """
    apart = {}
    for edge in (EDGE, np.pi * soft):
        moments = [held(B, np.array([phi, 0.0, 0.0]), edge=edge).moment[0] for phi in np.linspace(0.2, 0.8, 25) * B]
        apart[edge] = np.array(moments) / (-2 * STIFFNESS[0] * B)
    beyond = soft * np.log1p(np.exp((np.linspace(0.2, 0.8, 25) - 0.5) / soft))
    if soft > EDGE:
        assert np.abs(apart[np.pi * soft] - beyond).max() < np.abs(apart[EDGE] - beyond).max() / 4
    assert np.abs(apart[np.pi * soft] - beyond).max() < 0.12 * soft


@pytest.mark.parametrize("beside", ["viscoelastic", "hysteresis", "cubic_stiffness", "rod_slip", "damage"])
@pytest.mark.parametrize("phi", [-0.4 * B, 0.0, 0.4 * B])
def test_no_other_law_bridges_the_play(beside: str, phi: float) -> None:
    """Whatever it remembers. Torsion is not the play's: there foam still relaxes and yields."""
    found = held(B, np.array([phi, 0.0, 0.0]), beside, 0.02)
    assert abs(found.moment[0]) < 1e-13
    if beside in ("viscoelastic", "hysteresis"):
        assert found.moment[1] == pytest.approx(-2 * 0.3 * STIFFNESS[1] * 0.02 * np.cos(phi), rel=1e-9)
    assert abs(held(B, np.array([B, 0.0, 0.0]), beside, 0.02).moment[0]) > 0.01


@pytest.mark.parametrize("angle", [0.1 * B, 0.49 * B, 0.51 * B, 2 * B, -0.3 * B, -0.505 * B, -5 * B])
def test_moments_are_minus_the_gradient_of_the_energy_whatever_else_bends(angle: float) -> None:
    rest = np.array([angle, 0.03, -0.02])
    moment, h = held(B, rest).moment, 1e-5
    for axis in np.eye(3):
        ends = [(Rotation.from_rotvec(rest) * Rotation.from_rotvec(s * h * axis)).as_rotvec() for s in (1, -1)]
        slope = (held(B, ends[0]).energy - held(B, ends[1]).energy) / (2 * h)
        assert moment @ axis == pytest.approx(-slope, abs=2e-8)


def test_turning_within_the_play_keeps_no_energy() -> None:
    assert held(B, np.array([0.4 * B, 0.0, 0.0])).energy == pytest.approx(0.0, abs=1e-14)
    bent = [held(B, (Rotation.from_rotvec([phi, 0, 0]) * Rotation.from_rotvec([0, 0.05, 0])).as_rotvec()) for phi in
            (0.0, 0.4 * B)]  # fmt: skip
    assert bent[0].energy > 1e-4


@pytest.mark.parametrize("angle", [0.1 * B, 0.49 * B, 0.51 * B, 2 * B, -0.505 * B])
def test_stiffness_that_is_told_is_the_derivative(angle: float) -> None:
    """What the play adds to that about x: minus all of the spring's within, hardly anything beyond."""
    x, h = np.array([1.0, 0.0, 0.0]), 1e-6
    play = [held(B, (angle + s) * x).moment[0] - held(0.0, (angle + s) * x).moment[0] for s in (h, -h)]
    assert held(B, angle * x).added[0] == pytest.approx(-0.5 * (play[0] - play[1]) / (2 * h), abs=1e-6)


def test_only_the_rods_have_play_and_not_the_joints_of_the_wing() -> None:
    """Every body of a wing turned further about x than the one before."""
    structure = robird()
    scene = scene_of("backlash", structure, b=B)
    lanes, here, state = scene.frozen(), scene.setting(64), at_rest(structure)
    work, driven, bodies = new_work(structure.wiring, here, lanes), structure.wiring.driven, len(structure.bodies)
    work.R[:], work.p[:] = state.R, state.p
    turn = Rotation.from_rotvec(np.outer(1.0 + np.arange(bodies), [B, 0.0, 0.0]))
    work.R[:bodies] = turn.as_matrix().reshape(bodies, 9, 1)
    forces(structure.wiring, here, lanes, work)
    assert 0 < driven < len(work.more)
    assert not work.more[:driven].any()
    assert (work.more[driven:, 0] > 0).all()


def test_a_wing_falls_from_stop_to_stop_as_its_load_slowly_turns_round() -> None:
    """At rest under the moment of its weight, m g l / 2, down and up: behind the stop by what the springs give."""
    structure = board()
    lanes, state, found = with_play(B, STIFFNESS, damping=0.02), at_rest(structure), []
    mass = DENSITY * CHORD * THICKNESS * LENGTH
    for gravity in (9.81, 4.0, 0.5, -0.5, -4.0, -9.81):
        trace = march(structure, lanes, vacuum_here(5e-3, gravity), state, 240)
        found.append((float(np.arctan2(trace.R[-1, 0, 7, 0], trace.R[-1, 0, 4, 0])), gravity))
    for angle, gravity in found:
        sag = mass * abs(gravity) * LENGTH / 2 / (2 * STIFFNESS[0])
        behind = sag if sag > EDGES else 2 * np.sqrt(EDGES * sag) - EDGES
        assert angle == pytest.approx(-np.sign(gravity) * (0.5 * B + behind), rel=1e-3)


def test_within_the_play_only_the_dampers_hold() -> None:
    """Spun about its root, the plank slows down at the rate 2 D / I."""
    structure, damping, rate = board(), 2e-3, 0.01
    lanes, state = with_play(B, STIFFNESS * [1, 1, 1, 100, 100, 100], damping), at_rest(structure)
    mass = DENSITY * CHORD * THICKNESS * LENGTH
    inertia = mass * (LENGTH**2 + THICKNESS**2 / 4) / 3
    state.V[0, 0], state.V[0, 5] = rate, rate * LENGTH / 2
    trace = march(structure, lanes, vacuum_here(1e-3), state, 400)
    times = 1e-3 * np.arange(400)
    assert np.abs(np.arctan2(trace.R[:, 0, 7, 0], trace.R[:, 0, 4, 0])).max() < 0.4 * B
    np.testing.assert_allclose(trace.V[:, 0, 0, 0], rate * np.exp(-2 * damping / inertia * times), rtol=2e-2)


@pytest.mark.parametrize("b", [0.015, 0.06])
def test_the_work_of_the_motors_closes_the_ledger(b: float) -> None:
    assert ledger(beat_of("backlash", AIR, 192, b=b), AIR.flap_frequency) < 2e-4


def test_the_wing_lags_by_more_the_more_it_can_turn() -> None:
    tracks = [beat_of("backlash", AIR, 64, b=b).tracks for b in (0.0, 0.005, 0.015)]
    apart = [float(np.abs(one - tracks[0]).max()) for one in tracks[1:]]
    assert 1e-3 < apart[0] < apart[1]
