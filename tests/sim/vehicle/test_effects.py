"""Effects on the vehicle: each against a model that has the same by other means, or a closed form."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.vehicle.vehicles import COEFFICIENTS, DELFLY, PASSIVE, genome, plate, recording
from wingfit.records import FourierFlap, FourierPitch, LowPass, Recording, Vehicle
from wingfit.sim.effects.library.aerodynamics.circulation_lag import wagner
from wingfit.sim.effects.library.wake.induced_inflow import apparent_mass, swept_area
from wingfit.sim.effects.library.wake.tip_loss import prandtl
from wingfit.sim.effects.ports.vehicle import Setting, VehicleScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.filtering import low_passed
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.sampling import passed
from wingfit.sim.vehicle.terms import PRESETS, chosen

Array = npt.NDArray[np.float64]

ALL = tuple(name for name, effect in EFFECTS.items() if effect.vehicle)
FREE = tuple(name for name in ALL if EFFECTS[name].fits(chosen("proposed")))  # no term of the nominal model
REC = recording(12.5, 0.5, 1.2)


def beat_of(model: BladeElementWing, rec: Recording = REC, **values: float) -> Array:
    """Forces [n, 2] at the seed's coefficients and ``values``; names of effects in the form effect__parameter."""
    known = {gene.name for gene in model.genes}
    own = {name: value for name, value in COEFFICIENTS.items() if name in known}
    nominal_values = own | {name.replace("__", "."): value for name, value in values.items()}
    return np.asarray(model.beat([genome(model, **nominal_values)], rec)[0])


def scene_of(vehicle: Vehicle, rec: Recording, **genes: float) -> VehicleScene:
    """One individual with the terms of the nominal model."""
    r = (np.arange(40) + 0.5) / 40 * vehicle.span
    setting = Setting(vehicle, chosen("proposed"), vehicle.motion, rec.condition, 400, 0.0, r)
    return VehicleScene.of(setting, {name: np.array([value]) for name, value in genes.items()}, 1)


def act(name: str, scene: VehicleScene, **values: float) -> VehicleScene:
    """``scene`` after the effect, its other parameters at their nominal values."""
    effect = EFFECTS[name]
    given = {p.name: values.get(p.name, p.typical) for p in effect.parameters}
    assert effect.vehicle is not None
    effect.vehicle(scene, {key: np.full(len(scene), value) for key, value in given.items()})
    scene.settle()
    return scene


# -- the model with effects ---------------------------------------------------------------------------------------


def test_genes_come_after_the_models_own() -> None:
    bare, model = BladeElementWing(DELFLY), BladeElementWing(DELFLY).with_effects("tip_loss", "stroke_bias")
    assert model.genes[: len(bare.genes)] == bare.genes
    assert [g.name for g in model.genes[len(bare.genes) :]] == ["stroke_bias.angle", "tip_loss.spacing"]
    assert model.searched == (*bare.searched, "stroke_bias.angle", "tip_loss.spacing")
    again: BladeElementWing = pickle.loads(pickle.dumps(model))  # noqa: S301
    assert again.effects == model.effects


def test_off_is_exactly_the_model_without() -> None:
    bare, model = BladeElementWing(DELFLY), BladeElementWing(DELFLY).with_effects(*FREE)
    assert np.array_equal(beat_of(model), beat_of(bare))
    assert np.array_equal(model.observe([genome(model)], REC).channels, bare.observe([genome(bare)], REC).channels)


def test_results_do_not_depend_on_the_batch_or_the_order_of_names() -> None:
    """Individuals with other effects on, in another order, alone; effects named in another order."""
    model, draw = BladeElementWing(DELFLY).with_effects(*FREE), np.random.default_rng(5)
    typical = {key: value for name in FREE for key, value in EFFECTS[name].typical(DELFLY).items()}
    sizes = {f"{name}.{p.name}" for name in FREE for p in EFFECTS[name].size}
    batch = []
    for _ in range(21):
        on = {name for name in FREE if draw.random() < 0.4}
        values = {k: v * draw.uniform(0.5, 1.0) for k, v in typical.items() if k not in sizes or k.split(".")[0] in on}
        batch.append(genome(model, **COEFFICIENTS, **values))
    together = model.observe(batch, REC)
    assert together.reasons == (None,) * 21
    assert np.array_equal(together.channels[::-1], model.observe(batch[::-1], REC).channels)
    for k in (0, 7, 20):
        assert np.array_equal(together.channels[k], model.observe(batch[k], REC).channels[0])
    other = BladeElementWing(DELFLY).with_effects(*FREE[::-1])
    assert other.genes == model.genes
    assert np.array_equal(together.channels, other.observe(batch, REC).channels)


def test_terms_and_effects_are_the_beat() -> None:
    model = BladeElementWing(DELFLY).with_effects("circulation_lag", "mass_offset")
    values = genome(model, **{"circulation_lag.share": 1.0, "mass_offset.distance": 0.01})
    parts = model.term_forces(values, REC)
    assert np.abs(parts["effects"]).max() > 1e-3
    assert np.sum(list(parts.values()), axis=0) == pytest.approx(model.beat(values, REC)[0], abs=1e-14)


def test_acts_on_the_motion_of_a_recording() -> None:
    smaller = replace(DELFLY.motion, flap=FourierFlap(0.2, (-0.2,), (0.0,)))
    larger = replace(DELFLY.motion, flap=FourierFlap(0.2, (-0.22,), (0.0,)))
    model = BladeElementWing(DELFLY).with_effects("stroke_amplitude")
    found = beat_of(model, replace(REC, motion=smaller), stroke_amplitude__part=0.1)
    assert found == pytest.approx(beat_of(BladeElementWing(DELFLY), replace(REC, motion=larger)), abs=1e-12)


def test_refusals() -> None:
    with pytest.raises(ValueError, match="'clap_and_peel' is a term of this model already"):
        BladeElementWing(DELFLY).with_effects("clap_and_peel")
    alone = BladeElementWing(replace(DELFLY, claps=False), PRESETS["berman_wang"].terms)
    with pytest.raises(ValueError, match="needs wings that meet"):
        alone.with_effects("clap_and_peel")
    with pytest.raises(ValueError, match="named 2 times"):
        BladeElementWing(DELFLY).with_effects("tip_loss", "tip_loss")


# -- observation --------------------------------------------------------------------------------------------------


def test_a_drift_passes_the_low_pass_as_the_data_did() -> None:
    """What a faulty balance records and a filter then passes is what the model says of the filtered recording."""
    model = BladeElementWing(DELFLY).with_effects("balance_drift", "clock_offset", "scale_error")
    raw = replace(REC, times=np.arange(6000) / 6250, values=np.zeros((6000, 2)))
    typical = {name: value for each in model.chosen for name, value in each.typical(DELFLY).items()}
    values = genome(model, **COEFFICIENTS, **typical)
    raw = replace(raw, values=model.observe([values], raw).channels[0])
    filtered = low_passed(raw, LowPass(40.0))
    found, inside = model.observe([values], filtered).channels[0], slice(1500, 4500)
    assert found[inside] == pytest.approx(filtered.values[inside], abs=1e-5)
    assert np.isfinite(found).all()
    bare = model.observe([genome(model, **COEFFICIENTS)], filtered).channels[0]
    assert np.abs(found - bare)[inside].max() > 1e-3


def test_what_a_balance_adds_is_added() -> None:
    model, rec = BladeElementWing(DELFLY).with_effects("balance_offset"), low_passed(REC, LowPass(40.0))
    off, on = model.observe([genome(model), genome(model, **{"balance_offset.x": 0.01})], rec).channels
    assert on - off == pytest.approx(np.array([[0.01 * DELFLY.mass * 9.80665, 0.0]] * len(off)), abs=1e-12)


def test_instants_of_its_own() -> None:
    """An individual whose samples are late by one step sees what the others see a step later."""
    model, delay = BladeElementWing(DELFLY).with_effects("clock_offset"), 0.001
    for rec in (REC, low_passed(REC, LowPass(40.0))):
        off, on = model.observe([genome(model), genome(model, **{"clock_offset.delay": delay})], rec).channels
        assert on[:-1] == pytest.approx(off[1:], abs=1e-11)


def test_a_wobble_of_the_balance_is_filtered_like_the_data() -> None:
    raw = replace(REC, times=np.arange(6000) / 6250, values=np.zeros((6000, 2)))
    added = 1.0 + np.sin(2 * np.pi * 200.0 * raw.times)[:, None] * np.ones(2)
    filtered = low_passed(replace(raw, values=added), LowPass(40.0))
    found = passed(added, filtered)
    assert found[1500:4500] == pytest.approx(filtered.values[1500:4500], abs=1e-12)
    assert found[1500:4500] == pytest.approx(1.0, abs=1e-3)
    assert np.array_equal(passed(added, raw), added)


# -- the drive ----------------------------------------------------------------------------------------------------


def test_amplitude_and_bias_are_those_of_the_stroke() -> None:
    bare, model = BladeElementWing(DELFLY), BladeElementWing(DELFLY).with_effects("stroke_amplitude", "stroke_bias")
    nominal_values = {gene.name: gene.nominal for gene in bare.genes}
    found = beat_of(model, stroke_amplitude__part=0.1, stroke_bias__angle=0.05)
    assert found == pytest.approx(
        beat_of(bare, A=1.1 * nominal_values["A"], eta=nominal_values["eta"] + 0.05), abs=1e-12
    )


def test_harmonics_are_those_of_the_flap_angle() -> None:
    def vehicle(cosine: tuple[float, ...], sine: tuple[float, ...]) -> Vehicle:
        return replace(DELFLY, motion=replace(DELFLY.motion, flap=FourierFlap(0.3, cosine, sine), pitch=PASSIVE))

    model = BladeElementWing(vehicle((-0.3,), (0.4,))).with_effects("drive_harmonics")
    found = beat_of(model, drive_harmonics__cos2=0.02, drive_harmonics__sin3=-0.01)
    given = BladeElementWing(vehicle((-0.3, 0.01, 0.0), (0.4, 0.0, -0.005)))
    assert found == pytest.approx(beat_of(given), abs=1e-12)


# -- stream and loading -------------------------------------------------------------------------------------------


def test_stream_is_faster_and_denser() -> None:
    bare, model = BladeElementWing(DELFLY), BladeElementWing(DELFLY).with_effects("airspeed_error", "residual_air")
    faster = recording(12.5, 0.55, 1.2)
    assert beat_of(model, airspeed_error__part=0.1) == pytest.approx(beat_of(bare, faster), abs=1e-13)
    air = replace(REC.condition, pressure=REC.condition.pressure + 0.05 * 287.0 * REC.condition.temperature)
    denser = replace(REC, condition=air)
    assert beat_of(model, residual_air__density=0.05) == pytest.approx(beat_of(bare, denser), rel=1e-3, abs=1e-5)


def test_prandtls_factor() -> None:
    """F(0) = 0, F = 1/2 where e^-f = cos(pi / 4), and 1 far from the tip."""
    half = np.log(np.sqrt(2.0)) / np.pi
    assert prandtl(np.array([0.0, 0.02 * half, 1.0]), np.array(0.02)) == pytest.approx([0.0, 0.5, 1.0])


def test_tip_loss_takes_from_circulation_alone() -> None:
    """Of an untwisted plate in hover the force of circulation is the integral of c r^2 F."""
    wing = plate(FourierFlap(0.0, (0.5,), (0.0,)), FourierPitch(np.pi / 2 - 0.5, (), ()))
    model = BladeElementWing(wing, chosen("berman_wang"), elements=400).with_effects("tip_loss")
    rec = recording(12.5, 0.0, 0.0)
    values = genome(model, C_l=1.0, **{"tip_loss.spacing": 0.03})
    parts, bare = model.term_forces(values, rec), model.term_forces(genome(model, C_l=1.0), rec)
    r = (np.arange(4000) + 0.5) * 0.1 / 4000
    share = (r**2 * prandtl(0.1 - r, np.array(0.03))).sum() / (r**2).sum()
    assert 0.7 < share < 0.95
    assert parts["translation"] == pytest.approx(share * bare["translation"], rel=1e-3, abs=1e-9)
    assert np.array_equal(parts["viscous"], bare["viscous"])


def test_clap_and_peel_is_the_term_of_that_name() -> None:
    """The effect's coefficient is C_F + C_R: what the term puts in the place of rotational circulation."""
    term = BladeElementWing(DELFLY)
    effect = BladeElementWing(DELFLY, chosen("proposed", ("clap_and_peel",))).with_effects("clap_and_peel")
    coefficient = COEFFICIENTS["C_F"] + 0.75 * COEFFICIENTS["C_r"]
    assert beat_of(effect, clap_and_peel__coefficient=coefficient) == pytest.approx(beat_of(term), abs=1e-12)


LATE: dict[str, dict[str, float]] = {
    "dynamic_stall": {"share": 1.0, "angle": 0.4, "width": 0.1, "delay": 1.0, "advance": 0.0},
    "circulation_lag": {"share": 1.0},
}


def test_fling_as_a_term_and_as_an_effect_are_one_whatever_else_acts() -> None:
    term = BladeElementWing(DELFLY).with_effects(*LATE, "wake_capture")
    effect = BladeElementWing(DELFLY, chosen("proposed", ("clap_and_peel",)))
    effect = effect.with_effects("clap_and_peel", *LATE, "wake_capture")
    more = {f"{name}__{key}": value for name, values in LATE.items() for key, value in values.items()}
    coefficient = COEFFICIENTS["C_F"] + 0.75 * COEFFICIENTS["C_r"]
    found = beat_of(effect, REC, clap_and_peel__coefficient=coefficient, wake_capture__share=0.2, **more)
    assert found == pytest.approx(beat_of(term, REC, wake_capture__share=0.2, **more), abs=1e-12)


@pytest.mark.parametrize("name", LATE)
def test_fling_is_neither_late_nor_stalled(name: str) -> None:
    """It adds the same force whether the circulation beside it is late, stalled or neither; as on a wing."""
    model = BladeElementWing(DELFLY, chosen("proposed", ("clap_and_peel",))).with_effects("clap_and_peel", name)
    late = {f"{name}__{key}": value for key, value in LATE[name].items()}
    added = [
        beat_of(model, REC, clap_and_peel__coefficient=2.7, **more) - beat_of(model, REC, **more)
        for more in (dict[str, float](), late)
    ]
    assert np.abs(added[0]).max() > 0.05
    assert added[1] == pytest.approx(added[0], abs=1e-12)
    assert np.abs(beat_of(model, REC, **late) - beat_of(model, REC)).max() > 0.01


# -- the flow -----------------------------------------------------------------------------------------------------


def test_circulation_grows_as_wagner_says() -> None:
    """A step of circulation at constant speed: R. T. Jones' function of half chords travelled."""
    assert wagner([0.0, 2.0, 1e4]) == pytest.approx([0.5, 0.6655, 1.0], abs=1e-4)
    scene = scene_of(DELFLY, REC, **COEFFICIENTS)
    flow, places = scene.flow, scene.stations
    flow.speed[:] = 0.5 * places.chord / scene.step  # one half chord a step
    flow.circulation[:] = np.where(np.arange(400) < 200, 1.0, 2.0)[:, None]
    found = act("circulation_lag", scene, share=1.0).flow.circulation[0, 0, 200:398, 3]
    assert found == pytest.approx(1.0 + wagner(np.arange(198) + 0.5), abs=2e-3)
    halved = scene_of(DELFLY, REC, **COEFFICIENTS)
    quasi_steady = halved.flow.circulation.copy()
    full = act("circulation_lag", scene_of(DELFLY, REC, **COEFFICIENTS), share=1.0).flow.circulation
    act("circulation_lag", halved, share=0.5)
    assert halved.flow.circulation == pytest.approx(0.5 * (quasi_steady + full), abs=1e-12)


def test_stall_takes_lift_where_the_angle_is_large_and_for_long() -> None:
    """With a short delay it is the steady law; with a long one every instant has the mean attachment."""
    bare = scene_of(DELFLY, REC, **COEFFICIENTS)
    flow, turned = bare.flow, scene_of(DELFLY, REC, **COEFFICIENTS | {"C_l": 0.0}).flow.circulation
    own = flow.circulation - turned  # of the angle of attack
    assert np.abs(turned).max() > 0.1 * np.abs(own).max()
    alpha = np.arctan2(np.abs(flow.normal), np.abs(flow.along))
    steady = 1 / (1 + np.exp((alpha - 0.6) / 0.1))
    quick = act("dynamic_stall", bare, share=1.0, angle=0.6, width=0.1, delay=1e-6, advance=0.0)
    outer = (quick.flow.circulation - turned)[..., 4:]  # the innermost hardly move
    assert outer == pytest.approx((own * (0.5 + 0.5 * np.sqrt(steady)) ** 2)[..., 4:], abs=2e-3 * np.abs(own).max())
    late = act(
        "dynamic_stall", scene_of(DELFLY, REC, **COEFFICIENTS), share=1.0, angle=0.6, width=0.1, delay=2.0, advance=0.0
    )
    attached = late.follow(1.0 / (2.0 * np.tile(late.stations.chord, (1, 1))), steady)
    assert late.flow.circulation - turned == pytest.approx(own * (0.5 + 0.5 * np.sqrt(attached)) ** 2, abs=1e-5)
    slow = act("dynamic_stall", scene_of(DELFLY, REC, **COEFFICIENTS), share=1.0, angle=0.6, delay=1e6, advance=0.0)
    left = (slow.flow.circulation - turned) / own
    assert np.ptp(left, axis=2).max() < 1e-3
    assert np.all((left > 0.25) & (left < 1.0))


def test_circulation_of_rotation_does_not_stall() -> None:
    """Nor what the tip leaves of it: without lift of the angle of attack there is nothing to stall."""
    model = BladeElementWing(DELFLY).with_effects("dynamic_stall", "tip_loss")
    own = {"C_l": 0.0, "tip_loss__spacing": 0.05, "dynamic_stall__angle": 0.2}
    found = [beat_of(model, REC, dynamic_stall__share=share, **own) for share in (0.0, 1.0)]
    assert found[1] == pytest.approx(found[0], abs=1e-12)


@pytest.mark.parametrize("outward", [0.0, 0.5])
@pytest.mark.parametrize(("speed", "pitch"), [(0.0, 1.4), (0.5, 1.2), (2.0, 0.5)])
def test_inflow_balances_momentum(speed: float, pitch: float, outward: float) -> None:
    """2 rho A V_T times the mean inflow is the mean force, computed with that inflow; a part of it is uniform."""
    rec = recording(12.5, speed, pitch)
    scene = act("induced_inflow", scene_of(DELFLY, rec, **COEFFICIENTS), share=1.0, outward=outward)
    mean, (rho,) = float(scene.inflow.mean()) / (1.0 - outward), scene.density
    stroke = scene.angles.flap[:, 0].max() - scene.angles.flap[:, 0].min()
    through = np.hypot(speed * np.cos(pitch) + mean, speed * np.sin(pitch))
    momentum = 2 * rho * swept_area(DELFLY.span, stroke, 4) * through * mean
    assert mean > 0.02
    assert momentum == pytest.approx(scene.wings.forces(scene.flow)[0, 0].mean(), rel=5e-3)


def test_inflow_costs_force() -> None:
    model, rec = BladeElementWing(DELFLY).with_effects("induced_inflow"), recording(12.5, 0.0, 1.4)
    lift = [beat_of(model, rec, induced_inflow__share=share)[:, 0].mean() for share in (0.0, 0.5, 1.0)]
    assert lift[0] > lift[1] > lift[2] > 0.5 * lift[0]


def test_inflow_in_proportion_to_the_radius_has_the_same_mean_over_the_disc() -> None:
    """v 3/2 r / R over a disc has the mean v; over a rectangular wing 3/4 v. Of a small inflow, forces are as much."""
    steady = plate(FourierFlap(0.0, (0.3,), (0.0,)), FourierPitch(math.pi / 2 + 0.3, (), ()))
    model, rec = BladeElementWing(steady).with_effects("induced_inflow"), recording(0.05, 3.0)
    none = beat_of(model, rec)
    uniform, half, outward = (
        beat_of(model, rec, induced_inflow__share=1e-4, induced_inflow__outward=part) - none for part in (0.0, 0.5, 1.0)
    )
    assert np.abs(uniform).min() > 1e-7
    np.testing.assert_allclose(outward, 0.75 * uniform, rtol=1e-3)
    np.testing.assert_allclose(half, 0.875 * uniform, rtol=1e-3)


def test_swept_area_and_apparent_mass() -> None:
    assert swept_area(2.0, np.array(0.5), 2) == pytest.approx(2.0)
    assert swept_area(2.0, np.array(5.0), 4) == pytest.approx(4 * np.pi)
    assert apparent_mass(np.array(1.2), np.array(np.pi * 0.25)) == pytest.approx(8 / 3 * 1.2 * 0.125)


def test_wake_moves_as_the_wing_did() -> None:
    """At a constant fading rate the wake lags the flapping as a first-order low-pass.

    The wing meets none of it while it is the faster, what overtakes it as it slows down, and all once it has turned.
    """
    wing = plate(FourierFlap(0.0, (0.0,), (0.5,)), FourierPitch(np.pi / 2 - 0.5, (), ()))
    scene = scene_of(wing, recording(12.5, 0.0, 0.0), **COEFFICIENTS)
    flow, (cosine, sine) = scene.flow, scene.wings.turns
    before = flow.along.copy(), flow.normal.copy()
    flow.speed[:] = 3.0
    act("wake_capture", scene, share=0.2, chords=2.0)
    psi = 2 * np.pi * np.arange(400) / 400
    omega = 2 * np.pi * 12.5
    response = 1 / (1 + 1j * omega * 2.0 * 0.05 / 3.0)
    velocity = 0.5 * omega * scene.stations.r
    wake, own = (response * np.exp(1j * psi)).real, np.cos(psi)
    met = np.select([wake * own <= 0, np.abs(wake) <= np.abs(own)], [wake, 0.0 * wake], wake - own)
    assert 0.3 < np.mean(met == 0.0) < 0.6
    air = 0.2 * met[:, None] * velocity
    assert flow.along[0, 0] == pytest.approx(before[0][0, 0] - air * cosine[0], abs=1e-3)
    assert flow.normal[0, 0] == pytest.approx(before[1][0, 0] + air * sine[0], abs=1e-3)


def test_wake_adds_force_after_reversal() -> None:
    """After each reversal the wing meets air that comes towards it; before, air that it set in motion pushes it."""
    wing = plate(FourierFlap(0.0, (0.0,), (0.5,)), FourierPitch(np.pi / 2, (), ()))
    model = BladeElementWing(wing).with_effects("wake_capture")
    own = {name: value for name, value in COEFFICIENTS.items() if name != "C_F"}
    parts = model.term_forces(genome(model, **own, **{"wake_capture.share": 0.4}), recording(12.5, 0.0, 0.0))
    drag, captured = parts["viscous"][:, 1], parts["effects"][:, 1]
    early, after, before = slice(5, 20), slice(110, 150), slice(85, 98)  # zeta' is zero at a quarter of the beat
    assert np.abs(captured[early]).max() < 1e-3 * np.abs(drag).max(), "the wing takes its wake along"
    assert np.all(captured[after] / drag[after] > 0.05)
    assert np.all(captured[before] / drag[before] < -0.01)


# -- mass ---------------------------------------------------------------------------------------------------------


def test_mass_behind_the_axis_pulls_by_its_acceleration() -> None:
    """-m d^2/dt^2 of the offset, by differences of the positions of 400 elements; no force on average."""
    wing = plate(FourierFlap(0.0, (0.5,), (0.0,)), FourierPitch(np.pi / 2, (0.3,), (0.6,)))
    model = BladeElementWing(wing).with_effects("mass_offset")
    found = model.term_forces(genome(model, **{"mass_offset.distance": 0.01}), recording(12.5, 0.0, 0.0))["effects"]
    n, psi = 400, 2 * np.pi * np.arange(400) / 400
    share = ((np.arange(400) + 0.5) / 400 / 0.7)[:, None]
    theta = np.pi / 2 + share * (0.3 * np.cos(psi) + 0.6 * np.sin(psi))
    flap = 0.5 * np.cos(psi)
    step = 1 / (12.5 * n)
    for axis, projection, place in ((0, 1.0, -0.01 * np.sin(theta)), (1, np.cos(flap), -0.01 * np.cos(theta))):
        mean = place.mean(axis=0)
        acceleration = (np.roll(mean, 1) - 2 * mean + np.roll(mean, -1)) / step**2
        expected = -1e-3 * acceleration * projection
        assert found[:, axis] == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())
    assert abs(found[:, 0].mean()) < 1e-12
