from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.special import hankel2

from benchmarks.concealed.plant.vehicle.laws import CIRCULATION, LAWS, Flow, disc_inflow, levered, tip
from benchmarks.concealed.plant.vehicle.simulate import BERMAN_WANG, PROPOSED, density, simulate
from wingfit.records import Condition, FourierFlap, FourierPitch, Vehicle
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import chosen
from wingfit.sim.virtual_rigs.balance import DRAG, TRIALS, blank_recording, delfly

Array = npt.NDArray[np.float64]

WITHIN = 0.002  # of the root mean square of either axis
AIR = TRIALS[3].condition
TRUTH = {"C_l": 1.3, "C_r": 1.45, "C_F": 1.5, "C_D0": 0.05, "C_Dpi2": 2.0}


def of_the_model(vehicle: Vehicle, condition: Condition, preset: str, coefficients: dict[str, float]) -> Array:
    model = BladeElementWing(vehicle, terms=chosen(preset))
    values = {gene.name: coefficients.get(gene.name, gene.nominal) for gene in model.genes}
    return np.asarray(model.beat([list(values.values())], blank_recording(condition))[0])


def off(ours: Array, theirs: Array) -> Array:
    return np.asarray(np.sqrt(((ours - theirs) ** 2).mean(axis=0) / (theirs**2).mean(axis=0)))


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("trial", TRIALS, ids=lambda trial: trial.name)
@pytest.mark.parametrize(("preset", "terms"), [("proposed", PROPOSED), ("berman_wang", BERMAN_WANG)])
def test_the_nominal_forces_are_those_of_the_model(trial: object, preset: str, terms: tuple[str, ...]) -> None:
    assert hasattr(trial, "condition")
    assert hasattr(trial, "coefficients")
    coefficients = DRAG | trial.coefficients
    ours = simulate(delfly(), coefficients, trial.condition, terms=terms, instants=400)
    assert (off(ours, of_the_model(delfly(), trial.condition, preset, coefficients)) < WITHIN).all()


@pytest.mark.parametrize("layout", ["x4", "pair", "single"])
def test_other_layouts_agree_too(layout: str) -> None:
    flap, pitch = FourierFlap(0.4, (-0.38, 0.02), (0.0, 0.03)), FourierPitch(1.5, (0.1,), (-0.7, 0.05))
    motion = replace(delfly().motion, flap=flap, pitch=pitch, root_pitch=1.4)
    other = replace(delfly(), motion=motion, dihedral=0.2, pitch_axis=0.25, thickness=5e-3)
    other = replace(other, layout=layout, claps=layout == "x4")  # type: ignore[arg-type]
    terms = tuple(t for t in PROPOSED if layout == "x4" or t not in {"clap_and_peel", "effective_chord"})
    ours = simulate(other, TRUTH, AIR, terms=terms, instants=400)
    theirs = of_the_model(other, AIR, "proposed" if layout == "x4" else "berman_wang", TRUTH)
    assert (off(ours, theirs) < WITHIN).all()


@pytest.mark.parametrize("name", [name for name in LAWS if name != "body_pitch_convention"])  # which has no size
def test_zero_strength_changes_nothing_and_a_larger_one_changes_more(name: str) -> None:
    terms, law = BERMAN_WANG if name == "clap_and_peel" else PROPOSED, LAWS[name]
    drawn = law.draw(np.random.default_rng(4))

    def hide(part: float) -> Array:
        return simulate(delfly(), TRUTH, AIR, {name: drawn | {"strength": part * drawn["strength"]}}, terms=terms)

    nominal = simulate(delfly(), TRUTH, AIR, terms=terms)
    np.testing.assert_array_equal(hide(0.0), nominal)
    small, large = rms(hide(0.5) - nominal), rms(hide(1.0) - nominal)
    assert large > 5e-4
    assert 1.2 < large / small < 4.0


def test_listed_laws_are_in_the_library_and_the_others_are_not() -> None:
    for law in LAWS.values():
        assert (law.name in EFFECTS) == law.listed
        for gene in law.values(law.draw(np.random.default_rng(1))):
            effect, parameter = gene.split(".")
            assert parameter in {p.name for p in EFFECTS[effect].parameters}


def test_unknown_or_incomplete_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="nothing called 'tail'"):
        simulate(delfly(), TRUTH, AIR, {"tail": {"strength": 1.0}})
    with pytest.raises(ValueError, match="'wake_capture' has parameters"):
        simulate(delfly(), TRUTH, AIR, {"wake_capture": {"strength": 1.0}})
    with pytest.raises(ValueError, match="printed velocities"):
        simulate(replace(delfly(), velocities="printed"), TRUTH, AIR)


def a_flow(n: int = 480, speed: float = 4.0) -> Flow:
    """Elements that fly straight ahead."""
    r, chord, none, along = np.array([0.05, 0.1]), np.array([0.08, 0.06]), np.zeros(n), np.zeros((n, 2))
    steady = np.full((n, 2), speed + 0j)
    t = np.arange(n) / n
    return Flow(
        t, r, chord, 12.0, 1.2, 0.137, none, none, none, none, along, along, along, steady, steady, none, none, steady
    )


def test_lagged_circulation_equals_theodorsens() -> None:
    flow, lag = a_flow(), {"strength": 1.0}
    constant = np.ones((480, 2))
    np.testing.assert_allclose(CIRCULATION["circulation_lag"](flow, constant, constant, lag), 1.0, atol=2e-3)
    swinging = np.cos(2 * np.pi * flow.t)[:, None] * constant
    late = CIRCULATION["circulation_lag"](flow, swinging, swinging, lag)
    found = 2.0 * np.fft.rfft(late, axis=0)[1] / 480
    k = 2 * np.pi * 12.0 * flow.chord / (2 * 4.0)
    theodorsen = hankel2(1, k) / (hankel2(1, k) + 1j * hankel2(0, k))
    np.testing.assert_allclose(found, theodorsen, atol=0.02)  # Garrick's function is Wagner's to two per cent


def test_stall_does_not_change_attached_flow_or_rotation() -> None:
    drawn = LAWS["dynamic_stall"].draw(np.random.default_rng(1)) | {"strength": 1.0, "angle": 0.6, "softness": 0.1}
    gamma, rotation = np.full((480, 2), 2.0), np.full((480, 2), 0.5)
    low, steep = (replace(a_flow(), met=a_flow().met * np.exp(1j * angle)) for angle in (0.05, 1.2))
    np.testing.assert_allclose(CIRCULATION["dynamic_stall"](low, gamma, rotation, drawn), 2.0, rtol=2e-3)
    point = 0.04 + 0.66 * math.exp(-6.0)
    left = 0.5 + 1.5 * ((1 + math.sqrt(point)) / 2) ** 2
    np.testing.assert_allclose(CIRCULATION["dynamic_stall"](steep, gamma, rotation, drawn), left, rtol=1e-9)


def test_inflow_in_hover_is_that_of_momentum_theory() -> None:
    still = replace(AIR, airspeed=0.0)
    v = disc_inflow(np.full(120, 0.17), 0.0255, still, density(still), {"strength": 1.0, "lag": 0.4})
    np.testing.assert_allclose(v, math.sqrt(0.17 / (density(still) * 0.0255)), rtol=2e-3)
    swinging = 0.17 * (1.0 + np.cos(2 * np.pi * np.arange(120) / 120))
    late = disc_inflow(swinging, 0.0255, still, density(still), {"strength": 1.0, "lag": 0.4})
    np.testing.assert_allclose(late.mean(), v.mean(), rtol=1e-6)
    assert -math.pi / 2 < np.angle(np.fft.rfft(late)[1]) < -0.05  # it follows the thrust


def test_an_elliptic_tip_a_lever_and_a_blocked_tunnel() -> None:
    flow = a_flow()
    np.testing.assert_allclose(tip(flow, 1.0), np.sqrt(1 - (flow.r / 0.137) ** 2))
    assert tip(flow, 0.05)[0] == pytest.approx(1.0, abs=1e-9)
    flap = 0.3 + 0.3 * np.sin(2 * np.pi * np.arange(64) / 64)
    np.testing.assert_allclose(np.tan(levered(flap, 0.1) - 0.3), 1.1 * np.tan(flap - 0.3), atol=1e-12)
    faster = simulate(delfly(), TRUTH, AIR, {"airspeed_error": {"strength": 0.1}})
    np.testing.assert_allclose(faster, simulate(delfly(), TRUTH, replace(AIR, airspeed=AIR.airspeed * math.sqrt(1.2))))


def test_the_fling_ends_when_the_wings_stop_rotating_apart() -> None:
    fling = {"clap_and_peel": {"strength": 2.0, "width": 3.0}}
    more = simulate(delfly(), TRUTH, AIR, fling, terms=BERMAN_WANG) - simulate(delfly(), TRUTH, AIR, terms=BERMAN_WANG)
    t = np.arange(480) / 480
    assert rms(more[t > 0.4]) == 0.0
    assert more[(t > 0.02) & (t < 0.3), 0].min() > 0.0


def test_knock_and_jet_act_at_their_phase_and_place() -> None:
    knock = {"stop_knock": {"strength": 0.5, "phase": 0.4, "direction": 0.0}}
    slow, fast = (replace(AIR, flap_frequency=f) for f in (8.0, 16.0))
    pulses = [simulate(delfly(), TRUTH, c, knock) - simulate(delfly(), TRUTH, c) for c in (slow, fast)]
    assert abs(pulses[0][:, 0].argmax() / 480 - 0.4) < 0.005
    np.testing.assert_allclose(pulses[1], 4.0 * pulses[0], atol=1e-12)
    assert abs(pulses[0][:, 0].sum()) < 1e-9
    jet = {"local_jet": {"strength": 4.0, "phase": 0.7, "span": 0.8}}
    blown = simulate(delfly(), TRUTH, AIR, jet) - simulate(delfly(), TRUTH, AIR)
    assert abs(np.abs(blown).sum(axis=1).argmax() / 480 - 0.7) < 0.06


def test_the_same_seed_draws_the_same_parameters() -> None:
    for law in LAWS.values():
        one, other = (law.draw(np.random.default_rng(7), 2.0) for _ in range(2))
        assert one == other
        assert abs(one["strength"]) == pytest.approx(2.0 * law.typical)
