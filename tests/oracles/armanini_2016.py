"""The equations of Armanini et al. (2016), element by element, independent of the simulator's kernels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from wingfit.records import Condition, Vehicle

Array = npt.NDArray[np.float64]


def split_cycle(t: float, amplitude: float, delta: float, eta: float) -> float:
    """Eqs. 20-21."""
    omega = 2 * math.pi
    sigma, xi = delta * omega / (omega - 2 * delta), -2 * math.pi * delta / (omega - 2 * delta)
    t = t % 1.0
    if (omega - delta) * t <= math.pi:
        return -amplitude * math.cos((omega - delta) * t) + eta
    return -amplitude * math.cos((omega + sigma) * t + xi) + eta


def forces(
    vehicle: Vehicle,
    condition: Condition,
    rho: float,
    flap: Array,
    pitch: Array,
    coefficients: Mapping[str, float],
    peeling: bool,
    peeled: float,
    elements: int,
) -> Array:
    """Force [2] along body x and z at one instant.

    ``flap`` [3] is zeta with two derivatives, ``pitch`` [3] theta_w at the pitch station with two. Velocities are
    differentiated by hand from Eqs. 18-19.
    """
    total = np.zeros(2)
    stations = vehicle.stations
    area = sum(0.5 * (a.chord + b.chord) * (b.r - a.r) for a, b in pairwise(stations))
    dr, theta_b, V = vehicle.span / elements, condition.angle_of_attack, condition.airspeed
    zeta, dzeta, ddzeta = flap
    for upper in (False, True):
        for e in range(elements):
            r = (e + 0.5) * dr
            c = float(np.interp(r, [s.r for s in stations], [s.chord for s in stations]))
            q = r / (vehicle.motion.pitch_station * vehicle.span)
            theta = vehicle.motion.root_pitch + (pitch[0] - vehicle.motion.root_pitch) * q
            dtheta, ddtheta = pitch[1] * q, pitch[2] * q
            angle = vehicle.dihedral + zeta if upper else vehicle.dihedral - zeta
            dcos = -math.sin(angle) * (dzeta if upper else -dzeta)
            if vehicle.velocities == "printed":
                vx, vz, ax, az = _printed(theta, dtheta, theta_b, V, math.cos(angle), dcos, upper)
                shrink = math.cos(zeta)
            else:
                vx, vz, ax, az = _mirrored(theta, dtheta, theta_b, V, math.cos(angle), dcos, upper)
                shrink = math.cos(angle)
            vx += r * dzeta * math.cos(theta)
            vz += -r * dzeta * math.sin(theta)
            ax += r * ddzeta * math.cos(theta) - r * dzeta * dtheta * math.sin(theta)
            az += -r * ddzeta * math.sin(theta) - r * dzeta * dtheta * math.cos(theta) - 0.5 * c * ddtheta
            speed, alpha = math.hypot(vx, vz), math.atan(-vz / vx)
            gamma = 0.5 * coefficients["C_l"] * math.sin(2 * alpha) * c * speed
            if peeling:
                gamma += 0.5 * coefficients["C_F"] * c**2 * -dtheta
            else:
                gamma += 0.5 * coefficients["C_r"] * (0.75 - vehicle.pitch_axis) * c**2 * dtheta
            m11 = 0.25 * math.pi * rho * vehicle.thickness**2
            m22 = 0.25 * math.pi * rho * (c * peeled) ** 2
            m1, m2 = c / area * vehicle.wing_mass + m22, c / area * vehicle.wing_mass + m11
            C_D = coefficients["C_D0"] * math.cos(alpha) ** 2 + coefficients["C_Dpi2"] * math.sin(alpha) ** 2
            viscous = 0.5 * rho * c * C_D * speed
            fx = m1 * vz * dtheta - rho * gamma * vz - m11 * ax - viscous * vx
            fz = -m2 * vx * dtheta + rho * gamma * vx - m22 * az - viscous * vz
            total[0] += dr * (fx * math.sin(theta) + fz * math.cos(theta))
            total[1] += dr * (fx * math.cos(theta) - fz * math.sin(theta)) * shrink * (-1 if upper else 1)
    return 2 * total


def _printed(
    theta: float, dtheta: float, theta_b: float, V: float, cos: float, dcos: float, upper: bool
) -> tuple[float, float, float, float]:
    """The stream's part of Eqs. 18-19 and its time derivative."""
    if upper:
        a, da = theta_b - theta + math.pi / 2, -dtheta
        return (
            -V * math.cos(a),
            V * math.sin(a) * cos,
            V * math.sin(a) * da,
            V * math.cos(a) * da * cos + V * math.sin(a) * dcos,
        )
    a, da = theta_b + theta - math.pi / 2, dtheta
    return (
        V * math.cos(a),
        -V * math.sin(a) * cos,
        -V * math.sin(a) * da,
        -V * math.cos(a) * da * cos - V * math.sin(a) * dcos,
    )


def _mirrored(
    theta: float, dtheta: float, theta_b: float, V: float, cos: float, dcos: float, upper: bool
) -> tuple[float, float, float, float]:
    """The body's velocity through the air, projected on the chord and the normal of a wing at this dihedral."""
    u, w = V * math.cos(theta_b), (-1 if upper else 1) * V * math.sin(theta_b)
    s, k = math.sin(theta), math.cos(theta)
    return (
        u * s + w * cos * k,
        u * k - w * cos * s,
        dtheta * (u * k - w * cos * s) + w * dcos * k,
        -dtheta * (u * s + w * cos * k) - w * dcos * s,
    )
