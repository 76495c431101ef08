"""Air carried along as inertia: closed forms of sections, and how it moves with the wing."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from tests.oracles.plates import loaded
from tests.sim.kernels.marching import CHORD, LENGTH, THICKNESS, march, plank, with_connectors
from wingfit.records import Condition, Materials, Wing
from wingfit.sim.atmosphere import density
from wingfit.sim.effects.library.aerodynamics import added_mass
from wingfit.sim.effects.library.aerodynamics.added_mass import EFFECT, strip_matrix
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes, Setting, State, new_work
from wingfit.sim.kernels.integrate import forces
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]

SEA = Condition(3.0, 0.0, 101325.0, 293.15, gravity=0.0)
AIR = density(SEA.pressure, SEA.temperature)
UNDAMPED = {"D_E": 0.0, "D_G": 0.0}


class Immersed(NamedTuple):
    """A wing whose air has inertia and does nothing else."""

    structure: Structure
    lanes: Lanes
    here: Setting

    def of(self, kept: npt.NDArray[np.bool_]) -> Immersed:
        """The same with some of the connectors."""
        structure, lanes = with_connectors(self.structure, self.lanes, kept)
        return self._replace(structure=structure, lanes=lanes)


def immersed(
    wing: Wing, division: str, genome: dict[str, float], k: float = 1.0, condition: Condition = SEA, step: float = 1e-3
) -> Immersed:
    structure = build(wing, Division.parse(division), whole_strips=True)
    scene = WingScene.of(structure, condition, loaded(structure, genome))
    scene.lanes.coefficients[:] = 0.0
    assert EFFECT.wing
    if k:
        EFFECT.wing(scene, {"k": np.full(LANES, k)})
    return Immersed(structure, scene.frozen(), scene.setting(100)._replace(step=step))


def rigid(structure: Structure, strip: int, turn: float, move: float) -> Array:
    """Twists [6 n] of a strip's bodies that pitch together about mid-chord and heave."""
    first, count = structure.division.index(strip, 0), structure.division.bodies[strip]
    twists = np.zeros((count, 6))
    for i in range(count):
        twists[i, 1] = turn
        twists[i, 5] = move - turn * (structure.bodies[first + i].centre[0] - 0.5 * CHORD)
    return twists.ravel()


@pytest.mark.parametrize("count", [1, 2, 3, 4, 8])
def test_a_rigid_strip_moves_lambs_mass_of_air(count: int) -> None:
    """pi c^2 / 4 in heave and pi c^4 / 128 in pitch about mid-chord, per span and density, not coupled."""
    structure = build(plank(), Division.parse(f"2x{count}"))
    M = strip_matrix(structure, 1)
    heave, pitch = rigid(structure, 1, 0.0, 1.0), rigid(structure, 1, 1.0, 0.0)
    assert heave @ M @ heave == pytest.approx(np.pi * CHORD**2 / 4 * LENGTH / 2, rel=1e-9)
    assert pitch @ M @ pitch == pytest.approx(np.pi * CHORD**4 / 128 * LENGTH / 2, rel=1e-9)
    assert heave @ M @ pitch == pytest.approx(0.0, abs=1e-15)


def energy_of(structure: Structure, strip: int, twists: Array) -> float:
    """Twice the energy of air of density one, from the velocities omega x r + v of points of the strip.

    Of a section in modes of the flow: sum_m pi b^2 w_m^2 / m with w = sum_m w_m sin(m t) / sin t at cos t half chords.
    """
    edges, count = structure.planform.strips(structure.division), structure.division.bodies[strip]
    first, t, modes = structure.division.index(strip, 0), (np.arange(4000) + 0.5) * np.pi / 4000, np.arange(1, 129)
    total = 0.0
    for node, weight in zip(*np.polynomial.legendre.leggauss(4), strict=True):
        y = 0.5 * (edges[strip] + edges[strip + 1]) + 0.5 * (edges[strip + 1] - edges[strip]) * node
        chord, fraction = float(structure.planform.chord(y)), 0.5 * (1 + np.cos(t))
        w = np.zeros(len(t))
        for i in range(count):
            places = np.stack([structure.planform.leading_edge(y) + fraction * chord, 0 * t + y, 0 * t], axis=1)
            arms = places - structure.bodies[first + i].centre
            moving = (twists[i, 3:] + np.cross(twists[i, :3], arms))[:, 2]
            w = np.where((fraction >= i / count) & (fraction < (i + 1) / count), moving, w)
        found = 2 / 4000 * np.sin(np.outer(modes, t)) @ (w * np.sin(t))
        width = 0.5 * (edges[strip + 1] - edges[strip]) * weight
        total += width * np.pi * (0.5 * chord) ** 2 * float((found**2 / modes).sum())
    return total


@pytest.mark.parametrize("strip", [0, 2])
def test_any_motion_of_the_bodies_moves_its_own_air(strip: int) -> None:
    structure = build(robird_wing(), Division.parse("3x3"))
    rng, M = np.random.default_rng(2), strip_matrix(structure, strip)
    for _ in range(2):
        twists = rng.normal(size=(3, 6)) * np.array([5.0, 10.0, 5.0, 1.0, 1.0, 1.0])
        assert twists.ravel() @ M @ twists.ravel() == pytest.approx(energy_of(structure, strip, twists), rel=2e-3)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 8, 16])
def test_the_matrix_is_symmetric_and_positive_whatever_the_cut(count: int) -> None:
    """Definite in rotation about x and y and translation along z; nothing in the plane."""
    structure = build(robird_wing(), Division.parse(f"3x{count}"))
    for strip in range(3):
        M = strip_matrix(structure, strip)
        np.testing.assert_allclose(M, M.T, atol=1e-18)
        across = np.concatenate([6 * i + np.array([0, 1, 5]) for i in range(count)])
        reduced = M[np.ix_(across, across)]
        size = np.sqrt(np.diag(reduced))
        assert np.linalg.eigvalsh(reduced / np.outer(size, size)).min() > 1e-6
        assert not np.delete(M, across, axis=0).any()


@pytest.mark.parametrize("count", [2, 4, 8])
def test_modes_are_enough(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    structure = build(plank(), Division.parse(f"2x{count}"))
    kept = strip_matrix(structure, 0)
    monkeypatch.setattr(added_mass, "_MODES", 2048)
    added_mass._strip_matrix.cache_clear()
    exact = strip_matrix(structure, 0)
    added_mass._strip_matrix.cache_clear()
    heaving = np.arange(count) * 6 + 5
    np.testing.assert_allclose(np.diag(kept)[heaving], np.diag(exact)[heaving], rtol=3e-4)


def first_frequency(body: Immersed, guess: float) -> float:
    """Hz, from how often the tip crosses its mean after a sudden weight."""
    h = 1 / (guess * 150)
    here = body.here._replace(gravity=0.1, step=h)
    z = march(body.structure, body.lanes, here, at_rest(body.structure), 600).tracks[:, 0, 2, 0]
    middle = z.mean()
    crossings = np.flatnonzero((z[:-1] > middle) & (z[1:] <= middle))
    at = crossings + (z[crossings] - middle) / (z[crossings] - z[crossings + 1])
    return float(1 / (np.diff(at).mean() * h))


@pytest.mark.parametrize("foam", [40.0, 0.1])
def test_a_cantilever_swings_slower_by_the_root_of_its_mass(foam: float) -> None:
    """f / f_0 = (1 + rho pi c^2 / 4 m)^-1/2 in still air, up to air of 24 times the weight of the wing."""
    wing = replace(plank(), materials=Materials(foam, 0.0))
    mass = foam * CHORD * THICKNESS + 2 * np.pi / 4 * 1e-10
    ratio = (1 + AIR * np.pi * CHORD**2 / 4 / mass) ** -0.5
    genome = UNDAMPED | {"E_f": 2e7, "G_f": 2e7}
    guess = 1.875104**2 * np.sqrt(2e7 * CHORD * THICKNESS**3 / 12 / (mass * LENGTH**4)) / (2 * np.pi)
    without = first_frequency(immersed(wing, "4x2", genome, 0.0), guess)
    with_air = first_frequency(immersed(wing, "4x2", genome), guess * ratio)
    assert with_air / without == pytest.approx(ratio, rel=5e-3)


def test_energy_is_kept_in_still_air() -> None:
    """Of a wing falling onto its springs, the energy of the air included, to the integrator's error."""
    drift = []
    for h in (4e-4, 2e-4):
        body = immersed(robird_wing(), "11", UNDAMPED, k=3.0, step=h)
        start = at_rest(body.structure)
        here = body.here._replace(gravity=9.81)
        energy = march(body.structure, body.lanes, here, start, int(0.2 / h)).energy[..., 0]
        drift.append(np.ptp(energy.sum(axis=1)) / np.ptp(energy[:, 2]))
    assert drift[0] < 2e-5
    assert drift[1] < drift[0]


def tumbling(body: Immersed, wind: Array) -> State:
    """A wing that floats and turns as one, drifting with the wind on top of its own motion."""
    state, n = at_rest(body.structure), len(body.structure.bodies)
    spin, centre = np.array([2.0, 1.0, -0.5]), state.p[:n].mean(axis=0)[:, 0]
    own = np.array([0.5, -0.3, 1.0]) + np.cross(spin, state.p[:n, :, 0] - centre)
    state.V[:n, :3], state.V[:n, 3:] = spin[:, None], (own + wind)[:, :, None]
    return state


def test_a_wing_that_drifts_with_the_wind_feels_none_of_it() -> None:
    """Galilei: in a wind and moving with it on top, all markers are where they were, moved on by the wind."""
    still, wind = immersed(robird_wing(), "11", {}, k=2.0, step=5e-4), np.array([6.0, 0.5, -2.0])
    inner = still.structure.wiring.first < len(still.structure.bodies)
    still = still.of(inner)
    blown = still._replace(here=still.here._replace(wind=np.repeat(wind[:, None], LANES, axis=1)))
    calm, carried = (
        march(b.structure, b.lanes, b.here, tumbling(b, w), 100).tracks[..., 0]
        for b, w in ((still, np.zeros(3)), (blown, wind))
    )
    moved = wind * still.here.step * np.arange(100)[:, None, None]
    np.testing.assert_allclose(carried - moved, calm, atol=1e-7)
    bare = immersed(robird_wing(), "11", {}, k=0.0, step=5e-4).of(inner)
    alone = march(bare.structure, bare.lanes, bare.here, tumbling(bare, np.zeros(3)), 100).tracks[..., 0]
    assert np.abs(calm - alone).max() > 2e-4


def added_wrench(count: int, motion: Array, wind: float) -> Array:
    """What the air adds [N, 6] to the wrenches of a plank whose bodies all have the twist ``motion`` [6]."""
    wrenches = []
    for k in (0.0, 1.0):
        body = immersed(plank(), f"2x{count}", {}, k)
        w, n, rest = body.structure.wiring, len(body.structure.bodies), at_rest(body.structure)
        here = body.here._replace(wind=np.repeat(np.array([[wind], [0.0], [0.0]]), LANES, axis=1))
        work = new_work(w, here, body.lanes)
        work.R[:], work.p[:] = rest.R, rest.p
        work.V[:n] = motion[:, None]
        forces(w, here, body.lanes, work)
        wrenches.append(work.wrench[:n, :, 0].copy())
    return np.asarray(wrenches[1] - wrenches[0])


@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize(("along", "across"), [(-5.0, -1.0), (4.0, -2.0)])
def test_steady_motion_is_free(count: int, along: float, across: float) -> None:
    """The moment of a steady stream is that of the lift at the quarter of the chord, which the strips place."""
    steady = added_wrench(count, np.array([0.0, 0.0, 0.0, along, 0.0, across]), 3.0)
    np.testing.assert_allclose(steady, 0.0, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_plate_that_pitches_in_a_stream_is_lifted(count: int) -> None:
    """Theodorsen (1935, NACA Report 496): noncirculatory lift rho pi c^2 / 4 U alpha' per span, at mid-chord."""
    stream, rate = 6.0, 3.0
    added = added_wrench(count, np.array([0.0, rate, 0.0, 0.0, 0.0, 0.0]), stream)
    lift = AIR * np.pi * CHORD**2 / 4 * LENGTH * stream * rate
    assert added[:, 5].sum() == pytest.approx(lift, rel=1e-9)
    np.testing.assert_allclose(added[:, 3:5], 0.0, atol=1e-12)


def test_air_scales_with_its_density() -> None:
    thin = replace(SEA, pressure=SEA.pressure / 100)
    dense, rare = (immersed(plank(), "2x2", {}, 1.0, c).lanes.masses for c in (SEA, thin))
    np.testing.assert_allclose(rare, dense / 100, rtol=1e-12)
    np.testing.assert_array_equal(immersed(plank(), "2x2", {}, 2.0).lanes.masses, 2 * dense)
