"""Hidden forces on a vehicle besides those of its wings: body, tail, and the stop of the linkage."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from benchmarks.concealed.plant.law import Law, Parameters
from benchmarks.concealed.plant.vehicle.flow import Array, density, wing_area
from wingfit.records import Condition, Vehicle
from wingfit.records.dataset import STANDARD_GRAVITY

_POTENTIAL, _SUCTION = 1.3, 3.1  # K_p and K_v of a plate of aspect ratio 1 (Polhamus 1966)


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


def _drag(forces: Array, vehicle: Vehicle, air: Condition, p: Parameters) -> Array:
    """Constant force [n, 2] (N, body x and z) of a slender body in the stream: axial drag and cross-flow.

    Along x -strength q S cos^2 alpha, along z -strength q S sin^2 alpha, with the signs of the stream's components; q
    the dynamic pressure, S the area of one wing (Allen and Perkins 1951, NACA Report 1048).
    """
    along, across = math.cos(air.angle_of_attack), math.sin(air.angle_of_attack)
    size = p["strength"] * _pressure_force(vehicle, air)
    return np.tile([-size * along * abs(along), -size * across * abs(across)], (len(forces), 1))


def _lift(forces: Array, vehicle: Vehicle, air: Condition, p: Parameters) -> Array:
    """Constant force [n, 2] (N, body x and z) across the stream: lift of a tail of aspect ratio 1.

    C_L = K_p sin a cos^2 a + K_v sin^2 a cos a (Polhamus 1966, NASA TN D-3767), with a = alpha + ``incidence`` and the
    area ``strength`` times that of one wing.
    """
    alpha = air.angle_of_attack
    sine, cosine = math.sin(alpha + p["incidence"]), math.cos(alpha + p["incidence"])
    lift = p["strength"] * _pressure_force(vehicle, air)
    lift *= _POTENTIAL * sine * cosine**2 + _SUCTION * sine * abs(sine) * cosine
    return np.tile([lift * math.sin(alpha), -lift * math.cos(alpha)], (len(forces), 1))


def _pressure_force(vehicle: Vehicle, air: Condition) -> float:
    """Dynamic pressure times the area of one wing, N."""
    return 0.5 * density(air) * air.airspeed**2 * wing_area(vehicle)


AFTERWARDS: Mapping[str, Callable[[Array, Vehicle, Condition, Parameters], Array]] = {
    "tail_in_wake": _tail,
    "stop_knock": _knock,
    "body_drag": _drag,
    "tail_lift": _lift,
}

_listed = partial(Law, side="physics")
_unlisted = partial(Law, side="physics", listed=False)
BODY = (
    _listed(
        "body_drag",
        typical=0.5,
        source="Allen and Perkins (1951): axial drag and cross-flow of a slender body",
    ),
    _listed(
        "tail_lift",
        typical=0.4,
        source="Polhamus (1966): suction analogy for a plate of small aspect ratio",
        shape={"incidence": (-0.1, 0.1)},
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
)
