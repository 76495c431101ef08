from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from tests.sim.effects.bench import Array, beat_of, excursion, ledger, scene_of
from tests.sim.kernels.marching import LENGTH, plank
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import CHORDWISE_MODULUS, Structure, build


def kept(structure: Structure, **values: float) -> Array:
    """Part [C] of each connector's stiffness that is left; of all axes, and of its damping, the same."""
    whole, hurt = (scene_of("damage", structure, **(values | more)).lanes for more in ({"loss": 0.0}, {}))
    found = hurt.stiffness[:, 0, 0] / whole.stiffness[:, 0, 0]
    np.testing.assert_allclose(hurt.stiffness, whole.stiffness * found[:, None, None], rtol=1e-12)
    np.testing.assert_allclose(hurt.damping, whole.damping * found[:, None, None], rtol=1e-12)
    return np.asarray(found)


def sag(structure: Structure, part: Array) -> float:
    """Tip deflection of a chain of bending springs, each E I over its length, under a force: sum of (l - y)^2 / k."""
    reach = Joints.of(structure).reach * LENGTH
    at = np.array([c.point[1] for c in structure.connectors])
    two_at_root = np.where(at == 0.0, 0.5, 1.0)  # side by side
    return float((np.diff(reach)[:, 0] * two_at_root * (LENGTH - at) ** 2 / part).sum())


@pytest.mark.parametrize("loss", [0.5, 0.9, -2.0])
@pytest.mark.parametrize("station", [0.0, 0.4])
def test_cantilever_sags_as_a_beam_with_a_soft_section(loss: float, station: float) -> None:
    """int (l - y)^2 / (1 - d exp(-(y / l - s_0)^2 / 2 w^2)) dy, per force and rigidity."""
    width = 0.08

    def curvature(y: float) -> float:
        left = 1 - loss * float(np.exp(-0.5 * ((y / LENGTH - station) / width) ** 2))
        return (LENGTH - y) ** 2 / left

    exact = quad(curvature, 0, LENGTH, points=[station * LENGTH], epsrel=1e-9)[0] / (LENGTH**3 / 3)
    off = []
    for strips in (8, 32):
        structure = build(plank(), Division.parse(f"{strips}x1"))
        part = kept(structure, loss=loss, station=station, width=width)
        off.append(sag(structure, part) / sag(structure, np.ones(len(part))) / exact - 1)
    assert abs(off[0]) < 0.06
    assert abs(off[1]) < 0.004
    assert (exact > 1) == (loss > 0)


def test_is_local() -> None:
    structure = build(plank(), Division.parse("16x3"))
    part, reach = kept(structure, loss=0.9, station=0.5, width=0.03), Joints.of(structure).reach
    away = np.minimum(np.abs(reach[:, 0] - 0.5), np.abs(reach[:, 1] - 0.5)) > 0.2
    np.testing.assert_allclose(part[away], 1.0, atol=1e-9)
    along = Joints.of(structure).along_span
    covers = (reach[:, 0] <= 0.5) & (reach[:, 1] >= 0.5)
    assert np.all(part[covers & along] < 0.5)
    assert np.all(part[covers & ~along] < 0.7)


def test_chordwise_pieces_stand_side_by_side() -> None:
    """The mean of the remaining stiffness over their strip."""
    structure = build(plank(), Division.parse("5x2"))
    part = kept(structure, loss=0.6, station=0.5, width=0.1)
    for k, joint in enumerate(structure.connectors):
        if joint.modulus == CHORDWISE_MODULUS:
            y0, y1 = Joints.of(structure).reach[k]
            mean = quad(lambda s: 1 - 0.6 * np.exp(-0.5 * ((s - 0.5) / 0.1) ** 2), y0, y1)[0] / (y1 - y0)
            assert part[k] == pytest.approx(mean, rel=1e-4)


def test_changes_smoothly_with_its_place() -> None:
    """No step where the place crosses from piece to piece."""
    structure = build(plank(), Division.parse("4x2"))
    leaps = []
    for count in (101, 201):
        part = [kept(structure, loss=0.9, station=s, width=0.02) for s in np.linspace(0, 1, count)]
        leaps.append(np.abs(np.diff(part, axis=0)).max())
    assert leaps[1] < 0.6 * leaps[0]


def test_a_damaged_wing_swings_further_and_a_mended_one_less() -> None:
    plain, hurt, mended = (excursion(b) for b in (beat_of(""), *(beat_of("damage", loss=x) for x in (0.5, -2.0))))
    assert mended < plain < hurt


@pytest.mark.parametrize("loss", [0.9, -2.0])
def test_ledger_of_the_whole_wing_closes(loss: float) -> None:
    beat = beat_of("damage", division="11", steps=200, loss=loss)
    assert ledger(beat, 3.0) < 5e-4
    assert np.all(beat.power[:, 0] <= 0)
