"""Laws that the plant of the vehicle hides, against the effects of the library that have the same name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from benchmarks.concealed.benches.drifting import LAWS as DRIFTS
from benchmarks.concealed.plant.law import Parameters
from benchmarks.concealed.plant.measurement.balance import FAULTS as BALANCE_FAULTS
from benchmarks.concealed.plant.measurement.film import FAULTS as CAMERA_FAULTS
from benchmarks.concealed.plant.vehicle.flow import Flow, mean_chord
from benchmarks.concealed.plant.vehicle.laws import LAWS
from benchmarks.concealed.plant.vehicle.laws_circulation import revolving_drag, revolving_lift, varied
from benchmarks.concealed.plant.vehicle.laws_motion import pitched
from benchmarks.concealed.plant.vehicle.laws_stream import deflected, flown
from benchmarks.concealed.plant.vehicle.simulate import PROPOSED, density, simulate
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS
from benchmarks.concealed.rigs import pair_vehicle
from wingfit.records import Condition, Vehicle
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import TRIALS, blank_recording, delfly

Array = npt.NDArray[np.float64]
Genes = Callable[[Parameters], Mapping[str, float]]

TRUTH = {"C_l": 1.3, "C_r": 1.45, "C_F": 1.5, "C_D0": 0.05, "C_Dpi2": 2.0}
SLOW, FAST = TRIALS[3].condition, TRIALS[7].condition  # 0.65 and 2 m/s
PAIR_FLIGHT = replace(SLOW, airspeed=3.0, flap_frequency=10.0, angle_of_attack=0.5)
NEW = (
    "stroke_bias", "wing_pitch_zero", "wing_pitch_amplitude", "wing_pitch_phase", "elastic_twist", "body_pitch_error",
    "residual_air", "downwash", "wake_tip_loss", "translation", "rotational_circulation", "viscous", "zero_lift_angle",
    "lift_curve", "leading_edge_suction", "stall_vortex", "varying_coefficients", "inertial", "wing_acceleration",
    "added_mass", "added_mass_error", "wing_mass_error", "wing_length_error", "wing_chord_error", "effective_chord",
    "pitch_axis_error", "mass_offset", "body_drag", "tail_lift",
)  # fmt: skip
ALONE = {"rotational_circulation": "rotation"}  # other names of the terms that the library's effects are
# Genes of the library's effects whose meaning differs from the law's, at the values that come nearest.
NEAREST: dict[str, Genes] = {
    "elastic_twist": lambda p: {"compliance": p["strength"]},
    "translation": lambda p: {"coefficient": 1.8 * p["strength"]},  # the largest lift of either
    "viscous": lambda p: {"friction": 0.39 * p["strength"], "pressure": 3.46 * p["strength"]},
    "downwash": lambda p: {"share": p["strength"]},
    "lift_curve": lambda p: {"fourth": p["strength"]},
    "leading_edge_suction": lambda p: {"change": 0.8 * p["strength"]},
    "added_mass_error": lambda p: {"part": p["strength"]},
    "wing_length_error": lambda p: {"part": p["strength"]},
    "wing_chord_error": lambda p: {"part": p["strength"]},
    "pitch_axis_error": lambda p: {"chords": p["strength"]},
    "body_drag": lambda p: {"area": p["strength"], "slender": 1.0},
    "tail_lift": lambda p: {"constant": 0.0, "slope": p["strength"]},
    "varying_coefficients": lambda p: {
        "lift_by_frequency": -p["strength"],
        "lift_by_pitch": p["strength"] * p["by_pitch"],
        "fling_by_frequency": p["strength"] * p["fling"],
        "fling_by_pitch": -p["strength"] * p["by_pitch"] * p["fling"],
    },
    "stall_vortex": lambda p: {  # distances in chords there, in half chords here
        "share": p["strength"],
        "vortex": p["vortex"],
        "chords": p["decay"] / 2,
        "angle": p["angle"] + 0.5 * p["softness"],
        "width": p["softness"],
        "delay": p["layer_lag"] / 2,
        "advance": p["pressure_lag"] / 2,
    },
}
# Laws whose size depends on the condition in another way: stall by the angle of attack, lift of a tail by its incidence
VARIABLE = ("stall_vortex", "tail_lift")


def terms_without(name: str, vehicle: Vehicle) -> tuple[str, ...]:
    absent = {ALONE.get(name, name)} | (set() if vehicle.claps else {"clap_and_peel", "effective_chord"})
    return tuple(term for term in PROPOSED if term not in absent)


def change(name: str, vehicle: Vehicle, condition: Condition, parameters: Parameters) -> Array:
    """Change [400, 2] of the plant's forces (N) by a law."""
    terms = terms_without(name, vehicle)
    with_it = simulate(vehicle, TRUTH, condition, {name: parameters}, terms=terms, instants=400)
    return with_it - simulate(vehicle, TRUTH, condition, terms=terms, instants=400)


def change_in_library(name: str, vehicle: Vehicle, condition: Condition, genes: Mapping[str, float]) -> Array:
    """Change [400, 2] of the model's forces (N) by the library's effect with values of its ``genes``."""
    plain = BladeElementWing(vehicle, terms=terms_without(name, vehicle))
    found = []
    for model in (plain, plain.with_effects(name)):
        assert model is plain or set(genes) <= {gene.name for gene in model.genes}
        values = [genes.get(gene.name, TRUTH.get(gene.name, gene.nominal)) for gene in model.genes]
        found.append(model.beat([values], blank_recording(condition))[0])
    return np.asarray(found[1] - found[0])


def alike(ours: Array, theirs: Array) -> tuple[float, float]:
    """Correlation about zero, and ratio of the sizes."""
    size, other = math.sqrt((ours**2).sum()), math.sqrt((theirs**2).sum())
    return float((ours * theirs).sum() / (size * other)), size / other


def test_every_effect_of_the_library_can_be_hidden() -> None:
    hidden = {name: law.listed for laws in (LAWS, BALANCE_FAULTS, CAMERA_FAULTS, DRIFTS) for name, law in laws.items()}
    hidden |= {name: kind.listed for name, kind in KINDS.items()}
    assert {name for name, listed in hidden.items() if listed} == set(EFFECTS)


@pytest.mark.parametrize("name", NEW)
def test_a_law_is_absent_at_zero_strength_and_has_the_sign_of_its_gene(name: str) -> None:
    law = LAWS[name]
    drawn = law.draw(np.random.default_rng(4)) | {"strength": law.typical}
    assert not change(name, delfly(), SLOW, drawn | {"strength": 0.0}).any()
    cases = [(delfly(), SLOW)]
    if name not in VARIABLE:
        cases += [(delfly(), FAST)] + [(pair_vehicle(), PAIR_FLIGHT)] * (name != "effective_chord")
    for vehicle, condition in cases:
        genes = law.values(drawn) or {f"{name}.{key}": value for key, value in NEAREST[name](drawn).items()}
        ours = change(name, vehicle, condition, drawn)
        correlation, ratio = alike(ours, change_in_library(name, vehicle, condition, genes))
        # the added mass of wings that never come near varies over the beat here, and not in the library
        assert correlation > (0.85 if name == "added_mass_error" and vehicle.name == "pair" else 0.9)
        assert 0.6 < ratio < 1.6
        if law.both_signs and name != "varying_coefficients":
            other = change(name, vehicle, condition, drawn | {"strength": -law.typical})
            assert alike(ours, -other)[0] > 0.9


@pytest.mark.parametrize("name", VARIABLE)
def test_laws_of_another_size_have_the_shape_of_the_librarys(name: str) -> None:
    drawn = LAWS[name].draw(np.random.default_rng(7))
    genes = {f"{name}.{key}": value for key, value in NEAREST[name](drawn).items()}
    ours, theirs = change(name, delfly(), FAST, drawn), change_in_library(name, delfly(), FAST, genes)
    assert alike(ours, theirs)[0] > 0.9


@pytest.mark.parametrize("name", [name for name in NEW if "stall" not in name])
def test_laws_hold_up_to_four_times_the_typical_strength(name: str) -> None:
    drawn = LAWS[name].draw(np.random.default_rng(2), 4.0)
    for vehicle, condition in ((delfly(), SLOW), (delfly(), FAST), (pair_vehicle(), PAIR_FLIGHT)):
        found = change(name, vehicle, condition, drawn)
        nominal = simulate(vehicle, TRUTH, condition, terms=terms_without(name, vehicle), instants=400)
        assert np.isfinite(found).all()
        assert np.abs(found).max() < 12.0 * np.abs(nominal).max()


def a_flow(angle: float, speed: float = 4.0) -> Flow:
    """Elements that fly straight ahead at an angle of attack (rad)."""
    n = 8
    r, chord, none, along = np.array([0.05, 0.1]), np.array([0.08, 0.06]), np.zeros(n), np.zeros((n, 2))
    steady = np.full((n, 2), speed * np.exp(1j * angle))
    t = np.arange(n) / n
    flow = Flow(t, r, chord, 12.0, 1.2, 0.137, none, none, none, none, along, along, along, steady, steady, none, none)
    return replace(flow, met=steady)


def test_lift_and_drag_are_those_of_the_revolving_wing() -> None:
    for degrees, lift, drag in ((45.0, 1.805, 1.704), (-45.0, -1.805, 1.704)):
        flow = a_flow(math.radians(degrees))
        gamma = -0.5 * flow.chord * 4.0 * lift
        np.testing.assert_allclose(revolving_lift(flow, 1.0), np.tile(gamma, (8, 1)), rtol=2e-3)
        np.testing.assert_allclose(revolving_drag(flow, 1.0), drag, rtol=2e-3)


def test_downwash_of_an_elliptic_wing() -> None:
    """C_L / (pi A) against the lift, for the lift that is left, a alpha / (1 + a / (pi A))."""
    vehicle, flow = pair_vehicle(), a_flow(0.1)
    slope, aspect = 2.0 * math.pi, 2.0 * vehicle.span / mean_chord(vehicle)
    gamma = -0.5 * slope * 0.1 * flow.chord * flow.speed
    turned = np.angle(deflected(flow, gamma, vehicle, slope, 1.0))
    left = slope * 0.1 / (1.0 + slope / (math.pi * aspect))
    np.testing.assert_allclose(0.1 - turned, left / (math.pi * aspect), rtol=2e-3)


def test_air_and_pitch_are_as_the_errors_say() -> None:
    air = flown(SLOW, {"body_pitch_error": {"strength": 0.1}, "residual_air": {"strength": 0.03}})
    across = air.airspeed * math.sin(air.angle_of_attack - SLOW.angle_of_attack)
    assert across == pytest.approx(SLOW.airspeed * math.tan(0.1))
    assert density(air) == pytest.approx(density(SLOW) + 0.03)
    pitch = 1.5 + 0.6 * np.sin(2 * np.pi * np.arange(256) / 256)
    late = pitched(pitch, 1.5, {"wing_pitch_phase": {"strength": 0.02}})
    ratio = np.fft.rfft(late)[1] / np.fft.rfft(pitch)[1]
    assert -np.angle(ratio) / (2 * np.pi) == pytest.approx(0.02, rel=0.01)
    wide = pitched(pitch, 1.5, {"wing_pitch_amplitude": {"strength": 0.1}, "wing_pitch_zero": {"strength": 0.05}})
    np.testing.assert_allclose(np.sin((wide - 1.55) / 2), 1.1 * np.sin((pitch - 1.5) / 2), atol=1e-12)


def test_coefficients_vary_with_frequency_and_pitch() -> None:
    law = {"strength": 2.0, "by_pitch": 0.1, "fling": 0.5}
    at = replace(SLOW, flap_frequency=24.0, angle_of_attack=1.0)
    assert varied({"C_l": 1.0, "C_F": 1.0, "C_r": 1.0}, at, law) == pytest.approx({"C_l": 0.25, "C_F": 2.0, "C_r": 1.0})
    assert varied({"C_l": 1.0}, replace(at, flap_frequency=12.0), law) == pytest.approx({"C_l": 1.0})
    tilted = varied({"C_l": 1.0}, replace(at, flap_frequency=12.0, angle_of_attack=1.5), law)
    assert tilted["C_l"] == pytest.approx(math.exp(0.1))
