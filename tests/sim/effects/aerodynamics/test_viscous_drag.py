"""Skin friction against Blasius's plate, in air of any density."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.oracles.plates import loaded
from tests.sim.effects.moved import Motion, Moved
from tests.sim.kernels.marching import CHORD, LENGTH, plank
from wingfit.records import Condition
from wingfit.sim.effects.library.aerodynamics.viscous_drag import EFFECT, viscosity
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import new_work
from wingfit.sim.kernels.integrate import forces
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import build

Array = npt.NDArray[np.float64]

AREA = CHORD * LENGTH


def friction(airspeed: float, pressure: float = 101325.0, lost: float = 0.0) -> tuple[Array, float]:
    """Force [3] on a plank at rest in a stream, all other air forces gone, and the density with ``lost`` taken off."""
    structure = build(plank(), Division.parse("2x1"))
    condition = Condition(3.0, 0.0, pressure, 293.15, airspeed)
    scene = WingScene.of(structure, condition, loaded(structure, {}))
    scene.lanes.coefficients[:] = 0.0
    scene.density -= lost * scene.density
    assert EFFECT.wing
    EFFECT.wing(scene, {"part": np.ones(LANES)})
    lanes, here = scene.frozen(), scene.setting(100)
    work, rest = new_work(structure.wiring, here, lanes), at_rest(structure)
    work.R[:], work.p[:] = rest.R, rest.p
    forces(structure.wiring, here, lanes, work)
    return work.air_force[:, 0].copy(), float(scene.density[0])


@pytest.mark.parametrize("airspeed", [1.0, 8.0])
def test_both_faces_have_blasius_friction(airspeed: float) -> None:
    """D = 2 x 1.328 / sqrt(Re) 1/2 rho U^2 A, downstream; air at 20 C has 1.81e-5 Pa s."""
    force, density = friction(airspeed)
    reynolds = density * airspeed * CHORD / 1.81e-5
    expected = 2 * 1.328 / np.sqrt(reynolds) * 0.5 * density * airspeed**2 * AREA
    np.testing.assert_allclose(force, [expected, 0.0, 0.0], rtol=2e-3, atol=1e-12)


def test_it_falls_with_the_root_of_the_density_and_is_nothing_without_air() -> None:
    (dense, _), (thin, _), (none, _) = friction(6.0), friction(6.0, 1013.25), friction(6.0, lost=1.0)
    assert dense[0] / thin[0] == pytest.approx(10.0)
    assert none.tolist() == [0.0, 0.0, 0.0]


def test_viscosity_of_air() -> None:
    """Tables of dry air: 1.716e-5 Pa s at 0 C, 2.29e-5 at 400 K."""
    assert viscosity(273.15) == pytest.approx(1.716e-5, rel=2e-3)
    assert viscosity(400.0) == pytest.approx(2.29e-5, rel=5e-3)


def test_it_only_takes_energy_in_still_air() -> None:
    """The force along the chord is against the motion along it; what moves square to it feels nothing."""
    rng = np.random.default_rng(3)
    moved = Moved("viscous_drag", {"part": 1.0})
    moved.lanes.coefficients[:] = 0.0
    for _ in range(5):
        pitch, rates = rng.uniform(-1.5, 1.5, LANES), rng.normal(size=(3, LANES))
        moved.rate(Motion(pitch=pitch, pitch_rate=rates[0], flap_rate=rates[1], heave_rate=5 * rates[2]), moved.z)
        forces(moved.structure.wiring, moved.here, moved.lanes, moved.work)
        assert np.all(moved.work.air_power < 0.0)
    moved.rate(Motion(heave_rate=5.0), moved.z)
    forces(moved.structure.wiring, moved.here, moved.lanes, moved.work)
    assert np.abs(moved.work.air_power).max() < 1e-15
