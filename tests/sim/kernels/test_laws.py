"""Compiled laws in the integrator: each sees what is its own, and their states keep the order and the ledger."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from tests.oracles.plates import loaded
from tests.sim.kernels.marching import ORDER, driven, march, order, plank, vacuum_here, with_connectors
from tests.sim.wing.test_rigid import SMALL, TwoBodies
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import ALPHA, NOW, PUSH_N, SHARE, SPEED, START, STREAM_N, Lanes, State, new_work
from wingfit.sim.kernels.integrate import forces
from wingfit.sim.kernels.lanes.lanewise import cosine_and_sine
from wingfit.sim.kernels.lanes.vector import load, load0, load1, store, store1
from wingfit.sim.kernels.laws import AFTER, BEFORE, connector_port, point_port, strip_port
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]


def _one(frame: Any, moment: int) -> None:  # noqa: ARG001 (an argument of all laws)
    """One parameter, two states."""
    port = connector_port(frame)
    for c in range(port.places):
        given = load(port.parameters, 0, c)
        for k in range(2):
            store1(port.rate[k], c, given * (1.0 + k) + load1(port.state[k], c))
            store1(port.decay[k], c, given * 0.0 + 1.0)
            store1(port.drive[k], c, given * 0.0)
            store1(port.pull[k], c, given * 0.0)
        store(port.wrench, c, 0, load(port.wrench, c, 0) + given)


def _two(frame: Any, moment: int) -> None:  # noqa: ARG001
    """Two parameters, one state."""
    port = connector_port(frame)
    for c in range(port.places):
        first, second = load(port.parameters, 0, c), load(port.parameters, 1, c)
        store1(port.rate[0], c, first - second * load1(port.state[0], c))
        store1(port.decay[0], c, second)
        store1(port.drive[0], c, first * 0.0)
        store1(port.pull[0], c, first * 0.0)
        store(port.wrench, c, 5, load(port.wrench, c, 5) + second)


def _blowing(frame: Any, moment: int) -> None:
    """One parameter, one state: an upward induced velocity from the parameter and the wind."""
    port = strip_port(frame)
    for s in range(port.places):
        state, given = load1(port.state[0], s), load(port.parameters, 0, s)
        if moment == BEFORE:
            store(port.induced, s, 2, load(port.induced, s, 2) + state)
        if moment == AFTER:
            store1(port.rate[0], s, given + load(port.wind, 0, 0) * 0.0 + load1(port.wind, 0) + load0(port.density))
            store1(port.decay[0], s, given * 0.0)
            store(port.loads, s, PUSH_N, load(port.loads, s, PUSH_N) + given)


def _still(frame: Any, moment: int) -> None:  # noqa: ARG001
    """No state; shows that the law after it finds its own."""
    port = strip_port(frame)
    for s in range(port.places):
        store(port.loads, s, PUSH_N, load(port.loads, s, PUSH_N) + 100.0 * load(port.parameters, 1, s))


def test_a_law_sees_its_own_parameters_and_states() -> None:
    """Four laws at once, every place and lane with numbers of its own, in either order."""
    structure = build(robird_wing(), Division.parse("3,2"))
    w, rng = structure.wiring, np.random.default_rng(1)
    c, s = len(w.first), len(w.geometry)
    first, a, b, given, spare = (rng.normal(size=(n, LANES)) for n in (c, c, c, s, s))
    found = []
    for connectors in ((_one, _two), (_two, _one)):
        scene = WingScene.of(structure, tunnel(0.0, 3.0, 6.0), loaded(structure, {}))
        scene.wind[:, 3] = [1.0, 2.0, 3.0]
        scene.add_strip_law(_still, [spare, 0.5 * spare])
        for law in connectors:
            parameters, axes = ([first], [0, 4]) if law is _one else ([a, b], [2])
            scene.add_connector_law(law, parameters, axes=axes, states=[1.0] * len(axes))
        scene.add_strip_law(_blowing, [given], states=[1.0], before=True)
        group, here = scene.frozen(), scene.setting(100)
        work, rest = new_work(w, here, group), at_rest(structure)
        work.R[:], work.p[:], work.V[:] = rest.R, rest.p, rest.V
        states = {"one": rng.normal(size=(2, c, LANES)), "two": rng.normal(size=(c, LANES))}
        up = rng.normal(size=(s, LANES))
        parts = [states["one" if law is _one else "two"].reshape(-1, LANES) for law in connectors]
        work.z[:] = np.concatenate([*parts, up] if len(scene.frozen().laws.strip) == 2 else parts)
        forces(w, here, group, work)
        rate = {
            "one": first * np.array([1.0, 2.0])[:, None, None] + states["one"],
            "two": a - b * states["two"],
        }
        wanted = [rate["one" if law is _one else "two"].reshape(-1, LANES) for law in connectors]
        np.testing.assert_allclose(work.z_rate, np.concatenate([*wanted, given + scene.wind[0] + scene.density]))
        np.testing.assert_allclose(work.more[:, 0], first)
        np.testing.assert_allclose(work.more[:, 5], b)
        np.testing.assert_array_equal(work.more[:, 1:5], 0.0)
        np.testing.assert_allclose(work.loads[:, PUSH_N], given + 50.0 * spare)
        np.testing.assert_allclose(work.flow[:, STREAM_N], scene.wind[2] + up, atol=1e-12)
        assert np.all(work.flow[:, SPEED] > np.abs(work.flow[:, STREAM_N]) - 1e-12)
        np.testing.assert_allclose(np.sign(work.flow[:, ALPHA]), np.sign(scene.wind[2] + up))
        found.append(work.wrench)
    assert np.abs(found[0]).max() > 0


def _shaker(frame: Any, moment: int) -> None:  # noqa: ARG001
    """An upward force a cos psi, with the stage's share of its change in the step."""
    port = point_port(frame)
    now, start = cosine_and_sine(load1(port.clock, NOW)), cosine_and_sine(load1(port.clock, START))
    for p in range(port.places):
        force = load(port.parameters, 0, p) * (now[0] - load1(port.clock, SHARE) * start[1])
        store(port.wrench, p, 5, load(port.wrench, p, 5) + force)


def test_a_force_at_a_point_that_depends_on_time_keeps_the_order() -> None:
    """A free body, shaken at its centre: z = a / (m omega^2) (1 - cos omega t)."""
    structure = build(plank(), Division.parse("2x1"))
    group = loaded(structure, {})
    structure, group = with_connectors(structure, group, np.zeros(len(structure.connectors), bool))
    omega, mass, errors = 2 * np.pi, structure.bodies[0].mass, []
    for steps in (10, 20, 40):
        scene = WingScene.of(structure, vacuum(0.0, 0.0, 3.0), group)
        quarter, middle = np.full(LANES, 0.25), np.full(LANES, 0.5)
        scene.add_point_law(_shaker, quarter, middle, [np.full(LANES, mass * omega**2)])
        trace = march(structure, scene.frozen(), vacuum_here(1 / steps), at_rest(structure), steps)
        expected = 1 - np.cos(omega * np.arange(steps) / steps)
        errors.append(float(np.abs(trace.p[:, 0, 2, 0] - trace.p[0, 0, 2, 0] - expected).max()))
    assert errors[-1] < 1e-5
    assert order(errors) > ORDER - 0.25


def _maxwell(frame: Any, moment: int) -> None:  # noqa: ARG001
    """A spring behind a dashpot along every axis: parameters are the relaxation time and six stiffnesses."""
    port = connector_port(frame)
    for k in range(6):
        for c in range(port.places):
            spring, fading, z = (
                load(port.parameters, 1 + k, c),
                1.0 / load(port.parameters, 0, c),
                load1(port.state[k], c),
            )
            store1(port.rate[k], c, load(port.twist, c, k) - z * fading)
            store1(port.decay[k], c, fading)
            store1(port.drive[k], c, fading * 0.0 + 1.0)
            store1(port.pull[k], c, spring)
            store(port.wrench, c, k, load(port.wrench, c, k) - spring * z)


def relaxing(structure: Structure, group: Lanes, stiffness: Array, tau: float) -> Lanes:
    """With a Maxwell element of ``stiffness`` [6] along every axis of every connector."""
    scene = WingScene.of(structure, vacuum(0.0, 0.0, 3.0), group)
    parameters = [np.full(LANES, value) for value in (tau, *stiffness)]
    scene.add_connector_law(_maxwell, parameters, axes=[0, 1, 2, 3, 4, 5], states=[1.0] * 6)
    return scene.frozen()


def pair(soft: Array, tau: float) -> tuple[TwoBodies, Structure, Lanes]:
    """Two bodies on one connector with Maxwell elements of stiffness ``soft`` [6] beside spring and damper."""
    two = TwoBodies()
    structure = build(plank(), Division.parse("2x1"))
    structure, group = with_connectors(structure, loaded(structure, {}), structure.wiring.first == 0)
    w = structure.wiring
    w.mass[:], w.inertia[:], w.a[0], w.b[0] = two.mass, two.inertia.reshape(2, 9), two.a, two.b
    group.stiffness[0], group.damping[0] = two.K[:, None], 0.3 * two.D[:, None]
    return two, structure, relaxing(structure, group, soft, tau)


def released(two: TwoBodies, structure: Structure, size: float) -> tuple[State, Array]:
    """Displaced by about ``size`` parts of 0.3 rad and 1 cm, and these displacements [12]."""
    state, lengths = at_rest(structure, 6), np.tile([0.3, 0.3, 0.3, 0.01, 0.01, 0.01], 2)
    x = size * lengths * np.random.default_rng(5).normal(size=12)
    lanes = np.repeat(x[:, None], LANES, axis=1)
    two._displace(state, np.array([np.zeros(3), two.a - two.b]), lanes, 0 * lanes)
    return state, x


def linear_error(tau: float, steps: int) -> float:
    """Largest error of the strains, in parts of the largest, of a small motion over 0.03 s; linear theory.

    (x, v, z)' = (v, -M^-1 (K x + D v + J^T k z), J v - z / tau).
    """
    soft = 0.7 * TwoBodies().K
    two, structure, group = pair(soft, tau)
    M, D, K = two.matrices()
    J = np.zeros((6, 12))
    J[:3, :3], J[:3, 6:9], J[3:, 3:6], J[3:, 9:] = -np.eye(3), np.eye(3), -np.eye(3), np.eye(3)
    for k, axis in enumerate(np.eye(3)):
        J[3:, k], J[3:, 6 + k] = -np.cross(axis, two.a), np.cross(axis, two.b)
    A = np.zeros((30, 30))
    A[:12, 12:24], A[24:, 12:24], A[24:, 24:] = np.eye(12), J, -np.eye(6) / tau
    A[12:24] = -np.linalg.solve(M, np.hstack([K, 0.3 * D, J.T * soft]))
    state, x = released(two, structure, SMALL)
    trace = march(structure, group, vacuum_here(0.03 / steps), state, steps)
    step, exact = expm(A * 0.03 / steps), [np.concatenate([x, np.zeros(18)])]
    for _ in range(steps - 1):
        exact.append(step @ exact[-1])
    strains = np.array(exact)[:, 24:]
    return float(np.abs(trace.z[..., 0] - strains).max() / np.abs(strains).max())


@pytest.mark.parametrize(("tau", "steps"), [(0.02, 25), (2e-3, 25), (2e-4, 100)])
def test_states_that_pull_keep_the_order(tau: float, steps: int) -> None:
    """Strains that relax slower than the step, as fast, and faster: eliminated, they cost no order."""
    errors = [linear_error(tau, n) for n in (steps, 2 * steps, 4 * steps)]
    assert errors[-1] < 1e-5
    assert order(errors) > ORDER - 0.25


@pytest.mark.parametrize("tau", [2e-5, 2e-6])
def test_states_much_faster_than_the_step_are_stable(tau: float) -> None:
    assert linear_error(tau, 50) < 2e-3


def test_order_where_connectors_turn_far() -> None:
    """A third of a radian, tumbling: the states' stage leaves out how a twist changes with the pose, so the second."""
    strains = []
    for steps in (100, 200, 400):
        two, structure, group = pair(0.7 * TwoBodies().K, 0.02)
        state, _ = released(two, structure, 1.0)
        state.V[:2, :3] += np.array([30.0, -15.0, 21.0])[:, None]
        trace = march(structure, group, vacuum_here(0.03 / steps), state, steps)
        strains.append(trace.z[:: steps // 100, :, 0])
    errors = [float(np.abs(a - b).max()) for a, b in pairwise(strains)]
    assert errors[-1] < 1e-5 * np.abs(strains[-1]).max()
    assert order(errors) > ORDER - 0.25


def test_ledger_closes_with_states() -> None:
    """The Robird's wing of foam that relaxes, in the tunnel, two beats from rest: stored, lost and supplied agree."""
    closing, condition = [], tunnel(0.05, 3.0, 6.0)
    for steps in (200, 800):
        structure = build(robird_wing(), Division.parse("4"))
        scene = WingScene.of(structure, condition, loaded(structure, {}))
        for name in ("viscoelastic", "rotational_circulation"):
            effect = EFFECTS[name]
            assert effect.wing is not None
            effect.wing(scene, {p.name: np.full(LANES, p.typical) for p in effect.parameters})
        group, here = scene.frozen(), scene.setting(steps)._replace(gravity=0.0)
        state = at_rest(structure, len(group.laws.size))
        trace = march(structure, group, here, state, 2 * steps, driven(structure, condition, steps, 2))
        stored, power = trace.energy[..., 0].sum(axis=1), trace.power[..., 0]
        times = here.step * np.arange(2 * steps)
        work = CubicSpline(times, power).antiderivative()(times)
        closing.append(np.abs(stored - stored[0] - work.sum(axis=1)).max() / np.abs(work[-1]).max())
        assert np.all(power[:, 0] <= 0), "relaxation may only take energy"
    assert closing[0] < 1e-3
    assert closing[1] < 2e-5
