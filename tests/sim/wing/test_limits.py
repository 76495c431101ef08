"""Closed-form limits of the multi-body model: cantilever, drive, the energy ledger and the order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import CubicSpline

from tests.oracles.plates import loaded
from tests.sim.kernels.marching import CHORD, DENSITY, LENGTH, ORDER, THICKNESS, driven, march, plank, vacuum_here
from wingfit.records import Condition, FourBarDrive, Genome
from wingfit.sim.kernels.arrays import Setting
from wingfit.sim.solver.scene import at_rest, setting
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.genes import wing_genes
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]

LIGHT = {"D_E": 1.0, "D_G": 1.0}
YOUNG = 2.0e7


def run(
    structure: Structure, genome: dict[str, float], here: Setting, steps: int, table: Array | None = None
) -> tuple[Array, Array, Array]:
    """From rest: tracks [n, M, 3], energies [n, 3] and power through the ports [n, 4] of lane 0."""
    trace = march(structure, loaded(structure, genome), here, at_rest(structure), steps, table)
    return trace.tracks[..., 0], trace.energy[..., 0], trace.power[..., 0]


@pytest.mark.parametrize("strips", [4, 8, 16])
def test_cantilever_approaches_euler_bernoulli(strips: int) -> None:
    """Static tip deflection under gravity and first frequency of the clamped plank, error falling with the division."""
    structure = build(plank(), Division.parse(f"{strips}x1"))
    mass = DENSITY * CHORD * THICKNESS
    rigidity = YOUNG * CHORD * THICKNESS**3 / 12
    shear = {"E_f": YOUNG, "G_f": YOUNG, "D_E": 0.0, "D_G": 0.0}
    first = 1.875104**2 * np.sqrt(rigidity / (mass * LENGTH**4)) / (2 * np.pi)
    h = 1 / (first * 150)
    tracks, _, _ = run(structure, shear, vacuum_here(h, 0.1), 600)
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
    from wingfit.sim.wing.drive import four_bar_angle

    linkage = robird_wing().drive
    assert isinstance(linkage, FourBarDrive)
    psi = np.linspace(0, 2 * np.pi, 50)
    angle = four_bar_angle(linkage, psi) - linkage.offset
    pin = linkage.crank * np.stack([np.cos(psi), np.sin(psi)])
    tip = np.array([[linkage.ground], [0.0]]) + linkage.rocker * np.stack([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(np.linalg.norm(tip - pin, axis=0), linkage.coupler, rtol=1e-12)


@pytest.mark.parametrize(
    ("condition", "genome", "order"),
    [(vacuum(10.0, 0.05, 3.0), {}, 2.5), (tunnel(0.05, 3.0, 6.0), {}, 2.5), (vacuum(1.0, 0.05, 3.0), LIGHT, 2.0)],
    ids=["vacuum", "tunnel", "light damping"],
)
def test_energy_ledger_closes(condition: Condition, genome: dict[str, float], order: float) -> None:
    """Over two beats from rest: change of stored energy = work of motors + air - losses, to the integrator's error.

    Without damping modes ring that no step resolves; what the integrator takes from them is in no port, and is of
    second order.
    """
    condition = replace(condition, gravity=0.0)
    structure = build(robird_wing(), Division.parse("11"))
    closing = []
    for steps in (200, 800):
        here = setting(condition, steps)
        table = driven(structure, condition, steps, 2)
        _, energy, power = run(structure, genome, here, 2 * steps, table)
        stored, times = energy.sum(axis=1), here.step * np.arange(2 * steps)
        work = CubicSpline(times, power).antiderivative()(times)
        closing.append(np.abs(stored - stored[0] - work.sum(axis=1)).max() / np.abs(work[-1]).max())
        assert np.all(power[:, 0] <= 0), "dampers may only take energy"
    assert closing[0] < 5e-4
    assert closing[1] < 2e-5
    assert np.log(closing[0] / closing[1]) / np.log(4) > order


def test_without_damping_and_drive_energy_is_conserved() -> None:
    structure = build(robird_wing(), Division.parse("11"))
    drift = []
    for h in (4e-4, 2e-4):
        _, energy, _ = run(structure, {"D_E": 0.0, "D_G": 0.0}, vacuum_here(h, 9.81), int(0.2 / h))
        total = energy.sum(axis=1)
        drift.append(np.abs(total - total[0]).max() / np.ptp(energy[:, 2]))
    # the sudden weight rings modes too fast for either step, whose energy the method takes
    assert drift[0] < 5e-6
    assert drift[1] < drift[0]


def test_the_integrator_is_of_its_order() -> None:
    """Halving the step divides the error by two to the power of the order, of driven wings too.

    Two beats from rest in vacuum, where no force law has a kink, without gravity, whose sudden onset would ring stiff
    modes, and nearly without damping: strong dampers on stiff modes reduce the order to two, at micrometres.
    """
    structure = build(robird_wing(), Division.parse("4"))
    condition = replace(vacuum(0.01, 0.05, 3.0), gravity=0.0)
    tracks = {}
    for steps in (200, 400, 800):
        table = driven(structure, condition, steps, 2)
        whole, _, _ = run(structure, LIGHT, setting(condition, steps), 2 * steps, table)
        tracks[steps] = whole[:: steps // 200]
    errors = [np.abs(tracks[a] - tracks[b]).max() for a, b in ((200, 400), (400, 800))]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(ORDER, abs=0.3)


def test_genome_default_is_nominal() -> None:
    genes = wing_genes({})
    assert Genome.nominal(genes).values == tuple(g.nominal for g in genes)
