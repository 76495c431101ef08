"""Masses that effects add: against bodies that have them from the start, closed forms, the ledger and the order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from tests.oracles.plates import loaded
from tests.sim.kernels.marching import ORDER, driven, march, order, plank, vacuum_here, with_connectors
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes, Trace
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.virtual_rigs.campaign import robird_wing, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]
STILL_AIR = replace(vacuum(1000.0, 0.05, 3.0), gravity=0.0)
LIGHT = {"D_E": 1.0, "D_G": 1.0}
MASS, PLACE = 0.004, np.array([0.012, -0.08, 0.006])
G = 9.81


def scene_of(structure: Structure, genome: dict[str, float] | None = None, group: Lanes | None = None) -> WingScene:
    return WingScene.of(structure, STILL_AIR, loaded(structure, genome or {}) if group is None else group)


def free_body() -> tuple[Structure, WingScene]:
    """Half a plank and no connector."""
    structure = build(plank(), Division.parse("2x1"))
    none = np.zeros(len(structure.connectors), bool)
    structure, group = with_connectors(structure, loaded(structure, {}), none)
    return structure, scene_of(structure, group=group)


def own_matrix(structure: Structure) -> Array:
    """[6, 6]: inertia and mass of the first body."""
    M = structure.wiring.mass[0] * np.eye(6)
    M[:3, :3] = structure.wiring.inertia[0].reshape(3, 3)
    return np.asarray(M)


def fly(structure: Structure, group: Lanes, spin: Array, speed: Array, step: float, steps: int) -> Trace:
    """Free flight of the first body under gravity, from angular velocity ``spin`` and velocity ``speed``."""
    state = at_rest(structure)
    state.V[0, :3], state.V[0, 3:] = spin[:, None], speed[:, None]
    return march(structure, group, vacuum_here(step, G), state, steps)


def test_body_with_a_point_mass_flies_as_the_body_that_has_it() -> None:
    """The same body, described about its new centre: places and rotations agree to the integrator's order."""
    spin, speed, errors = np.array([9.0, 4.0, -6.0]), np.array([0.3, -0.2, 0.1]), []
    for steps in (100, 200, 400):
        step = 0.4 / steps
        structure, scene = free_body()
        scene.add_point_mass(0, np.full(LANES, MASS), np.repeat(PLACE[:, None], LANES, axis=1))
        added = fly(structure, scene.frozen(), spin, speed, step, steps)
        structure, scene = free_body()
        own, inertia = structure.wiring.mass[0], structure.wiring.inertia[0].reshape(3, 3).copy()
        centre, pair = MASS / (own + MASS) * PLACE, own * MASS / (own + MASS)
        structure.wiring.mass[0] += MASS
        structure.wiring.inertia[0] = (inertia + pair * (PLACE @ PLACE * np.eye(3) - np.outer(PLACE, PLACE))).ravel()
        from_start = fly(structure, scene.frozen(), spin, speed + np.cross(spin, centre), step, steps)
        R = from_start.R[:, 0, :, 0].reshape(-1, 3, 3)
        shift = from_start.p[0, 0, :, 0] - added.p[0, 0, :, 0]
        place = from_start.p[:, 0, :, 0] - shift - (R - R[0]) @ centre
        errors.append(float(np.abs(added.p[:, 0, :, 0] - place).max()))
        np.testing.assert_allclose(added.R[:, 0, :, 0], from_start.R[:, 0, :, 0], atol=2e3 * step**4 / 0.4**3)
        energies = [trace.energy[..., 0].sum(axis=1) for trace in (added, from_start)]
        one, other = (e - e[0] for e in energies)
        np.testing.assert_allclose(one, other, atol=1e-4 * energies[0].max())
    assert errors[-1] < 1e-6
    assert order(errors) > ORDER - 0.3


def test_equal_weight_about_the_centre_is_more_of_the_same_body() -> None:
    """Twice the mass and inertia of every body of a driven wing, in whatever way they come: the same motion."""
    structure = build(robird_wing(), Division.parse("4"))
    scene, n = scene_of(structure), len(structure.bodies)
    inertia = structure.wiring.inertia.reshape(n, 3, 3)
    for k in range(n):
        second = np.repeat(inertia[k][:, :, None], LANES, axis=2)
        scene.add_mass(k, np.full(LANES, structure.wiring.mass[k]), np.zeros((3, LANES)), second)
    table, here = driven(structure, STILL_AIR, 96, 1), scene.setting(96)._replace(gravity=G)
    added = march(structure, scene.frozen(), here, at_rest(structure), 96, table)
    wiring = structure.wiring._replace(mass=2 * structure.wiring.mass, inertia=2 * structure.wiring.inertia)
    heavy = replace(structure, wiring=wiring)
    from_start = march(heavy, scene.lanes, here, at_rest(structure), 96, table)
    np.testing.assert_allclose(added.tracks, from_start.tracks, atol=1e-12)
    np.testing.assert_allclose(added.energy, from_start.energy, atol=1e-12)
    np.testing.assert_allclose(added.power, from_start.power, atol=1e-10)


def test_lanes_have_masses_of_their_own() -> None:
    structure = build(robird_wing(), Division.parse("4"))
    mass = np.linspace(0.0, 0.01, LANES)
    table = driven(structure, STILL_AIR, 64, 1)
    tracks = []
    for given in (mass, mass[::-1].copy()):
        scene = scene_of(structure)
        scene.add_point_mass(2, given, np.repeat(PLACE[:, None], LANES, axis=1))
        trace = march(structure, scene.frozen(), scene.setting(64), at_rest(structure), 64, table)
        tracks.append(trace.tracks)
    assert np.array_equal(tracks[0], tracks[1][..., ::-1])
    assert np.all(np.diff(np.abs(tracks[0] - tracks[0][..., :1]).max(axis=(0, 1, 2))) > 0)


def test_a_plate_that_drifts_with_the_wind_has_no_load() -> None:
    """Air moved along has the momentum of the motion relative to the wind: none, whatever its matrix."""
    structure, scene = free_body()
    part = np.random.default_rng(1).normal(size=(6, 6)) * np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])[:, None]
    scene.add_air(0, 0, np.repeat((part @ part.T)[:, :, None], LANES, axis=2) * 1e-3)
    wind, state = np.array([3.0, -1.0, 2.0]), at_rest(structure)
    turn = Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix()
    state.R[0] = turn.ravel()[:, None]
    state.V[0, 3:] = (turn.T @ wind)[:, None]
    here = vacuum_here(1e-3)._replace(wind=np.repeat(wind[:, None], LANES, axis=1))
    trace = march(structure, scene.frozen(), here, state, 200)
    np.testing.assert_allclose(trace.V[-1, 0], state.V[0], atol=1e-12)
    assert np.abs(trace.energy[:, 0] - 0.5 * structure.wiring.mass[0] * (wind @ wind)).max() < 1e-12


@pytest.mark.parametrize("wind", [np.zeros(3), np.array([0.6, 0.2, -0.3])], ids=["still", "wind"])
def test_a_body_that_moves_air_across_itself(wind: Array) -> None:
    """Against scipy: M V' = h x omega + p x v - N q', q = (omega_x, omega_y, n . (velocity - wind)); energy is kept."""
    start = np.array([3.0, 5.0, 2.0, 0.8, 0.3, 0.0])
    block = np.zeros((6, 6))
    block[np.ix_([0, 1, 5], [0, 1, 5])] = [[1e-5, 2e-6, 1e-4], [2e-6, 2e-5, -2e-4], [1e-4, -2e-4, 0.04]]
    errors, drifts = [], []
    for steps in (200, 400, 800):
        structure, scene = free_body()
        scene.add_air(0, 0, np.repeat(block[:, :, None], LANES, axis=2))
        state, M = at_rest(structure), own_matrix(structure)
        state.V[0] = start[:, None]
        here = vacuum_here(1.0 / steps)._replace(wind=np.repeat(wind[:, None], LANES, axis=1))
        trace = march(structure, scene.frozen(), here, state, steps)

        def rate(_: float, y: Array, M: Array = M) -> Array:
            V, R = y[:6], y[6:].reshape(3, 3)
            momentum, blown = M @ V, wind @ R
            turned = np.concatenate([np.cross(momentum[:3], V[:3]), np.cross(momentum[3:], V[:3])])
            turning = block[:, 5] * np.cross(V[:3], blown)[2]
            spin = np.array([[0.0, -V[2], V[1]], [V[2], 0.0, -V[0]], [-V[1], V[0], 0.0]])
            return np.concatenate([np.linalg.solve(M + block, turned - turning), (R @ spin).ravel()])

        expected = solve_ivp(rate, (0.0, 1.0), np.concatenate([start, np.eye(3).ravel()]), rtol=1e-11, atol=1e-12)
        errors.append(float(np.abs(state.V[0, :, 0] - expected.y[:6, -1]).max()))
        energy = trace.energy[:, 0, 0]
        drifts.append(float(np.ptp(energy) / energy.max()))
    assert errors[-1] < 1e-6
    assert order(errors) > ORDER - 0.3
    if not wind.any():
        assert drifts[-1] < 1e-8


def heavy_scene(division: str, *, air: bool, weight: bool, genome: dict[str, float] | None = None) -> WingScene:
    """The Robird's wing with weight at odd places and all of the air that plates move."""
    structure = build(robird_wing(), Division.parse(division), whole_strips=True)
    scene, rng = scene_of(structure, genome), np.random.default_rng(4)
    if weight:
        for n, body in enumerate(structure.bodies):
            place = np.repeat(0.02 * rng.normal(size=(3, 1)), LANES, axis=1)
            scene.add_point_mass(n, np.full(LANES, 0.5 * body.mass), place)
    if air:
        effect = EFFECTS["added_mass"]
        assert effect.wing is not None
        effect.wing(scene, {p.name: np.full(LANES, p.typical) for p in effect.parameters})
    return scene


@pytest.mark.parametrize(("air", "weight"), [(False, True), (True, False), (True, True)])
def test_ledger_closes_with_masses(air: bool, weight: bool) -> None:
    """Over two beats from rest in still air, gravity on: the stored energy is what went through the ports."""
    closing = []
    for steps in (200, 800):
        scene = heavy_scene("11", air=air, weight=weight)
        structure, here = scene.structure, scene.setting(steps)._replace(gravity=G)
        state = at_rest(structure)
        trace = march(structure, scene.frozen(), here, state, 2 * steps, driven(structure, STILL_AIR, steps, 2))
        stored, power = trace.energy[..., 0].sum(axis=1), trace.power[..., 0]
        work = CubicSpline(here.step * np.arange(2 * steps), power).antiderivative()(here.step * np.arange(2 * steps))
        closing.append(np.abs(stored - stored[0] - work.sum(axis=1)).max() / np.abs(work[-1]).max())
    assert closing[0] < 2e-3
    assert closing[1] < 5e-5
    assert np.log(closing[0] / closing[1]) / np.log(4) > 2.0


@pytest.mark.parametrize(("air", "weight"), [(False, True), (True, False)])
def test_order_with_masses(air: bool, weight: bool) -> None:
    """Driven, nearly undamped, air that moves along but does not blow: halving the step shows the order."""
    tracks = {}
    for steps in (200, 400, 800):
        scene = heavy_scene("4", air=air, weight=weight, genome=LIGHT)
        here = scene.setting(steps)
        here = here._replace(density=0 * here.density)
        table = driven(scene.structure, STILL_AIR, steps, 2)
        trace = march(scene.structure, scene.frozen(), here, at_rest(scene.structure), 2 * steps, table)
        tracks[steps] = trace.tracks[:: steps // 200, ..., 0]
    errors = [np.abs(tracks[a] - tracks[b]).max() for a, b in ((200, 400), (400, 800))]
    assert order(errors) == pytest.approx(ORDER, abs=0.5)
