from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.sim.effects.bench import Array, Bench, beat_of, excursion, ledger
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import YOUNG, build

CHANGES = [10.0, 1.0, -0.3, -0.5]


def at_curvature(bench: Bench, axis: int, curvature: float) -> tuple[float, float]:
    """Moment by k sin a cos a, where the bending's sine is ``curvature`` radians over the span, and the energy."""
    sine = curvature * float(Joints.of(bench.scene.structure).part[bench.at])
    bench.call(np.eye(3)[axis] * np.arcsin(sine), np.zeros(3), np.zeros(0))
    return float(-bench.moment[axis] / (bench.stiffness[axis] * sine * np.sqrt(1 - sine**2))), bench.energy


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("at", "axis"), [(1, 0), (12, 1)])
def test_changes_the_stiffness_by_its_size_at_a_radian_over_the_span(change: float, at: int, axis: int) -> None:
    bench = Bench.of("cubic_stiffness", "11", at, change=change)
    assert bench.scene.structure.connectors[at].modulus[axis] == YOUNG, "bends about this axis"
    assert at_curvature(bench, axis, 1.0)[0] == pytest.approx(change, rel=1e-9)
    assert at_curvature(bench, axis, -1.0)[0] == pytest.approx(change, rel=1e-9)
    assert at_curvature(bench, 1 - axis, 1.0) == (0.0, 0.0), "torsion stays as it was"


@pytest.mark.parametrize("change", [5.0, 1.0])
def test_hardening_is_cubic(change: float) -> None:
    """Duffing's spring: moment k a / b^2 phi^3, energy k a / b^2 phi^4 / 4."""
    bench = Bench.of("cubic_stiffness", change=change)
    part = float(Joints.of(bench.scene.structure).part[bench.at])
    for curvature in (0.1, 0.5, 2.0):
        more, energy = at_curvature(bench, 0, curvature)
        assert more == pytest.approx(change * curvature**2, rel=1e-9)
        closed = bench.stiffness[0] * change * part**2 * curvature**4 / 4
        assert energy == pytest.approx(closed, rel=1e-9)


def test_softening_begins_cubic_and_leaves_stiffness_however_far_it_bends() -> None:
    """The slope of moment over angle, k (1 + ...), never falls below an eighth of k."""
    bench = Bench.of("cubic_stiffness", change=-0.5)
    early = [at_curvature(bench, 0, c)[0] / c**2 for c in (0.02, 0.04)]
    assert early[0] == pytest.approx(early[1], rel=0.01)
    sines = np.linspace(0, 1, 2001)[:-1]
    slope = []
    for angle in np.arcsin(sines):
        bench.call(np.array([angle, 0.0, 0.0]), np.zeros(3), np.zeros(0))
        slope.append(1 + bench.work.more_k[bench.at, 0, 0] / bench.stiffness[0])
    assert min(slope) == pytest.approx(0.125, abs=1e-3)


@pytest.mark.parametrize("change", CHANGES)
def test_moment_is_minus_the_gradient_of_the_energy(change: float) -> None:
    """For turns about any axis: power into the spring is what it keeps."""
    rng = np.random.default_rng(3)
    for at in (1, 12):
        bench = Bench.of("cubic_stiffness", "11", at, change=change)
        for _ in range(10):
            turn, rate, h = rng.uniform(-0.7, 0.7, 3), rng.normal(size=3), 1e-6
            kept = [energy_at(bench, moved(turn, rate * by)) for by in (h, -h)]
            bench.call(turn, rate, np.zeros(0))
            assert -bench.moment @ rate == pytest.approx((kept[0] - kept[1]) / (2 * h), rel=1e-6)


def energy_at(bench: Bench, turn: Array) -> float:
    bench.call(turn, np.zeros(3), np.zeros(0))
    return bench.energy


def moved(turn: Array, by: Array) -> Array:
    """A rotation vector after a small turn about A's axes."""
    return np.asarray((Rotation.from_rotvec(by) * Rotation.from_rotvec(turn)).as_rotvec())


@pytest.mark.parametrize("change", CHANGES)
def test_tells_its_stiffness(change: float) -> None:
    bench, angle, h = Bench.of("cubic_stiffness", change=change), 0.1, 1e-6
    found = []
    for a in (angle + h, angle - h):
        bench.call(np.array([a, 0.0, 0.0]), np.zeros(3), np.zeros(0))
        found.append(-bench.moment[0])
    told = bench.work.more_k[bench.at, 0, 0]
    assert told == pytest.approx((found[0] - found[1]) / (2 * h), rel=0.02)  # by the sine, not the angle


def test_means_the_same_in_every_division() -> None:
    """Energy of the robird's foam and rods bent evenly by a radian over the span, per length and mean stiffness."""
    found = []
    for division in ("4", "16x1"):
        structure = build(robird_wing(), Division.parse(division))
        joints, kept = Joints.of(structure), []
        for at in np.flatnonzero(joints.within).tolist():
            bench = Bench.of("cubic_stiffness", division, at, change=1.0)
            rigidity = bench.stiffness[0] * joints.part[at]
            kept.append(at_curvature(bench, 0, 1.0)[1] / rigidity / joints.part[at])
        found.append(np.mean(kept))
    assert found[0] == pytest.approx(0.25, rel=1e-9)
    assert found[1] == pytest.approx(0.25, rel=1e-9)


def test_a_hardening_wing_swings_less() -> None:
    plain, hard, soft = (
        excursion(b) for b in (beat_of(""), *(beat_of("cubic_stiffness", change=c) for c in (5.0, -0.5)))
    )
    assert hard < plain < soft


@pytest.mark.parametrize("change", [5.0, -0.5])
def test_ledger_of_the_whole_wing_closes(change: float) -> None:
    assert ledger(beat_of("cubic_stiffness", steps=200, change=change), 3.0) < 2e-4
