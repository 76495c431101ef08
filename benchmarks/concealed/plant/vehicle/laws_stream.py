"""Hidden changes of the air that a vehicle's wings meet: stream, inflow, wakes, and the downwash of lift."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.concealed.plant.law import Concealed, Law, Parameters, strength
from benchmarks.concealed.plant.vehicle.flow import GAS, Array, Complex, Flow, followed, mean_chord
from wingfit.records import Condition, Vehicle

_ROOM = 293.15  # K: temperature at which an error of pressure is converted to one of density


def blocked(condition: Condition, strength: float) -> Condition:
    """Copy of ``condition`` with airspeed squared times 1 + 2 ``strength``, as by tunnel blockage (Maskell 1963)."""
    return replace(condition, airspeed=condition.airspeed * math.sqrt(1.0 + 2.0 * strength))


def flown(condition: Condition, hidden: Concealed) -> Condition:
    """The air as it is, with the hidden errors of the described ``condition``: airspeed, direction, and pressure.

    The stream has an additional component U tan(angle) across its described direction, as by the flow angularity of a
    tunnel (Barlow, Rae and Pope 1999, ch. 6). A barometer reads too low by a constant pressure, which is R T_0 times
    the "strength" of residual_air (kg/m^3), with the gas constant R and T_0 = 293 K.
    """
    air = blocked(condition, strength(hidden, "airspeed_error"))
    if strength(hidden, "body_pitch_convention"):
        air = replace(air, angle_of_attack=-air.angle_of_attack)
    angle = strength(hidden, "body_pitch_error")
    if angle:
        airspeed, attack = air.airspeed / math.cos(angle), air.angle_of_attack + angle
        air = replace(air, airspeed=airspeed, angle_of_attack=attack)
    more = strength(hidden, "residual_air")
    return replace(air, pressure=air.pressure + more * GAS * _ROOM) if more else air


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
    return followed(pushed[:, None] / through, steps)[:, 0]


def deflected(flow: Flow, gamma: Array, vehicle: Vehicle, slope: float, share: float) -> Complex:
    """Velocity through the air [n, E] (m/s, complex, axes of the chord) with the downwash of a wing of finite span.

    The angle of the downwash is share C_L / (pi A + slope share), with C_L = 2 Gamma / (c V) from the circulation
    ``gamma`` [n, E] without downwash, the chord c, the speed V, the aspect ratio A of the wings on both sides and the
    ``slope`` of C_L per rad: Prandtl's elliptic wing, in closed form (Glauert 1926, ch. XI).
    """
    aspect = vehicle.span * (1.0 if vehicle.layout == "single" else 2.0) / mean_chord(vehicle)
    lift = 2.0 * gamma / (flow.chord * flow.speed)
    return np.asarray(flow.met * (1.0 + 1j * share * lift / (math.pi * aspect + slope * share)))


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


GUSTS: Mapping[str, Callable[[Flow, Parameters], Complex]] = {"wake_capture": _pocket, "local_jet": _jet}

_listed = partial(Law, side="physics")
_unlisted = partial(Law, side="physics", listed=False)
STREAM = (
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
        "body_pitch_error",
        typical=0.05,
        source="Barlow, Rae and Pope (1999), ch. 6: flow angularity, a velocity across the stream",
        both_signs=True,
        values=lambda p: {"body_pitch_error.angle": p["strength"]},
    ),
    _listed(
        "body_pitch_convention",
        typical=1.0,
        source="a mistake: the body pitch with the other sign; any strength above zero is all",
        values=lambda _: {"body_pitch_convention.part": -2.0},
    ),
    _listed(
        "residual_air",
        typical=0.03,
        source="Clapeyron (1834): a barometer that reads too low by the same pressure in every recording",
        values=lambda p: {"residual_air.density": p["strength"]},
    ),
    _listed(
        "downwash",
        typical=1.0,
        source="Glauert (1926), ch. XI: angle of downwash of an elliptic wing by its aspect ratio, in closed form",
    ),
    _unlisted(
        "local_jet",
        typical=4.0,
        source="a local jet",
        both_signs=True,
        shape={"phase": (0.0, 1.0), "span": (0.6, 0.9)},
    ),
)
