"""Inputs of the blade elements: motion of the wings, and the stream relative to the lower and to the upper wings."""

from __future__ import annotations

import numpy as np

from wingfit.records import Vehicle
from wingfit.records.array_types import Array
from wingfit.sim.vehicle import elements
from wingfit.sim.vehicle.elements import Side
from wingfit.sim.vehicle.motion import Angles

ROW_COUNT = 14


def uppers(vehicle: Vehicle) -> tuple[bool, ...]:
    """For each side that is computed, whether it is the upper one: (False, True) for the layout "x4", else (False,)."""
    return (False, True) if vehicle.layout == "x4" else (False,)


def mirrored(vehicle: Vehicle) -> float:
    """Number of wings per computed side: 2 (left and right wings have the same motion), 1 for the layout "single"."""
    return 1.0 if vehicle.layout == "single" else 2.0


def motion_rows(prescribed: Angles, forward: Array, root: float, half_step: float) -> Array:
    """Motion [B, 14, n] of the wings, in rows of :mod:`wingfit.sim.vehicle.elements`; :func:`set_side` sets the others.

    ``prescribed``: flap angle and pitch; ``forward`` [B, n]: speed of the stream along body x, m/s; ``root``: pitch at
    the wing's root, rad; ``half_step``: twist (pitch less ``root``) of the first element as a fraction of that at the
    pitch station, half the increment from one element to the next.
    """
    flap, pitch = prescribed.flap, prescribed.pitch
    rows = np.empty((len(flap), ROW_COUNT, flap.shape[2]))
    rows[:, [elements.FLAP_RATE, elements.FLAP_ACCELERATION]] = flap[:, 1:]
    rows[:, [elements.PITCH_RATE, elements.PITCH_ACCELERATION]] = pitch[:, 1:]
    rows[:, elements.PEELED] = prescribed.peeled
    rows[:, elements.FORWARD] = forward
    set_twist(rows, pitch[:, 0], root, half_step)
    return rows


def set_twist(rows: Array, pitch: Array, root: float, half_step: float) -> None:
    """Set cosine and sine of the first element's pitch and of the step between elements in ``rows`` [B, 14, n].

    ``pitch`` [B, n]: at the pitch station, ``root``: at the root, rad. ``half_step``: twist (pitch less ``root``) of
    the first element as a fraction of that at the pitch station, half the increment between elements.
    """
    half = half_step * (pitch - root)
    c, s = np.cos(half), np.sin(half)
    rows[:, elements.COSINE], rows[:, elements.SINE] = (
        np.cos(root) * c - np.sin(root) * s,
        np.sin(root) * c + np.cos(root) * s,
    )
    rows[:, elements.STEP_COSINE], rows[:, elements.STEP_SINE] = c * c - s * s, 2 * c * s


def set_side(rows: Array, vehicle: Vehicle, flap: tuple[Array, Array, Array], below: Array, upper: bool) -> Side:
    """Set dihedral and stream in ``rows`` [B, 14, n] for lower or (``upper``) upper wings; return the side's factors.

    In axes mirrored at the body's plane the upper wing moves like the lower one, in a mirrored stream. As printed, Eq.
    18 of Armanini et al. (2016) reverses the stream along the upper wing's chord (docs/decisions/0005). ``flap``:
    cosine and sine of the flap angle, and its rate (rad/s), [B, n] each; ``below`` [B]: speed of the stream along body
    z, m/s.
    """
    cosine, sine, rate = flap
    sign, printed = -1.0 if upper else 1.0, vehicle.velocities == "printed"
    c, s = np.cos(vehicle.dihedral), np.sin(vehicle.dihedral)  # of the angle zeta_0 - sign zeta:
    rows[:, elements.DIHEDRAL] = c * cosine + sign * s * sine
    rows[:, elements.DIHEDRAL_RATE] = (sign * s * cosine - c * sine) * rate
    rows[:, elements.PROJECTION] = cosine if printed else rows[:, elements.DIHEDRAL]
    rows[:, elements.DOWNWARD] = (sign * below)[:, None]
    return Side(-1.0 if printed and upper else 1.0, float(printed), sign)
