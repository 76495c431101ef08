"""Closed-form limits of the multi-body model: free body, pendulum, cantilever, and the energy ledger."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import CubicSpline

from records import Condition, FourBarDrive, FourierDrive, Gene, Genome, Hinge, Marker, Materials, Rod, Station, Wing
from sim.division import Division
from sim.kernels import LANES
from sim.kernels.integrate import NODES, Lanes, Setting, State, Wiring, advance, new_work
from sim.rig import robird_wing, tunnel, vacuum
from sim.simulate import Numerics, at_rest, drive_table, new_trace, setting
from sim.structure import Structure, build
from sim.wing_genes import lanes, wing_genes

Array = npt.NDArray[np.float64]

LIGHT = {"D_E": 1.0, "D_G": 1.0}
LENGTH, CHORD, THICKNESS, DENSITY, YOUNG = 0.5, 0.05, 0.02, 40.0, 2.0e7


def plank(drive: FourierDrive | None = None) -> Wing:
    """A uniform foam plank with rods too light and too soft to matter."""
    rods = tuple(Rod(n, x, 0.0, x, LENGTH, 1e-5, 1.0, 0.0) for n, x in (("front", 0.01), ("rear", 0.04)))
    stations = tuple(Station(y, 0.0, CHORD, THICKNESS) for y in (0.0, LENGTH))
    tip = Marker("tip", (CHORD / 2, LENGTH - 1e-9, 0.0), 1e-12)
    still = FourierDrive(0.0, (), ())
    return Wing(
        "plank", stations, Materials(DENSITY, 0.0), rods, ("front", "rear"), (tip,), ("tip",), Hinge(0.0, 0.0),
        drive or still,
    )  # fmt: skip


def march(
    structure: Structure, genome: dict[str, float], here: Setting, state: State, steps: int, table: Array | None = None
) -> tuple[Array, Array, Array]:
    """Integrate ``steps`` steps; tracks [n, M, 3], energies [n, 3] and power through the ports [n, 4] of lane 0."""
    genes = wing_genes({})
    values = np.array([[genome.get(g.name, g.nominal) for g in genes]])
    group = lanes(structure, genes, values)
    trace, alive = new_trace(structure, steps), np.ones(LANES, bool)
    still = np.zeros((steps, 4, 2, 3)) if table is None else table
    advance(structure.wiring, here, group, still, new_work(structure.wiring, group, here.step), state, trace, alive)
    assert alive[0]
    return trace.tracks[..., 0], trace.energy[..., 0], trace.power[..., 0]


def only_first_body(structure: Structure) -> Structure:
    """The structure with all springs and dampers cut."""
    empty: Wiring = structure.wiring._replace(
        first=structure.wiring.first[:0], second=structure.wiring.second[:0], block=structure.wiring.block[:0],
        a=structure.wiring.a[:0], b=structure.wiring.b[:0], driven=0,
    )  # fmt: skip
    return Structure(
        structure.wing, structure.division, structure.planform, structure.panels, structure.bodies, (), empty
    )


def test_free_body_keeps_energy_and_angular_momentum_and_falls() -> None:
    """An asymmetric body tumbles by Euler's equations: Poinsot's two invariants, and a parabola for its centre."""
    structure = only_first_body(build(robird_wing(), Division.parse("2x3")))
    structure.wiring.inertia[0] = np.diag([1e-5, 2e-5, 3e-5]).ravel()
    state = at_rest(structure)
    state.V[0, :3] = np.array([0.1, 20.0, 0.1])[:, None]
    start = state.p[0, :, 0].copy()
    here = Setting(0.0, np.zeros(3), 9.81, 1e-3)
    genes = wing_genes({})
    group = lanes_without_connectors(structure, genes)
    trace, alive, n = new_trace(structure, 500), np.ones(LANES, bool), 500
    inertia = structure.wiring.inertia[0].reshape(3, 3)

    def invariants() -> tuple[float, Array]:
        omega, R = state.V[0, :3, 0], state.R[0, :, 0].reshape(3, 3)
        return float(omega @ inertia @ omega), R @ inertia @ omega

    energy, momentum = invariants()
    work = new_work(structure.wiring, group, 1e-3)
    advance(structure.wiring, here, group, np.zeros((n, 4, 2, 3)), work, state, trace, alive)
    turned = invariants()
    assert abs(state.V[0, 0, 0]) > 1.0, "rotation about the middle axis must have become unstable by now"
    assert turned[0] == pytest.approx(energy, rel=1e-4)
    np.testing.assert_allclose(turned[1], momentum, rtol=0, atol=2e-4 * float(np.linalg.norm(momentum)))
    # the velocity is integrated in body axes, which turn: exact to third order only
    np.testing.assert_allclose(state.p[0, :, 0], start - [0, 0, 0.5 * 9.81 * 0.25], atol=1e-5)


def lanes_without_connectors(structure: Structure, genes: tuple[Gene, ...]) -> Lanes:
    full = build(structure.wing, structure.division)
    group = lanes(full, genes, np.array([[g.nominal for g in genes]]))
    return group._replace(stiffness=group.stiffness[:0], damping=group.damping[:0])


def test_heavy_pendulum_swings_with_its_period() -> None:
    """The plank held only against translation at the root is a compound pendulum: T = 2 pi sqrt(I / m g l)."""
    wing = plank()
    structure = build(wing, Division.parse("2x1"))
    w = structure.wiring
    root = w.first >= len(structure.bodies)
    genes = wing_genes({})
    group = lanes(structure, genes, np.array([[g.nominal for g in genes]]))
    group.stiffness[~root] *= 1e3  # rigid between the strips
    group.stiffness[root, :3] = 0.0  # free to turn at the root,
    group.stiffness[root, 3:] = 1e6  # held in place
    group.damping[:] = 0.0
    hinges = w.a.copy()
    w.a[root, 0] = w.a[root, 0].mean() + np.array([-0.5, 0.5])  # wide apart, so that the axis is x
    w.b[root] = w.b[root] + (w.a[root] - hinges[root])
    mass = sum(b.mass for b in structure.bodies)
    inertia = mass * (LENGTH**2 / 3 + THICKNESS**2 / 12)
    period = 2 * np.pi * np.sqrt(inertia / (mass * 9.81 * LENGTH / 2))
    state, angle = at_rest(structure), 0.05
    hang(structure, state, angle - np.pi / 2)
    steps, h = 400, 2.5 * period / 400
    here = Setting(0.0, np.zeros(3), 9.81, h)
    trace, alive = new_trace(structure, steps), np.ones(LANES, bool)
    advance(w, here, group, np.zeros((steps, 4, 2, 3)), new_work(w, group, h), state, trace, alive)
    y = trace.tracks[:, 0, 1, 0]
    crossings = np.flatnonzero(np.diff(np.sign(y)))
    times = h * (crossings + y[crossings] / (y[crossings] - y[crossings + 1]))
    measured = 2 * np.diff(times).mean()
    assert measured == pytest.approx(period * (1 + angle**2 / 16), rel=1e-3)


def hang(structure: Structure, state: State, angle: float) -> None:
    """Turn the whole wing rigidly by ``angle`` about the x axis through the origin."""
    c, s = np.cos(angle), np.sin(angle)
    n = len(structure.bodies)
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    state.R[:n] = R.ravel()[None, :, None]
    state.p[:n] = np.einsum("ij,njw->niw", R, state.p[:n])


@pytest.mark.parametrize("strips", [4, 8, 16])
def test_cantilever_approaches_euler_bernoulli(strips: int) -> None:
    """Static tip deflection under gravity and first frequency of the clamped plank, error falling with the division."""
    structure = build(plank(), Division.parse(f"{strips}x1"))
    mass = DENSITY * CHORD * THICKNESS
    rigidity = YOUNG * CHORD * THICKNESS**3 / 12
    shear = {"E_f": YOUNG, "G_f": YOUNG, "D_E": 0.0, "D_G": 0.0}
    first = 1.875104**2 * np.sqrt(rigidity / (mass * LENGTH**4)) / (2 * np.pi)
    state = at_rest(structure)
    h = 1 / (first * 150)
    here = Setting(0.0, np.zeros(3), 0.1, h)
    tracks, _, _ = march(structure, shear, here, state, 600)
    z = tracks[:, 0, 2]
    # released from straight, the tip swings about its static deflection with its natural period
    static = -mass * 0.1 * LENGTH**4 / (8 * rigidity)
    middle = z.mean()
    crossings = np.flatnonzero((z[:-1] > middle) & (z[1:] <= middle))
    at = crossings + (z[crossings] - middle) / (z[crossings] - z[crossings + 1])
    frequency = 1 / (np.diff(at).mean() * h)
    # a plank 25 times as long as thick, G = E: shear softens by about 1 %; the division by 1 / strips^2
    tolerance = 0.02 + 2.5 / strips**2
    assert frequency == pytest.approx(first, rel=tolerance)
    assert middle == pytest.approx(static, rel=2 * tolerance)


def test_four_bar_rocker_closes_the_loop() -> None:
    from sim.drive import four_bar_angle

    linkage = robird_wing().drive
    assert isinstance(linkage, FourBarDrive)
    psi = np.linspace(0, 2 * np.pi, 50)
    angle = four_bar_angle(linkage, psi) - linkage.offset
    pin = linkage.crank * np.stack([np.cos(psi), np.sin(psi)])
    tip = np.array([[linkage.ground], [0.0]]) + linkage.rocker * np.stack([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(np.linalg.norm(tip - pin, axis=0), linkage.coupler, rtol=1e-12)


@pytest.mark.parametrize(
    ("condition", "genome", "order"),
    [(vacuum(10.0, 0.05, 3.0), {}, 1.0), (tunnel(0.05, 3.0, 6.0), {}, 1.0), (vacuum(1.0, 0.05, 3.0), LIGHT, 2.7)],
    ids=["vacuum", "tunnel", "light damping"],
)
def test_energy_ledger_closes(condition: Condition, genome: dict[str, float], order: float) -> None:
    """Over two beats from rest: change of stored energy = work of motors + air - losses, to the integrator's error.

    Third order, as the motion, where damping is light; what strong dampers take from stiff modes converges more slowly.
    """
    condition = replace(condition, gravity=0.0)
    structure = build(robird_wing(), Division.parse("11"))
    closing = []
    for steps in (200, 800):
        numerics = Numerics(steps=steps)
        here, state = setting(condition, numerics), at_rest(structure)
        table = np.concatenate([drive_table(structure, condition, numerics, beat) for beat in (0, 1)])
        _, energy, power = march(structure, genome, here, state, 2 * steps, table)
        stored, times = energy.sum(axis=1), here.step * np.arange(2 * steps)
        work = CubicSpline(times, power).antiderivative()(times)
        closing.append(np.abs(stored - stored[0] - work.sum(axis=1)).max() / np.abs(work[-1]).max())
        assert np.all(power[:, 0] <= 0), "dampers may only take energy"
    assert closing[0] < 0.05
    assert closing[1] < 0.002
    assert np.log(closing[0] / closing[1]) / np.log(4) > order


def test_without_damping_and_drive_energy_is_conserved() -> None:
    structure = build(robird_wing(), Division.parse("11"))
    drift = []
    for h in (4e-4, 2e-4):
        state = at_rest(structure)
        here = Setting(0.0, np.zeros(3), 9.81, h)
        _, energy, _ = march(structure, {"D_E": 0.0, "D_G": 0.0}, here, state, int(0.2 / h))
        total = energy.sum(axis=1)
        drift.append(np.abs(total - total[0]).max() / np.ptp(energy[:, 2]))
    assert drift[0] < 0.02
    assert drift[1] < drift[0] / 3


def test_the_integrator_is_of_third_order() -> None:
    """Halving the step divides the error by eight.

    Two beats from rest in vacuum, where no force law has a kink, without gravity, whose sudden onset would ring stiff
    modes, and nearly without damping: strong dampers on stiff modes reduce the order to two, at micrometres.
    """
    structure = build(robird_wing(), Division.parse("4"))
    condition = replace(vacuum(0.01, 0.05, 3.0), gravity=0.0)
    tracks = {}
    for steps in (200, 400, 800):
        numerics = Numerics(steps=steps)
        table = np.concatenate([drive_table(structure, condition, numerics, beat) for beat in (0, 1)])
        whole, _, _ = march(structure, LIGHT, setting(condition, numerics), at_rest(structure), 2 * steps, table)
        tracks[steps] = whole[:: steps // 200]
    errors = [np.abs(tracks[a] - tracks[b]).max() for a, b in ((200, 400), (400, 800))]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(3, abs=0.3)


def test_stage_times_are_those_of_the_method() -> None:
    np.testing.assert_allclose(NODES, [0, 0.871733043016918, 0.731579957788852, 1], atol=1e-12)


def test_genome_default_is_nominal() -> None:
    genes = wing_genes({})
    assert Genome.nominal(genes).values == tuple(g.nominal for g in genes)
