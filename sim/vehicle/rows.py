"""Inputs of the elements of all wings: rows of their motion, and the stream relative to each side."""

from __future__ import annotations

import numpy as np

from wingfit.records import Vehicle
from wingfit.records.array_types import Array
from wingfit.sim.vehicle import elements
from wingfit.sim.vehicle.elements import Side
from wingfit.sim.vehicle.motion import Angles

ROW_COUNT = 14


def uppers(vehicle: Vehicle) -> tuple[bool, ...]:
    """Whether each computed pair of wings is the upper one: (False, True) for the layout "x4", else (False,)."""
    return (False, True) if vehicle.layout == "x4" else (False,)


def mirrored(vehicle: Vehicle) -> float:
    """Number of wings per computed side; left and right wings have the same motion."""
    return 1.0 if vehicle.layout == "single" else 2.0


def motion_rows(prescribed: Angles, forward: Array, root: float, half_step: float) -> Array:
    """Motion [B, 14, n] for the kernels, without the rows that depend on the side (see :func:`set_side`).

    ``forward`` [B, n]: the stream along body x, m/s; ``root``: pitch at the wing's root, rad. ``half_step`` is the
    twist of the first element as a fraction of that at the pitch station: half a step of the elements.
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
    """Set the pitch of the first element and the step between elements in ``rows`` [B, 14, n].

    ``pitch`` [B, n]: at the pitch station, ``root``: at the root, rad.
    """
    half = half_step * (pitch - root)
    c, s = np.cos(half), np.sin(half)
    rows[:, elements.COSINE], rows[:, elements.SINE] = (
        np.cos(root) * c - np.sin(root) * s,
        np.sin(root) * c + np.cos(root) * s,
    )
    rows[:, elements.STEP_COSINE], rows[:, elements.STEP_SINE] = c * c - s * s, 2 * c * s


def set_side(rows: Array, vehicle: Vehicle, flap: tuple[Array, Array, Array], below: Array, upper: bool) -> Side:
    """Set the rows of the dihedral and of the stream for the lower wings, or for the upper ones.

    In axes mirrored at the body's plane the upper wing moves like the lower one, in a mirrored stream. As printed, Eq.
    18 reverses the stream along the upper wing's chord (docs/decisions/0005). Wings of other layouts than "x4" are
    computed as lower ones. ``flap`` is the cosine and the sine of the flap angle, and its rate, [B, n] each; ``below``
    [B] is the speed of the stream along body z, m/s.
    """
    cosine, sine, rate = flap
    sign, printed = -1.0 if upper else 1.0, vehicle.velocities == "printed"
    c, s = np.cos(vehicle.dihedral), np.sin(vehicle.dihedral)  # of the angle zeta_0 - sign zeta:
    rows[:, elements.DIHEDRAL] = c * cosine + sign * s * sine
    rows[:, elements.DIHEDRAL_RATE] = (sign * s * cosine - c * sine) * rate
    rows[:, elements.PROJECTION] = cosine if printed else rows[:, elements.DIHEDRAL]
    rows[:, elements.DOWNWARD] = (sign * below)[:, None]
    return Side(-1.0 if printed and upper else 1.0, float(printed), sign)
