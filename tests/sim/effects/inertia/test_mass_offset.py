from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.bench import Array, beat_of, ledger, scene_of
from tests.sim.kernels.marching import CHORD, DENSITY, LENGTH, THICKNESS, plank
from wingfit.records import Genome
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.structure import build


@pytest.mark.parametrize("distance", [0.05, -0.05, 0.001])
@pytest.mark.parametrize("division", ["4", "24"])
def test_every_body_moves_with_the_energy_of_its_own_mass_further_aft(distance: float, division: str) -> None:
    """m (v + omega x e)^2 / 2 + omega I omega / 2, and not the least energy more: nothing can have a negative one."""
    structure = build(robird_wing(), Division.parse(division))
    group = scene_of("mass_offset", structure, distance=distance).frozen()
    assert group.weighing == len(group.pairs) == len(structure.bodies)
    rng = np.random.default_rng(2)
    for (first, second, _), block in zip(group.pairs, group.masses[..., 0].reshape(-1, 6, 6), strict=True):
        body = structure.bodies[first]
        whole = block + np.block([[body.inertia, np.zeros((3, 3))], [np.zeros((3, 3)), body.mass * np.eye(3)]])
        assert first == second
        assert np.all(np.linalg.eigvalsh(whole) > 0)
        twist = rng.normal(size=6)
        omega, v = twist[:3], twist[3:] + np.cross(twist[:3], [distance, 0.0, 0.0])
        assert twist @ whole @ twist == pytest.approx(body.mass * v @ v + omega @ body.inertia @ omega, rel=1e-9)


def load_at_rest(distance: float) -> Array:
    """Mean wrench [6] of a stiff plank, held still in vacuum, on its rods."""
    wing = plank()
    model = FlexibleWing(wing, "4x2", 1e3, Numerics(steps=64, periodic=1e-6, max_beats=60), ("mass_offset",))
    stiff = {"E_f": 2e9, "G_f": 1e9, "D_E": 2e7, "D_G": 1e7, "mass_offset.distance": distance}
    beat = model.beat(Genome.nominal(model.genes).replace(stiff).values, blank_recording(wing, vacuum(1e-3, 0.0, 3.0)))
    assert beat.reason is None
    return np.asarray(beat.rods.mean(axis=0).sum(axis=0))


@pytest.mark.parametrize("distance", [0.01, -0.01])
def test_the_same_weight_pulls_further_aft(distance: float) -> None:
    """The moment about the span grows by m g e, nose up of the wing on the rods being negative; the force stays."""
    weight = DENSITY * CHORD * THICKNESS * LENGTH * 9.80665
    more = load_at_rest(distance) - load_at_rest(0.0)
    np.testing.assert_allclose(more, [0.0, weight * distance, 0.0, 0.0, 0.0, 0.0], atol=2e-3 * weight * abs(distance))


def test_both_signs_move_the_wing_to_opposite_sides() -> None:
    plain = beat_of("").tracks
    aft, fore = (beat_of("mass_offset", distance=d).tracks - plain for d in (2e-3, -2e-3))
    assert np.abs(aft + fore).max() < 0.1 * np.abs(aft).max()


@pytest.mark.parametrize("end", [1.0, -1.0])
def test_ledger_of_the_whole_wing_closes_at_both_ends(end: float) -> None:
    gene = EFFECTS["mass_offset"].genes(robird_wing())[0]
    distance = gene.upper if end > 0 else gene.lower
    assert ledger(beat_of("mass_offset", division="11", steps=200, distance=distance), 3.0) < 5e-4
