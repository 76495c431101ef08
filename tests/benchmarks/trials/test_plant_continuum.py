"""The wing as a continuous rod: closed forms, convergence, and the plant of bodies and springs at fine division."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_bvp
from scipy.signal import resample

from benchmarks.concealed.plant.continuum.integrate import STAGES, A, C
from benchmarks.concealed.plant.continuum.periodic import Settings
from benchmarks.concealed.plant.continuum.sections import Sections, torsion_constant
from benchmarks.concealed.plant.continuum.simulate import EFFECTS, beam, simulate
from benchmarks.concealed.plant.wing.geometry import Cut
from benchmarks.concealed.plant.wing.simulate import simulate as simulate_bodies
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS
from benchmarks.concealed.plant.wing_effects.hidden import Effect, Hidden
from benchmarks.concealed.rigs import WINGS
from benchmarks.concealed.trials import chamber, tunnel
from wingfit.records import Condition, FourierDrive, Hinge, Marker, Materials, Rod, Station, Wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]

COARSE = Settings(rough=48, steps=96, periodic=1e-5)
FEW = 6  # elements
THIN, STREAM = chamber(1000.0, 0.12, 3.0), tunnel(0.05, 3.5, 6.0)
IN_STREAM = ("dynamic_stall", "circulation_lag", "leading_edge_vortex", "added_mass", "closed_cells")

LENGTH, CHORD, THICKNESS = 0.5, 0.1, 0.01
EI_OVER_E, LOAD = CHORD * THICKNESS**3 / 12, 30.0 * CHORD * THICKNESS  # m^4, kg/m


def nominal(name: str) -> dict[str, float]:
    return {gene.name: gene.nominal for gene in FlexibleWing(WINGS[name][0], "4").genes}


def uniform(angle: float = 0.0) -> Wing:
    """A uniform plate of foam that flaps by ``angle`` (rad) about its root; its rods have neither mass nor rigidity."""
    stations = tuple(Station(y, -0.5 * CHORD, CHORD, THICKNESS) for y in (0.0, LENGTH))
    rods = tuple(Rod(name, x, 0.0, x, LENGTH, 1e-6, 0.0, 0.0) for name, x in (("front", -0.03), ("rear", 0.03)))
    places = {"middle": (0.0, 0.5), "tip": (0.0, 1.0), "nose": (-0.05, 1.0), "tail": (0.05, 1.0)}
    markers = tuple(Marker(name, (x, y * LENGTH, 0.0), 0.0) for name, (x, y) in places.items())
    drive = FourierDrive(0.0, (angle,), (0.0,))
    return Wing(
        "plate", stations, Materials(30.0, 0.0), rods, ("front", "rear"), markers, ("tip",), Hinge(0.0, 0.0), drive
    )


def plate(young: float, shear: float, loss: float) -> dict[str, float]:
    """Genome with foam of the moduli ``young``, ``shear`` (Pa) and the damping ``loss`` (s) relative to them."""
    moduli = {"E_f": young, "G_f": shear, "D_E": loss * young, "D_G": loss * shear, "E_r": 1.0, "G_r": 1.0}
    return nominal("robird") | moduli


def still(frequency: float, gravity: float) -> Condition:
    return Condition(frequency, 0.0, 0.0, 293.15, gravity=gravity)


@cache
def of_rod(condition: Condition, effect: str = "", strength: float = 0.0, wing: str = "robird") -> Array:
    return simulate(WINGS[wing][0], nominal(wing), condition, concealed(effect, strength), FEW, COARSE).tracks


@cache
def of_bodies(
    condition: Condition, division: str, effect: str = "", strength: float = 0.0, wing: str = "robird"
) -> Array:
    hidden = concealed(effect, strength)
    return simulate_bodies(WINGS[wing][0], division, nominal(wing), condition, hidden).tracks


def concealed(effect: str, strength: float) -> Hidden:
    return Hidden.one(effect, strength) if effect else Hidden()


def apart(a: Array, b: Array) -> float:
    """Largest distance (m) of a marker in two beats, which may have different numbers of instants."""
    return float(np.linalg.norm(even(a) - even(b), axis=2).max())


def even(tracks: Array) -> Array:
    """The beat at 192 instants."""
    return tracks if len(tracks) == 192 else np.asarray(resample(tracks, 192, axis=0))


# --- closed forms ---------------------------------------------------------------------------------------------------


def test_a_heavy_cantilever_is_an_elastica() -> None:
    """EI theta'' = -q (L - s) cos theta (Bickley 1934): clamped at 0, free at L; the tip falls by almost L / 2."""
    young = 7e5
    heavy = LOAD * 9.81 / (young * EI_OVER_E)
    s = np.linspace(0, LENGTH, 200)
    angle = solve_bvp(
        lambda s, q: np.array([q[1], -heavy * (LENGTH - s) * np.cos(q[0])]),
        lambda a, b: np.array([a[0], b[1]]), s, np.zeros((2, len(s))), tol=1e-8,
    ).sol  # fmt: skip
    t, weights = np.polynomial.legendre.leggauss(20)
    theta = angle(0.5 * LENGTH * (t + 1))[0]
    tip = 0.5 * LENGTH * np.array([weights @ np.cos(theta), -weights @ np.sin(theta)])
    found = simulate(uniform(), plate(young, 1e9, 0.05), still(1.0, 9.81), None, FEW).tracks
    assert np.ptp(found, axis=0).max() < 1e-5
    assert tip[1] < -0.4 * LENGTH
    assert found[0, 1, 1:] == pytest.approx(tip, abs=2e-5)


def test_a_torque_twists_by_saint_venants_law() -> None:
    """Torque m g x at the fraction s of the span: twist m g x s L / (G J) there and beyond; small."""
    mass, shear = 4e-3, 1e6
    hidden = Hidden((Effect("lumped_mass", mass, {"span": 0.8, "chord": 0.9}),))
    found = simulate(uniform(), plate(1e9, shear, 0.05), still(1.0, 9.81), hidden, FEW).tracks[0]
    expected = mass * 9.81 * 0.4 * CHORD * 0.8 * LENGTH / (shear * torsion_constant(CHORD, THICKNESS))
    twist = math.asin((found[2, 2] - found[3, 2]) / CHORD)
    assert expected > 0.01
    assert twist == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("ratio", [0.5, 0.97, 1.5])
def test_a_plate_that_flaps_is_a_beam_of_euler_and_bernoulli(ratio: float) -> None:
    """EI w'''' = m omega^2 w with w = 0, w' = angle at the root and a free tip, EI complex by damping.

    ``ratio``: of the frequency to the first natural one, 3.516 sqrt(EI / m) / L^2.
    """
    young, loss, angle = 4e6, 2e-3, 0.002
    natural = 1.8751**2 * math.sqrt(young * EI_OVER_E / LOAD) / LENGTH**2
    omega = ratio * natural
    b = (LOAD * omega**2 / (young * EI_OVER_E * (1 + 1j * omega * loss))) ** 0.25
    z = b * LENGTH
    rows = np.array([
        [1, 0, 1, 0], [0, b, 0, b],
        [-np.cos(z), -np.sin(z), np.cosh(z), np.sinh(z)], [np.sin(z), -np.cos(z), np.sinh(z), np.cosh(z)],
    ])  # fmt: skip
    part = np.linalg.solve(rows, [0, angle, 0, 0])
    places = b * LENGTH * np.array([0.5, 1.0])
    expected = part @ np.array([np.cos(places), np.sin(places), np.cosh(places), np.sinh(places)])
    wing = uniform(angle)
    found = simulate(wing, plate(young, 1e9, loss), still(omega / (2 * math.pi), 0.0), None, FEW).tracks
    series = 2 * np.fft.fft(found[:, :2, 2], axis=0)[1] / len(found)
    assert np.abs(series - expected).max() < 4e-3 * np.abs(expected).max()


def test_a_rigid_wing_turns_about_the_axle() -> None:
    wing, stiff = WINGS["robird"][0], {k: 1e5 * v for k, v in nominal("robird").items() if k[:2] in ("E_", "G_", "D_")}
    found = simulate(wing, nominal("robird") | stiff, replace(THIN, phase_lag=0.0), None, FEW, COARSE).tracks
    rest = np.array([marker.position for marker in wing.markers])
    angle = np.arctan2(found[:, 0, 2], found[:, 0, 1]) - math.atan2(rest[0, 2], rest[0, 1])
    c, s, one = np.cos(angle), np.sin(angle), np.ones(len(angle))
    x, y = np.outer(one, rest[:, 0]), np.outer(c, rest[:, 1]) - np.outer(s, rest[:, 2])
    assert np.ptp(angle) > 0.5
    assert apart(found, np.stack([x, y, np.outer(s, rest[:, 1]) + np.outer(c, rest[:, 2])], axis=2)) < 5e-5


def test_the_method_has_order_three_and_second_stage_order() -> None:
    b = A[-1]
    assert (b.sum(), b @ C, b @ C**2, b @ A @ C) == pytest.approx((1, 1 / 2, 1 / 3, 1 / 6), abs=1e-12)
    assert A.sum(axis=1) == pytest.approx(C, abs=1e-12)
    assert pytest.approx(C**2 / 2, abs=1e-12) == A @ C
    assert len(C) == STAGES


def test_sections_and_mass_are_those_of_the_bodies() -> None:
    """Mass, centre and inertia of the whole wing; the torsion constant of a square and of a strip."""
    for wing, _ in WINGS.values():
        found, (mass, centre, inertia) = beam(wing, nominal("robird"), THIN), Cut(wing, "8x1").bodies
        at = np.einsum("qi,qik->qk", found.part, found.rest[2 * found.element[:, None] + np.arange(3)])
        first = found.mass[:, None] * at + found.moment
        assert found.mass.sum() == pytest.approx(mass.sum(), rel=1e-9)
        assert first.sum(axis=0) == pytest.approx(mass @ centre, rel=1e-4, abs=1e-9)
        y = found.mass @ at[:, 1] ** 2 + 2 * found.moment[:, 1] @ at[:, 1] + found.inertia[:, 0, 0].sum()
        assert y == pytest.approx(mass @ centre[:, 1] ** 2 + inertia[:, 0, 0].sum(), rel=2e-3)
    assert torsion_constant(1.0, 1.0) == pytest.approx(0.1406, abs=1e-4)  # Timoshenko and Goodier, section 109
    assert torsion_constant(0.01, 1e3) == pytest.approx(1e-6 / 3 * 1e3, rel=1e-4)


def test_a_driven_rod_must_reach_the_root() -> None:
    wing = WINGS["robird"][0]
    short = replace(wing, rods=(replace(wing.rods[0], y_root=0.1), *wing.rods[1:]))
    with pytest.raises(ValueError, match="bring it there"):
        beam(short, nominal("robird"), THIN)
    assert Sections(wing, nominal("robird")).borders[-1] == wing.stations[-1].y


# --- convergence ----------------------------------------------------------------------------------------------------


def test_elements_and_steps_are_fine_enough() -> None:
    """The error with the default values; that of the coarse values in the tests below is a third of a millimetre."""
    wing, genome = WINGS["robird"][0], nominal("robird")
    usual = simulate(wing, genome, THIN)
    assert len(usual.tracks) >= 192
    assert apart(usual.tracks, of_rod(THIN)) < 3e-4
    finer = simulate(wing, genome, THIN, None, 24, COARSE).tracks
    assert apart(simulate(wing, genome, THIN, None, 12, COARSE).tracks, finer) < 2e-5
    few = [simulate(wing, genome, THIN, None, FEW, Settings(steps=n)).tracks for n in (256, 768)]
    assert apart(*few) < 3e-5


@pytest.mark.parametrize(
    ("name", "condition", "allowed"),
    # at 32 strips; the rest is about halved with every doubling
    [("robird", THIN, 4e-4), ("robird", STREAM, 4e-4), ("insect", tunnel(0.05, 10.0, 2.5), 4e-4)],
)
def test_bodies_and_springs_tend_to_the_rod(name: str, condition: Condition, allowed: float) -> None:
    rod = of_rod(condition, wing=name)
    rest = [apart(of_bodies(condition, f"{strips}x1", wing=name), rod) for strips in (8, 16, 32)]
    assert rest[1] < 0.8 * rest[0]
    assert rest[2] < 0.8 * rest[1]
    assert rest[2] < allowed


# --- hidden effects -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_changes_the_motion_as_it_does_that_of_bodies(name: str) -> None:
    condition, strength = STREAM if name in IN_STREAM else THIN, KINDS[name].typical
    rod = even(of_rod(condition, name, strength)) - even(of_rod(condition))
    bodies = even(of_bodies(condition, "16x1", name, strength)) - even(of_bodies(condition, "16x1"))
    sizes = [float(np.sqrt(np.sum(x**2))) for x in (rod, bodies)]
    assert np.sum(rod * bodies) > 0.98 * sizes[0] * sizes[1]
    # bodies harden at their borders but not at the root, where a wing bends most
    assert sizes[0] == pytest.approx(sizes[1], rel=0.4 if name == "cubic_stiffness" else 0.06)


def test_an_effect_vanishes_at_zero_strength_and_others_are_refused() -> None:
    assert np.array_equal(of_rod(THIN, "brake"), of_rod(THIN))
    with pytest.raises(ValueError, match="cannot hide 'jet'; it can hide lumped_mass"):
        of_rod(THIN, "jet", 1.0)


def test_a_stop_acts_at_the_phase_at_which_it_does_on_bodies() -> None:
    hidden, wing, genome = Hidden.one("stop", 60.0), WINGS["robird"][0], nominal("robird")
    found = simulate(wing, genome, STREAM, hidden, FEW, COARSE)
    like = simulate_bodies(wing, "16x1", genome, STREAM, hidden)
    assert found.turns["stop"] == pytest.approx(like.turns["stop"], abs=0.02)


def test_a_motion_that_cannot_be_integrated_is_an_error() -> None:
    with pytest.raises(ArithmeticError):
        simulate(WINGS["robird"][0], nominal("robird") | {"E_f": float("nan")}, THIN, None, FEW, COARSE)
