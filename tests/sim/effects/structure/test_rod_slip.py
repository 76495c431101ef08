from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.sim.effects.bench import Array, Bench, beat_of, excursion, ledger, scene_of
from wingfit.sim.effects.library.structure.rod_slip import of_rods
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.genes import wing_genes
from wingfit.sim.wing.structure import build

FRICTION, CLEARANCE, STICK = 0.05, 0.04, 0.3
SHAKE = 0.1  # e of the page


def bench_of(clearance: float = CLEARANCE) -> Bench:
    return Bench.of("rod_slip", friction=FRICTION, clearance=clearance, stick=STICK)


def part_of(bench: Bench) -> float:
    """Angle of the connector that is one radian over the span."""
    return float(Joints.of(bench.scene.structure).part[bench.at])


def spring_of(bench: Bench) -> float:
    return STICK * float(of_rods(bench.scene)[bench.at, 0])


def plateau(bench: Bench, friction: float, clearance: float) -> float:
    """Moment at which rods slip freely: h / h_max + e w / w_max = 1."""
    most = friction + clearance
    h = (1 - SHAKE * clearance / most) / (1 / friction + SHAKE / most)
    return spring_of(bench) * h * part_of(bench)


def there_and_back(bench: Bench, reach: float, steps: int = 800) -> Array:
    ends = np.array([0.0, reach, -reach, reach]) * part_of(bench)
    return np.concatenate([np.linspace(a, b, steps, endpoint=False) for a, b in pairwise(ends)])


def test_rods_slip_at_their_friction_to_both_sides() -> None:
    bench = bench_of()
    phi = there_and_back(bench, 0.6)
    moment, _, _, _ = bench.swing(0, phi, 1e-3)
    top = plateau(bench, FRICTION, CLEARANCE)
    assert moment.min() == pytest.approx(-top, rel=1e-3)
    assert moment.max() == pytest.approx(top, rel=1e-3)
    assert moment[799] < 0, "resists what is positive"


def test_dead_band_is_the_play() -> None:
    """Nothing is felt over twice the clearance when the wing bends back; e stretches that by a third of (e c)^2."""
    bench = bench_of()
    phi = there_and_back(bench, 0.6)[:1600]
    moment, _, _, _ = bench.swing(0, phi, 1e-3)
    dead = np.abs(np.diff(phi[800:])).mean() * np.count_nonzero(moment[800:] == 0.0)
    share = SHAKE * CLEARANCE / (CLEARANCE + FRICTION)
    stretched = np.log((1 + share) / (1 - share)) / (2 * share)
    assert dead == pytest.approx(2 * CLEARANCE * part_of(bench) * stretched, rel=0.02)
    assert stretched == pytest.approx(1, abs=0.01)


def test_within_the_play_nothing_is_felt() -> None:
    bench = bench_of()
    moment, kept, lost, _ = bench.swing(0, there_and_back(bench, 0.95 * CLEARANCE, 200), 1e-3)
    assert not moment.any()
    assert not kept.any()
    assert not lost.any()


def test_loop_without_play_is_dahls() -> None:
    """Pulled on, the moment nears its plateau as exp(-phi (1 + e) / h_max) (Dahl 1968, exponent one)."""
    bench = bench_of(clearance=0.0)
    most = FRICTION * part_of(bench)
    phi = np.linspace(0, 3 * most, 1001)
    moment, _, _, _ = bench.swing(0, phi, 1e-3)
    top = plateau(bench, FRICTION, 0.0)
    np.testing.assert_allclose(moment, -top * (1 - np.exp(-phi * (1 + SHAKE) / most)), atol=1e-5 * top)


def test_loses_the_area_of_its_loop() -> None:
    bench = bench_of()
    phi = there_and_back(bench, 0.3)
    moment, kept, lost, given = bench.swing(0, phi, 1e-3)
    np.testing.assert_allclose(kept + lost, given, atol=2e-3 * given[-1])
    assert np.all(np.diff(lost) >= 0)
    loop = slice(800, 2400)
    work = float(np.trapezoid(-moment[loop], phi[loop]))
    assert lost[2399] - lost[800] == pytest.approx(work - kept[2399] + kept[800], rel=5e-3)


@pytest.mark.parametrize(("state", "rate"), [(0.02, 0.3), (-0.021, -0.2), (0.02, -0.3), (0.005, 0.3)])
def test_tells_its_derivatives(state: float, rate: float) -> None:
    bench_of().derivatives(np.zeros(3), np.array([rate, 0.0, 0.0]), np.array([state]), [0])


def test_only_connectors_with_rods_slip_and_by_what_rods_add() -> None:
    """On a wing whose rods run all along a connector, E_r I_r over its length."""
    structure = build(robird_wing(), Division.parse("11"))
    found = of_rods(scene_of("rod_slip", structure))[:, 0]
    modulus = {gene.name: gene.nominal for gene in wing_genes(structure.wing.estimates)}["E_r"]
    for k, c in enumerate(structure.connectors):
        whole = c.rods[c.parts > 0]
        if np.ptp(whole[:, 0]) == 0:
            assert found[k] == pytest.approx(modulus * whole[0, 0], rel=1e-9, abs=1e-9)
        else:
            assert 0 < found[k] < modulus * whole[:, 0].max()
    assert np.count_nonzero(found) == sum(bool(c.rods.any()) for c in structure.connectors)


def test_rods_that_hold_stiffen_the_wing() -> None:
    plain, loose, tight = (excursion(b) for b in (beat_of(""), beat_of("rod_slip"), beat_of("rod_slip", friction=0.5)))
    assert tight < loose < plain


def test_ledger_of_the_whole_wing_closes() -> None:
    assert ledger(beat_of("rod_slip", steps=200), 3.0) < 1e-3
