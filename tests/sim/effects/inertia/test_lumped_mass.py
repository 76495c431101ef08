from __future__ import annotations

import numpy as np
import pytest

from tests.sim.effects.bench import beat_of, ledger, scene_of
from tests.sim.kernels.marching import plank
from wingfit.records import Genome
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.genes import lanes, wing_genes
from wingfit.sim.wing.planform import Planform
from wingfit.sim.wing.structure import build

MASS = 0.004


@pytest.mark.parametrize("division", ["4", "11", "24"])
@pytest.mark.parametrize(("station", "chord"), [(0.8, 0.8), (0.0, 0.0), (1.0, 1.0), (0.5, 0.34)])
def test_moves_with_the_energy_of_a_point(division: str, station: float, chord: float) -> None:
    """m v^2 / 2 of the point at that place of the wing, however its body turns and moves."""
    structure = build(robird_wing(), Division.parse(division))
    group = scene_of("lumped_mass", structure, mass=MASS, station=station, chord=chord).frozen()
    (pair,) = group.pairs
    body, block = structure.bodies[pair[0]], group.masses[0, :, 0].reshape(6, 6)
    assert group.weighing == 1
    y = structure.wing.stations[0].y + station * (structure.wing.stations[-1].y - structure.wing.stations[0].y)
    place = np.array([Planform(structure.wing).x(chord, y), y, 0.0])
    rng = np.random.default_rng(1)
    for _ in range(5):
        twist = rng.normal(size=6)
        v = twist[3:] + np.cross(twist[:3], place - body.centre)
        assert twist @ block @ twist == pytest.approx(MASS * v @ v, rel=1e-9)
    panel = structure.panels[pair[0]]
    assert panel.y0 - 1e-9 <= y <= panel.y1 + 1e-9
    assert panel.s0 - 1e-9 <= chord <= panel.s1 + 1e-9


def test_every_individual_has_its_own_place() -> None:
    structure = build(robird_wing(), Division.parse("11"))
    genes = wing_genes(structure.wing.estimates)
    scene = WingScene.of(
        structure, vacuum(10.0, 0.0, 3.0), lanes(structure, genes, np.array([Genome.nominal(genes).values]))
    )
    mass, station = np.linspace(1e-3, 8e-3, LANES), np.linspace(0.05, 0.95, LANES)
    wing = EFFECTS["lumped_mass"].wing
    assert wing is not None
    wing(scene, {"mass": mass, "station": station, "chord": np.full(LANES, 0.5)})
    found = scene.frozen().masses.reshape(-1, 6, 6, LANES)
    assert len(found) == 4
    np.testing.assert_allclose(found[:, 3, 3].sum(axis=0), mass, rtol=1e-12)
    assert np.all(np.count_nonzero(found[:, 3, 3], axis=0) == 1)


def load_at_rest(*, mass: float, station: float = 0.6, chord: float = 0.9) -> np.ndarray:
    """Mean wrench [6] of a stiff plank, held still in vacuum, on its rods."""
    wing = plank()
    model = FlexibleWing(wing, "8x2", 1e3, Numerics(steps=64, periodic=1e-6, max_beats=60), ("lumped_mass",))
    genes = Genome.nominal(model.genes).replace(
        {
            "E_f": 2e9, "G_f": 1e9, "D_E": 2e7, "D_G": 1e7,
            "lumped_mass.mass": mass, "lumped_mass.station": station, "lumped_mass.chord": chord,
        }
    )  # fmt: skip
    beat = model.beat(genes.values, blank_recording(wing, vacuum(1e-3, 0.0, 3.0)))
    assert beat.reason is None
    return np.asarray(beat.rods.mean(axis=0).sum(axis=0))


def test_weighs_on_the_root_with_its_lever() -> None:
    """m g at its place: down, and the moment (y, -x) m g about the hinge."""
    more = load_at_rest(mass=MASS) - load_at_rest(mass=1e-9)
    weight = MASS * 9.80665
    np.testing.assert_allclose(more, weight * np.array([-0.3, 0.9 * 0.05, 0.0, 0.0, 0.0, -1.0]), atol=2e-3 * weight)


def test_a_tip_mass_lags_more_than_one_at_the_root() -> None:
    plain = beat_of("").tracks
    moved = [np.abs(beat_of("lumped_mass", station=s).tracks - plain).max() for s in (0.05, 0.95)]
    assert moved[1] > 20 * moved[0]


@pytest.mark.parametrize("station", [0.0, 1.0])
def test_ledger_of_the_whole_wing_closes(station: float) -> None:
    assert ledger(beat_of("lumped_mass", division="11", steps=200, station=station, chord=1.0), 3.0) < 5e-4
