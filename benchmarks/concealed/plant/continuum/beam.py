"""Plain arrays with all that the compiled equations of motion of a wing as a rod need, under one condition."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

NODES = 3  # of an element; a shape function is a quadratic polynomial that is 1 at its node
STRAINS = 2  # points of an element at which strains are evaluated (reduced integration, which avoids locking)
AIR_STATES = 4  # per section: two lagged downwashes, lagged angle of attack, attached fraction


class Beam(NamedTuple):
    """A wing as a rod of E quadratic elements with n = 2 E + 1 nodes, SI units.

    Node 0 is the root; element e has the nodes 2 e to 2 e + 2. P = STRAINS E points for strains, two in each element;
    Q sections with mass, of which the first A carry air loads too.

    Attributes:
        rest: [n, 3] nodes at rest, m, on the reference line (mid-chord); all frames are then the wing's.
        shape, slope: [P, NODES] shape functions at the points for strains, and their derivatives by y (1/m).
        length: [P] m of span; ``before`` [P, 3] derivative of the reference line by y at rest.
        stiffness, damping: [P, 6] about x, y, z (N m^2, N m^2 s), then along x, y, z (N, N s).
        steep: m, h times the span in the bending moment EI kappa sinh(x) / x, x = steep kappa; 0: linear.
        memory_axis, memory_kind, memory_limit: [M] of the springs with an internal state at every point for strains:
            axis (0 x, 1 y), kind as in ``wing/rig.py``, and relaxation time (s) or yield curvature (1/m);
            ``memory_stiffness`` [P, M] N m^2.
        element, part: [Q] and [Q, NODES] element and shape functions of each section.
        mass, moment, inertia: [Q] kg, [Q, 3] kg m, [Q, 3, 3] kg m^2 about mid-chord, in the section's frame.
        area, chord: [A] m^2 and m; ``lift``, ``drag`` [A] x (m) of their points of attack from mid-chord.
        coefficients: [4] genes L_a, L_b, ID_a, ID_b of lift and drag (van der Grinten's thesis, Eqs. 10-11).
        air: density, kg/m^3; ``wind`` [3] m/s; ``gravity`` m/s^2.
        air_laws: as in :class:`benchmarks.concealed.plant.wing.rig.Rig`; ``remembers``: 1 if they have states, else 0.
        points: [K, 11] hidden loads at one point: kind, arm from mid-chord, parameters, as in ``Rig.points``.
        point_element, point_part: [K] and [K, NODES], as ``element`` and ``part``.
        grip: [2, 3] points where the front and the rear driving rod hold the root, from node 0 at rest, m;
            ``reach`` [2, 3]: the same points from the hinge.
        root_stiffness, root_damping: [2, 6] of the springs there: N m/rad, N/m and so on.
        hinge: [3] m; ``axle`` [3] direction of the axis; ``period`` of a beat, s.
    """

    rest: Array
    shape: Array
    slope: Array
    length: Array
    before: Array
    stiffness: Array
    damping: Array
    steep: float
    memory_axis: Index
    memory_kind: Index
    memory_limit: Array
    memory_stiffness: Array
    element: Index
    part: Array
    mass: Array
    moment: Array
    inertia: Array
    area: Array
    chord: Array
    lift: Array
    drag: Array
    coefficients: Array
    air: float
    wind: Array
    gravity: float
    air_laws: Array
    remembers: int
    points: Array
    point_element: Index
    point_part: Array
    grip: Array
    reach: Array
    root_stiffness: Array
    root_damping: Array
    hinge: Array
    axle: Array
    period: float


class Motion(NamedTuple):
    """Motion of the n nodes at one instant, in the world frame.

    Rotation ``R`` [n, 3, 3]; place ``p``, velocity ``v``, angular velocity ``w``, and their derivatives ``dv`` and
    ``dw``, [n, 3] each (m, rad, s). ``turn`` [2 E, 3]: Rodrigues' vectors, 2 tan(angle / 2) along the axis, of the
    frames of the inner (row 2 e) and the outer end of element e relative to its middle, in the frame of the middle.
    """

    R: Array
    p: Array
    v: Array
    w: Array
    dv: Array
    dw: Array
    turn: Array


def states_of(beam: Beam) -> int:
    """Number Z of internal states: those of the air, two of each load at a point, those of the springs."""
    return AIR_STATES * len(beam.area) * beam.remembers + 2 * len(beam.points) + beam.memory_stiffness.size
