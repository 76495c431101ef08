"""What effects declare of their power, against what their laws do."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.effects.bench import VACUUM, Bench, beat_of, described, ledger, scene_of
from tests.sim.effects.moved import Motion, Moved
from tests.sim.kernels.test_step_matrix import bent as bent_wing
from tests.sim.kernels.test_step_matrix import rates
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.integrate import forces, point_forces
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import build

PROMISES = [name for name, effect in EFFECTS.items() if effect.wing is not None and effect.power != "any"]


def laws_of(name: str) -> tuple[int, int, int]:
    """How many laws of connectors, of the air and of points it has."""
    laws = scene_of(name, build(robird_wing(), Division.parse("4"))).frozen().laws
    return len(laws.connector), len(laws.strip), len(laws.point)


OF_CONNECTORS = [name for name in PROMISES if laws_of(name)[0]]
OF_AIR = [name for name in PROMISES if laws_of(name)[1]]
OF_POINTS = [name for name in PROMISES if laws_of(name)[2]]
DISSIPATIVE = [name for name in PROMISES if EFFECTS[name].power == "dissipative"]


@pytest.mark.parametrize("name", PROMISES)
def test_the_ledger_of_a_whole_beat_closes(name: str) -> None:
    """In vacuum: what the motors give is what the dampers and the effect take, and nothing else comes or goes."""
    beat = beat_of(name, steps=200)
    assert ledger(beat, VACUUM.flap_frequency) < 1e-3
    assert np.all(beat.power[:, 0] <= 0)


@pytest.mark.parametrize("name", OF_CONNECTORS)
def test_a_law_of_the_connectors_keeps_its_promise(name: str) -> None:
    """Bent to and fro by hand: what goes in is kept or lost; lost is nothing, or at every instant something."""
    bench = Bench.of(name)
    if not np.any([abs(m) > 0 for m in bent(bench, np.array([0.0, 0.1]))[0]]):  # only the root has it
        bench = Bench.of(name, at=int(np.flatnonzero(~Joints.of(bench.scene.structure).within)[0]))
    t = np.linspace(0, 1, 801)
    moment, kept, lost, given = bent(bench, 0.06 * np.sin(20 * t) + 0.04 * np.sin(53 * t))
    assert np.abs(moment).max() > 0
    np.testing.assert_allclose(kept - kept[0] + lost, given, atol=2e-3 * np.abs(given).max())
    if EFFECTS[name].power == "conservative":
        assert not lost.any()
    else:
        assert np.all(np.diff(lost) >= 0)
        assert lost[-1] > 0.1 * given[-1] > 0


def bent(bench: Bench, angle: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], ...]:
    """Swung about x in steps of 1/800 s."""
    return bench.swing(0, angle, 1 / 800)


@pytest.mark.parametrize("name", OF_AIR)
def test_a_law_of_still_air_keeps_its_promise(name: str) -> None:
    """Alone, at any motion, it takes energy from a wing in still air."""
    rng = np.random.default_rng(4)
    moved = Moved(name, described(name, robird_wing(), {}))
    moved.lanes.coefficients[:] = 0.0
    assert EFFECTS[name].power == "dissipative", "no law of the air only keeps energy"
    for _ in range(20):
        rates = rng.normal(size=(3, LANES)) * [[20.0], [5.0], [3.0]]
        moved.rate(Motion(0.0, rates[1], rng.uniform(-1.5, 1.5, LANES), rates[0], 0.0, rates[2]), moved.z)
        forces(moved.structure.wiring, moved.here, moved.lanes, moved.work)
        assert np.all(moved.work.air_power < 0.0)


@pytest.mark.parametrize("name", OF_POINTS)
def test_a_law_of_points_keeps_its_promise(name: str) -> None:
    """On a bent wing in full motion the power of its wrenches is what it loses and what it stores per time."""
    wing, act = robird_wing(), EFFECTS[name].wing
    assert act is not None
    values = {key: np.full(LANES, value) for key, value in described(name, wing, {}).items()}
    case = bent_wing("3,2", lambda scene, _: act(scene, values))
    (_, _, lanes, work, state), nothing, stored = case, np.zeros_like(case.state.V), []
    for part in (-1e-6, 1e-6, 0.0):
        rates(case, part * state.V, nothing, 0.0 * state.z)
        for array in (work.wrench, work.lost, work.stored):
            array[:] = 0.0
        point_forces(lanes, work)
        stored.append(work.stored.copy())
    given = -(work.wrench * work.V).sum(axis=(0, 1))
    np.testing.assert_allclose(given, work.lost + (stored[1] - stored[0]) / 2e-6, rtol=1e-6)
    assert np.all(work.lost > 0.0) if EFFECTS[name].power == "dissipative" else not work.lost.any()


def test_what_takes_energy_does_so_by_a_law_of_its_own() -> None:
    assert set(DISSIPATIVE) <= {*OF_CONNECTORS, *OF_AIR, *OF_POINTS}
