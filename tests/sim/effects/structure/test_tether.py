from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.effects.bench import beat_of, ledger, scene_of
from tests.sim.effects.pendulum import Swing
from tests.sim.kernels.marching import CHORD, LENGTH, plank
from tests.sim.kernels.test_step_matrix import assemble_and_differentiate
from wingfit.records import Genome
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import DAMPERS, new_work
from wingfit.sim.kernels.integrate import forces
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.structure import build

Array = npt.NDArray[np.float64]

STATION = 0.4  # of the span: on the half of the plank that swings
LEVER = STATION * LENGTH
TETHER = Swing("tether", {"k": 0.0, "c": 0.0, "station": STATION, "chord": 0.5}, LEVER)


@pytest.mark.parametrize("k", [0.0, 1.0, 10.0])
@pytest.mark.parametrize("amplitude", [1e-3, 1.5])
def test_shifts_the_frequency_of_a_rigid_body(k: float, amplitude: float) -> None:
    TETHER.swings_as_in_print(k, amplitude)


def test_a_spring_conserves_energy() -> None:
    TETHER.conserves_energy(10.0)


def test_a_damper_takes_the_power_of_its_speed() -> None:
    """P = c v^2 at every instant, and nothing else leaves: the swing loses energy to it alone."""
    trace, t, _ = TETHER.march(1.0, 1600, k=5.0, c=0.02)
    arm = np.array([0.5 * CHORD, LEVER, 0.0]) - build(plank(), Division.parse("2x1")).bodies[0].centre
    velocity = trace.V[:, 0, 3:, 0] + np.cross(trace.V[:, 0, :3, 0], arm)
    power = trace.power[:, DAMPERS, 0]
    np.testing.assert_allclose(power, -0.02 * (velocity**2).sum(axis=1), rtol=1e-9)
    total = trace.energy[:, :, 0].sum(axis=1)
    lost = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
    np.testing.assert_allclose(total - total[0], lost, atol=1e-3 * total[0])
    assert total[-1] < 0.7 * total[0]


def deflection(k: float) -> float:
    """Height of the tip of a plank that is clamped at its root and hangs under its weight, m."""
    wing = plank()
    model = FlexibleWing(wing, "20x1", 1e3, Numerics(steps=64, periodic=1e-7, max_beats=80), ("tether",))
    own = {"D_E": 6e5, "D_G": 2.5e5, "tether.k": k, "tether.c": 0.01, "tether.station": 1.0, "tether.chord": 0.5}
    genome = Genome.nominal(model.genes).replace(own)
    beat = model.beat(genome.values, blank_recording(wing, vacuum(1e-3, 0.0, 3.0)))
    assert beat.reason is None
    return float(beat.tracks[:, 0, 2].mean())


@pytest.mark.parametrize("k", [2.0, 20.0])
def test_holds_up_the_tip_of_a_beam(k: float) -> None:
    """w = w_0 / (1 + k L^3 / (3 E I)), with w_0 = q L^4 / (8 E I) of the same beam without a spring."""
    free = deflection(0.0)
    load = plank().materials.foam_density * 0.05 * 0.02 * 9.80665
    compliance = -free * 8 / (3 * load * LENGTH)
    assert free < -0.01
    assert deflection(k) == pytest.approx(free / (1 + k * compliance), rel=0.01)


def test_pulls_back_to_where_the_wing_rests() -> None:
    """1 cm above its place at rest and still, the point is pulled down by k times 1 cm, with its lever on its body."""
    structure = build(robird_wing(), Division.parse("11"))
    scene = scene_of("tether", structure, vacuum(0.0, 0.0, 3.0), k=3.0, station=0.7, chord=0.8)
    lanes, rest = scene.frozen(), at_rest(structure)
    (body,), work = lanes.laws.bodies, new_work(structure.wiring, scene.setting(100), lanes)
    found = []
    for height in (0.0, 0.01):
        work.R[:], work.p[:], work.V[:] = rest.R, rest.p, rest.V
        work.p[:, 2] += height
        forces(structure.wiring, scene.setting(100), lanes, work)
        found.append(work.wrench[:, :, 0].copy())
    more, arm = found[1] - found[0], lanes.laws.arms[0, :, 0]
    np.testing.assert_allclose(more[body], -0.03 * np.array([arm[1], -arm[0], 0.0, 0.0, 0.0, 1.0]), atol=1e-12)
    others = np.delete(more[: len(structure.bodies)], body, axis=0)
    np.testing.assert_allclose(others, 0.0, atol=1e-12)
    assert work.stored[0] == pytest.approx(0.5 * 3.0 * 1e-4)


def test_however_stiff_it_holds_the_wing_still() -> None:
    TETHER.holds_still_however_stiff()


def test_its_part_of_the_step_is_the_exact_derivative() -> None:
    """Against central differences, on a bent wing in full motion."""
    assemble_and_differentiate(lambda scene, _: TETHER.attach(scene, k=2e3, c=5.0, station=0.8, chord=0.9))


def test_every_individual_has_its_own_place() -> None:
    structure = build(robird_wing(), Division.parse("11"))
    scene = scene_of("tether", structure)
    wing = EFFECTS["tether"].wing
    assert wing is not None
    fresh = WingScene.of(structure, scene.condition, scene.lanes)
    k, station = np.linspace(1.0, 8.0, LANES), np.linspace(0.05, 0.95, LANES)
    wing(fresh, {"k": k, "c": 0.0 * k, "station": station, "chord": np.full(LANES, 0.5)})
    laws = fresh.frozen().laws
    springs = laws.parameters.reshape(5, len(laws.bodies), LANES)[0]
    assert len(laws.bodies) == 4
    np.testing.assert_array_equal(springs.sum(axis=0), k)
    assert np.all(np.count_nonzero(springs, axis=0) == 1)


@pytest.mark.parametrize("station", [0.0, 1.0])
def test_ledger_of_the_whole_wing_closes(station: float) -> None:
    assert ledger(beat_of("tether", division="11", steps=200, station=station, chord=1.0), 3.0) < 5e-4
