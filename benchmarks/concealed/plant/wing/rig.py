"""Plain arrays with all that the compiled equations of motion need about one wing under one condition."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

# Columns of Rig.memory (internal states of joints), and its kinds
KEEPS, STIFF, PARAMETER = range(3)
MAXWELL, DAHL, SLIDER = range(3)
# Indices of Rig.air_laws
LAG, LAG_RATE, STALL, STALL_ANGLE, STALL_DELAY, VORTEX, VORTEX_ANGLE, CARRIED, TURNING, PLATE, SKIN = range(11)
AIR_LAWS = 11
AIR_STATES = 4  # per strip: two lagged downwashes, lagged angle of attack, attached fraction
# Columns of Rig.jets: strip, velocity of the air, height and half height of the stream
JETS = 6
# Columns of Rig.points: kind, place from the body's centre, parameters of the law; and its kinds
POINTS = 11
BAND, STOP, BRAKE, TETHER, APPENDAGE, CABLE = range(6)


class Rig(NamedTuple):
    """One wing under one condition, SI units: N bodies, S strips, C joints.

    Frames N and N + 1 are the front and the rear driving rod.

    Attributes:
        mass: [N] kg; ``inertia`` [N, 3, 3] kg m^2 about the centre of mass, in the body's frame.
        rest: [N, 3] centres of mass at rest, m.
        first, second: [C] bodies that a joint connects; ``a``, ``b`` [C, 3] the joint's position from the centre of
            either (for a rod: from the hinge), m.
        stiffness, damping: [C, 6] about x, y, z (N m/rad, N m s/rad), then along x, y, z (N/m, N s/m), of the first
            body's axes.
        bends: [C] axis (0 x, 1 y) about which a joint bends; ``curvature`` [C]: angle over the whole span per angle of
            the joint.
        hardening: [C] h in the bending moment k phi sinh(x) / x, x = h curvature phi; ``play`` [C] free angle to either
            side, rad; both 0 without the effect.
        memory_of: [E] joint of each spring with an internal state; ``memory_axis`` [E] its axis; ``memory`` [E, 3]
            kind, stiffness (N m/rad), and relaxation time (s) or yield angle (rad).
        strip: [S + 1] first body of each strip; ``weight`` [N] body's part of the strip's area; ``centroid`` [N, 2] of
            the body's area from its centre of mass, m.
        area, chord: [S] of the strips, m^2 and m.
        coefficients: [4] genes L_a, L_b, ID_a, ID_b of lift and drag (van der Grinten's thesis, Eqs. 10-11); ``lift``,
            ``drag`` [N, 2]: as returned by :func:`.joints.shares`.
        air: density, kg/m^3; ``wind`` [3] velocity, m/s; ``gravity`` m/s^2.
        air_laws: [AIR_LAWS] parameters of the hidden effects in the air loads, by the indices above; ``remembers``: 1
            if these have internal states, else 0.
        jets: [J, JETS] hidden jets of air; ``points`` [P, POINTS] hidden loads at a point of the body ``point_body``
            [P]; columns as above.
        hinge: [3] m on the axis of the rods; ``axle`` [3] its direction.
        period: of a beat, s.
        reach: largest difference of the numbers of two coupled bodies; sets the bandwidth of the Newton matrix.
    """

    mass: Array
    inertia: Array
    rest: Array
    first: Index
    second: Index
    a: Array
    b: Array
    stiffness: Array
    damping: Array
    bends: Index
    curvature: Array
    hardening: Array
    play: Array
    memory_of: Index
    memory_axis: Index
    memory: Array
    strip: Index
    weight: Array
    centroid: Array
    area: Array
    chord: Array
    coefficients: Array
    lift: Array
    drag: Array
    air: float
    wind: Array
    gravity: float
    air_laws: Array
    remembers: int
    jets: Array
    points: Array
    point_body: Index
    hinge: Array
    axle: Array
    period: float
    reach: int


class Motion(NamedTuple):
    """Motion of the frames of N bodies and 2 rods at one instant, in the world frame.

    Rotation ``R`` [N + 2, 3, 3]; centre ``p``, velocity ``v``, angular velocity ``w``, and their time derivatives
    ``dv`` and ``dw``, [N + 2, 3] each (m, rad, s).
    """

    R: Array
    p: Array
    v: Array
    w: Array
    dv: Array
    dw: Array


def states_of(rig: Rig) -> int:
    """Number Z of internal states of all hidden effects that have memory."""
    return len(rig.memory) + AIR_STATES * len(rig.area) * rig.remembers + 2 * len(rig.points)
