"""Blade-element simulation of a flapping vehicle: an independent implementation that produces the test data.

After Armanini et al. (2016); all equation numbers are theirs. It shares no code with ``wingfit.sim``, which is tested.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.law import Concealed, check_known, strength
from benchmarks.concealed.plant.vehicle.flow import Flow
from benchmarks.concealed.plant.vehicle.flow import density as density
from benchmarks.concealed.plant.vehicle.laws import AFTERWARDS, CIRCULATION, GUSTS, LAWS
from benchmarks.concealed.plant.vehicle.laws_circulation import (
    by_suction,
    cambered,
    fling,
    revolving_drag,
    revolving_lift,
    suction,
    tip,
    varied,
    wake_tip,
)
from benchmarks.concealed.plant.vehicle.laws_inertia import further_aft, moved_air, resized, wing_inertia, wing_mass
from benchmarks.concealed.plant.vehicle.laws_motion import flapped, pitched, yielded
from benchmarks.concealed.plant.vehicle.laws_stream import deflected, disc_inflow, flown
from wingfit.records import Condition, FourierFlap, FourierPitch, SplitCycleFlap, Vehicle
from wingfit.records.vehicle import Flap

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

PROPOSED = ("inertial", "translation", "rotation", "clap_and_peel", "added_mass", "effective_chord", "viscous")
BERMAN_WANG = ("inertial", "translation", "rotation", "added_mass", "viscous")
_FLING = "clap_and_peel"
_FINE = 4096  # samples of the flap law for its Fourier series
_HARMONICS = 100
_NODES = 10  # Gauss points between two stations
_ROUNDS, _COARSE, _SETTLED = 40, 120, 1e-5  # of the inflow: iterations, instants, m/s
_TWISTS, _STILL, _PRESSURE = 80, 1e-6, 10.0  # of the twist: iterations, rad, Pa


@dataclass(frozen=True)
class Motion:
    """Angles ``flap``, and ``pitch`` at the pitch station, of a wing at n equal steps of a beat from its start.

    Both [3, n]: angle and its first two time derivatives (rad, s).
    """

    flap: Array
    pitch: Array


def simulate(
    vehicle: Vehicle,
    coefficients: Mapping[str, float],
    condition: Condition,
    hidden: Concealed | None = None,
    *,
    terms: tuple[str, ...] = PROPOSED,
    instants: int = 480,
) -> Array:
    """Forces [instants, 2] of all wings along body x and z (N) at equal steps of one beat from its start.

    Args:
        vehicle: geometry, mass and prescribed wing motion.
        coefficients: C_l, C_r, C_F, C_D0 and C_Dpi2; those of disabled terms are not needed.
        condition: frequency, air, airspeed and body pitch.
        hidden: parameters of the hidden effects, by name as in :data:`.laws.LAWS`.
        terms: force terms of the nominal model to include, from PROPOSED. The terms that can be hidden ("inertial",
            "translation", "rotational_circulation" for "rotation", "added_mass", "effective_chord", "viscous") are
            for models without them; what they add does not depend on ``coefficients``.
        instants: number of instants in the beat.
    """
    hidden = hidden or {}
    check_known(hidden, LAWS)
    if vehicle.velocities != "mirrored":
        raise ValueError(f"vehicle {vehicle.name!r} has printed velocities; this plant supports mirrored ones only")
    air, vehicle = flown(condition, hidden), resized(vehicle, hidden)
    if strength(hidden, "varying_coefficients"):
        coefficients = varied(coefficients, condition, hidden["varying_coefficients"])
    inflow = twist = None
    if strength(hidden, "elastic_twist"):
        twist = _twist(vehicle, coefficients, air, hidden, terms)
    if strength(hidden, "induced_inflow"):
        inflow = _inflow(vehicle, coefficients, air, hidden, terms, instants, twist)
    return _forces(vehicle, coefficients, air, hidden, terms, instants, inflow, twist)[0]


def motion_of(
    vehicle: Vehicle, frequency: float, instants: int, hidden: Concealed, twist: Array | None = None
) -> Motion:
    """Flap and pitch angle with two time derivatives, at ``instants`` equal steps of a beat of ``frequency`` (Hz).

    ``twist``: rad, added to the pitch at equal steps of a beat.
    """
    flap = flapped(_flap_samples(vehicle.motion.flap), hidden)
    rates = [_derived(flap, frequency, order) for order in range(4)]
    law = vehicle.motion.pitch
    if isinstance(law, FourierPitch):
        samples, rest = _series(law.mean, law.cosine, law.sine), law.mean
    else:
        rest = np.pi / 2 + law.constant
        samples = rest + law.flap * rates[0] + law.flap_rate * rates[1] + law.flap_rate_squared * rates[1] ** 2
    samples = pitched(samples, rest, hidden)
    if twist is not None:
        samples = samples + np.fft.irfft(np.fft.rfft(twist) * (_FINE / len(twist)), _FINE)
    pitch = [_derived(samples, frequency, order) for order in range(3)]
    keep = _FINE / instants * np.arange(instants)
    grid = np.arange(_FINE + 1)
    both = [np.stack([np.interp(keep, grid, np.append(a, a[0])) for a in these]) for these in (rates[:3], pitch)]
    return Motion(*both)


def _flap_samples(law: Flap) -> Array:
    """Flap angle [_FINE] (rad) in a beat: Fourier series, or Eqs. 20-21 of Armanini et al. (2016) with smoothing."""
    if isinstance(law, FourierFlap):
        return _series(law.mean, law.cosine, law.sine)
    spectrum = np.fft.rfft(_split_cycle(law))
    k = np.arange(len(spectrum))
    spectrum *= np.exp(-0.5 * (2 * np.pi * k * law.smoothing) ** 2) * (k <= _HARMONICS)
    return np.fft.irfft(spectrum, _FINE)


def _split_cycle(law: SplitCycleFlap) -> Array:
    t, omega = np.arange(_FINE) / _FINE, 2 * np.pi
    sigma = law.split * omega / (omega - 2 * law.split)
    late = -2 * np.pi * law.split / (omega - 2 * law.split)
    opening = (omega - law.split) * t
    return law.bias - law.amplitude * np.cos(np.where(opening <= np.pi, opening, (omega + sigma) * t + late))


def _series(mean: float, cosine: tuple[float, ...], sine: tuple[float, ...]) -> Array:
    psi = 2 * np.pi * np.arange(_FINE) / _FINE
    out = np.full(_FINE, mean)
    for k, c in enumerate(cosine, 1):
        out += c * np.cos(k * psi)
    for k, s in enumerate(sine, 1):
        out += s * np.sin(k * psi)
    return out


def _derived(samples: Array, frequency: float, order: int) -> Array:
    """Time derivative of the given ``order`` of one period of ``samples`` [n] that repeat at ``frequency`` (Hz).

    Spectral; frequencies far above all harmonics of the motion are removed.
    """
    spectrum = np.fft.rfft(samples)
    k = np.arange(len(spectrum))
    spectrum *= (2j * np.pi * k * frequency) ** order * (k <= 2 * _HARMONICS)
    return np.fft.irfft(spectrum, len(samples))


def _elements(vehicle: Vehicle) -> tuple[Array, Array, Array]:
    """Radii (m), chords (m) and quadrature weights (m) of the blade elements, [E] each."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    places, widths = [], []
    for inner, outer in zip(vehicle.stations[:-1], vehicle.stations[1:], strict=True):
        half = 0.5 * (outer.r - inner.r)
        places.append(inner.r + half * (nodes + 1.0))
        widths.append(half * weights)
    r = np.concatenate(places)
    chord = np.interp(r, [s.r for s in vehicle.stations], [s.chord for s in vehicle.stations])
    return r, chord, np.concatenate(widths)


def _forces(
    vehicle: Vehicle,
    coefficients: Mapping[str, float],
    air: Condition,
    hidden: Concealed,
    terms: tuple[str, ...],
    instants: int,
    inflow: Array | None,
    twist: Array | None = None,
) -> tuple[Array, Array]:
    """Forces [n, 2] of all wings along body x and z, and the part along x [n] due to circulation and drag, N.

    ``inflow`` [n]: induced velocity at the wing tips, m/s, or None. ``twist``: of the wings besides their motion, rad.
    """
    motion = motion_of(vehicle, air.flap_frequency, instants, hidden, twist)
    r, chord, width = _elements(vehicle)
    total, carried = np.zeros((instants, 2)), np.zeros(instants)
    alike = 1.0 if vehicle.layout == "single" else 2.0
    for sign in (1.0, -1.0) if vehicle.layout == "x4" else (1.0,):
        flow = _flow(vehicle, air, motion, r, chord, sign)
        lifted, inert = _element_forces(flow, vehicle, coefficients, air, hidden, terms, inflow)
        carried += alike * lifted.real @ width
        stroke = lifted + inert
        total[:, 0] += alike * stroke.real @ width
        total[:, 1] += alike * sign * flow.level * (stroke.imag @ width)
    for name, law in AFTERWARDS.items():
        if strength(hidden, name):
            total = total + law(total, vehicle, air, hidden[name])
    return total, carried


def _flow(vehicle: Vehicle, air: Condition, motion: Motion, r: Array, chord: Array, sign: float) -> Flow:
    """Motion of the blade elements of the lower (``sign`` 1) or upper wings (-1, mirrored at the body's plane).

    ``r``, ``chord`` [E], m.
    """
    share = r / (vehicle.motion.pitch_station * vehicle.span)
    root, frequency = vehicle.motion.root_pitch, air.flap_frequency
    zeta, rate, acceleration = motion.flap
    apart = vehicle.dihedral - sign * zeta
    down = sign * air.airspeed * np.sin(air.angle_of_attack)
    swing = rate[:, None] * r + (down * np.cos(apart))[:, None]
    gain = acceleration[:, None] * r + (down * np.sin(apart) * sign * rate)[:, None]
    t = np.arange(len(zeta)) / len(zeta)
    window, peeled = _peel(motion.pitch[1], t, vehicle)
    return Flow(
        t=t,
        r=r,
        chord=chord,
        frequency=frequency,
        rho=density(air),
        span=vehicle.span,
        zeta=zeta,
        rate=rate,
        acceleration=acceleration,
        level=np.cos(apart),
        theta=root + (motion.pitch[0] - root)[:, None] * share,
        turn=motion.pitch[1][:, None] * share,
        turn_rate=motion.pitch[2][:, None] * share,
        own=air.airspeed * np.cos(air.angle_of_attack) + 1j * swing,
        own_rate=1j * gain,
        peel=window,
        peeled=peeled,
    )


def _peel(turn: Array, t: Array, vehicle: Vehicle) -> tuple[Array, Array]:
    """Fraction of each instant in which the wings peel apart, and of the chord that has separated, [n] each.

    Armanini et al. (2016), Eq. 7. ``turn``: pitch rate [n], rad/s; ``t``: instants [n], beats.
    """
    if not vehicle.claps:
        return np.zeros(len(t)), np.ones(len(t))
    started = np.logical_or.accumulate(turn < 0)
    over = np.logical_or.accumulate(started & (turn >= 0))
    window = (started & ~over).astype(float)
    if not window.any() or t[int(window.argmax())] >= vehicle.motion.peel_end:
        window[:] = 0.0
    window[0] *= 0.5  # the beat starts in the middle of this instant
    peeled = np.minimum(t / vehicle.motion.peel_end, 1.0)
    peeled[0] = np.sqrt(0.5)
    return window, peeled


def _element_forces(
    flow: Flow,
    vehicle: Vehicle,
    coefficients: Mapping[str, float],
    air: Condition,
    hidden: Concealed,
    terms: tuple[str, ...],
    inflow: Array | None,
) -> tuple[Complex, Complex]:
    """Forces (N/m of span) on the elements, two arrays [n, E]: due to circulation and drag, and due to inertia.

    Complex: the real part is along body x, the imaginary part along the normal of the wing at zero pitch.
    """
    rho, chord = flow.rho, flow.chord
    met = flow.own if inflow is None else flow.own + inflow[:, None] * flow.r / flow.span
    stream = flow.turned(met) - 1j * further_aft(flow, vehicle, hidden) * flow.turn
    for name, gust in GUSTS.items():
        if strength(hidden, name):
            met = met + gust(flow, hidden[name])
    flow = replace(flow, met=flow.turned(met))
    if strength(hidden, "downwash"):  # not by the fling, whose vortices on both wings are opposite
        single, other = tuple(t for t in terms if t != _FLING), {k: p for k, p in hidden.items() if k != _FLING}
        bound, slope = _circulation(flow, vehicle, coefficients, air, other, single), 2.0 * coefficients.get("C_l", 0.0)
        flow = replace(flow, met=deflected(flow, bound, vehicle, slope, strength(hidden, "downwash")))
    gamma = _circulation(flow, vehicle, coefficients, air, hidden, terms)
    force = 1j * rho * gamma * flow.met
    if strength(hidden, "leading_edge_suction"):
        force += suction(flow, coefficients.get("C_l", 0.0), strength(hidden, "leading_edge_suction"))
    if "viscous" in terms:
        drag = coefficients["C_D0"] * flow.met.real**2 + coefficients["C_Dpi2"] * flow.met.imag**2
        force -= 0.5 * rho * chord * drag / flow.speed * flow.met
    if strength(hidden, "viscous"):
        force -= 0.5 * rho * chord * revolving_drag(flow, strength(hidden, "viscous")) * flow.speed * flow.met
    return flow.turned(force), flow.turned(_inertia(flow, stream, vehicle, hidden, terms))


def _circulation(
    flow: Flow,
    vehicle: Vehicle,
    coefficients: Mapping[str, float],
    air: Condition,
    hidden: Concealed,
    terms: tuple[str, ...],
) -> Array:
    """Circulation [n, E] (m^2/s) by Armanini et al. (2016), Eqs. 2-4 and 7, changed by the hidden effects.

    Circulation lag and stall act on the circulation of a single wing, not on that of two wings that peel apart.
    """
    half = 0.5 * flow.chord**2 * flow.turn
    turning = (coefficients["C_r"] if "rotation" in terms else 0.0) + strength(hidden, "rotational_circulation")
    rotation = turning * (0.75 - vehicle.pitch_axis + further_aft(flow, vehicle, hidden) / flow.chord) * half
    gamma = rotation + _translation(flow, coefficients, hidden, terms)
    for name, law in CIRCULATION.items():
        if strength(hidden, name):
            gamma = law(flow, gamma, rotation, hidden[name])
    if "clap_and_peel" in terms:
        gamma -= (coefficients["C_F"] * half + rotation) * flow.peel[:, None]
    if strength(hidden, "clap_and_peel"):
        gamma += fling(flow, hidden["clap_and_peel"])
    if strength(hidden, "tip_loss"):
        gamma = gamma * tip(flow, strength(hidden, "tip_loss"))
    if strength(hidden, "wake_tip_loss"):
        gamma = gamma * wake_tip(flow, vehicle, air, _swept(vehicle), strength(hidden, "wake_tip_loss"))
    return gamma


def _translation(flow: Flow, coefficients: Mapping[str, float], hidden: Concealed, terms: tuple[str, ...]) -> Array:
    """Circulation [n, E] (m^2/s) by the angle of attack, Armanini et al. (2016), Eqs. 2-3, with the hidden effects."""
    gamma = np.zeros(flow.met.shape)
    if "translation" in terms:
        gamma -= coefficients["C_l"] * flow.chord * flow.met.real * flow.met.imag / flow.speed
        if strength(hidden, "zero_lift_angle"):
            gamma += cambered(flow, coefficients["C_l"], strength(hidden, "zero_lift_angle"))
        if strength(hidden, "lift_curve"):
            gamma += by_suction(flow, coefficients["C_l"], strength(hidden, "lift_curve"))
    if strength(hidden, "translation"):
        gamma += revolving_lift(flow, strength(hidden, "translation"))
    return gamma


def _inertia(flow: Flow, stream: Complex, vehicle: Vehicle, hidden: Concealed, terms: tuple[str, ...]) -> Complex:
    """Inertial and added-mass forces (N/m of span) [n, E], complex, in axes of the chord.

    Armanini et al. (2016), Eqs. 9-14. The wing's own mass moves with the wing, the added mass with the velocity
    relative to the air, ``stream`` [n, E]. The rate of change of the induced inflow is neglected.
    """
    rho, chord, own = flow.rho, flow.chord, flow.turned(flow.own)
    peeled = flow.peeled[:, None] if "effective_chord" in terms else 1.0
    mass, along = wing_mass(flow, vehicle, hidden), np.pi / 4 * rho * vehicle.thickness**2
    across = moved_air(flow, vehicle, np.pi / 4 * rho * (chord * peeled) ** 2, hidden)
    inertial, moved = (float(name in terms) + strength(hidden, name) for name in ("inertial", "added_mass"))
    turning = mass * (own.imag - 1j * own.real) + across * stream.imag - 1j * along * stream.real
    behind = 0.5 * chord + further_aft(flow, vehicle, hidden)
    rate = flow.turned(flow.own_rate) - 1j * flow.turn * stream - 1j * behind * flow.turn_rate
    force = inertial * flow.turn * turning - moved * (along * rate.real + 1j * across * rate.imag)
    return np.asarray(force + wing_inertia(flow, own, vehicle, hidden))


def _twist(
    vehicle: Vehicle, coefficients: Mapping[str, float], air: Condition, hidden: Concealed, terms: tuple[str, ...]
) -> Array:
    """Twist [_COARSE] (rad) at the pitch station, by iteration with the moment of the air that it reduces.

    ValueError if the iteration does not converge.
    """
    (r, chord, width), twist, share = _elements(vehicle), np.zeros(_COARSE), hidden["elastic_twist"]["strength"]
    sides = (1.0, -1.0) if vehicle.layout == "x4" else (1.0,)
    for _ in range(_TWISTS):
        motion, moment = motion_of(vehicle, air.flap_frequency, _COARSE, hidden, twist), np.zeros(_COARSE)
        for sign in sides:
            flow = _flow(vehicle, air, motion, r, chord, sign)
            force = flow.turned(_element_forces(flow, vehicle, coefficients, air, hidden, terms, None)[0])
            moment -= force.imag @ (width * chord) / (len(sides) * _PRESSURE * (width @ chord**2))
        change = 0.3 * (yielded(moment, share) - twist)
        twist = twist + change
        if np.abs(change).max() < _STILL:
            return twist
    raise ValueError(f"the twist at {air.airspeed:g} m/s does not converge; choose a strength below {share:g}")


def _inflow(
    vehicle: Vehicle,
    coefficients: Mapping[str, float],
    air: Condition,
    hidden: Concealed,
    terms: tuple[str, ...],
    instants: int, twist: Array | None,
) -> Array:  # fmt: skip
    """Induced velocity [instants] (m/s) along body x at the wing tips, by iteration with the thrust that it reduces.

    The actuator disc is as large as the area that the wings sweep. ValueError if it does not converge.
    """
    p, swept, v = hidden["induced_inflow"], _swept(vehicle), np.zeros(_COARSE)
    for _ in range(_ROUNDS):
        thrust = _forces(vehicle, coefficients, air, hidden, terms, _COARSE, v, twist)[1]
        change = 0.5 * (disc_inflow(thrust, swept, air, density(air), p) - v)
        v = v + change
        if np.abs(change).max() < _SETTLED:
            return np.fft.irfft(np.fft.rfft(v) * (instants / _COARSE), instants)
    raise ValueError(f"the inflow at {air.airspeed:g} m/s does not converge; choose a strength below {p['strength']:g}")


def _swept(vehicle: Vehicle) -> float:
    """Area (m^2) that all wings sweep with the described motion."""
    return min(0.5 * vehicle.wings * float(np.ptp(_flap_samples(vehicle.motion.flap))), np.pi) * vehicle.span**2
