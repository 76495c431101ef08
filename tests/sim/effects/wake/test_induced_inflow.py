"""Momentum theory: the downwash of a steady lift, how fast it grows, and what it does to the lift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.effects.flown import DELFLY, FOURIER, flown
from tests.sim.effects.moved import Motion, Moved
from tests.sim.kernels.marching import LENGTH
from tests.sim.vehicle.vehicles import recording
from wingfit.sim.effects.library.wake.induced_inflow import slices
from wingfit.sim.effects.ports.vehicle import Setting, VehicleScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import CIRCULATION, NORMAL_X, STREAM_C, STREAM_N

Array = npt.NDArray[np.float64]

AIRSPEED = 6.0
PLAIN = {"L_a": 5.0, "L_b": 0.0}
STRIPS = 6


def steady(share: npt.ArrayLike, pitch: float = 0.1, airspeed: npt.ArrayLike = AIRSPEED, seconds: float = 4.0) -> Moved:
    """A wing that has been at an angle of attack for long."""
    moved = Moved("induced_inflow", {"share": share}, airspeed=airspeed, strips=STRIPS, genes=PLAIN)
    moved.march(lambda _: Motion(pitch=pitch), 0.01, int(seconds / 0.01))
    moved.rate(Motion(pitch=pitch), moved.z)
    return moved


def lifts(moved: Moved) -> Array:
    """Lift of the strips over the density [S, 3, W], m^4/s^2, in the world."""
    flow, area = moved.work.flow, moved.structure.wiring.geometry[:, 0]
    normal, chord = flow[:, NORMAL_X : NORMAL_X + 3], flow[:, :3]
    along, across = flow[:, STREAM_C][:, None], flow[:, STREAM_N][:, None]
    return np.asarray(
        0.5 * area[:, None, None] * moved.work.loads[:, CIRCULATION][:, None] * (along * normal - across * chord)
    )


def test_the_downwash_is_that_of_momentum_theory() -> None:
    """Of every strip: lift = 2 rho A |U + v| v, with the slice of a disc as A (Glauert 1926)."""
    share = np.array([0.2, 0.5, 1.0, 1.0, 1.0, 1.5, 2.0, 2.0])
    moved = steady(share, airspeed=np.array([6.0, 6.0, 6.0, 2.0, 11.0, 6.0, 6.0, 3.0]))
    v = moved.z.reshape(3, STRIPS, LANES).swapaxes(0, 1)
    through = np.linalg.norm(v + moved.here.wind, axis=1)
    area = slices(np.linspace(0.0, LENGTH, STRIPS + 1))[:, None, None]
    np.testing.assert_allclose(2 * area * through[:, None] * v, -share * lifts(moved), rtol=1e-6, atol=1e-9)
    assert np.all(v[:, 2] < 0), "lift goes with downwash"


def test_an_elliptic_load_has_even_inflow_of_a_lifting_line() -> None:
    """Slices that are in proportion to an elliptic chord, in all half a disc: v / U = C_L / (pi AR)."""
    edges = np.linspace(0.0, 0.5, 41)
    middle = 0.5 * (edges[1:] + edges[:-1])
    np.testing.assert_allclose(slices(edges).sum(), 0.5 * np.pi * 0.5**2, rtol=1e-12)
    elliptic = 0.1 * np.sqrt(1 - (middle / 0.5) ** 2) * np.diff(edges)  # areas of the strips of a wing
    even = (elliptic / slices(edges))[:-2]
    np.testing.assert_allclose(even, even[0], rtol=2e-3)
    area = 2 * np.pi * 0.1 * 0.5 / 4  # with its image, of span 1
    assert even[0] / 4 == pytest.approx(1 / (np.pi * 1.0**2 / area), rel=1e-3)  # v / U = c_l S / (4 A) of a strip


def test_it_grows_with_the_time_of_the_apparent_mass() -> None:
    """Of a small lift: tau = m / (2 rho A U), m / (rho A) = 8 R / (3 pi), in parts of ``inertia``."""
    inertia = np.geomspace(0.1, 3.0, LANES)
    moved = Moved("induced_inflow", {"share": 1e-6, "inertia": inertia}, airspeed=AIRSPEED, strips=STRIPS, genes=PLAIN)
    motion = Motion(pitch=0.1)
    history = moved.march(lambda _: motion, 5e-4, 401)
    down = history.z[:, 2 * STRIPS]
    final = moved.rate(motion, 0.0 * moved.z)[2 * STRIPS] * (tau := 8 * LENGTH / (3 * np.pi) * inertia / (2 * AIRSPEED))
    t = 5e-4 * np.arange(401)[:, None]
    np.testing.assert_allclose(down, final * -np.expm1(-t / tau), rtol=1e-4, atol=1e-12)


def test_it_takes_lift_and_the_more_the_slower_the_stream() -> None:
    lift = lifts(steady(np.repeat([1e-9, 1.0], 4), airspeed=np.tile([11.0, 6.0, 3.0, 1.0], 2))).sum(axis=0)[2]
    assert np.all(lift[4:] < 0.95 * lift[:4])
    ratio = lift[4:] / lift[:4]
    np.testing.assert_allclose(ratio, ratio[0], rtol=0.05)  # the angle is what sets v / U
    bent = steady(np.repeat([1e-9, 1.0], 4))
    tilted = lifts(bent).sum(axis=0)[0]
    assert np.all(tilted[4:] > tilted[:4] + 1e-6), "the lift leans back: induced drag"


def test_in_still_air_it_is_that_of_hover() -> None:
    """Without a stream |v| v = lift / (2 rho A)."""
    moved = Moved("induced_inflow", {"share": 1.0}, strips=STRIPS, genes=PLAIN)
    fall = Motion(heave_rate=-0.5, pitch=-1.0)
    moved.march(lambda _: fall, 0.05, 800)
    moved.rate(fall, moved.z)
    v = moved.z.reshape(3, STRIPS, LANES).swapaxes(0, 1)
    area = slices(np.linspace(0.0, LENGTH, STRIPS + 1))[:, None, None]
    expected = -lifts(moved) / (2 * area)
    np.testing.assert_allclose(np.linalg.norm(v, axis=1, keepdims=True) * v, expected, rtol=2e-3)
    assert np.abs(v).max() > 1e-3


def test_decay_is_the_states_own_derivative() -> None:
    """But for the lift that the inflow takes, whose coupling the step does without."""
    moved = Moved("induced_inflow", {"share": 1e-9}, airspeed=AIRSPEED)
    described, found = moved.decay(Motion(pitch=0.1), moved.z + np.linspace(-2.0, 2.0, LANES))
    np.testing.assert_allclose(described, found, rtol=1e-5)


@pytest.mark.parametrize("terms", [("inertial",), ("added_mass",), ("inertial", "added_mass", "effective_chord")])
def test_the_added_mass_moves_with_the_air_that_a_wing_meets(terms: tuple[str, ...]) -> None:
    """As in a faster stream along the body, whose forces the elements of a wing without mass have."""
    vehicle = replace(DELFLY, velocities="mirrored", motion=FOURIER, wing_mass=0.0, dihedral=0.2)
    slow, fast = recording(12.5, 1.0), recording(12.5, 1.7)
    stream = flown(vehicle, fast, terms) - flown(vehicle, slow, terms)
    r = (np.arange(40) + 0.5) / 40 * vehicle.span
    scene = VehicleScene.of(Setting(vehicle, terms, FOURIER, slow.condition, len(stream), 0.0, r), {}, 1)
    scene.carry(np.full((1, len(stream), 8), 0.7))
    assert np.abs(stream).max() > 1e-4
    np.testing.assert_allclose(scene.added[0].T, stream, atol=5e-3 * np.abs(stream).max())


def test_an_inflow_that_grows_with_the_radius_acts_on_the_added_mass() -> None:
    """The force of the effect is that of the changed flow and that of the added mass in the air it moves."""
    vehicle, rec = replace(DELFLY, velocities="mirrored", motion=FOURIER), recording(12.5, 0.5, 1.0)
    terms = ("translation", "inertial", "added_mass")
    r = (np.arange(40) + 0.5) / 40 * vehicle.span
    setting = Setting(vehicle, terms, FOURIER, rec.condition, 400, 0.0, r)
    scene, other = (VehicleScene.of(setting, {"C_l": np.array([1.5])}, 1) for _ in range(2))
    effect = EFFECTS["induced_inflow"]
    assert effect.vehicle is not None
    given = {"share": 1.0, "inertia": 1.0, "outward": 1.0}
    effect.vehicle(scene, {name: np.array([value]) for name, value in given.items()})
    scene.settle()
    cosine, sine = scene.wings.turns
    moved = (scene.flow.along - other.flow.along)[0] * sine + (scene.flow.normal - other.flow.normal)[0] * cosine
    other.carry(moved)  # air along body x
    assert np.abs(other.added).max() > 1e-3
    np.testing.assert_allclose(scene.added, other.added, rtol=1e-9, atol=1e-12)
