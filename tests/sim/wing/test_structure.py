"""Connectors, masses and statics of plates whose answers can be written down."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest

from tests.oracles.plates import cut, displacement, loaded, plate, stiffness_matrix, straight_rod, with_materials
from wingfit.records import Marker, Wing
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import Connector, Structure

Array = npt.NDArray[np.float64]

CHORD, SPAN, THICKNESS = 0.2, 0.6, 0.01
FRONT_X, REAR_X, FRONT_D, REAR_D = 0.05, 0.15, 0.004, 0.003
REAR_TIP = 0.3  # in the middle of the second of three strips, so that masses and areas have different centres
GENOME = {"E_f": 7e6, "E_r": 1.1e11, "G_f": 3e6, "G_r": 4e9, "D_E": 5e4, "D_G": 2e4}


def rodded_plate() -> Wing:
    rods = (
        straight_rod("front", FRONT_X, SPAN, FRONT_D, 1600.0, 0.01),
        straight_rod("rear", REAR_X, REAR_TIP, REAR_D, 1600.0, 0.01),
    )
    return with_materials(plate(CHORD, SPAN, THICKNESS, rods), 30.0, 0.2)


def saint_venant(width: float, thickness: float) -> float:
    """Torsion constant of a rectangle by its series (Timoshenko and Goodier, section 109)."""
    n = np.arange(1, 200, 2)
    total = (np.tanh(n * np.pi * width / (2 * thickness)) / n**5).sum()
    return float(width * thickness**3 / 3 * (1 - 192 / np.pi**5 * thickness / width * total))


def foam_rows(width: float, torsion_share: float, moduli: tuple[float, float]) -> Array:
    """Thesis Eq. 15-16, foam alone, with the piece's part of the whole chord's torsion constant."""
    E, G = moduli
    A, J = width * THICKNESS, saint_venant(CHORD, THICKNESS) * width / CHORD * torsion_share
    return np.array([E * width * THICKNESS**3 / 12, G * J, E * THICKNESS * width**3 / 12, G * A, E * A, G * A])


def rod_rows(diameter: float) -> Array:
    """Thesis Eq. 15-16, the rod alone: it slides, so nothing along or about the span."""
    E_r, G_r, A_r, I_r = GENOME["E_r"], GENOME["G_r"], np.pi * diameter**2 / 4, np.pi * diameter**4 / 64
    return np.array([E_r * I_r, 0.0, E_r * I_r, G_r * A_r, 0.0, G_r * A_r])


def spanwise(width: float, length: float, diameter: float, torsion_share: float, foam_share: float = 1.0) -> Array:
    """Thesis Eqs. 15-16 over a length: stiffness of foam ``width`` x THICKNESS, with a rod if its diameter is not 0."""
    foam = foam_rows(width, torsion_share, (GENOME["E_f"], GENOME["G_f"]))
    return np.asarray((foam_share * foam + rod_rows(diameter)) / length)


def spanwise_damping(width: float, length: float, torsion_share: float, foam_share: float = 1.0) -> Array:
    """Thesis Eq. 17 over a length: no part of it is the rod's."""
    return np.asarray(foam_share * foam_rows(width, torsion_share, (GENOME["D_E"], GENOME["D_G"])) / length)


def numbered(structure: Structure, first: int, second: int) -> int:
    """Number of the one connector between two bodies."""
    found = [k for k, c in enumerate(structure.connectors) if (c.first, c.second) == (first, second)]
    assert len(found) == 1, f"{len(found)} connectors between {first} and {second}"
    return found[0]


def assert_connector(structure: Structure, first: int, second: int, stiffness: Array, damping: Array) -> Connector:
    """Both tables."""
    group, k = loaded(structure, GENOME), numbered(structure, first, second)
    for found, expected in ((group.stiffness[k], stiffness), (group.damping[k], damping)):
        assert np.all(found == found[:, :1]), "every lane of one genome is the same"
        assert np.all(np.abs(found[:, 0] / expected - 1) < 1e-6), f"{found[:, 0]} instead of {expected}"
    return structure.connectors[k]


# Bodies of the plate cut 3x2: 0 1 | 2 3 | 4 5, leading edge first; strips 0.2 m wide, bodies 0.1 m deep.
@pytest.mark.parametrize(
    ("first", "second", "diameter"),
    [(0, 2, FRONT_D), (1, 3, REAR_D), (2, 4, FRONT_D), (3, 5, 0.0)],
    ids=["front rod", "rear rod", "front rod outboard", "beyond the rear rod's tip"],
)
def test_connection_along_the_span(first: int, second: int, diameter: float) -> None:
    """Over the 0.2 m between the areas' centroids; two bodies along the chord leave it 3/4 of the torsion constant."""
    structure = cut(rodded_plate(), "3x2")
    connector = assert_connector(
        structure, first, second, spanwise(0.1, 0.2, diameter, 0.75), spanwise_damping(0.1, 0.2, 0.75)
    )
    np.testing.assert_allclose(connector.point, [0.05 if first % 2 == 0 else 0.15, 0.2 * (1 + first // 2), 0.0])


def test_connection_along_the_chord() -> None:
    """The same with the axes exchanged and no rod: strips 0.15 m wide, 0.1 m between centroids, half the torsion.

    Its torsion constant too is a part of the whole chord's: all edges of the plate twisted along the span are there.
    """
    E_f, G_f, D_E, D_G = (GENOME[name] for name in ("E_f", "G_f", "D_E", "D_G"))
    A, I_y, I_z = 0.15 * THICKNESS, 0.15 * THICKNESS**3 / 12, THICKNESS * 0.15**3 / 12
    J = saint_venant(CHORD, THICKNESS) * 0.15 / CHORD / 2
    rows = np.array([J, I_y, I_z, A, A, A]) / 0.1
    structure = cut(rodded_plate(), "4x2")
    group = loaded(structure, GENOME)
    for strip in range(4):
        k = numbered(structure, 2 * strip, 2 * strip + 1)
        np.testing.assert_allclose(group.stiffness[k, :, 0], rows * [G_f, E_f, E_f, E_f, G_f, G_f], rtol=1e-6)
        np.testing.assert_allclose(group.damping[k, :, 0], rows * [D_G, D_E, D_E, D_E, D_G, D_G], rtol=1e-6)
        np.testing.assert_allclose(structure.connectors[k].point, [0.1, 0.075 + 0.15 * strip, 0.0], atol=1e-12)


def test_root_holds_each_rods_body() -> None:
    """Each driven rod enters a body of its own: half a strip of foam to its centroid, the rod through it."""
    structure = cut(rodded_plate(), "3x2")
    for drive, body, x, diameter in ((-1, 0, FRONT_X, FRONT_D), (-2, 1, REAR_X, REAR_D)):
        connector = assert_connector(
            structure, drive, body, spanwise(0.1, 0.1, diameter, 0.75), spanwise_damping(0.1, 0.1, 0.75)
        )
        np.testing.assert_allclose(connector.point, [x, 0.0, 0.0])


def test_root_of_one_body_is_shared_by_its_rods() -> None:
    """Both rods enter the one body: half its foam each, their own carbon each; the whole torsion constant."""
    structure = cut(rodded_plate(), "3x1")
    for drive, diameter in ((-1, FRONT_D), (-2, REAR_D)):
        assert_connector(
            structure, drive, 0, spanwise(0.2, 0.1, diameter, 1.0, 0.5), spanwise_damping(0.2, 0.1, 1.0, 0.5)
        )


def test_two_rods_through_one_connection_add() -> None:
    structure = cut(rodded_plate(), "3x1")
    k = numbered(structure, 0, 1)
    one, other = (spanwise(0.2, 0.2, d, 1.0) for d in (FRONT_D, REAR_D))
    found = loaded(structure, GENOME).stiffness[k, :, 0]
    np.testing.assert_allclose(found, one + other - spanwise(0.2, 0.2, 0.0, 1.0), rtol=1e-6)


@pytest.mark.parametrize(
    ("gene", "along_span", "along_chord"),
    [
        ("E_f", [0, 2, 4], [1, 2, 3]),
        ("G_f", [1, 3, 5], [0, 4, 5]),
        ("E_r", [0, 2], []),
        ("G_r", [3, 5], []),
        ("D_E", [0, 2, 4], [1, 2, 3]),
        ("D_G", [1, 3, 5], [0, 4, 5]),
    ],
)
def test_which_modulus_governs_which_row(gene: str, along_span: list[int], along_chord: list[int]) -> None:
    """Doubling one gene changes these rows (rotations 0-2, translations 3-5) and no other."""
    structure = cut(rodded_plate(), "3x2")
    base, doubled = loaded(structure, GENOME), loaded(structure, {**GENOME, gene: 2 * GENOME[gene]})
    touched, still = ("damping", "stiffness") if gene.startswith("D") else ("stiffness", "damping")
    assert np.array_equal(getattr(base, still), getattr(doubled, still))
    for pair, rows in (((0, 2), along_span), ((-1, 0), along_span), ((0, 1), along_chord)):
        k = numbered(structure, *pair)
        ratio = (getattr(doubled, touched) / getattr(base, touched))[k, :, 0]
        assert np.flatnonzero(ratio > 1).tolist() == rows


def test_where_three_bodies_meet_two() -> None:
    """The 11-body wing's last seam: the foam is cut at thirds and at the half, and adds up to the chord."""
    rods = (straight_rod("front", 0.03, SPAN, 0.0), straight_rod("rear", 0.06, SPAN, 0.0))
    structure = cut(plate(0.18, 0.8, THICKNESS, rods), "11")
    pairs, widths = ((6, 9), (7, 9), (7, 10), (8, 10)), (0.06, 0.03, 0.03, 0.06)
    seam = [c for c in structure.connectors if c.first in (6, 7, 8) and c.second in (9, 10)]
    assert [(c.first, c.second) for c in seam] == list(pairs)
    np.testing.assert_allclose([c.foam[4] * 0.2 / THICKNESS for c in seam], widths)
    np.testing.assert_allclose([c.point[0] for c in seam], [0.03, 0.075, 0.105, 0.15])
    np.testing.assert_allclose([c.point[1] for c in seam], 0.6)
    # each half of the distance wants what the chordwise connectors of its strip leave: (1 + 1/3)/2 and (1 + 1/2)/2
    expected = [saint_venant(0.18, THICKNESS) * width / 0.18 * (2 / 3 + 3 / 4) / 2 / 0.2 for width in widths]
    np.testing.assert_allclose([c.foam[1] for c in seam], expected, rtol=1e-6)


@pytest.mark.parametrize("division", ["4", "11", "24"])
def test_foam_of_every_seam_adds_up_to_its_section(division: str) -> None:
    structure = cut(robird_wing(), division)
    cuts = Division.parse(division).bodies
    strip = np.repeat(np.arange(len(cuts)), cuts)
    for s in range(len(cuts) - 1):
        y = 0.03 + 0.49 * (s + 1) / len(cuts)
        seam = [c for c in structure.connectors if c.first >= 0 and (strip[c.first], strip[c.second]) == (s, s + 1)]
        length = [structure.bodies[c.second].centroid[1] - structure.bodies[c.first].centroid[1] for c in seam]
        stations = robird_wing().stations
        section = np.interp(y, [t.y for t in stations], [t.chord for t in stations]) * np.interp(
            y, [t.y for t in stations], [t.thickness for t in stations]
        )
        assert sum(c.foam[4] * a for c, a in zip(seam, length, strict=True)) == pytest.approx(section, rel=1e-9)


def point(mass: float, r: Array) -> Array:
    return mass * (r @ r * np.eye(3) - np.outer(r, r))


def test_mass_and_inertia_of_a_plate_with_everything_on_it() -> None:
    """Foam as a block, skin as two faces, rods as slender bars, a marker as a point; the inner of two strips."""
    c, b, h, foam, skin = 0.2, 0.3, 0.012, 35.0, 0.3
    mark = Marker("heavy", (0.13, 0.21, 0.02), 0.004)
    rods = (straight_rod("front", 0.05, 2 * b, 0.004, 1600.0, 0.012), straight_rod("rear", 0.15, b, 0.0))
    body = cut(with_materials(plate(c, 2 * b, h, rods, (mark,)), foam, skin), "2x1").bodies[0]
    m_f, m_s, m_m = foam * c * b * h, skin * c * b, mark.mass
    m_r = (1600.0 * np.pi * 0.004**2 / 4 + 0.012) * b
    middle, bar, place = np.array([c / 2, b / 2, 0.0]), np.array([0.05, b / 2, 0.0]), np.array(mark.position)
    mass = m_f + m_s + m_r + m_m
    centre = ((m_f + m_s) * middle + m_r * bar + m_m * place) / mass
    block = m_f / 12 * np.diag([b**2 + h**2, c**2 + h**2, b**2 + c**2])
    faces = m_s / 12 * np.diag([b**2 + 3 * h**2, c**2 + 3 * h**2, b**2 + c**2])
    slender = m_r * b**2 / 12 * np.diag([1.0, 0.0, 1.0])
    inertia = block + faces + slender + point(m_f + m_s, middle - centre) + point(m_r, bar - centre)
    inertia += point(m_m, place - centre)
    assert body.mass == pytest.approx(mass, rel=1e-9)
    np.testing.assert_allclose(body.centre, centre, atol=1e-9)
    np.testing.assert_allclose(body.inertia, inertia, atol=1e-6 * inertia.max())
    assert body.area == pytest.approx(c * b)
    np.testing.assert_allclose(body.centroid, middle, atol=1e-12)


def whole(structure: Structure) -> tuple[float, Array, Array]:
    """Mass, centre and inertia of all bodies together."""
    mass = sum(b.mass for b in structure.bodies)
    centre = np.sum([b.mass * b.centre for b in structure.bodies], axis=0) / mass
    return mass, centre, np.sum([b.inertia + point(b.mass, b.centre - centre) for b in structure.bodies], axis=0)


def integrated(wing: Wing) -> tuple[float, Array, Array]:
    """Mass, centre and inertia of the uncut wing: Gauss points between stations, where all is polynomial in y."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    table = np.array([(s.y, s.leading_edge, s.chord, s.thickness) for s in wing.stations])
    mass, first, about_origin = 0.0, np.zeros(3), np.zeros((3, 3))
    for low, high in pairwise(table):
        for t, weight in zip((nodes + 1) / 2, weights / 2 * (high[0] - low[0]), strict=True):
            y, le, c, h = low + t * (high - low)
            foam, skin = wing.materials.foam_density * h * c * weight, wing.materials.skin_areal_density * c * weight
            m, r = foam + skin, np.array([le + c / 2, y, 0.0])
            through = foam * h**2 / 12 + skin * h**2 / 4
            mass, first = mass + m, first + m * r
            about_origin += point(m, r) + np.diag([through, m * c**2 / 12 + through, m * c**2 / 12])
    for rod in wing.rods:
        start, along = (
            np.array([rod.x_root, rod.y_root, 0.0]),
            np.array([rod.x_tip - rod.x_root, rod.y_tip - rod.y_root, 0.0]),
        )
        m = (rod.density * np.pi * rod.diameter**2 / 4 + rod.glue_linear_density) * np.linalg.norm(along)
        mass, first = mass + float(m), first + m * (start + along / 2)
        about_origin += point(float(m), start + along / 2) + point(float(m) / 12, along)
    for marker in wing.markers:
        r = np.array(marker.position)
        mass, first, about_origin = mass + marker.mass, first + marker.mass * r, about_origin + point(marker.mass, r)
    return mass, first / mass, about_origin - point(mass, first / mass)


@pytest.mark.parametrize("division", ["4", "11", "24", "6x3"])
def test_every_discretisation_has_the_same_mass_properties(division: str) -> None:
    mass, centre, inertia = integrated(robird_wing())
    found = whole(cut(robird_wing(), division))
    assert found[0] == pytest.approx(mass, rel=2e-5)
    np.testing.assert_allclose(found[1], centre, atol=1e-5)
    np.testing.assert_allclose(found[2], inertia, atol=1e-4 * inertia.max())


def test_the_number_of_bodies_along_the_chord_does_not_change_the_mass() -> None:
    one, four = (whole(cut(robird_wing(), division)) for division in ("6x1", "6x4"))
    assert four[0] == pytest.approx(one[0], rel=1e-12)
    np.testing.assert_allclose(four[2], one[2], atol=1e-6 * one[2].max())


def slender(division: str, chord: float, thickness: float, x: float) -> Structure:
    """A plate 0.6 m long, both driven rods at one x and without substance."""
    rods = (straight_rod("front", x, SPAN, 0.0), straight_rod("rear", x, SPAN, 0.0))
    return cut(plate(chord, SPAN, thickness, rods), division)


@pytest.mark.parametrize("thickness", [0.001, 0.005], ids=["thin", "thick"])
@pytest.mark.parametrize("strips", [12, 24])
@pytest.mark.parametrize("chordwise", [1, 2, 4])
def test_twist_under_a_tip_couple_is_saint_venants(chordwise: int, strips: int, thickness: float) -> None:
    """Twist per length = T / (G J), however the plate is cut: spanwise and chordwise connectors share J.

    Measured in the middle half, away from where the ends are held and loaded. The half of the torque that chordwise
    connectors bear goes along the outermost pieces as a shear force, whose shear adds n (h / c)^2 / 6 to the twist.
    """
    chord, couple = 0.1, 1e-3
    structure = slender(f"{strips}x{chordwise}", chord, thickness, 0.0499)
    load = np.zeros((len(structure.bodies), 6))
    load[-chordwise:, 1] = couple / chordwise
    u = displacement(stiffness_matrix(structure, GENOME), load)
    turn = u[:, 1].reshape(strips, chordwise).mean(axis=1)
    a, b = strips // 4, strips - 1 - strips // 4
    expected = couple * SPAN * (b - a) / strips / (GENOME["G_f"] * saint_venant(chord, thickness))
    shear = chordwise * (thickness / chord) ** 2 / 6 if chordwise > 1 else 0.0
    assert turn[b] - turn[a] == pytest.approx(expected * (1 + shear), rel=0.15 * shear + 5e-5)


def test_chord_bends_as_a_clamped_plate() -> None:
    """Leading-edge bodies clamped, trailing edge loaded: F l^3 / 3 E I + F l / G A; ten bodies are 1/(4 9^2) short."""
    chord, thickness, strips, count, force = 0.2, 0.01, 3, 10, 0.01
    structure = slender(f"{strips}x{count}", chord, thickness, 0.01)
    load = np.zeros((len(structure.bodies), 6))
    load[count - 1 :: count, 5] = force / strips
    held = tuple(range(0, strips * count, count))
    sag = displacement(stiffness_matrix(structure, GENOME), load, held)[count - 1 :: count, 5]
    length, A, second = chord * (1 - 1 / count), SPAN * thickness, SPAN * thickness**3 / 12
    expected = force * length**3 / (3 * GENOME["E_f"] * second) + force * length / (GENOME["G_f"] * A)
    np.testing.assert_allclose(sag, expected, rtol=0.005)


@pytest.mark.parametrize(("axis", "thick", "wide"), [(5, 3, 1), (3, 1, 3)], ids=["out of plane", "in plane"])
def test_rods_stiffen_a_cantilever_both_ways(axis: int, thick: int, wide: int) -> None:
    """Two rods side by side on the neutral axis; strips clamped at the innermost: Timoshenko's beam with its rods."""
    chord, thickness, strips, d, force = 0.03, 0.01, 20, 0.002, 1e-3
    rods = (straight_rod("front", chord / 2, SPAN, d), straight_rod("rear", chord / 2, SPAN, d))
    structure = cut(plate(chord, SPAN, thickness, rods), f"{strips}x1")
    load = np.zeros((strips, 6))
    load[-1, axis] = force
    sag = displacement(stiffness_matrix(structure, GENOME), load, (0,))[-1, axis]
    length = SPAN * (1 - 1 / strips)
    bending = GENOME["E_f"] * chord**wide * thickness**thick / 12 + 2 * GENOME["E_r"] * np.pi * d**4 / 64
    shear = GENOME["G_f"] * chord * thickness + 2 * GENOME["G_r"] * np.pi * d**2 / 4
    assert sag == pytest.approx(force * length**3 / (3 * bending) + force * length / shear, rel=0.002)
