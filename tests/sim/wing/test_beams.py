"""Beams cut into rigid bodies against beam theory, and the order at which a finer cut improves them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc, iv, jv

from tests.oracles.beams import (
    CANTILEVER_ROOTS,
    CASES,
    ELASTIC,
    STOCKY,
    THICK_PLATE,
    UNIFORM_ROD,
    UNIFORM_SHEET,
    WINGS,
    Beam,
    Family,
    cut_beam,
    elastica,
    euler_bernoulli,
    frequency_errors,
    frequency_markdown,
    observed_order,
    spring_chain,
    timoshenko,
    torsion_carried,
    torsion_constant,
    torsional,
    transfer_matrix,
    twist_rate,
    wing_tracks,
)

Array = npt.NDArray[np.float64]

BENDING: tuple[Family, ...] = ("flapwise", "in-plane")


def changes_sign(determinant: list[float]) -> bool:
    return determinant[0] * determinant[1] < 0


# -- the references themselves ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", BENDING)
def test_ritz_gives_the_closed_form_of_the_uniform_cantilever(family: Family) -> None:
    beam = UNIFORM_ROD
    mass = beam.density * beam.chord[0] * beam.thickness[0]
    rigidity = beam.young * float(beam.second_moment(family, np.array(0.0)))
    closed = np.array(CANTILEVER_ROOTS) ** 2 / (2 * np.pi) * np.sqrt(rigidity / mass) / beam.length**2
    np.testing.assert_allclose(euler_bernoulli(beam, family), closed, rtol=1e-9)
    np.testing.assert_allclose(np.cos(CANTILEVER_ROOTS) * np.cosh(CANTILEVER_ROOTS), -1, rtol=1e-9)


def test_ritz_gives_the_closed_form_of_a_wedge() -> None:
    """Thickness falling to nothing: J1 I2 + I1 J2 = 0 at z = 2 sqrt(omega L^2 sqrt(m / EI)) (Kirchhoff 1879)."""
    beam = Beam(1.0, (0.05, 0.05), (0.01, 1e-9))
    unit = np.sqrt(beam.young * 0.01**2 / 12 / beam.density) / (2 * np.pi)
    z = 2 * np.sqrt(euler_bernoulli(beam, "flapwise", count=2) / unit)
    for exact in z:
        sides = [jv(1, x) * iv(2, x) + iv(1, x) * jv(2, x) for x in (exact * (1 - 1e-6), exact * (1 + 1e-6))]
        assert changes_sign(sides)
    assert z[0] ** 2 / 4 == pytest.approx(5.315, abs=1e-3)


@pytest.mark.parametrize("family", BENDING)
def test_ritz_finds_the_roots_of_timoshenkos_frequency_equation(family: Family) -> None:
    """State (w, theta, M, V): free tip, so that M and V vanish there."""
    beam = STOCKY
    A, inertia = beam.chord[0] * beam.thickness[0], float(beam.second_moment(family, np.array(0.0)))
    for frequency in timoshenko(beam, family):
        sides = []
        for omega in 2 * np.pi * frequency * np.array([1 - 1e-7, 1 + 1e-7]):
            rate = np.zeros((4, 4))
            rate[0, 1], rate[0, 3] = 1.0, 1 / (beam.shear * A)
            rate[1, 2] = 1 / (beam.young * inertia)
            rate[2, 1], rate[2, 3] = -beam.density * inertia * omega**2, -1.0
            rate[3, 0] = -beam.density * A * omega**2
            sides.append(float(np.linalg.det(transfer_matrix(rate, beam.length)[2:, 2:])))
        assert changes_sign(sides)
    assert timoshenko(beam, family)[2] < 0.95 * euler_bernoulli(beam, family)[2], "a beam where shear matters"


def test_ritz_gives_both_torsions_of_the_uniform_beam() -> None:
    """Warping free: quarter waves. Root held flat: the free tip's bimoment and torque vanish (Vlasov)."""
    beam = UNIFORM_SHEET
    c, h, L = beam.chord[0], beam.thickness[0], beam.length
    rigidity = beam.shear * float(torsion_constant(c, h))
    inertia = beam.density * c * h * (c**2 + h**2) / 12
    closed = np.array([0.25, 0.75, 1.25]) * np.sqrt(rigidity / inertia) / L
    np.testing.assert_allclose(torsional(beam), closed, rtol=1e-9)
    # short, so that the determinant keeps its digits
    L, warping = 0.2, beam.young * (c * h) ** 3 / 144
    for frequency in torsional(replace(beam, length=L), warping=1.0):
        sides = []
        for omega in 2 * np.pi * frequency * np.array([1 - 1e-6, 1 + 1e-6]):
            rate = np.diag([1.0, 1.0, 1.0], 1)
            rate[3] = [inertia * omega**2 / warping, 0.0, rigidity / warping, 0.0]
            tip = transfer_matrix(rate, L)
            free = np.array([tip[2], warping * tip[3] - rigidity * tip[1]])[:, 2:]
            sides.append(float(np.linalg.det(free)))
        assert changes_sign(sides)


def test_torsion_constant_of_the_square_and_the_thin_strip() -> None:
    """0.1406 a^4 and w h^3 / 3 (1 - 0.630 h / w) (Timoshenko and Goodier, section 109)."""
    assert float(torsion_constant(1.0, 1.0)) == pytest.approx(0.1406, abs=5e-5)
    assert float(torsion_constant(0.01, 1.0)) == pytest.approx(1e-6 / 3 * (1 - 0.0063), rel=1e-4)


@pytest.mark.parametrize("load", [1.0, 2.0])
def test_elastica_is_bisshopp_and_druckers(load: float) -> None:
    """sqrt(a) = K(p) - F(p, phi), sin phi = 1 / (p sqrt 2); deflection 1 - 2 (E(p) - E(p, phi)) / sqrt(a)."""
    sag, shortening, turn = elastica(load)
    m = (1 + np.sin(turn)) / 2  # p^2 from the tip's rotation
    phi = np.arcsin(1 / np.sqrt(2 * m))
    assert ellipk(m) - ellipkinc(phi, m) == pytest.approx(np.sqrt(load), rel=1e-8)
    assert sag == pytest.approx(1 - 2 * (ellipe(m) - ellipeinc(phi, m)) / np.sqrt(load), rel=1e-8)
    assert 1 - shortening == pytest.approx(np.sqrt(2 * (2 * m - 1) / load), rel=1e-8)


# -- what the division does to them ----------------------------------------------------------------------------------

CUT_CASES = [(name, family, chordwise) for name, _, families, _ in CASES for family in families for chordwise in (1, 2)]


def errors_of(name: str, family: Family, chordwise: int, strips: int) -> Array:
    beam, slender = next((b, s) for n, b, _, s in CASES if n == name)
    (row,) = frequency_errors(name, beam, (family,), slender, chordwise, strips)
    return np.array(row.errors)


@pytest.mark.parametrize(
    ("name", "family", "chordwise"),
    [c for c in CUT_CASES if c[1] != "torsion" and c != ("stocky beam", "in-plane", 2)]
    + [("uniform rod", "flapwise", 4), ("stocky beam", "flapwise", 4)]
    + [(name, "torsion", 1) for name in ("uniform sheet", "tapered sheet")],
)
def test_frequencies_converge_at_second_order(name: str, family: Family, chordwise: int) -> None:
    """First three frequencies: half the strips' width, a quarter of the error, which is below 1.1 % at 16 strips."""
    coarse, fine = errors_of(name, family, chordwise, 8), errors_of(name, family, chordwise, 16)
    assert np.all(np.abs(fine) < [2.5e-3, 7e-3, 1.1e-2])
    orders = [observed_order(a, b) for a, b in zip(coarse, fine, strict=True)]
    assert orders == pytest.approx([2.0] * 3, abs=0.3)


@pytest.mark.parametrize("chord", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("division", ["4x1", "4x3", "6x4", "32x4", "8x16"])
def test_all_connectors_together_carry_the_torsion_constant(chord: float, division: str) -> None:
    """Of narrow and of wide plates, of strips wider and narrower than the plate is thick."""
    beam = Beam(0.5, (chord, chord), (0.02, 0.02))
    assert torsion_carried(cut_beam(beam, division)) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(("chordwise", "off"), [(2, 0.9e-3), (4, 1.8e-3)])
def test_twist_of_a_thick_plate_does_not_depend_on_the_strips(chordwise: int, off: float) -> None:
    """A twentieth as thick as deep, strips down to three times its thickness: within 0.2 % of Saint-Venant's."""
    coarse, fine = (twist_rate(THICK_PLATE, f"{strips}x{chordwise}") for strips in (16, 32))
    assert 1 < fine < 1 + off
    assert fine == pytest.approx(coarse, abs=1e-4)


@pytest.mark.parametrize(("chordwise", "limit"), [(2, (1e-3, 1.5e-3, 3e-3)), (4, (1.5e-3, 7e-3, 1.5e-2))])
def test_torsion_of_a_sheet_divided_in_both_directions_converges(chordwise: int, limit: tuple[float, ...]) -> None:
    """A sheet three times as long as deep, strips narrower than the 24 mm over which its clamped end warps.

    Order between one and two (docs/beams.md). Four pieces also let the chord bend, which the theory does not.
    """
    beam = replace(UNIFORM_SHEET, length=0.3, thickness=(0.001, 0.001))
    cuts = (128 // chordwise // 4, 128 // chordwise // 2, 128 // chordwise)
    errors = np.array([frequency_errors("", beam, ("torsion",), True, chordwise, n)[0].errors for n in cuts])
    assert np.all(np.abs(errors[2]) < limit)
    steps = np.abs(np.diff(errors, axis=0))
    assert np.all(np.log2(steps[0] / steps[1]) > 1.2)


@pytest.mark.parametrize("chordwise", [2, 4])
@pytest.mark.parametrize("name", ["uniform sheet", "tapered sheet"])
def test_torsion_of_a_slender_sheet_divided_in_both_directions(name: str, chordwise: int) -> None:
    """First two frequencies at 32 strips; they stay so close at 64."""
    assert np.all(np.abs(errors_of(name, "torsion", chordwise, 32)[:2]) < 1.6e-3)
    if chordwise == 2:
        assert np.all(np.abs(errors_of(name, "torsion", chordwise, 64)[:2]) < 3e-4)


@pytest.mark.parametrize(("chordwise", "worst"), [(2, 0.115), (4, 0.145)])
def test_in_plane_shear_of_a_divided_chord_is_too_soft(chordwise: int, worst: float) -> None:
    """A limit on a known error (docs/beams.md): spanwise and chordwise connectors shear in series, each with G A."""
    errors = errors_of("stocky beam", "in-plane", chordwise, 16)
    assert np.all(np.abs(errors) < worst)


@pytest.mark.parametrize(("load", "deflection", "shortening"), [(1.0, 7e-4, 2e-4), (2.0, 1.2e-3, 5e-4)])
def test_large_deflection_is_the_elasticas(load: float, deflection: float, shortening: float) -> None:
    """At 16 strips, as part of the length; second order in the strips' width."""
    truth = elastica(load)
    coarse, fine = (np.array(spring_chain(ELASTIC, strips, load)) - truth for strips in (8, 16))
    assert abs(fine[0]) < deflection
    assert abs(fine[1]) < shortening
    assert observed_order(coarse[0], fine[0]) == pytest.approx(2, abs=0.2)
    assert observed_order(coarse[1], fine[1]) == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize("name", WINGS)
def test_the_wing_converges_at_second_order(name: str) -> None:
    """Periodic motion of the markers in vacuum: each halving of the strips moves them about a quarter as far.

    The share of the error that comes from where a rod ends in its strip differs from cut to cut, so for the wing with
    its own rods the mean over two halvings counts.
    """
    tracks = [wing_tracks(WINGS[name], f"{strips}x1") for strips in (4, 8, 16, 32)]
    steps = [float(np.linalg.norm(b - a, axis=-1).mean()) for a, b in pairwise(tracks)]
    assert observed_order(steps[0], steps[2], 4.0) == pytest.approx(2, abs=0.3)
    assert steps[2] < 2e-4


def test_more_bodies_along_the_chord_move_the_wing_less_and_less() -> None:
    """The robird's front rod changes pieces of the chord twice: broken there, divisions would differ by centimetres."""
    two, four, eight = (wing_tracks(WINGS["robird"], division) for division in ("16x2", "16x4", "16x8"))
    steps = [float(np.linalg.norm(b - a, axis=-1).mean()) for a, b in ((two, four), (four, eight))]
    assert steps[0] < 1.5e-3
    assert steps[1] < 1.5e-3


def test_tables_omit_motions_that_a_discretisation_does_not_have() -> None:
    rows = frequency_errors("rod", replace(UNIFORM_ROD, length=1.0), ("flapwise",), True, 1, 2)
    text = frequency_markdown(rows)
    assert np.isnan(rows[0].errors[2])
    assert text.splitlines()[-1].endswith("| - | - |")
