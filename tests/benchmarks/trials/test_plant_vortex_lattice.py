from __future__ import annotations

import math
import os
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import hankel2

from benchmarks.concealed.plant.law import Concealed
from benchmarks.concealed.plant.vehicle.simulate import BERMAN_WANG, Motion, density, motion_of
from benchmarks.concealed.plant.vehicle.simulate import _flow as blade_element_flow
from benchmarks.concealed.plant.vehicle.simulate import simulate as blade_elements
from benchmarks.concealed.plant.vortex_lattice.simulate import (
    EFFECTS,
    LAWS,
    REMEDY,
    VARIABLE,
    Resolution,
    forces_of,
    request_for,
    resampled,
    simulate,
    wing_inertia,
)
from benchmarks.concealed.plant.vortex_lattice.vehicle import flights, ornithopter
from benchmarks.concealed.plant.vortex_lattice.worker import Request, euler
from wingfit.records import Vehicle
from wingfit.sim.effects.registry import EFFECTS as LIBRARY
from wingfit.sim.virtual_rigs.balance import delfly

Array = npt.NDArray[np.float64]

AIR = flights()[3]
TINY = Resolution(span=4, chord=2, steps=(12, 12))
needs_it = pytest.mark.skipif(not os.environ.get(VARIABLE), reason=f"{VARIABLE} is not set: {REMEDY}")


def motion(vehicle: Vehicle, instants: int = 48) -> Motion:
    return motion_of(vehicle, AIR.flap_frequency, instants, {})


def body(values: Array) -> Array:
    """In body axes (x forward, z down) from geometry axes (x aft, z up); the last axis has x, y, z."""
    return np.asarray(values * np.array([-1.0, 1.0, -1.0]))


def off(ours: Array, theirs: Array) -> Array:
    return np.asarray(np.sqrt(((ours - theirs) ** 2).mean(axis=0) / (theirs**2).mean(axis=0)))


@pytest.mark.parametrize("hidden", [{}, {"wing_pitch_phase": {"strength": 0.03}, "stroke_bias": {"strength": 0.05}}])
def test_both_plants_move_the_wing_alike(hidden: Concealed) -> None:
    vehicle = replace(ornithopter(), motion=replace(ornithopter().motion, root_pitch=1.45))
    request = Request.of(request_for(vehicle, AIR, hidden))
    n = len(request.down)
    moved = motion_of(vehicle, AIR.flap_frequency, n, hidden)
    flow = blade_element_flow(vehicle, AIR, moved, request.r, request.chord, 1.0)
    edges = [request.edges(step) for step in range(n)]
    lead, axes = np.array([body(one[0]) for one in edges]), np.array([body(one[1]) for one in edges])
    axis = lead + request.pitch_axis * request.chord[:, None] * axes[:, :, 0]
    spectrum = 2j * np.pi * np.arange(n // 2 + 1)[:, None, None] * AIR.flap_frequency * np.fft.rfft(axis, axis=0)
    velocity = np.fft.irfft(spectrum, n, axis=0)
    down = request.down[:, None]
    normal = np.stack([np.zeros((n, 1)), -np.sin(down), np.cos(down)], axis=-1)
    np.testing.assert_allclose((velocity * normal).sum(axis=-1), flow.rate[:, None] * request.r, atol=1e-5)
    forward = -axes[:, 1:, 0]  # the chord at the root does not follow the flap angle
    np.testing.assert_allclose(forward[:, :, 0], np.sin(flow.theta[:, 1:]), atol=1e-9)
    np.testing.assert_allclose((forward * normal).sum(axis=-1), np.cos(flow.theta[:, 1:]), atol=1e-9)


def test_the_vehicle_flies_at_angles_of_attack_with_attached_flow() -> None:
    vehicle, r = ornithopter(), np.linspace(0.05, 0.35, 7)
    for air in flights():
        flow = blade_element_flow(vehicle, air, motion_of(vehicle, air.flap_frequency, 60, {}), r, 0.1 + 0.0 * r, 1.0)
        met = flow.turned(flow.own)
        alpha = np.degrees(np.arctan2(-met.imag, met.real))
        assert np.abs(alpha).max() < 16.0
        assert 0.1 < np.pi * air.flap_frequency * 0.0945 / air.airspeed < 0.5


def test_euler_angles_give_the_axes_back() -> None:
    turn = Rotation.from_euler("XYZ", [20.0, -35.0, 50.0], degrees=True)
    np.testing.assert_allclose(euler(turn.as_matrix().T), [20.0, -35.0, 50.0])


def test_the_printed_inertia_is_that_of_the_blade_element_plant() -> None:
    vehicle, none = ornithopter(), {"C_l": 0.0, "C_r": 0.0, "C_D0": 0.0, "C_Dpi2": 0.0}
    theirs = blade_elements(vehicle, none, replace(AIR, pressure=1e-6), terms=BERMAN_WANG, instants=48)
    np.testing.assert_allclose(wing_inertia(vehicle, AIR, motion(vehicle)), theirs, atol=1e-5)


def test_the_acceleration_is_the_second_derivative_of_the_position() -> None:
    vehicle, n = ornithopter(), 240
    r = np.linspace(0.0, vehicle.span, 20001)
    chord = np.interp(r, [s.r for s in vehicle.stations], [s.chord for s in vehicle.stations])
    moment = 2.0 * vehicle.wing_mass * np.trapezoid(chord * r, r) / np.trapezoid(chord, r)
    z = moment * np.sin(motion(vehicle, n).flap[0] - vehicle.dihedral)
    numerical = -(np.roll(z, -1) - 2.0 * z + np.roll(z, 1)) * (n * AIR.flap_frequency) ** 2
    ours = wing_inertia(vehicle, AIR, motion(vehicle, n), "acceleration")
    np.testing.assert_allclose(ours[:, 1], numerical, atol=2e-3 * np.abs(numerical).max())
    assert not ours[:, 0].any()


@pytest.mark.parametrize("name", EFFECTS)
def test_laws_are_in_the_library_and_change_the_request(name: str) -> None:
    law = LAWS[name]
    drawn = law.draw(np.random.default_rng(3))
    assert law.listed
    for gene in law.values(drawn):
        assert gene.split(".")[0] == name
        assert gene.split(".")[1] in {one.name for one in LIBRARY[name].size}
    assert request_for(ornithopter(), AIR, {name: drawn}) != request_for(ornithopter(), AIR)
    assert request_for(ornithopter(), AIR, {name: {"strength": 0.0}}) == request_for(ornithopter(), AIR)


def test_the_stream_changes_as_described() -> None:
    request = request_for(ornithopter(), AIR, {"airspeed_error": {"strength": 0.1}, "residual_air": {"strength": 0.06}})
    assert request["airspeed"] == pytest.approx(AIR.airspeed * math.sqrt(1.2))
    assert request["density"] == pytest.approx(density(AIR) + 0.06)
    turned = request_for(ornithopter(), AIR, {"body_pitch_error": {"strength": 0.05}})
    assert turned["incidence"] == pytest.approx(AIR.angle_of_attack + 0.05)


def test_what_cannot_be_simulated_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing called 'tip_loss'"):
        simulate(ornithopter(), AIR, {"tip_loss": {"strength": 0.2}})
    with pytest.raises(ValueError, match="pair of wings"):
        simulate(delfly(), AIR)
    with pytest.raises(ValueError, match="needs a stream"):
        simulate(ornithopter(), replace(AIR, airspeed=0.0))


@pytest.mark.parametrize("python", ["", "/no/such/python", sys.executable])
def test_an_absent_interpreter_or_package_gives_a_remedy(monkeypatch: pytest.MonkeyPatch, python: str) -> None:
    monkeypatch.setenv(VARIABLE, python)
    with pytest.raises(RuntimeError, match=f"pterasoftware.*{VARIABLE}"):
        simulate(ornithopter(), AIR)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"extra": 1}, "has the fields"),
        ({"airspeed": 0.0}, "airspeed is 0"),
        ({"r": [0.0, 0.2, 0.1], "chord": [0.1, 0.1, 0.1]}, "increase"),
        ({"pitch": [1.5]}, "one value per edge"),
        ({"down": [0.0], "pitch": [1.5]}, "at least 4"),
        ({"down": [math.nan] * 4, "pitch": [1.5] * 4}, "finite"),
    ],
)
def test_a_wrong_request_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Request.of(request_for(ornithopter(), AIR, None, TINY) | change)


def test_resampling_keeps_a_periodic_force() -> None:
    t = np.arange(30) / 30
    fine = np.arange(120) / 120
    both = [np.stack([np.cos(2 * np.pi * s), np.sin(4 * np.pi * s) - 1.0], axis=1) for s in (t, fine)]
    np.testing.assert_allclose(resampled(both[0], 120), both[1], atol=1e-12)


def rectangle(ratio: float, panels: int, steps: int, span: int, frequency: float) -> dict[str, Any]:
    """Request for a wing of 0.1 m chord and aspect ``ratio``, at rest in a stream of 6 m/s."""
    edges = 0.05 * ratio * np.sin(0.5 * np.pi * np.arange(span + 1) / span)
    return {
        "r": edges.tolist(), "chord": [0.1] * len(edges), "pitch_axis": 0.25, "down": [0.0] * steps,
        "pitch": [math.pi / 2] * steps, "root_pitch": math.pi / 2, "frequency": frequency, "density": 1.2,
        "airspeed": 6.0, "incidence": 0.0, "panels": panels, "beats": 3, "wake": 2.5, "free": False,
    }  # fmt: skip


@needs_it
@pytest.mark.parametrize("ratio", [3.0, 10.0])
def test_a_wing_at_rest_has_the_lift_slope_of_helmbold(ratio: float) -> None:
    alpha = math.radians(4.0)
    request = rectangle(ratio, 4, 20, 8, 6.0 / 0.1 / 10.0) | {"incidence": alpha}
    x, z = forces_of(request)[-1] / (0.5 * 1.2 * 6.0**2 * 0.01 * ratio)
    lift, drag = x * math.sin(alpha) - z * math.cos(alpha), -x * math.cos(alpha) - z * math.sin(alpha)
    assert lift / alpha == pytest.approx(2 * math.pi * ratio / (2 + math.sqrt(4 + ratio**2)), rel=0.04)
    assert drag == pytest.approx(lift**2 / (math.pi * ratio), rel=0.12)


@needs_it
def test_a_heaving_wing_has_the_lift_of_theodorsen() -> None:
    ratio, k, half, speed = 40.0, 0.3, 0.05, 6.0
    omega = k * speed / half
    swing = 0.02 / (ratio * half)
    found = []
    for finer in (1, 2):
        steps = finer * 31
        request = rectangle(ratio, 3 * finer, steps, 8, omega / (2 * np.pi)) | {"beats": 2, "wake": 2.0}
        request["down"] = (swing * np.cos(2 * np.pi * np.arange(steps) / steps)).tolist()
        found.append(2.0 * np.fft.rfft(forces_of(request)[:, 1])[1] / steps)
    theodorsen = hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k))
    heave = swing * (ratio * half) ** 2  # integral over both wings
    wanted = -2j * np.pi * 1.2 * speed * half * theodorsen * omega * heave + np.pi * 1.2 * half**2 * omega**2 * heave
    ratio_found = (2.0 * found[1] - found[0]) / wanted
    assert abs(ratio_found) == pytest.approx(1.0, abs=0.06)
    assert abs(np.degrees(np.angle(ratio_found))) < 5.0


@needs_it
def test_forces_agree_with_blade_elements_but_for_the_wake() -> None:
    vehicle, air = ornithopter(), flights()[5]
    ours = simulate(vehicle, air)
    ratio = 2 * vehicle.span / 0.0945
    lift = math.pi * ratio / (2 + math.sqrt(4 + ratio**2))
    quasi_steady = {"C_l": lift, "C_r": 2.0 * lift, "C_D0": 0.0, "C_Dpi2": 0.0}
    theirs = blade_elements(vehicle, quasi_steady, air, terms=BERMAN_WANG, instants=120)
    x, z = off(theirs, ours)
    assert x < 0.55  # no induced drag
    assert 0.1 < z < 0.3  # no lag of the circulation
    late = {"circulation_lag": {"strength": 0.75}}
    lagging = blade_elements(vehicle, quasi_steady, air, late, terms=BERMAN_WANG, instants=120)
    assert (off(lagging, ours) < 0.6 * off(theirs, ours)).all()
    assert np.sign(ours.mean(axis=0)).tolist() == [1.0, -1.0]  # thrust, and lift
    assert ours.mean(axis=0)[1] == pytest.approx(theirs.mean(axis=0)[1], rel=0.1)
    coarse = simulate(vehicle, air, resolution=Resolution(span=6, chord=2, steps=(20, 80)))
    assert (off(coarse, ours) < 0.03).all()


@needs_it
def test_the_same_request_gives_the_same_forces_in_proportion_to_the_density() -> None:
    request = request_for(ornithopter(), AIR, None, TINY)
    once = forces_of(request)
    np.testing.assert_array_equal(forces_of(request), once)
    thin = forces_of(request | {"density": 0.5 * density(AIR)})
    np.testing.assert_allclose(thin, 0.5 * once, rtol=1e-9)


@needs_it
def test_an_unsettled_force_is_refused() -> None:
    request = request_for(ornithopter(), AIR, None, TINY) | {"beats": 1}
    with pytest.raises(RuntimeError, match="simulate more beats"):
        forces_of(request)
