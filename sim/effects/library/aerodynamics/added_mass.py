"""Effect: inertia of the air that a wing accelerates together with itself (added mass)."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from wingfit.records import Station
from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.wing.division import MAX_STRIPS
from wingfit.sim.wing.structure import Structure

Array = npt.NDArray[np.float64]

_MODES = 128  # of the flow about a section: entries of up to 8 bodies along the chord to 3e-4


def _wing(scene: WingScene, values: Values) -> None:
    scale, structure = values["k"] * scene.density, scene.structure
    for strip, count in enumerate(structure.division.bodies):
        joined, first = strip_matrix(structure, strip), structure.division.index(strip, 0)
        for i in range(count):
            for j in range(count):
                block = joined[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
                scene.add_air(first + i, first + j, block[:, :, None] * scale)


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.include("added_mass", values["k"])


def strip_matrix(structure: Structure, strip: int) -> Array:
    """Return the added-mass matrix [6 n, 6 n] (m^3 to m^5) of the n bodies of ``strip``, in air of density one.

    Its quadratic form in the twists of the bodies is twice the kinetic energy of the air. The points of a section of
    chord c = 2 b move along its normal with the velocity w(x), x = cos t from edge to edge (-1 to 1). This causes the
    jump sqrt(1 - x^2) sum_k W_k U_k(x) of the velocity potential, with U_k(x) = sin((k + 1) t) / sin t. For w = sum_k
    w_k U_k, W_k is 2 b w_k / (k + 1), and the energy per span is rho / 2 times the integral of the jump times w. A
    section that heaves thus moves rho pi c^2 / 4 of air; one that pitches about its middle, rho pi c^4 / 128
    (Bisplinghoff, Ashley and Halfman, Aeroelasticity (1955), ch. 5).
    """
    panel = structure.panels[structure.division.index(strip, 0)]
    first, count = structure.division.index(strip, 0), structure.division.bodies[strip]
    centres = tuple((float(b.centre[0]), float(b.centre[1])) for b in structure.bodies[first : first + count])
    return _strip_matrix(structure.wing.stations, panel.y0, panel.y1, centres)


@lru_cache(maxsize=4 * MAX_STRIPS)
def _strip_matrix(
    stations: tuple[Station, ...], y0: float, y1: float, centres: tuple[tuple[float, float], ...]
) -> Array:
    """Return the matrix of :func:`strip_matrix`, for the strip from ``y0`` to ``y1`` (m); cached and read-only.

    ``stations``: the outline of the wing; ``centres`` [n]: x and y (m) of the centres of mass of the strip's n bodies.
    """
    count = len(centres)
    total = np.zeros((6 * count, 6 * count))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    middle, half = 0.5 * (y0 + y1), 0.5 * (y1 - y0)
    span, edges, chords = np.array([(s.y, s.leading_edge, s.chord) for s in stations]).T
    for node, weight in zip(nodes, weights, strict=True):
        y = middle + half * node
        b = 0.5 * float(np.interp(y, span, chords))
        modes = np.zeros((_MODES, 6 * count))
        for i, centre in enumerate(centres):
            for column, constant, slope in _normal_motion(y, float(np.interp(y, span, edges)) + b, centre):
                modes[:, 6 * i + column] = _modes(i / count, (i + 1) / count, constant, slope * b)
        k = np.arange(1, _MODES + 1)
        total += half * weight * math.pi * b * b * modes.T @ (modes / k[:, None])
    total.setflags(write=False)
    return total


def _normal_motion(y: float, middle: float, centre: tuple[float, float]) -> list[tuple[int, float, float]]:
    """Return the normal velocity of a wing section at span ``y`` (m) for a unit of each twist component of a body.

    Each entry: index of the component, velocity at mid-chord, its change per metre along x. ``middle``: x of mid-chord
    (m); ``centre``: x and y of the body's centre of mass (m). Components that do not move the section along its normal
    are not listed.
    """
    return [(0, y - centre[1], 0.0), (1, centre[0] - middle, -1.0), (5, 1.0, 0.0)]


def _modes(s0: float, s1: float, constant: float, slope: float) -> Array:
    """Return the coefficients w_k [_MODES] of w(x) = constant + slope x between two fractions of the chord.

    w is zero outside ``s0`` to ``s1``; x is -1 at the leading edge and 1 at the trailing edge. w_k is 2 / pi times the
    integral of w U_k sqrt(1 - x^2) dx, which with x = cos t is that of w sin((k + 1) t) sin t.
    """
    t0, t1 = math.acos(max(min(2 * s1 - 1, 1.0), -1.0)), math.acos(max(min(2 * s0 - 1, 1.0), -1.0))
    m = np.arange(1, _MODES + 1)

    def cosines(n: npt.NDArray[np.int64]) -> Array:
        """Return the integral of cos(n t) over t from t0 to t1."""
        safe = np.where(n == 0, 1, n)
        return np.where(n == 0, t1 - t0, (np.sin(safe * t1) - np.sin(safe * t0)) / safe)

    even = 0.5 * (cosines(m - 1) - cosines(m + 1))
    odd = 0.25 * (cosines(m - 2) - cosines(m + 2))  # times cos t
    return np.asarray(2 / math.pi * (constant * even + slope * odd))


EFFECT = Effect(
    name="added_mass",
    title="Added mass",
    family="aerodynamics",
    port="inertia",
    size=(Parameter("k", "1", 0.0, 3.0, 1.0, "mass of the moved air over that for plates in unbounded flow"),),
    power="conservative",
    law="T' = k (pi rho b^2 / 2) sum_j w_j^2 / (j + 1)",
    source="Theodorsen (1935), NACA Report 496: the noncirculatory part; Lamb (1932), Hydrodynamics, section 71; "
    "Ellington (1984), Philosophical Transactions B 305, 17; Armanini et al. (2016), Eqs. 9 and 10",
    signature="the wing swings later and wider, as if it were heavier when it moves along its normal, and the change "
    "grows with air density and acceleration but little with airspeed",
    confused_with=("lumped_mass", "rotational_circulation"),
    term="added_mass",
    wing=_wing,
    vehicle=_vehicle,
)
