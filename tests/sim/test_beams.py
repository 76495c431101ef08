"""Beams cut into rigid bodies against beam theory, and the order at which a finer cut improves them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc, iv, jv

from benchmarks.beam_theory import (
    CANTILEVER_ROOTS,
    Beam,
    Family,
    elastica,
    euler_bernoulli,
    timoshenko,
    torsion_constant,
    torsional,
)
from benchmarks.beams import (
    CASES,
    ELASTIC,
    STOCKY,
    UNIFORM_ROD,
    UNIFORM_SHEET,
    WINGS,
    frequency_errors,
    frequency_markdown,
    observed_order,
    torsion_carried,
    wing_tracks,
)
from benchmarks.spring_chain import cut_beam, spring_chain

Array = npt.NDArray[np.float64]

BENDING: tuple[Family, ...] = ("flapwise", "in-plane")


def transfer(rate: Array, length: float) -> Array:
    """Of the state of a uniform beam from root to tip; ``rate`` [4, 4] is its derivative along the span."""
    return np.asarray(expm(rate * length))


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
            sides.append(float(np.linalg.det(transfer(rate, beam.length)[2:, 2:])))
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
    for frequency in torsional(replace(beam, length=L), warping=True):
        sides = []
        for omega in 2 * np.pi * frequency * np.array([1 - 1e-6, 1 + 1e-6]):
            rate = np.diag([1.0, 1.0, 1.0], 1)
            rate[3] = [inertia * omega**2 / warping, 0.0, rigidity / warping, 0.0]
            tip = transfer(rate, L)
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


@pytest.mark.parametrize("chordwise", [2, 4])
@pytest.mark.parametrize("strips", [16, 32])
def test_torsion_of_a_sheet_cut_both_ways_follows_what_its_connectors_carry(chordwise: int, strips: int) -> None:
    """The pieces' own torsion constants lose at their edges what the whole section has: docs/beams.md."""
    carried = torsion_carried(cut_beam(UNIFORM_SHEET, f"{strips}x{chordwise}"))
    assert 0.95 < carried < 1.001
    first = errors_of("uniform sheet", "torsion", chordwise, strips)[0]
    assert first == pytest.approx(np.sqrt(carried) - 1, abs=8e-3)
    assert torsion_carried(cut_beam(UNIFORM_SHEET, f"{strips}x1")) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize(("chordwise", "worst"), [(2, 0.115), (4, 0.145)])
def test_shear_in_the_plane_of_a_cut_chord_is_too_soft(chordwise: int, worst: float) -> None:
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


def test_the_wing_converges_at_second_order_where_rods_do_not_end_between_seams() -> None:
    """Periodic motion of the markers in vacuum: each halving of the strips moves them a quarter as far."""
    tracks = [wing_tracks(WINGS["rods to the tip"], strips, 1) for strips in (4, 8, 16, 32)]
    steps = [float(np.linalg.norm(b - a, axis=-1).mean()) for a, b in pairwise(tracks)]
    assert observed_order(steps[1], steps[2]) == pytest.approx(2, abs=0.3)
    assert steps[2] < 2e-4


def test_tables_leave_out_motions_that_a_division_does_not_have() -> None:
    rows = frequency_errors("rod", replace(UNIFORM_ROD, length=1.0), ("flapwise",), True, 1, 2)
    text = frequency_markdown(rows)
    assert np.isnan(rows[0].errors[2])
    assert text.splitlines()[-1].endswith("| - | - |")
