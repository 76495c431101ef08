"""The flow at the stations against the elements, and the states that follow it against closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.vehicle.vehicles import COEFFICIENTS, DELFLY, angles, genome, recording
from wingfit.sim.effects.ports.vehicle import Setting, VehicleScene
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.states import followed, separate, settled_inflow, steady_attachment
from wingfit.sim.vehicle.stations import stations
from wingfit.sim.vehicle.terms import PRESETS

Array = npt.NDArray[np.float64]

STEP = 1e-3


def scene_of(model: BladeElementWing, values: dict[str, float], speed: float = 0.5, pitch: float = 1.2) -> VehicleScene:
    """One individual, without effects."""
    rec = recording(12.5, speed, pitch)
    genes = {gene.name: np.array([value]) for gene, value in zip(model.genes, genome(model, **values), strict=True)}
    setting = Setting(
        model.vehicle, model.terms, model.vehicle.motion, rec.condition, model.instants, 0.0, model._span[0]
    )
    return VehicleScene.of(setting, genes, 1)


def test_weights_integrate_cubics() -> None:
    places = stations(DELFLY, DELFLY.motion)
    assert np.all(places.weight > 0)
    for k in range(4):
        assert places.weight @ places.r**k == pytest.approx(DELFLY.span ** (k + 1) / (k + 1), rel=1e-12)
    assert places.weight @ places.mass == pytest.approx(1.0, rel=5e-3)


@pytest.mark.parametrize("velocities", ["mirrored", "printed"])
@pytest.mark.parametrize("preset", ["proposed", "berman_wang", "dickinson"])
def test_forces_are_those_of_the_elements(preset: str, velocities: Literal["mirrored", "printed"]) -> None:
    vehicle = replace(DELFLY, velocities=velocities, dihedral=0.1)
    model = BladeElementWing(vehicle, PRESETS[preset].terms)
    given = {name: value for name, value in COEFFICIENTS.items() if name in [gene.name for gene in model.genes]}
    scene = scene_of(model, given)
    parts = model.term_forces(genome(model, **given), recording(12.5, 0.5, 1.2))
    flow_terms = ("translation", "rotation", "clap_and_peel", "viscous", "steady_curves")
    expected = np.sum([parts[name] for name in flow_terms if name in parts], axis=0)
    found = scene.wings.forces(scene.flow)[0].T
    assert np.abs(found - expected).max() < (5e-3 if preset != "dickinson" else 0.015) * np.abs(expected).max()


def test_faster_stream_is_more_thrust_as_a_faster_flight() -> None:
    """An inflow that never changes is a faster flight along body x."""
    model = BladeElementWing(DELFLY)
    scene, faster = scene_of(model, COEFFICIENTS, 0.5, 0.0), scene_of(model, COEFFICIENTS, 0.9, 0.0)
    assert scene.wings.forces(scene.wings.flow(scene.forward(np.full((1, 400), 0.4)))) == pytest.approx(
        faster.wings.forces(faster.flow), abs=1e-12
    )


def follow(speed: Array, share: float, target: Array) -> Array:
    """The kernel for one side, one individual and eight equal stations; all [n]."""
    out = np.empty((1, 1, len(target), 8))
    lanes = [np.repeat(a[None, None, :, None], 8, axis=3).copy() for a in (speed, target)]
    followed(lanes[0], np.full((1, 8), share), lanes[1], STEP, out)
    assert np.ptp(out, axis=3).max() == 0
    return np.asarray(out[0, 0, :, 0])


def test_a_state_lags_a_sine_as_a_first_order_low_pass() -> None:
    n, V, share = 400, 5.0, 2.0
    psi = 2 * np.pi * np.arange(n) / n
    omega = 2 * np.pi / (n * STEP)
    response = 1.0 / (1.0 + 1j * omega / (V * share))
    found = follow(np.full(n, V), share, 0.3 + np.cos(psi))
    assert found == pytest.approx(0.3 + (response * np.exp(1j * psi)).real, abs=3e-5)


def test_a_state_is_periodic_with_a_rate_that_varies() -> None:
    """Marching the equation through one more beat with a hundred times finer steps ends where it began."""
    n = 64
    psi = 2 * np.pi * np.arange(n) / n
    speed, target = 3.0 + 2.9 * np.cos(psi), np.sin(psi) + 0.5 * np.cos(3 * psi)
    found = follow(speed, 4.0, target)
    grid = np.arange(n * 100) / 100
    rates, targets = (np.interp(grid + 0.005, np.arange(n + 1), np.append(a, a[0])) for a in (speed, target))
    rates = np.repeat(0.5 * (speed + np.roll(speed, -1)), 100)
    x, marched = found[0], []
    for k in range(len(grid)):
        if k % 100 == 0:
            marched.append(x)
        x = targets[k] + (x - targets[k]) * np.exp(-4.0 * rates[k] * STEP / 100)
    assert x == pytest.approx(found[0], abs=1e-5)
    assert found == pytest.approx(np.array(marched), abs=1e-5)


def test_in_still_air_a_state_keeps_the_mean() -> None:
    psi = 2 * np.pi * np.arange(80) / 80
    assert follow(np.zeros(80), 2.0, 0.7 + np.cos(psi)) == pytest.approx(0.7, abs=1e-6)
    assert follow(np.full(80, 1e6), 2.0, np.cos(psi)) == pytest.approx(np.cos(psi), abs=0.1)  # no overshoot


def turning_flow(n: int) -> tuple[Array, Array, Array]:
    """Velocities [1, 1, n, 8] of a wing whose angle of attack runs through more than a turn."""
    psi = 2 * np.pi * np.arange(n) / n
    angle = psi[:, None] + 0.5 * np.sin(psi[:, None] + np.arange(8))
    speed = 2.0 + np.cos(psi[:, None] - np.arange(8))
    along, normal = speed * np.cos(angle), speed * np.sin(angle)
    return along[None, None], normal[None, None], speed[None, None]


def test_attachment_at_rest() -> None:
    """1 / (1 + exp((alpha - angle) / width)), in the four quadrants."""
    along, normal, speed = turning_flow(400)
    out, chord = np.empty_like(speed), np.full((1, 8), 0.05)
    alpha = np.arctan2(np.abs(normal), np.abs(along))
    for width in (0.02, 0.1, 0.3):
        steady_attachment(along, normal, speed, chord, np.array([[0.4, width, 0.0]]), STEP, out)
        assert out == pytest.approx(1 / (1 + np.exp((alpha - 0.4) / width)), abs=2e-6)


def test_attachment_comes_late_where_the_angle_rises() -> None:
    along, normal, speed = turning_flow(4000)
    out, chord = np.empty_like(speed), np.full((1, 8), 0.05)
    alpha = np.arctan2(np.abs(normal), np.abs(along))
    rate = (np.roll(alpha, -1, axis=2) - np.roll(alpha, 1, axis=2)) / (2 * STEP)
    smooth = np.abs(np.roll(rate, -1, axis=2) - np.roll(rate, 1, axis=2)) < 0.1 * np.abs(rate).max()  # not at a fold
    steady_attachment(along, normal, speed, chord, np.array([[0.4, 0.1, 3.0]]), STEP, out)
    expected = 1 / (1 + np.exp((alpha - 3.0 * chord / speed * rate - 0.4) / 0.1))
    assert out[smooth] == pytest.approx(expected[smooth], abs=1e-4)
    assert smooth.mean() > 0.9


def test_lift_after_separation() -> None:
    """Kirchhoff: all of it attached leaves all, none of it a quarter; and all of what is of rotation."""
    attached = np.array([1.0, 0.0, 0.25, -1e-9])[None, None, :, None] * np.ones(8)
    found, rotation = np.full_like(attached, 2.0), np.zeros((1, 4, 8))
    separate(attached, np.array([1.0]), rotation, found)
    assert found[0, 0, :, 0] == pytest.approx([2.0, 0.5, 1.125, 0.5])
    found[:] = 2.0
    separate(attached, np.array([0.5]), rotation, found)
    assert found[0, 0, 1, 3] == pytest.approx(1.25)
    found[:], rotation[:] = 2.0, [[-1.0], [-1.0], [2.0], [3.0]]
    separate(attached, np.array([1.0]), rotation, found)
    assert found[0, 0, :, 5] == pytest.approx([2.0, -0.25, 2.0, 2.75])


def inflow(force: Array, slope: Array, mass: float, stream: tuple[float, float]) -> Array:
    out = np.empty((1, len(force)))
    settled_inflow(force[None], slope[None], np.array([0.1]), np.array([mass]), np.array([stream]), STEP, out)
    return np.asarray(out[0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_steady_inflow_is_that_of_momentum_theory(sign: float) -> None:
    """Hover: F v |v| = T. In fast flight across the disc: F U v = T. With a slope: T - s v."""
    n, none = 80, np.zeros(80)
    assert inflow(np.full(n, sign * 0.4), none, 0.01, (0.0, 0.0)) == pytest.approx(sign * 2.0, rel=1e-2)
    assert inflow(np.full(n, sign * 0.4), none, 0.01, (0.0, 40.0)) == pytest.approx(sign * 0.1, rel=1e-3)
    fast = inflow(np.full(n, sign * 0.4), np.full(n, 4.0), 0.01, (0.0, 40.0))
    assert fast == pytest.approx(sign * 0.05, rel=1e-3)


def test_inflow_follows_the_force_through_its_mass() -> None:
    """Small ripples pass a first-order low-pass with the time m / (F V_T + s)."""
    n, mass = 400, 0.02
    psi = 2 * np.pi * np.arange(n) / n
    found = inflow(0.4 + 0.1 * np.cos(psi), np.full(n, 0.05), mass, (0.3, 30.0))
    mean = found.mean()
    through = 0.1 * np.hypot(0.3 + mean, 30.0) + 0.05
    assert mean == pytest.approx(0.4 / through, rel=1e-4)
    response = 0.1 / (through + 1j * mass * 2 * np.pi / (n * STEP))
    assert found - mean == pytest.approx((response * np.exp(1j * psi)).real, abs=1e-4 * abs(response))


def test_hover_is_solved_exactly() -> None:
    """The mean of m v' + F |mean v| v = f is that of the force, whatever the mass."""
    psi = 2 * np.pi * np.arange(400) / 400
    found = inflow(0.4 * (1 + np.cos(psi)), np.zeros(400), 0.05, (0.0, 0.0))
    assert found.mean() == pytest.approx(2.0, rel=1e-4)


def test_angles_of_the_scene_are_those_of_the_model() -> None:
    model = BladeElementWing(DELFLY)
    scene = scene_of(model, {})
    assert np.array_equal(scene.angles.pitch, angles(DELFLY.motion, {}, 12.5, 400, claps=True).pitch)
    with pytest.raises(ValueError, match="read-only"):
        scene.flap[:, 0] += 0.1
