"""Rigid bodies and springs by the real integrator, against closed forms; the order of the integrator on each."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import eig, eigh
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

from tests.oracles.free_body import FreeBody
from tests.oracles.plates import loaded
from tests.sim.kernels.marching import (
    ORDER,
    STIFF_ORDER,
    driven,
    march,
    order,
    plank,
    turned,
    vacuum_here,
    with_connectors,
)
from wingfit.records import FourierDrive, Hinge
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes, State
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.virtual_rigs.campaign import vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.drive import flap_angle
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]

G = 9.81
PRINCIPAL = np.array([1e-5, 2e-5, 3e-5])
AXES = Rotation.from_rotvec([0.4, -0.7, 0.3]).as_matrix()  # principal axes in the body frame, as columns
SPIN = np.array([10.0, 0.0, 7.0])  # about the principal axes; close to where the middle axis tips over


def free_flight(step: float, steps: int, gravity: float = 0.0) -> tuple[Array, Array, Array, Structure]:
    """Rotation [T, 3, 3], rates about the principal axes [T, 3] and centre [T, 3] of a body without connectors."""
    structure = build(plank(), Division.parse("2x1"))
    group = loaded(structure, {})
    structure, group = with_connectors(structure, group, np.zeros(len(structure.connectors), bool))
    structure.wiring.inertia[0] = (AXES @ np.diag(PRINCIPAL) @ AXES.T).ravel()
    state = at_rest(structure)
    state.V[0, :3] = (AXES @ SPIN)[:, None]
    state.V[0, 3:] = np.array([0.3, -0.2, 0.1])[:, None]
    trace = march(structure, group, vacuum_here(step, gravity), state, steps)
    return trace.R[:, 0, :, 0].reshape(-1, 3, 3), trace.V[:, 0, :3, 0] @ AXES, trace.p[:, 0, :, 0], structure


def test_free_body_turns_as_jacobis_elliptic_functions_say() -> None:
    """Rates over three periods and the precession about the angular momentum; errors fall with the declared order."""
    body = FreeBody(PRINCIPAL, SPIN)
    rate_errors, angle_errors = [], []
    for steps in (300, 600, 1200):
        h = 3 * body.period / steps
        t = h * np.arange(steps)
        R, rates, _, _ = free_flight(h, steps)
        rate_errors.append(float(np.abs(rates - body.rates(t)).max() / np.abs(SPIN).max()))
        L = AXES @ (PRINCIPAL * SPIN) / body.momentum
        third = R @ AXES[:, 2]
        east = np.cross(L, third[0])
        east /= np.linalg.norm(east)
        around = np.unwrap(np.arctan2(third @ east, third @ np.cross(east, L)))
        fine = np.linspace(0, t[-1], 40 * (steps - 1) + 1)
        angle_errors.append(float(np.abs(around - body.precession(fine)[::40]).max()))
    assert rate_errors[-1] < 1e-6
    assert angle_errors[-1] < 1e-5
    assert order(rate_errors) > ORDER - 0.25
    assert order(angle_errors) > ORDER - 0.25


def test_free_body_keeps_energy_and_angular_momentum() -> None:
    """Both drift by no more than the integrator's error, which falls with its order; what drifts is not round-off."""
    body = FreeBody(PRINCIPAL, SPIN)
    drifts: list[list[float]] = [[], []]
    for steps in (300, 600, 1200):
        R, rates, _, _ = free_flight(3 * body.period / steps, steps)
        energy = rates**2 @ PRINCIPAL
        momentum = np.einsum("tij,tj->ti", R @ AXES, rates * PRINCIPAL)
        drifts[0].append(float(np.abs(energy / energy[0] - 1).max()))
        drifts[1].append(float(np.linalg.norm(momentum - momentum[0], axis=1).max() / body.momentum))
    for drift in drifts:
        assert drift[-1] < 1e-7
        assert order(drift) > ORDER - 0.25


def test_centre_of_a_tumbling_body_falls_along_a_parabola() -> None:
    """The velocity is integrated in body axes, which turn; in the world it must come out straight."""
    errors = []
    for steps in (100, 200, 400):
        h = 0.5 / steps
        _, _, p, _ = free_flight(h, steps, G)
        t = h * np.arange(steps)[:, None]
        errors.append(float(np.abs(p - p[0] - t * [0.3, -0.2, 0.1] + 0.5 * G * t**2 * [0, 0, 1]).max()))
    assert errors[-1] < 1e-8
    assert order(errors) > ORDER - 0.25


def pendulum() -> tuple[Structure, Lanes, float, float]:
    """The inner half of the plank pinned at two points of the x axis: m g l and the inertia about that axis."""
    structure = build(plank(), Division.parse("2x1"))
    group = loaded(structure, {})
    structure, group = with_connectors(structure, group, structure.wiring.first >= len(structure.bodies))
    w, body = structure.wiring, structure.bodies[0]
    shift = np.zeros((2, 3))
    shift[:, 0] = body.centre[0] + np.array([-0.5, 0.5]) - w.a[:, 0]
    w.a[:] += shift
    w.b[:] += shift
    group.stiffness[:, :3], group.stiffness[:, 3:], group.damping[:] = 0.0, 1e8, 0.0
    arm = float(body.centre[1])
    return structure, group, body.mass * G * arm, float(body.inertia[0, 0]) + body.mass * arm**2


@pytest.mark.parametrize(("amplitude", "steps", "limit"), [(0.1, 100, 1e-5), (1.5, 400, 2e-4), (2.5, 1600, 2e-4)])
def test_heavy_pendulum_of_finite_amplitude(amplitude: float, steps: int, limit: float) -> None:
    """sin(theta / 2) = k cd(omega_0 t; k), k = sin(amplitude / 2), over two periods 4 K(k) / omega_0.

    A pin is a spring far too stiff for the step: there the order is that of stiff problems.
    """
    structure, group, torque, inertia = pendulum()
    pace, k = np.sqrt(torque / inertia), np.sin(amplitude / 2)
    period, errors = 4 * ellipk(k**2) / pace, []
    for n in (steps // 2, steps):
        h, state = 2 * period / n, at_rest(structure)
        turned(structure, state, amplitude - np.pi / 2)
        R = march(structure, group, vacuum_here(h, G), state, n).R[:, 0, :, 0]
        theta = np.unwrap(np.arctan2(R[:, 7], R[:, 8])) + np.pi / 2
        _, cn, dn, _ = ellipj(pace * h * np.arange(n), k**2)
        errors.append(float(np.abs(theta - 2 * np.arcsin(k * cn / dn)).max()) / amplitude)
    assert errors[-1] < limit
    assert order(errors) > STIFF_ORDER - 0.25


def motor_torque_error(steps: int) -> float:
    """Largest error over a beat of the motors' torque on a nearly rigid wing, as part of its largest value.

    I phi'' + m g (r_y cos phi - r_z sin phi) about a hinge beside the plank. The first resonance lies at 600 Hz: it
    leaves (6 / 600)^2, and four beats are enough for its ringing to die.
    """
    drive, hinge, beats = FourierDrive(0.1, (0.5, 0.05), (0.1, 0.0)), Hinge(-0.03, 0.02), 4
    structure = build(plank(drive, hinge), Division.parse("4x1"))
    group = loaded(structure, {"E_f": 1e11, "G_f": 1e11, "D_E": 1e7, "D_G": 1e7})
    table = driven(structure, vacuum(0.0, 0.0, 3.0), steps, beats)
    trace = march(structure, group, vacuum_here(1 / (3.0 * steps), G), at_rest(structure), beats * steps, table)
    mass = np.array([b.mass for b in structure.bodies])
    arms = np.array([b.centre for b in structure.bodies]) - [0.0, hinge.y, hinge.z]
    inertia = sum(b.inertia[0, 0] for b in structure.bodies) + mass @ (arms[:, 1] ** 2 + arms[:, 2] ** 2)
    weight = G * mass @ arms
    phi, _, bend = flap_angle(drive, 2 * np.pi * np.arange(steps) / steps)[:, :3].T
    expected = inertia * (2 * np.pi * 3.0) ** 2 * bend + weight[1] * np.cos(phi) - weight[2] * np.sin(phi)
    assert np.ptp(weight[1] * np.cos(phi)) > 1e-2 * np.abs(expected).max(), "the weight's part must be seen to vary"
    found = -trace.rods[-steps:, :, 0, 0].sum(axis=1)
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def test_motors_of_a_rigid_wing_bear_inertia_and_weight() -> None:
    """A stiff root feels every error in the place of the rods."""
    errors = [motor_torque_error(steps) for steps in (400, 1600)]
    assert errors[0] < 0.01
    assert errors[1] < 2e-4


class TwoBodies:
    """Two bodies joined by one connector, all parameters unequal; linear theory in world axes from scratch."""

    def __init__(self) -> None:
        self.mass = np.array([0.02, 0.035])
        turns = Rotation.from_rotvec([[0.3, 0.5, -0.2], [-0.6, 0.1, 0.4]]).as_matrix()
        principal = np.array([[1.0, 2.0, 2.5], [3.0, 2.2, 4.0]]) * 1e-5
        self.inertia = np.einsum("nij,nj,nkj->nik", turns, principal, turns)
        self.a, self.b = np.array([0.01, 0.03, -0.005]), np.array([-0.008, -0.02, 0.012])
        self.K = np.array([0.3, 0.5, 0.8, 300.0, 700.0, 450.0])
        self.D = np.array([4e-4, 2e-4, 5e-4, 0.15, 0.5, 0.1])

    def matrices(self) -> tuple[Array, Array, Array]:
        """M, D, K [12, 12] for small (rotation, displacement) of body A, then B."""
        J = np.zeros((6, 12))
        J[:3, 0:3], J[:3, 6:9] = -np.eye(3), np.eye(3)
        J[3:, 3:6], J[3:, 9:12] = -np.eye(3), np.eye(3)
        for k, axis in enumerate(np.eye(3)):
            J[3:, k], J[3:, 6 + k] = -np.cross(axis, self.a), np.cross(axis, self.b)
        M = np.zeros((12, 12))
        for n in range(2):
            M[6 * n : 6 * n + 3, 6 * n : 6 * n + 3] = self.inertia[n]
            M[6 * n + 3 : 6 * n + 6, 6 * n + 3 : 6 * n + 6] = self.mass[n] * np.eye(3)
        return M, J.T @ np.diag(self.D) @ J, J.T @ np.diag(self.K) @ J

    def march(self, x: Array, rate: Array, step: float, steps: int, *, damped: bool) -> Array:
        """Motion [T, 12, W] from small displacements and rates [12, W]."""
        structure = build(plank(), Division.parse("2x1"))
        structure, group = with_connectors(structure, loaded(structure, {}), structure.wiring.first == 0)
        w = structure.wiring
        w.mass[:], w.inertia[:], w.a[0], w.b[0] = self.mass, self.inertia.reshape(2, 9), self.a, self.b
        group.stiffness[0] = self.K[:, None]
        group.damping[0] = self.D[:, None] if damped else 0.0
        state = at_rest(structure)
        place = np.array([np.zeros(3), self.a - self.b])
        self._displace(state, place, x, rate)
        trace = march(structure, group, vacuum_here(step), state, steps)
        R = np.moveaxis(trace.R[:, :2], -1, 1).reshape(steps, LANES, 2, 3, 3)
        theta = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec().reshape(steps, LANES, 2, 3)
        moved = np.moveaxis(trace.p[:, :2], -1, 1) - place
        return np.moveaxis(np.concatenate([theta, moved], axis=-1).reshape(steps, LANES, 12), 1, -1)

    @staticmethod
    def _displace(state: State, place: Array, x: Array, rate: Array) -> None:
        for lane in range(LANES):
            k = min(lane, x.shape[1] - 1)
            for n in range(2):
                turn = Rotation.from_rotvec(x[6 * n : 6 * n + 3, k])
                state.R[n, :, lane] = turn.as_matrix().ravel()
                state.p[n, :, lane] = place[n] + x[6 * n + 3 : 6 * n + 6, k]
                twist = rate[6 * n : 6 * n + 6, k].reshape(2, 3)
                state.V[n, :, lane] = turn.inv().apply(twist).ravel()


SMALL = 1e-7


def test_two_bodies_on_one_connector_ring_in_six_modes() -> None:
    """Frequencies and shapes of the generalised eigenproblem, every mode in a lane of its own, undamped."""
    pair = TwoBodies()
    M, _, K = pair.matrices()
    squares, shapes = eigh(K, M)
    assert np.abs(squares[:6]).max() < 1e-9 * squares[-1], "six rigid modes"
    omega, shapes = np.sqrt(squares[6:]), SMALL * shapes[:, 6:] / np.abs(shapes[:, 6:]).max(axis=0)
    errors = []
    for refine in (0.5, 1):
        h = 2 * np.pi / omega[-1] / (40 * refine)
        steps = int(2 * np.pi / omega[0] * 2 / h)
        found = pair.march(shapes, 0 * shapes, h, steps, damped=False)[..., :6]
        expected = shapes * np.cos(omega * h * np.arange(steps)[:, None])[:, None, :]
        errors.append(float(np.abs(found - expected).max(axis=(0, 1)).max() / SMALL))
    assert errors[-1] < 1e-4
    assert order(errors) > ORDER - 0.25


def test_two_bodies_on_one_connector_ring_down() -> None:
    """Complex modes of the damped pair, Re(v exp(lambda t)), with damping that no mode of the springs diagonalises."""
    pair = TwoBodies()
    M, D, K = pair.matrices()
    zero, one = np.zeros((12, 12)), np.eye(12)
    values, vectors = eig(np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]]))
    ringing = np.flatnonzero(values.imag > 1e-6 * np.abs(values).max())
    assert len(ringing) == 6
    lam, v = values[ringing], vectors[:12, ringing]
    assert np.all(lam.real < -1e-3 * np.abs(lam))
    v = SMALL * v / np.abs(v).max(axis=0)
    errors = []
    for refine in (0.5, 1):
        h = 2 * np.pi / np.abs(lam).max() / (40 * refine)
        steps = int(2 * np.pi / np.abs(lam).min() * 2 / h)
        found = pair.march(v.real, (lam * v).real, h, steps, damped=True)[..., :6]
        expected = (v * np.exp(lam * h * np.arange(steps)[:, None])[:, None, :]).real
        errors.append(float(np.abs(found - expected).max() / SMALL))
    assert errors[-1] < 1e-4
    assert order(errors) > ORDER - 0.25
