"""Everything about one wing under one condition that the compiled equations need, as plain arrays."""

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
LAG, LAG_RATE, STALL, STALL_ANGLE, STALL_DELAY, VORTEX, VORTEX_ANGLE, CARRIED = range(8)
AIR_LAWS = 8
AIR_STATES = 4  # per strip: two lagged downwashes, lagged angle of attack, attached fraction
# Columns of Rig.jets: strip, velocity of the air, height and half height of the stream
JETS = 6
# Columns of Rig.points: kind, place from the body's centre, parameters of the law; and its kinds
POINTS = 11
BAND, STOP, BRAKE, APPENDAGE = range(4)


class Rig(NamedTuple):
    """One wing under one condition, SI units. N bodies; frames N and N + 1 are the front and the rear driving rod.

    Attributes:
        mass: [N] kg; ``inertia`` [N, 3, 3] kg m^2 about the centre of mass, in the body's frame.
        rest: [N, 3] centres of mass at rest, m.
        first, second: [C] bodies that a joint connects; ``a``, ``b`` [C, 3] its place from the body (for a rod: from
            the hinge), m.
        stiffness, damping: [C, 6] about x, y, z, then along x, y, z, of the first body's axes.
        bends: [C] axis about which it bends; ``curvature`` [C]: rad over the span per rad.
        hardening: [C] growth of the bending moment; ``play`` [C] rad to either side about x; 0 without them.
        memory_of: [E] joint, ``memory_axis`` [E] axis, ``memory`` [E, 3] kind, stiffness (N m/rad), and relaxation time
            (s) or yield angle (rad).
        strip: [S + 1] first body of each strip; ``weight`` [N] part of the strip's area; ``centroid`` [N, 2] from the
            body's centre, m.
        area, chord: [S] m^2 and m.
        coefficients: [4] L_a, L_b, ID_a, ID_b (thesis Eqs. 10-11); ``lift``, ``drag`` [N, 2]: shares and places.
        air: density, kg/m^3; ``wind`` [3] m/s; ``gravity`` m/s^2.
        air_laws: [AIR_LAWS]; ``remembers``: whether they have internal states.
        jets: [J, JETS]; ``points`` [P, POINTS] with ``point_body`` [P].
        hinge: [3] m on the axis of the rods; ``axle`` [3] its direction.
        period: of a beat, s.
        reach: largest difference of the numbers of two joined bodies.
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
    """Frames [N + 2, ...] in the world: rotation, centre, velocity, angular velocity, and both accelerations."""

    R: Array
    p: Array
    v: Array
    w: Array
    dv: Array
    dw: Array


def states_of(rig: Rig) -> int:
    """Number of internal states."""
    return len(rig.memory) + AIR_STATES * len(rig.area) * rig.remembers + 2 * len(rig.points)
