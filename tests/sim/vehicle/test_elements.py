"""The blade elements against the printed equations, and against limits known in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.armanini_2016 import forces
from tests.sim.vehicle.vehicles import COEFFICIENTS, DELFLY, angles, genome, plate, recording
from wingfit.records import FourierFlap, FourierPitch
from wingfit.sim.atmosphere import density
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import PRESETS, TERMS, chosen

RHO = density(101325.0, 293.15)
STILL = FourierFlap(0.0, (), ())


@pytest.mark.parametrize("velocities", ["mirrored", "printed"])
@pytest.mark.parametrize(("speed", "pitch", "dihedral"), [(0.0, 1.4, 0.0), (0.65, 1.24, 0.1), (2.0, 0.54, -0.2)])
def test_equals_the_printed_equations(velocities: str, speed: float, pitch: float, dihedral: float) -> None:
    vehicle = replace(DELFLY, velocities=velocities, dihedral=dihedral)  # type: ignore[arg-type]
    model, rec = BladeElementWing(vehicle, elements=7), recording(12.5, speed, pitch)
    found = model.beat(genome(model, **COEFFICIENTS), rec)[0]
    motion = angles(vehicle.motion, {}, 12.5, model.instants, claps=True)
    for k in range(3, model.instants, 41):
        peel = motion.peel[0, k]
        assert peel in (0.0, 1.0)
        wanted = forces(
            vehicle,
            rec.condition,
            RHO,
            motion.flap[0, :, k],
            motion.pitch[0, :, k],
            COEFFICIENTS,
            bool(peel),
            min(k / model.instants / 0.17, 1.0),
            7,
        )
        assert found[k] == pytest.approx(wanted, rel=1e-10, abs=1e-14)


def test_steady_thin_plate() -> None:
    """A plate in a steady stream: lift 1/2 rho V^2 S C_l sin 2 alpha across it, drag by Eq. 11 along it."""
    alpha, speed = math.radians(20), 3.0
    vehicle = plate(STILL, FourierPitch(math.pi / 2, (), ()))
    model = BladeElementWing(vehicle)
    force = model.beat(genome(model, C_l=1.7, C_D0=0.05, C_Dpi2=1.9), recording(10, speed, alpha))[0]
    assert np.ptp(force, axis=0) == pytest.approx(0, abs=1e-15)
    q = 0.5 * RHO * speed**2 * 0.005
    lift = -force[0, 1] * math.cos(alpha) + force[0, 0] * math.sin(alpha)
    drag = -force[0, 0] * math.cos(alpha) - force[0, 1] * math.sin(alpha)
    assert lift == pytest.approx(q * 1.7 * math.sin(2 * alpha), rel=1e-12)
    assert drag == pytest.approx(q * (0.05 * math.cos(alpha) ** 2 + 1.9 * math.sin(alpha) ** 2), rel=1e-12)


def test_flapping_plate_makes_drag_against_its_motion() -> None:
    """Chord normal to the motion: the force is -1/2 rho C_Dpi2 |v| v integrated over span, R^3 / 3."""
    frequency, A = 2.0, 0.05
    vehicle = plate(FourierFlap(0.0, (-A,), ()), FourierPitch(math.pi / 2, (), ()))
    model = BladeElementWing(vehicle, terms=("viscous",), elements=200)
    force = model.beat(genome(model, C_D0=0.0, C_Dpi2=2.0), recording(frequency))[0]
    t = np.arange(model.instants) / model.instants
    rate = A * 2 * math.pi * frequency * np.sin(2 * math.pi * t)
    lift = np.cos(-A * np.cos(2 * math.pi * t))  # Eq. 15
    wanted = -0.5 * RHO * 0.05 * 2.0 * rate * np.abs(rate) * 0.1**3 / 3 * lift
    assert force[:, 1] == pytest.approx(wanted, rel=1e-4, abs=1e-12)
    assert np.abs(force[:, 0]).max() < 1e-15


def test_pure_rotation_gives_kramer_lift() -> None:
    """A plate pitching in a stream along its chord: lift rho V Gamma, Gamma = 1/2 C_r (3/4 - x0) c^2 theta_w'."""
    frequency, speed, amplitude, x0 = 1.0, 5.0, 0.02, 0.25
    vehicle = plate(STILL, FourierPitch(math.pi / 2, (), (amplitude,)), pitch_axis=x0)
    vehicle = replace(vehicle, motion=replace(vehicle.motion, root_pitch=math.pi / 2))
    model = BladeElementWing(vehicle, terms=("rotation",))
    force = model.beat(genome(model, C_r=1.9), recording(frequency, speed, 0.0))[0]
    rate = amplitude * 2 * math.pi * frequency * 0.5 / 0.7  # mean over the span, of which 0.7 is the pitch station
    gamma = 0.5 * 1.9 * (0.75 - x0) * 0.05**2 * rate
    # At t* = 0 the chord lies along the stream and its nose turns up: lift, which is along -z.
    assert force[0] == pytest.approx([0.0, -RHO * speed * gamma * 0.1], rel=1e-9, abs=1e-15)


def test_pure_acceleration_of_a_plate_is_its_added_mass() -> None:
    """A plate shaken normal to itself: force -1/4 pi rho c^2 R^2 / 2 zeta''; its thickness shaken edgewise likewise."""
    frequency, A = 2.0, 1e-3
    for mean, chord in ((math.pi / 2, 0.05), (0.0, 1e-4)):
        vehicle = plate(FourierFlap(0.0, (-A,), ()), FourierPitch(mean, (), ()))
        model = BladeElementWing(vehicle, terms=("added_mass",), elements=64)
        force = model.beat(genome(model), recording(frequency))[0]
        t = np.arange(model.instants) / model.instants
        acceleration = A * (2 * math.pi * frequency) ** 2 * np.cos(2 * math.pi * t)
        wanted = -0.25 * math.pi * RHO * chord**2 * 0.1**2 / 2 * acceleration
        assert force[:, 1] == pytest.approx(wanted, rel=1e-5, abs=1e-9 * np.abs(wanted).max())


def _power(model: BladeElementWing, term: str, speed: float, pitch: float, dihedral: float) -> tuple[np.ndarray, float]:
    """Power (W) that the force of a term gives to one wing that flaps and flies, and its natural size."""
    vehicle = replace(DELFLY, layout="single", claps=False, dihedral=dihedral)
    single = replace(model, vehicle=vehicle, terms=(term,), elements=1)
    rec = recording(12.5, speed, pitch)
    values = {g.name: COEFFICIENTS[g.name] for g in single.genes if g.name in COEFFICIENTS}
    force = single.beat(genome(single, **values), rec)[0]
    motion = angles(vehicle.motion, {}, 12.5, single.instants, claps=False)
    # One element at R / 2. In the direction of the flap Eq. 15 projects the force by cos(dihedral - zeta): undo it.
    cosine = np.cos(dihedral - motion.flap[0, 0])
    swing = 0.5 * vehicle.span * motion.flap[0, 1]
    power = force[:, 0] * speed * math.cos(pitch) + force[:, 1] * speed * math.sin(pitch) + force[:, 1] / cosine * swing
    return power, float(np.abs(force).max() * np.abs(swing).max())


@pytest.mark.parametrize(("speed", "pitch", "dihedral"), [(0.0, 0.0, 0.0), (1.5, 0.9, 0.0), (1.5, 0.9, 0.3)])
def test_power_balance(speed: float, pitch: float, dihedral: float) -> None:
    """Circulation does no work on the element that carries it; friction and pressure drag only take."""
    model = BladeElementWing(DELFLY)
    for term in ("translation", "rotation"):
        power, size = _power(model, term, speed, pitch, dihedral)
        assert np.abs(power).max() < 1e-12 * size
    power, size = _power(model, "viscous", speed, pitch, dihedral)
    assert power.max() < 1e-12 * size
    assert power.min() < -0.05 * size


def test_printed_velocities_make_circulation_do_work() -> None:
    """Why Eqs. 18-19 are not taken as printed: with them a bound vortex would gain or lose work."""
    model = BladeElementWing(replace(DELFLY, velocities="printed"))
    vehicle = replace(DELFLY, layout="single", claps=False, velocities="printed")
    assert vehicle.velocities == model.vehicle.velocities
    single = replace(model, vehicle=vehicle, terms=("translation",), elements=1)
    force = single.beat(genome(single, C_l=1.0), recording(12.5, 1.5, 0.9))[0]
    motion = angles(vehicle.motion, {}, 12.5, single.instants, claps=False)
    swing = 0.5 * vehicle.span * motion.flap[0, 1]
    power = force[:, 0] * 1.5 * math.cos(0.9) + force[:, 1] * 1.5 * math.sin(0.9)
    power += force[:, 1] / np.cos(motion.flap[0, 0]) * swing
    assert np.abs(power).max() > 1e-3 * np.abs(force).max() * np.abs(swing).max()


def test_upper_and_lower_wings_are_mirror_images() -> None:
    """Turning the vehicle on its back: body pitch changes sign, X stays and Z changes sign."""
    model = BladeElementWing(DELFLY)
    values = genome(model, **COEFFICIENTS)
    up = model.beat(values, recording(12.5, 1.0, 0.6))[0]
    down = model.beat(values, recording(12.5, 1.0, -0.6))[0]
    assert up[:, 0] == pytest.approx(down[:, 0], abs=1e-14)
    assert up[:, 1] == pytest.approx(-down[:, 1], abs=1e-14)
    printed = BladeElementWing(replace(DELFLY, velocities="printed"))
    up, down = (printed.beat(values, recording(12.5, 1.0, s * 0.6))[0] for s in (1, -1))
    assert np.abs(up[:, 0] - down[:, 0]).max() > 0.02


def test_hovering_x_wing_makes_no_force_across() -> None:
    model = BladeElementWing(DELFLY)
    force = model.beat(genome(model, **COEFFICIENTS), recording(12.5, 0.0, 1.0))[0]
    assert np.abs(force[:, 1]).max() < 1e-15
    assert force[:, 0].mean() > 0.1


def test_own_inertia_is_its_acceleration() -> None:
    """Flapping in a vacuum shakes the wing across the body: no force along it. Eqs. 12-14 alone give one on average."""
    airless = replace(DELFLY, layout="pair", claps=False)
    model = BladeElementWing(airless, terms=("inertial", "wing_acceleration"))
    vacuum = recording(12.5, 0.0, 0.0)
    vacuum = replace(vacuum, condition=replace(vacuum.condition, pressure=1e-9))
    force = model.beat(genome(model), vacuum)[0]
    motion = angles(airless.motion, {}, 12.5, model.instants, claps=False)
    r, _, mass, width = model._span
    wanted = -2 * float((mass * r).sum() * width) * motion.flap[0, 2] * np.cos(motion.flap[0, 0])
    assert np.abs(force[:, 0]).max() < 1e-12
    assert force[:, 1] == pytest.approx(wanted, rel=1e-9, abs=1e-12)
    printed = replace(model, terms=("inertial",)).beat(genome(model), vacuum)[0]
    assert printed[:, 0].mean() > 0.01


def test_air_gives_back_its_impulse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Still air around a whole chord gives no force on average, if velocity and acceleration are of one point.

    As printed they are not (d is 0 for velocities and 0.5 for the acceleration), which leaves a mean force.
    """
    massless = replace(DELFLY, layout="pair", claps=False, wing_mass=1e-12)
    model, rec = BladeElementWing(massless, terms=("inertial", "added_mass")), recording(12.5)
    printed = model.beat(genome(model), rec)[0][:, 0]
    monkeypatch.setattr("wingfit.sim.vehicle.blade_element_wing.ADDED_MASS_POINT", 0.0)
    force = replace(model).beat(genome(model), rec)[0][:, 0]  # another one, which remembers nothing
    assert abs(force.mean()) < 1e-9
    assert printed.mean() > 0.1 * np.abs(printed).max()
    assert np.abs(force).max() > 0.01


@pytest.mark.parametrize("term", sorted(TERMS))
def test_each_term_can_be_omitted(term: str) -> None:
    every = tuple(name for name in TERMS)
    model, rec = BladeElementWing(DELFLY, terms=every), recording(12.5, 0.5, 1.2)
    values = {"C_l": 1.24, "C_r": 1.44, "C_F": 1.58, "C_D0": 0.07, "C_Dpi2": 2.0, "K_l": 0.8, "K_d": 0.9}
    whole = model.beat(genome(model, **values), rec)[0]
    left = BladeElementWing(DELFLY, terms=tuple(name for name in every if name != term))
    rest = left.beat(genome(left, **{k: v for k, v in values.items() if k in [g.name for g in left.genes]}), rec)[0]
    assert np.abs(whole - rest).max() > 1e-4
    parts = model.term_forces(genome(model, **values), rec)
    assert sum(parts.values()) == pytest.approx(whole, abs=1e-14)
    if term not in ("clap_and_peel", "effective_chord"):  # these also change what the others do
        assert whole - rest == pytest.approx(parts[term], abs=1e-14)


def test_coefficients_scale_their_terms_alone() -> None:
    model, rec = BladeElementWing(DELFLY), recording(12.5, 0.5, 1.2)
    base = model.beat(genome(model, **COEFFICIENTS), rec)[0]
    for name, term in (("C_l", "translation"), ("C_r", "rotation"), ("C_F", "clap_and_peel")):
        doubled = model.beat(genome(model, **(COEFFICIENTS | {name: 2 * COEFFICIENTS[name]})), rec)[0]
        assert doubled - base == pytest.approx(model.term_forces(genome(model, **COEFFICIENTS), rec)[term], abs=1e-13)


def test_fling_lifts_at_the_start_of_the_beat_only() -> None:
    model, rec = BladeElementWing(DELFLY), recording(12.5, 0.0, math.pi / 2)
    fling = model.term_forces(genome(model, C_F=1.5), rec)["clap_and_peel"][:, 0]
    t = np.arange(model.instants) / model.instants
    end = t[np.nonzero(fling)[0][-1]]
    assert 0.2 < end < 0.4
    assert fling[1:].min() >= 0
    assert fling.max() > 0.05


def test_smooth_switch_keeps_the_forces_elsewhere() -> None:
    rec = recording(12.5, 0.0, 1.5)
    sharp, smooth = BladeElementWing(DELFLY), BladeElementWing(DELFLY, peel_width=0.1)
    a, b = (m.term_forces(genome(m, **COEFFICIENTS), rec)["clap_and_peel"][:, 0] for m in (sharp, smooth))
    t = np.arange(len(a)) / len(a)
    end = t[np.nonzero(a)[0][-1]]
    assert a[np.abs(t - end) > 0.055] == pytest.approx(b[np.abs(t - end) > 0.055], abs=1e-15)
    kinks = []
    for model in (sharp, smooth):
        parts = model.term_forces(genome(model, **COEFFICIENTS), rec)
        whole = (parts["rotation"] + parts["clap_and_peel"])[:, 0]
        kinks.append(np.abs(np.diff(whole, 2))[np.abs(t[1:-1] - end) < 0.1].max())
    assert kinks[1] < 0.5 * kinks[0]
    with pytest.raises(ValueError, match=r"peel_width is 0.7 beats; it must lie in \[0, 0.5\]"):
        BladeElementWing(DELFLY, peel_width=0.7)


def test_steady_curves_are_those_of_the_revolving_wing() -> None:
    """At 45 degrees C_L = 0.225 + 1.58 sin(88.65 deg), C_D = 1.92 - 1.55 cos(81.98 deg)."""
    vehicle = plate(STILL, FourierPitch(math.pi / 2, (), ()))
    model = BladeElementWing(vehicle, terms=("steady_curves",))
    alpha, speed = math.radians(45), 2.0
    force = model.beat(genome(model), recording(10, speed, alpha))[0][0]
    q = 0.5 * RHO * speed**2 * 0.005
    lift, drag = force[0] * math.sin(alpha) - force[1] * math.cos(alpha), -(force[0] + force[1]) * math.cos(alpha)
    assert lift / q == pytest.approx(0.225 + 1.58 * math.sin(math.radians(88.65)), rel=1e-12)
    assert drag / q == pytest.approx(1.92 - 1.55 * math.cos(math.radians(81.98)), rel=1e-12)
    flipped = model.beat(genome(model), recording(10, speed, -alpha))[0][0]
    assert flipped == pytest.approx([force[0], -force[1]], rel=1e-12)


def test_converges_with_elements_and_instants() -> None:
    """Second order along the span and in time, although forces jump where the peel begins."""
    rec = recording(12.5, 0.65, 1.24)

    def harmonics(elements: int, instants: int) -> np.ndarray:
        model = BladeElementWing(DELFLY, elements=elements, instants=instants)
        return np.fft.rfft(model.beat(genome(model, **COEFFICIENTS), rec)[0], axis=0)[:6] / instants

    for finest, coarser in (((320, 400), ((20, 400), (40, 400))), ((40, 6400), ((40, 200), (40, 400)))):
        exact = harmonics(*finest)
        errors = [np.abs(harmonics(*size) - exact).max() / np.abs(exact).max() for size in coarser]
        assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)
        assert errors[1] < 5e-4
    assert errors[1] < 2.5e-5


def test_presets_and_refusals() -> None:
    for preset in PRESETS.values():
        assert set(preset.terms) <= set(TERMS)
        assert preset.source
    assert "clap_and_peel" not in chosen("berman_wang")
    assert chosen("proposed", ("clap_and_peel",)) == tuple(t for t in PRESETS["proposed"].terms if t != "clap_and_peel")
    with pytest.raises(ValueError, match="unknown model 'sane'; there are proposed, berman_wang, dickinson"):
        chosen("sane")
    with pytest.raises(ValueError, match="has no term 'wake'"):
        chosen("proposed", ("wake",))
    with pytest.raises(ValueError, match="unknown term 'lift'"):
        BladeElementWing(DELFLY, terms=("lift",))
    with pytest.raises(ValueError, match="multiple of 8"):
        BladeElementWing(DELFLY, instants=401)
    with pytest.raises(ValueError, match="unknown gene 'C_x'"):
        _ = BladeElementWing(replace(DELFLY, estimates={"C_x": 1.0})).genes
    for term in TERMS.values():
        assert term.equation
        assert term.source
