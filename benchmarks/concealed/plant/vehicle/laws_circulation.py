"""Hidden changes of the circulation and of the drag of a vehicle's wings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from scipy.special import zeta as hurwitz

from benchmarks.concealed.plant.law import Law, Parameters
from benchmarks.concealed.plant.vehicle.flow import Array, Flow, density, followed
from wingfit.records import Condition, Vehicle
from wingfit.records.dataset import STANDARD_GRAVITY

_LAG_STEPS = 120  # steps per beat of the integral over past circulation
_LOADED = 0.72  # of the spacing over the span: the super-elliptic wing then loses as much lift as Prandtl's factor
_REFERENCE_HZ, _REFERENCE_PITCH = 12.0, 1.0  # where the coefficients are as described; pitch in rad


def fling(flow: Flow, p: Parameters) -> Array:
    """Circulation [n, E] (m^2/s) due to air drawn into the gap of opening wings.

    Ellington (1984, part IV); Maxworthy (1979):
    1/2 C c^2 (-theta') / (1 + gap / (width c)) while the wings rotate apart, with C = ``strength``, c the chord,
    theta' the pitch rate and gap = 2 r sin(zeta - min zeta).
    """
    gap = 2.0 * flow.r * np.sin(flow.zeta - flow.zeta.min())[:, None]
    near = 1.0 / (1.0 + gap / (p["width"] * flow.chord))
    return np.asarray(-p["strength"] * 0.5 * flow.chord**2 * flow.turn * near * flow.peel[:, None])


def tip(flow: Flow, strength: float) -> Array:
    """Tip-loss factor [E] on the circulation of a super-elliptic wing of span R: sqrt(1 - (r / R)^(2 / strength))."""
    return np.asarray(np.sqrt(1.0 - (flow.r / flow.span) ** (2.0 / strength)))


def wake_tip(flow: Flow, vehicle: Vehicle, air: Condition, swept: float, share: float) -> Array:
    """Tip-loss factor [E] on the circulation as of :func:`tip`, with an exponent by the speed of the wake.

    The vortex sheets are share (U_x / 2 + sqrt(U_x^2 / 4 + v^2)) / (2 f) apart: the way of the wake in a half stroke,
    with the stream U_x along body x and v^2 = m g / (2 rho A), A the area ``swept`` (m^2) by the wings (Rankine and
    Froude; Leishman 2006, sect. 2.13, axial climb).
    """
    ahead = 0.5 * air.airspeed * math.cos(air.angle_of_attack)
    hover = vehicle.mass * STANDARD_GRAVITY / (2.0 * density(air) * swept)
    spacing = share * (ahead + math.sqrt(ahead**2 + hover)) / (2.0 * air.flap_frequency)
    return tip(flow, _LOADED * spacing / vehicle.span)


def revolving_lift(flow: Flow, strength: float) -> Array:
    """Circulation [n, E] (m^2/s) of ``strength`` times the lift coefficient measured on a revolving wing.

    C_L = 0.225 + 1.58 sin(2.13 alpha - 7.2), alpha in degrees (Dickinson, Lehmann and Sane 1999).
    """
    lift = 0.225 + 1.58 * np.sin(np.radians(2.13 * _attack(flow) - 7.2))
    return np.asarray(-0.5 * strength * flow.chord * flow.speed * lift * np.sign(flow.met.real * flow.met.imag))


def suction(flow: Flow, lift: float, strength: float) -> Array:
    """Change of the force per length [n, E] (N/m) towards the leading edge if its suction changes by ``strength``.

    Polhamus (1966): potential flow has the thrust K_p sin^2 alpha. Here K_p is 2 ``lift``, and a part
    sin^2 alpha of the thrust is lost to separation.
    """
    alpha = np.radians(_attack(flow))
    thrust = 2.0 * lift * (np.sin(alpha) * np.cos(alpha)) ** 2
    return np.asarray(0.5 * flow.rho * flow.chord * flow.speed**2 * strength * thrust * np.sign(flow.met.real))


def revolving_drag(flow: Flow, strength: float) -> Array:
    """``strength`` times the drag coefficient [n, E] measured on a revolving wing.

    C_D = 1.92 - 1.55 cos(2.04 alpha - 9.82), alpha in degrees (Dickinson, Lehmann and Sane 1999).
    """
    return np.asarray(strength * (1.92 - 1.55 * np.cos(np.radians(2.04 * _attack(flow) - 9.82))))


def _attack(flow: Flow) -> Array:
    """Angle of attack [n, E], 0 to 90 degrees."""
    return np.degrees(np.arctan2(np.abs(flow.met.imag), np.abs(flow.met.real)))


def cambered(flow: Flow, lift: float, angle: float) -> Array:
    """Change of circulation [n, E] (m^2/s) of a wing whose zero-lift angle is ``angle`` (rad).

    -1/2 c V angle dC_L/dalpha, with a slope in proportion to that of the curve of a revolving wing, 2 ``lift`` cos(2.13
    alpha - 7.2), alpha in degrees (Dickinson, Lehmann and Sane 1999), ``lift`` being the largest C_L, and c the chord,
    V the speed.
    """
    slope = 2.0 * lift * np.cos(np.radians(2.13 * _attack(flow) - 7.2))
    return np.asarray(-0.5 * flow.chord * flow.speed * angle * slope)


def by_suction(flow: Flow, lift: float, strength: float) -> Array:
    """Change of circulation [n, E] (m^2/s) if potential lift and vortex lift have another ratio.

    Polhamus (1966): C_L = K_p sin alpha cos^2 alpha + K_v cos alpha sin^2 alpha. K_p grows by 4 ``lift`` ``strength``,
    and K_v falls by as much.
    """
    alpha = np.radians(_attack(flow))
    more = 2.0 * strength * (np.cos(alpha) - np.sin(alpha)) * np.sin(2.0 * alpha) * lift
    return np.asarray(-0.5 * flow.chord * flow.speed * more * np.sign(flow.met.real * flow.met.imag))


def varied(coefficients: Mapping[str, float], condition: Condition, p: Parameters) -> dict[str, float]:
    """Copy of ``coefficients`` with C_l times (f / f_0)^-s exp(s b (a - a_0)), and C_F by its inverse to the power g.

    f is the flap frequency (Hz), a the body pitch (rad), s the ``strength``, b ``by_pitch``, g ``fling``: power laws as
    of the reduced frequency (Dickson and Dickinson 2004, who vary the ratio of translation to flapping).
    """
    grown = -p["strength"] * math.log(condition.flap_frequency / _REFERENCE_HZ)
    grown += p["strength"] * p["by_pitch"] * (condition.angle_of_attack - _REFERENCE_PITCH)
    factors = {"C_l": math.exp(grown), "C_F": math.exp(-p["fling"] * grown)}
    return {name: value * factors.get(name, 1.0) for name, value in coefficients.items()}


def _wagner(flow: Flow, gamma: Array, _: Array, p: Parameters) -> Array:
    """Circulation [n, E] that lags the quasi-steady ``gamma`` [n, E]: Duhamel's integral over all past beats.

    Indicial function of Garrick (1938): phi(s) = 1 - 2 / (4 + s), s the distance in half chords. phi'(s) =
    2 / (4 + s)^2, summed over past beats of S half chords each, is 2 / S^2 zeta(2, (4 + s) / S), Hurwitz's zeta.
    """
    n = len(flow.t)
    every = n // _LAG_STEPS if n % _LAG_STEPS == 0 else 1
    s = flow.travelled(flow.speed)
    beat, at, late = s[-1], s[:-1:every], gamma[::every]
    step = 0.5 * ((np.roll(at, -1, axis=0) - np.roll(at, 1, axis=0)) % beat)
    since = (at[:, None] - at[None, :]) % beat
    kernel = 2.0 / beat**2 * hurwitz(2.0, (4.0 + since) / beat)
    edge = np.arange(len(at))  # the present instant belongs half to this beat and half to the last
    kernel[edge, edge] = 0.5 * (kernel[edge, edge] + 2.0 / beat**2 * hurwitz(2.0, 4.0 / beat + 1.0))
    followed = np.einsum("ije,je,je->ie", kernel, late, step)
    spectrum = np.fft.rfft(followed, axis=0) * (n / len(at))
    delayed = 0.5 * gamma + np.fft.irfft(spectrum, n, axis=0)
    return np.asarray(gamma + p["strength"] * (delayed - gamma))


def _stall(flow: Flow, gamma: Array, rotation: Array, p: Parameters) -> Array:
    """Circulation [n, E] with dynamic stall: Kirchhoff's lift with a doubly lagged separation point.

    Leishman and Beddoes (1989); the lags are in half chords travelled. ``rotation`` [n, E], the rotational part of
    ``gamma`` [n, E], does not stall.
    """
    steps = np.diff(flow.travelled(flow.speed), axis=0)
    alpha = np.abs(np.arctan2(flow.met.imag, np.abs(flow.met.real)))
    late = followed(alpha, steps / p["pressure_lag"])
    over = (late - p["angle"]) / p["softness"]
    point = np.where(over < 0, 1.0 - 0.3 * np.exp(np.minimum(over, 0.0)), 0.04 + 0.66 * np.exp(-np.maximum(over, 0.0)))
    attached = followed(point, steps / p["layer_lag"])
    lost = p["strength"] * (1.0 - ((1.0 + np.sqrt(attached)) / 2.0) ** 2)
    return np.asarray(gamma - lost * (gamma - rotation))


def _shed(flow: Flow, gamma: Array, rotation: Array, p: Parameters) -> Array:
    """Circulation [n, E] with dynamic stall and the vortex that is shed: it carries what the separation has taken.

    The vortex leaves the wing in two stages of ``decay`` / 2 half chords each: it rolls up, then it is convected, so
    that little of it is lost at first (Leishman and Beddoes 1989, who let it stay whole until it passes the trailing
    edge). ``vortex``: fraction of what :func:`_stall` takes that the vortex carries.
    """
    left = _stall(flow, gamma, rotation, {**p, "strength": min(p["strength"], 1.0)})
    lost = gamma - left
    steps = np.diff(flow.travelled(flow.speed), axis=0) * 2.0 / p["decay"]
    gone = followed(followed(lost, steps), steps)
    return np.asarray(left + p["vortex"] * (lost - gone))


def _camber(flow: Flow, gamma: Array, _: Array, p: Parameters) -> Array:
    """Circulation [n, E]: ``gamma`` plus that of a flexible wing cambered by its own inertia.

    The camber is strength r zeta'' / (R A) chords, with zeta the flap angle, R the span and A = 1000 rad/s^2.
    """
    camber = p["strength"] * flow.acceleration[:, None] * flow.r / (1000.0 * flow.span)
    return np.asarray(gamma + 0.5 * flow.chord * flow.speed * 4.0 * np.pi * camber)


CIRCULATION: Mapping[str, Callable[[Flow, Array, Array, Parameters], Array]] = {
    "dynamic_stall": _stall,
    "stall_vortex": _shed,
    "circulation_lag": _wagner,
    "inertial_camber": _camber,
}

_STALL = {"angle": (0.5, 0.9), "softness": (0.1, 0.2), "pressure_lag": (1.0, 2.0), "layer_lag": (2.0, 5.0)}
_listed = partial(Law, side="physics")
_unlisted = partial(Law, side="physics", listed=False)
LOADING = (
    _listed(
        "clap_and_peel",
        typical=2.7,
        source="Ellington (1984, part IV); Maxworthy (1979): fling circulation that falls as the gap opens",
        shape={"width": (2.0, 4.0)},
    ),
    _listed("circulation_lag", typical=1.0, source="Garrick (1938); Duhamel's integral"),
    _listed("dynamic_stall", typical=0.7, source="Leishman and Beddoes (1989)", shape=_STALL),
    _listed(
        "stall_vortex",
        typical=0.5,
        source="Leishman and Beddoes (1989): separation with two lags, and a vortex that leaves in two stages",
        shape={**_STALL, "vortex": (0.8, 1.2), "decay": (4.0, 8.0)},
    ),
    _listed(
        "tip_loss", typical=0.25, source="Prandtl (1918): square-root decay of the load at the tip, super-elliptic"
    ),
    _listed(
        "wake_tip_loss",
        typical=0.5,
        source="Prandtl (1918): square-root decay; its width by the wake of an axial climb (Leishman 2006)",
        values=lambda p: {"wake_tip_loss.share": p["strength"]},
    ),
    _listed(
        "translation", typical=1.0, source="lift of a revolving wing, as measured (Dickinson, Lehmann and Sane 1999)"
    ),
    _listed(
        "rotational_circulation",
        typical=1.5,
        source="Sane and Dickinson (2002): circulation in proportion to the pitch rate",
        values=lambda p: {"rotational_circulation.coefficient": p["strength"]},
    ),
    _listed("viscous", typical=1.0, source="drag of a revolving wing, as measured (Dickinson, Lehmann and Sane 1999)"),
    _listed(
        "zero_lift_angle",
        typical=0.05,
        source="Munk (1922); slope of the measured lift curve (Dickinson, Lehmann and Sane 1999)",
        both_signs=True,
        values=lambda p: {"zero_lift_angle.angle": p["strength"]},
    ),
    _listed(
        "lift_curve",
        typical=0.15,
        source="Polhamus (1966), NASA TN D-3767: potential lift and vortex lift, in another ratio",
        both_signs=True,
    ),
    _listed(
        "leading_edge_suction",
        typical=0.3,
        source="Polhamus (1966), NASA TN D-3767: suction of potential flow, of which separation takes sin^2 alpha",
        both_signs=True,
    ),
    _listed(
        "varying_coefficients",
        typical=2.0,
        source="powers of frequency and exponentials of pitch; the library has affine laws (Armanini et al. 2016)",
        both_signs=True,
        shape={"by_pitch": (-0.1, 0.1), "fling": (0.2, 0.6)},
    ),
    _unlisted(
        "inertial_camber",
        typical=0.1,
        source="thin cambered airfoil, lift 4 pi camber; camber by inertia of the membrane",
        both_signs=True,
    ),
)
