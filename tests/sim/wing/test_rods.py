"""Rods that end between centroids, and rods that change from one piece of the chord to the next."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.oracles.plates import cut, displacement, loaded, plate, stiffness_matrix, straight_rod
from tests.sim.wing.test_structure import FRONT_D, GENOME, REAR_D, SPAN, THICKNESS, foam_rows, numbered, rod_rows
from wingfit.records import Rod, Wing
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.structure import CHORDWISE_MODULUS, Structure, spring_constants

Array = npt.NDArray[np.float64]


def springs(structure: Structure) -> Array:
    """Stiffness [C, 6] of every connector with ``GENOME``."""
    moduli = np.array([[GENOME["E_f"], GENOME["G_f"]], [GENOME["E_r"], GENOME["G_r"]]])
    return spring_constants(structure.connectors, moduli[0, :, None], moduli[1, :, None])[:, :, 0]


def rodded(ends: tuple[float, float], chord: float = 0.2) -> Wing:
    """A plate with two rods on its middle line, which end at the given positions."""
    rods = [
        straight_rod(n, chord / 2, y, d) for n, y, d in zip(("front", "rear"), ends, (FRONT_D, REAR_D), strict=True)
    ]
    return plate(chord, SPAN, THICKNESS, (rods[0], rods[1]))


def test_beyond_a_rods_end_there_is_only_foam_and_both_bear_the_same_moment() -> None:
    """Centroids at 0.1, 0.3, 0.5: one rod ends after a quarter of the distance, one after a half; compliances add."""
    found = springs(structure := cut(rodded((0.15, 0.2)), "3x1"))[numbered(structure, 0, 1)]
    foam, front, rear = foam_rows(0.2, 1.0, (GENOME["E_f"], GENOME["G_f"])), rod_rows(FRONT_D), rod_rows(REAR_D)
    expected = 0.2 * (0.25 / (foam + front + rear) + 0.25 / (foam + rear) + 0.5 / foam)
    np.testing.assert_allclose(found, 1 / expected, rtol=1e-6)


def test_a_driven_rod_that_ends_before_the_first_centroid() -> None:
    found = springs(structure := cut(rodded((0.04, SPAN)), "3x1"))[numbered(structure, -1, 0)]
    foam = foam_rows(0.2, 1.0, (GENOME["E_f"], GENOME["G_f"])) / 2
    np.testing.assert_allclose(found, 1 / (0.1 * (0.4 / (foam + rod_rows(FRONT_D)) + 0.6 / foam)), rtol=1e-6)


def test_lanes_get_these_springs() -> None:
    structure = cut(rodded((0.15, 0.2)), "3x2")
    np.testing.assert_allclose(loaded(structure, GENOME).stiffness[:, :, 0], springs(structure), rtol=1e-12)


def sag_of_chain(strips: int, end: float) -> float:
    """Tip deflection of strips on their bending springs under a unit force at the tip: the sum of M^2 / k."""
    structure = cut(rodded((end, end)), f"{strips}x1")
    joints = {round(c.point[1], 9): 0.0 for c in structure.connectors}
    for c, k in zip(structure.connectors, springs(structure), strict=True):
        joints[round(c.point[1], 9)] += k[0]  # the two rods at the root stand side by side
    return float(sum((SPAN - y) ** 2 / k for y, k in joints.items()))


def test_a_rod_may_end_anywhere_at_second_order() -> None:
    """Against the stepped beam, int (l - y)^2 / E I dy: root mean square over places of the end."""
    ends = np.linspace(0.3 * SPAN, 0.9 * SPAN, 61)
    foam = GENOME["E_f"] * 0.2 * THICKNESS**3 / 12
    both = foam + GENOME["E_r"] * np.pi * (FRONT_D**4 + REAR_D**4) / 64
    assert both > 10 * foam, "a rod whose end matters"
    errors = []
    for strips in (8, 16, 32):
        exact = [(SPAN**3 - (SPAN - y) ** 3) / (3 * both) + (SPAN - y) ** 3 / (3 * foam) for y in ends]
        found = [sag_of_chain(strips, float(y)) for y in ends]
        errors.append(np.sqrt(np.mean((np.array(found) / exact - 1) ** 2)))
    assert errors[2] < 2e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.25)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.25)


@pytest.mark.parametrize("division", ["4", "11", "24", "6x3", "32x4", "5,1,4,2"])
def test_every_stretch_of_every_rod_is_counted_once(division: str) -> None:
    """Rigidity times length, from the root to the last centroid, of rods that cross from piece to piece."""
    wing = robird_wing()
    structure = cut(wing, division)
    last, counted = float(structure.bodies[-1].centroid[1]), 0.0
    centre = [float(body.centroid[1]) for body in structure.bodies]
    for c in structure.connectors:
        length = centre[c.second] - (centre[c.first] if c.first >= 0 else wing.stations[0].y)
        if c.modulus != CHORDWISE_MODULUS:
            counted += float(c.parts @ c.rods[:, 0]) * length**2
        else:
            assert not c.rods.any()
        assert c.parts.sum() == pytest.approx(1)
    expected = sum(np.pi * r.diameter**4 / 64 * (min(r.y_tip, last) - r.y_root) for r in wing.rods)
    assert counted == pytest.approx(expected, rel=1e-9)


def slanted(division: str) -> Structure:
    """A plate 0.15 m deep whose rods lie together, from a tenth of the chord at the root to nine tenths at the tip."""
    rods = tuple(Rod(n, 0.015, 0.0, 0.135, SPAN, 0.003, 0.0, 0.0) for n in ("front", "rear"))
    return cut(plate(0.15, SPAN, THICKNESS, (rods[0], rods[1])), division)


@pytest.mark.parametrize("division", ["8x2", "12x4", "20x4", "10x3", "4,4,2,3,3,1,4"])
def test_a_slanted_rod_is_an_unbroken_chain(division: str) -> None:
    structure = slanted(division)
    carrying = [c for c in structure.connectors if c.rods.any() and c.first >= 0]
    assert len(carrying) == len(structure.division.bodies) - 1
    at = next(c.second for c in structure.connectors if c.first == -1)
    for c in carrying:
        assert c.first == at
        assert c.point[0] == pytest.approx(0.015 + 0.2 * c.point[1], abs=0.15 / 2)
        at = c.second


@pytest.mark.parametrize("division", ["16x2", "32x4", "16x8"])
def test_a_slanted_rod_stiffens_the_plate_as_a_straight_one(division: str) -> None:
    """First strip clamped, last loaded: within 15 % of the beam; a broken rod would sag 2 to 4 times as far."""
    structure, force = slanted(division), 1e-3
    strips, n = len(structure.division.bodies), structure.division.bodies[0]
    load = np.zeros((len(structure.bodies), 6))
    load[-n:, 5] = force / n
    sag = displacement(stiffness_matrix(structure, GENOME), load, tuple(range(n)))[-n:, 5].mean()
    rigidity = GENOME["E_f"] * 0.15 * THICKNESS**3 / 12 + 2 * GENOME["E_r"] * np.pi * 0.003**4 / 64
    beam = force * (SPAN * (1 - 1 / strips)) ** 3 / (3 * rigidity)
    assert 1 < sag / beam < 1.15
