from __future__ import annotations

import ctypes

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from tests.sim.effects.bench import AIR, beat_of, ledger, scene_of
from tests.sim.effects.pendulum import Swing, angle
from tests.sim.kernels.marching import LENGTH, plank
from tests.sim.kernels.test_step_matrix import assemble_and_differentiate
from tests.sim.wing.test_rigid import pendulum
from wingfit.records import Genome
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import DAMPERS, Lanes, Work, new_work
from wingfit.sim.kernels.integrate import forces
from wingfit.sim.kernels.laws import AFTER
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]

INNER = 0.25  # station of the middle of the inner half of the plank, which is the pendulum
CABLE = Swing("cable", {"k": 0.0, "c": 0.0, "station": INNER}, lever=1.0)
_LAW = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_int64), ctypes.c_int64)


@pytest.mark.parametrize("k", [0.0, 0.05, 1.0])
@pytest.mark.parametrize("amplitude", [1e-3, 1.5])
def test_shifts_the_frequency_of_a_rigid_body(k: float, amplitude: float) -> None:
    CABLE.swings_as_in_print(k, amplitude)


def test_a_spring_conserves_energy() -> None:
    CABLE.conserves_energy(1.0)


def test_a_damper_dissipates_the_power_of_the_rotation() -> None:
    """P = c |omega|^2 at every instant, and the swing loses energy to it alone."""
    trace, t, _ = CABLE.march(1.0, 1600, k=0.1, c=3e-4)
    power = trace.power[:, DAMPERS, 0]
    np.testing.assert_allclose(power, -3e-4 * (trace.V[:, 0, :3, 0] ** 2).sum(axis=1), rtol=1e-9)
    total = trace.energy[:, :, 0].sum(axis=1)
    np.testing.assert_allclose(total - total[0], cumulative_trapezoid(power, t, initial=0.0), atol=1e-3 * total[0])
    assert total[-1] < 0.7 * total[0]


def test_small_swings_decay_like_those_of_a_damped_oscillator() -> None:
    """theta = theta_0 exp(-d t) (cos w t + d / w sin w t), d = c / (2 I), w^2 = (K_0 + k) / I - d^2."""
    c = 5e-4
    trace, t, pace = CABLE.march(1e-3, 1600, k=0.1, c=c)
    d = c / (2 * pendulum()[3])
    w = np.sqrt(pace**2 - d**2)
    expected = 1e-3 * np.exp(-d * t) * (np.cos(w * t) + d / w * np.sin(w * t))
    assert expected.min() > -0.9e-3
    np.testing.assert_allclose(angle(trace), expected, atol=1e-6)


def deflection(k: float, station: float) -> float:
    """Height of the tip of a plank that is clamped at its root and hangs under its weight, m."""
    wing = plank()
    model = FlexibleWing(wing, "20x1", 1e3, Numerics(steps=64, periodic=1e-7, max_beats=80), ("cable",))
    own = {"D_E": 6e5, "D_G": 2.5e5, "cable.k": k, "cable.c": 1e-3, "cable.station": station}
    genome = Genome.nominal(model.genes).replace(own)
    beat = model.beat(genome.values, blank_recording(wing, vacuum(1e-3, 0.0, 3.0)))
    assert beat.reason is None
    return float(beat.tracks[:, 0, 2].mean())


@pytest.mark.parametrize("k", [0.05, 1.0])
@pytest.mark.parametrize("station", [0.4, 0.5, 0.975])
def test_holds_up_a_beam(k: float, station: float) -> None:
    """w = q L^4 / (8 E I) - M a (L - a / 2) / (E I), M = k theta_0 / (1 + k a / (E I)) at a = station L.

    theta_0 = q a (3 L^2 - 3 L a + a^2) / (6 E I) is the rotation there of the same beam without a cable. The stations
    are the border of two strips, where each has half of the cable, and the middle of the last.
    """
    free = deflection(0.0, station)
    load = plank().materials.foam_density * 0.05 * 0.02 * 9.80665
    rigidity = -load * LENGTH**4 / 8 / free
    a = station * LENGTH
    rotation = load * a * (3 * LENGTH**2 - 3 * LENGTH * a + a**2) / (6 * rigidity)
    moment = k * rotation / (1 + k * a / rigidity)
    lifted = moment * a * (LENGTH - a / 2) / rigidity
    assert lifted > -0.02 * free
    assert deflection(k, station) - free == pytest.approx(lifted, rel=0.02)


def turned_bodies(turn: Array, station: float) -> tuple[Structure, Lanes, Work]:
    """The Robird's wing with a cable of 3 N m/rad, all of whose bodies are rotated by the vector ``turn``, at rest."""
    structure = build(robird_wing(), Division.parse("4"))
    scene = scene_of("cable", structure, vacuum(0.0, 0.0, 3.0), k=3.0, station=station)
    lanes, rest = scene.frozen(), at_rest(structure)
    lanes.stiffness[:] = 0.0
    work = new_work(structure.wiring, scene.setting(100), lanes)
    work.R[:], work.p[:], work.V[:] = rest.R, rest.p, 0.0
    work.R[:4] = Rotation.from_rotvec(turn).as_matrix().reshape(9, 1)
    forces(structure.wiring, scene.setting(100)._replace(gravity=0.0), lanes, work)
    return structure, lanes, work


@pytest.mark.parametrize("turn", [[0.2, 0.0, 0.0], [0.0, -1.2, 0.0], [0.0, 0.0, 2.0], [0.7, -0.4, 0.9]])
def test_turns_the_wing_back_by_a_moment_alone(turn: list[float]) -> None:
    """-k sin(angle) about the axis of the rotation, shared by the strips beside the station; k (1 - cos) is stored."""
    vector = np.array(turn)
    size = float(np.linalg.norm(vector))
    _, _, work = turned_bodies(vector, 0.475)  # at 1.4 middles of strips
    moment = -3.0 * np.sin(size) * vector / size  # the axis has the same components in the axes of the body
    expected = np.zeros((6, 6))
    expected[1, :3], expected[2, :3] = 0.6 * moment, 0.4 * moment
    np.testing.assert_allclose(work.wrench[:, :, 0], expected, atol=1e-12)
    assert work.stored[0] == pytest.approx(3.0 * (1 - np.cos(size)))
    assert work.wrench[1, :3, 0] @ vector < 0.0


def test_stiffness_is_the_derivative_at_any_rotation() -> None:
    """Minus the derivative of the moment by a further rotation in the world, all nine of it, at every angle."""
    rng = np.random.default_rng(3)
    structure = build(robird_wing(), Division.parse("4"))
    lanes = scene_of("cable", structure, k=0.7, c=0.03, station=0.375).frozen()
    work = new_work(structure.wiring, scene_of("cable", structure).setting(64), lanes)
    frame = work.point_frames[0].ctypes.data_as(ctypes.POINTER(ctypes.c_int64))

    def moment(turn: Rotation, omega: Array) -> Array:
        work.turn[0], work.point_twist[0, :3] = turn.as_matrix().reshape(9, 1), omega[:, None]
        for array in (work.point_wrench, work.point_k, work.point_d):
            array[:] = 0.0
        _LAW(int(lanes.laws.point[0, 0]))(frame, AFTER)
        assert not work.point_wrench[0, 3:].any()
        return np.array(work.point_wrench[0, :3, 0])

    for size in (0.0, 0.5, 1.5, 3.0):
        axis, omega = rng.normal(size=3), rng.normal(size=3)
        turn = Rotation.from_rotvec(size * axis / np.linalg.norm(axis))
        found = np.zeros((2, 6, 6))
        for k, unit in enumerate(1e-6 * np.eye(3)):
            sides = [moment(Rotation.from_rotvec(s * unit) * turn, omega) for s in (1, -1)]
            found[0, :3, k] = (sides[1] - sides[0]) / 2e-6
            sides = [moment(turn, omega + s * unit) for s in (1, -1)]
            found[1, :3, k] = (sides[1] - sides[0]) / 2e-6
        moment(turn, omega)
        np.testing.assert_allclose(work.point_k[0, :, 0].reshape(6, 6), found[0], atol=1e-9)
        np.testing.assert_allclose(work.point_d[0, :, 0].reshape(6, 6), found[1], atol=1e-9)
        if size > 0.0:
            assert np.abs(found[0] - found[0].T).max() > 0.05, "it is not symmetric"


def test_however_stiff_it_holds_the_wing_still() -> None:
    CABLE.holds_still_however_stiff()


def test_its_part_of_the_step_is_the_exact_derivative() -> None:
    """Against central differences, on a bent wing in full motion."""
    assemble_and_differentiate(lambda scene, _: CABLE.attach(scene, k=20.0, c=0.05, station=0.55))


def test_every_individual_has_its_own_place() -> None:
    """Spring and damper of each are shared by at most two strips, whose middles have their mean at its station."""
    structure = build(robird_wing(), Division.parse("4"))
    scene = scene_of("cable", structure)
    wing = EFFECTS["cable"].wing
    assert wing is not None
    fresh = WingScene.of(structure, scene.condition, scene.lanes)
    k, station = np.linspace(1.0, 8.0, LANES), np.linspace(0.0, 1.0, LANES)
    wing(fresh, {"k": k, "c": 0.1 * k, "station": station})
    laws = fresh.frozen().laws
    found = np.zeros((2, 4, LANES))
    for _, _, count, first, start in laws.point:
        for n in range(count):
            found[:, laws.bodies[start + n]] += laws.parameters[[first + n, first + count + n]]
    np.testing.assert_allclose(found.sum(axis=1), [k, 0.1 * k])
    np.testing.assert_allclose((np.arange(4) + 0.5) / 4 @ found[0] / k, np.clip(station, 0.125, 0.875))
    np.testing.assert_allclose(found[1], 0.1 * found[0])
    assert np.all(np.count_nonzero(found[0], axis=0) <= 2)


def test_tracks_are_smooth_in_its_place() -> None:
    """Across the border between two strips, and across the middle of one."""
    for station in (0.5, 0.375):
        beats = [beat_of("cable", steps=96, k=0.5, station=station + d).tracks for d in (-1e-3, -1e-5, 1e-5, 1e-3)]
        near, far = np.abs(beats[2] - beats[1]).max(), np.abs(beats[3] - beats[0]).max()
        assert 0.0 < near < 0.1 * far, f"a jump at {station:g}"


def test_a_wing_that_is_held_bends_less() -> None:
    """The tip goes less far, and less far the stiffer the cable is."""
    heights = [np.ptp(beat_of("cable", AIR, k=k, station=0.5).tracks[:, :, 2], axis=0).max() for k in (0.0, 0.5, 2.0)]
    assert heights[0] > heights[1] > heights[2]


@pytest.mark.parametrize("station", [0.0, 0.55, 1.0])
def test_ledger_of_the_whole_wing_closes(station: float) -> None:
    assert ledger(beat_of("cable", division="11", steps=200, station=station), 3.0) < 5e-4
