"""Effects that can be hidden in the simulated flapping vehicle.

The diagnosis has its own library of effects; an effect that both have follows an equation of another form here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import numpy.typing as npt
from scipy.special import zeta as hurwitz

from benchmarks.concealed.plant.law import Law, Parameters
from wingfit.records import Condition, Vehicle
from wingfit.records.dataset import STANDARD_GRAVITY

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_NONE = np.zeros((0, 0), complex)
_LAG_STEPS = 120  # steps per beat of the integral over past circulation


@dataclass(frozen=True)
class Flow:
    """Motion of the blade elements of the wings on one side over a beat: n instants, E elements along the span.

    Complex vectors: the real part is along body x (axes of the stroke) or along the chord (axes of the chord), the
    imaginary part normal to it.

    Attributes:
        t: beats from the start of the beat.
        r, chord: radius and chord of the elements [E], m.
        frequency: flapping frequency, Hz.
        rho: density of the air, kg/m^3.
        span: length of a wing, m.
        zeta, rate, acceleration: flap angle and its first two time derivatives [n] (rad, s).
        level: cosine of the wing's angle to the horizontal [n].
        theta, turn, turn_rate: pitch angle and its first two time derivatives [n, E] (rad, s).
        own, own_rate: velocity due to flapping and airspeed in axes of the stroke, complex, and its time derivative
            [n, E] (m, s).
        peel, peeled: fraction of each instant in which the two wings peel apart, and of the chord that has separated
            [n] (clap and peel).
        met: velocity through the air in axes of the chord, complex, with all inflow and gusts [n, E], m/s.
    """

    t: Array
    r: Array
    chord: Array
    frequency: float
    rho: float
    span: float
    zeta: Array
    rate: Array
    acceleration: Array
    level: Array
    theta: Array
    turn: Array
    turn_rate: Array
    own: Complex
    own_rate: Complex
    peel: Array
    peeled: Array
    met: Complex = field(default_factory=lambda: _NONE)

    def turned(self, q: Complex) -> Complex:
        """Transform complex vectors ``q`` [n, E] from axes of the stroke to those of the chord, or back."""
        return np.asarray(1j * np.exp(-1j * self.theta) * np.conj(q))

    @property
    def speed(self) -> Array:
        """Airspeed of each element, m/s [n, E]; never zero."""
        return np.abs(self.met) + 1e-12

    def travelled(self, speed: Array) -> Array:
        """Distance travelled since the start of the beat [n + 1, E], in half chords, at ``speed`` [n, E] (m/s).

        The last row is the distance of the whole beat.
        """
        step = 1.0 / (self.frequency * len(self.t))
        closed = np.concatenate([speed, speed[:1]])
        way = np.cumsum(0.5 * (closed[1:] + closed[:-1]), axis=0) * step * 2.0 / self.chord
        return np.concatenate([np.zeros((1, len(self.r))), way])


def levered(flap: Array, strength: float) -> Array:
    """Flap angle [n] (rad) if the driving lever is longer by the fraction ``strength`` than for ``flap`` [n].

    The tangent of the angle's deviation from its mean grows by that fraction.
    """
    if not strength:
        return flap
    mean = flap.mean()
    return np.asarray(mean + np.arctan((1.0 + strength) * np.tan(flap - mean)))


def blocked(condition: Condition, strength: float) -> Condition:
    """Copy of ``condition`` with airspeed squared times 1 + 2 ``strength``, as by tunnel blockage (Maskell 1963)."""
    return replace(condition, airspeed=condition.airspeed * math.sqrt(1.0 + 2.0 * strength))


def disc_inflow(thrust: Array, swept: float, air: Condition, rho: float, p: Parameters) -> Array:
    """Induced inflow [n] (m/s) at the wing tips due to ``thrust`` [n] (N) of an actuator disc of area ``swept`` (m^2).

    The inflow is proportional to the radius. Its mean v is that of momentum theory, v^2 = T / (rho A) in hover (Glauert
    1935; Leishman 2006, sect. 3.3), for the thrust times ``strength``; variations follow the thrust with the time
    constant ``lag`` R_A / |U + v| (Oye 1990), R_A the radius of a circle of area ``swept`` and U the airspeed.
    """
    ahead = air.airspeed * math.cos(air.angle_of_attack)
    aside = air.airspeed * math.sin(air.angle_of_attack)
    pushed = p["strength"] * thrust / (rho * swept)
    v = 0.0
    for _ in range(200):  # damped iteration; it would oscillate otherwise
        through = math.hypot(ahead + v, aside) + 1e-3
        v = 0.5 * (v + float(pushed.mean()) / through)
    tau = p["lag"] * math.sqrt(swept / math.pi) / through
    steps = np.full((len(pushed), 1), 1.0 / (air.flap_frequency * len(pushed) * tau))
    return _followed(pushed[:, None] / through, steps)[:, 0]


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
    late = _followed(alpha, steps / p["pressure_lag"])
    over = (late - p["angle"]) / p["softness"]
    point = np.where(over < 0, 1.0 - 0.3 * np.exp(np.minimum(over, 0.0)), 0.04 + 0.66 * np.exp(-np.maximum(over, 0.0)))
    attached = _followed(point, steps / p["layer_lag"])
    lost = p["strength"] * (1.0 - ((1.0 + np.sqrt(attached)) / 2.0) ** 2)
    return np.asarray(gamma - lost * (gamma - rotation))


def _followed(target: Array, steps: Array) -> Array:
    """Periodic solution x [n, E] of x' = target - x, for steps ``steps`` [n, E] in units of the time constant."""
    keep = np.exp(-steps)
    start = np.zeros(target.shape[1])
    for _ in range(2):  # the first round gives the correction of the start value
        x = start.copy()
        out = np.empty_like(target)
        for k in range(len(target)):
            out[k] = x
            x = target[k] + (x - target[k]) * keep[k]
        start = start + (x - start) / (1.0 - np.prod(keep, axis=0))
    return out


def _camber(flow: Flow, gamma: Array, _: Array, p: Parameters) -> Array:
    """Circulation [n, E]: ``gamma`` plus that of a flexible wing cambered by its own inertia.

    The camber is strength r zeta'' / (R A) chords, with zeta the flap angle, R the span and A = 1000 rad/s^2.
    """
    camber = p["strength"] * flow.acceleration[:, None] * flow.r / (1000.0 * flow.span)
    return np.asarray(gamma + 0.5 * flow.chord * flow.speed * 4.0 * np.pi * camber)


def _pocket(flow: Flow, p: Parameters) -> Complex:
    """Change [n, E] (m/s, complex) of the velocity relative to the air by wake capture (Birch and Dickinson 2003).

    The air that a stroke has set in motion reaches the wing near its reversal. In the model it moves at ``strength``
    times the excess of the stroke's mean speed over the wing's own while the wing slows down, and times the mean speed
    after the reversal, multiplied by exp(-x / (reach c)) at a distance x travelled from the reversal, c the chord.
    """
    air, way_to = np.zeros(flow.own.shape), flow.travelled(np.abs(flow.own))
    whole, here = way_to[-1], way_to[:-1]
    for way, turned in ((1.0, int(flow.zeta.argmax())), (-1.0, int(flow.zeta.argmin()))):
        going = way * flow.rate > 0
        speed = np.abs(flow.rate[going]).mean()
        slowing = going & (way * flow.acceleration < 0)
        beyond = np.where(going, np.maximum(speed - np.abs(flow.rate), 0.0) * slowing, speed)
        since = (here - here[turned]) % whole
        apart = 0.5 * np.where(going[:, None], whole - since, since)
        air += way * flow.r * beyond[:, None] * np.exp(-apart / p["reach"])
    return np.asarray(-1j * p["strength"] * air)


def _jet(flow: Flow, p: Parameters) -> Complex:
    """Change [n, E] (m/s) of the velocity along body x by a jet of ``strength`` m/s near one phase and span."""
    apart = (flow.t - p["phase"] + 0.5) % 1.0 - 0.5
    place = np.exp(-0.5 * ((flow.r / flow.span - p["span"]) / 0.15) ** 2)
    return np.asarray(p["strength"] * np.exp(-0.5 * (apart / 0.05) ** 2)[:, None] * place + 0j)


def _tail(forces: Array, vehicle: Vehicle, air: Condition, p: Parameters) -> Array:
    """Force [n, 2] (N, body x and z) on a tail in the wake of the wings.

    Along x it is -strength X(t - delay), with X the positive part of the wings' force along x (``forces`` [n, 2])
    smoothed in time, and ``strength`` the fraction of the jet's momentum that the tail takes.
    """
    n = len(forces)
    wash = np.maximum(forces[:, 0], 0.0)
    speed = air.airspeed + math.sqrt(vehicle.mass * STANDARD_GRAVITY / (2.0 * 1.2 * math.pi * vehicle.span**2))
    delay = p["distance"] / speed * air.flap_frequency
    k = np.arange(n // 2 + 1)
    spectrum = np.fft.rfft(wash) * np.exp(-2j * np.pi * k * delay - 0.5 * (0.25 * k) ** 2)
    push = p["strength"] * np.fft.irfft(spectrum, n)
    return np.stack([-push, -math.sin(p["incidence"]) * push], axis=1)


def _knock(forces: Array, vehicle: Vehicle, air: Condition, p: Parameters) -> Array:
    """Force [n, 2] (N, body x and z) of a linkage that hits its stop at one phase, then reversed as it separates.

    ``strength``: peak force in units of the vehicle's weight at 12 Hz; it grows with the square of the frequency.
    """
    t = np.arange(len(forces)) / len(forces)
    width = 0.02
    apart = (t - p["phase"] + 0.5) % 1.0 - 0.5
    pulse = np.exp(-0.5 * (apart / width) ** 2) - 0.5 * np.exp(-0.5 * ((apart - 4.0 * width) / (2.0 * width)) ** 2)
    size = p["strength"] * vehicle.mass * STANDARD_GRAVITY * (air.flap_frequency / 12.0) ** 2
    return np.asarray(size * pulse[:, None] * [math.cos(p["direction"]), math.sin(p["direction"])])


GUSTS: Mapping[str, Callable[[Flow, Parameters], Complex]] = {"wake_capture": _pocket, "local_jet": _jet}
CIRCULATION: Mapping[str, Callable[[Flow, Array, Array, Parameters], Array]] = {
    "dynamic_stall": _stall,
    "circulation_lag": _wagner,
    "inertial_camber": _camber,
}
AFTERWARDS: Mapping[str, Callable[[Array, Vehicle, Condition, Parameters], Array]] = {
    "tail_in_wake": _tail,
    "stop_knock": _knock,
}

_listed = partial(Law, side="physics")
_unlisted = partial(Law, side="physics", listed=False)
LAWS = {
    law.name: law
    for law in (
        _listed(
            "clap_and_peel",
            typical=2.7,
            source="Ellington (1984, part IV); Maxworthy (1979): fling circulation that falls as the gap opens",
            shape={"width": (2.0, 4.0)},
        ),
        _listed("circulation_lag", typical=1.0, source="Garrick (1938); Duhamel's integral"),
        _listed(
            "dynamic_stall",
            typical=0.7,
            source="Leishman and Beddoes (1989)",
            shape={"angle": (0.5, 0.9), "softness": (0.1, 0.2), "pressure_lag": (1.0, 2.0), "layer_lag": (2.0, 5.0)},
        ),
        _listed(
            "tip_loss", typical=0.25, source="Prandtl (1918): square-root decay of the load at the tip, super-elliptic"
        ),
        _listed("induced_inflow", typical=0.7, source="Glauert (1935); Oye (1990)", shape={"lag": (0.3, 0.55)}),
        _listed(
            "wake_capture",
            typical=0.25,
            source="Birch and Dickinson (2003): wake of the last stroke",
            shape={"reach": (0.12, 0.25)},
        ),
        _listed(
            "airspeed_error",
            typical=0.1,
            source="Maskell (1963): q' = q (1 + 2 strength)",
            both_signs=True,
            values=lambda p: {"airspeed_error.part": math.sqrt(1.0 + 2.0 * p["strength"]) - 1.0},
        ),
        _listed(
            "stroke_amplitude",
            typical=0.05,
            source="a lever longer than described: the tangent of the angle grows",
            both_signs=True,
            values=lambda p: {"stroke_amplitude.part": p["strength"]},
        ),
        _unlisted(
            "tail_in_wake",
            typical=0.15,
            source="momentum of a jet on a surface in it, delayed by the distance (Glauert 1935)",
            shape={"distance": (0.06, 0.14), "incidence": (-0.3, 0.3)},
        ),
        _unlisted(
            "stop_knock",
            typical=0.5,
            source="impulse at a stop, equal to the momentum of the striking mass",
            shape={"phase": (0.0, 1.0), "direction": (-0.8, 0.8)},
        ),
        _unlisted(
            "inertial_camber",
            typical=0.1,
            source="thin cambered airfoil, lift 4 pi camber; camber by inertia of the membrane",
            both_signs=True,
        ),
        _unlisted(
            "local_jet",
            typical=4.0,
            source="a local jet",
            both_signs=True,
            shape={"phase": (0.0, 1.0), "span": (0.6, 0.9)},
        ),
    )
}
