"""Hidden effects of structure and inertia that the diagnosis can name, but simulates by other equations.

"The library" is the set of effects that the diagnosis can name.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from benchmarks.concealed.plant.wing.build import Draft
from benchmarks.concealed.plant.wing.geometry import Cut, Lump
from benchmarks.concealed.plant.wing.rig import CABLE, DAHL, MAXWELL, POINTS, SLIDER, TETHER
from benchmarks.concealed.plant.wing_effects.kind import Kind, Values
from wingfit.records import Wing

_SPECTRUM = (
    (0.5, 1.0),
    (0.5, 6.0),
)  # fractions of the stiffness that relaxes, and relaxation times relative to the first
_YIELDS = (0.4, 1.0, 2.5)  # of Dahl's elements, relative to the middle one
_TORSION = 1 / (4 * 1.4)  # of a round cable over bending: G J / L over 4 E I / L, with Poisson's ratio 0.4
_STEEPEST = 12.0  # largest argument of sinh at one radian over the span


def _lump(draft: Draft, strength: float, at: Values) -> None:
    """Add a point mass of ``strength`` kg before the wing is divided; masses, centres and inertias then include it."""
    x, y = Cut(draft.wing, draft.division).place(at["span"], at["chord"])
    draft.lumps.append(Lump(strength, (x, y, 0.0)))


def _lump_genes(_: Wing, strength: float, at: Values) -> dict[str, float]:
    return {
        "lumped_mass.mass": strength,
        "lumped_mass.station": at["span"],
        "lumped_mass.chord": at["chord"],
    }


def _aft(draft: Draft, strength: float, _: Values) -> None:
    draft.aft = strength * _mean_chord(draft.wing)


def _mean_chord(wing: Wing) -> float:
    y = [station.y for station in wing.stations]
    return float(np.trapezoid([station.chord for station in wing.stations], y)) / (y[-1] - y[0])


def _tethered(draft: Draft, strength: float, at: Values) -> None:
    """Tie one place of the wing to its position at rest by a rubber cord of ``strength`` N/m, half a span long.

    The cord is neo-Hookean (Treloar 1975), with a damper in parallel of ``strength`` times ``at["time"]`` (s).
    """
    body, arm, rest = draft.at(at["span"], at["chord"])
    row = [float(TETHER), *arm.tolist(), strength, 0.5 * draft.span, at["time"] * strength, *rest.tolist()]
    draft.points.append((body, row + [0.0] * (POINTS - len(row))))


def _tether_genes(_: Wing, __: float, at: Values) -> dict[str, float]:
    return {"tether.station": at["span"], "tether.chord": at["chord"]}


def _cabled(draft: Draft, strength: float, at: Values) -> None:
    """Clamp a cable along the span of ``strength`` N m/rad in bending to one station of the wing.

    Bodies have one rotation each: the two strips whose middles are next to the station share the cable. It has a damper
    of ``strength`` times ``at["time"]`` (s).
    """
    edges = draft.cut.edges
    middles, y = 0.5 * (edges[1:] + edges[:-1]), draft.cut.place(at["span"], 0.5)[1]
    for middle, one in zip(middles, np.eye(len(middles)), strict=True):
        share = strength * float(np.interp(y, middles, one))
        if share > 0.0:
            body, arm, _ = draft.at(float((middle - edges[0]) / draft.span), 0.5)
            row = [float(CABLE), *arm.tolist(), share, _TORSION * share, at["time"] * share]
            draft.points.append((body, row + [0.0] * (POINTS - len(row))))


def _cable_genes(_: Wing, __: float, at: Values) -> dict[str, float]:
    return {"cable.station": at["span"]}


def _damage(draft: Draft, strength: float, at: Values) -> None:
    """Reduce stiffness and damping by the fraction ``strength``, uniformly over an interval of the span."""
    root = float(draft.cut.edges[0])
    lower, upper = (root + draft.span * (at["span"] + side * 0.5 * at["width"]) for side in (-1, 1))
    for c, joint in enumerate(draft.joints):
        common = max(min(upper, joint.to_y) - max(lower, joint.from_y), 0.0) / (joint.to_y - joint.from_y)
        if joint.along_span:
            draft.factor[c] *= 1 / (1 - common + common / (1 - strength))
        else:
            draft.factor[c] *= 1 - strength * common


def _damage_genes(_: Wing, __: float, at: Values) -> dict[str, float]:
    return {"damage.station": at["span"]}


def _hardening(draft: Draft, strength: float, _: Values) -> None:
    """Make bending springs, except at the root, harden: moment k phi sinh(x) / x at the angle phi, x = h curvature.

    Curvature is the angle over the whole span; h is such that sinh(x) / x is 1 + ``strength`` at one radian.
    """
    steep = float(brentq(lambda h: math.sinh(h) / h - 1 - strength, 1e-6, _STEEPEST))
    for c, joint in enumerate(draft.joints):
        if joint.first >= 0:
            draft.hardening[c] = steep


def _relaxing(draft: Draft, strength: float, at: Values) -> None:
    """Add two Maxwell branches in parallel to each spring of bending and torsion (at the root: torsion only)."""
    for c, joint in enumerate(draft.joints):
        for k in (0, 1):
            if joint.first >= 0 or k == 1:
                for part, times in _SPECTRUM:
                    stiff = strength * part * float(joint.stiffness[k])
                    draft.memory.append((c, k, float(MAXWELL), stiff, times * at["time"]))


def _yielding(draft: Draft, strength: float, at: Values) -> None:
    """Add three parallel Dahl elements (Iwan 1966) to each spring of bending and torsion (root: torsion only)."""
    for c, joint in enumerate(draft.joints):
        for k in (0, 1):
            if joint.first >= 0 or k == 1:
                for part in _YIELDS:
                    stiff = strength * float(joint.stiffness[k]) / len(_YIELDS)
                    draft.memory.append((c, k, float(DAHL), stiff, part * at["angle"] / draft.curvature(joint)))


def _slipping(draft: Draft, strength: float, at: Values) -> None:
    """Add a spring in series with a dry-friction slider in parallel to each joint with rods, except at the root.

    The slider slips when the spring's angle, expressed over the whole span, reaches ``strength`` (rad).
    """
    for c, joint in enumerate(draft.joints):
        if joint.first >= 0 and joint.of_rods > 0:
            limit = strength / draft.curvature(joint)
            draft.memory.append((c, 0, float(SLIDER), at["stick"] * joint.of_rods, limit))


_PLACE = {"span": (0.75, 0.3, 0.95), "chord": (0.7, 0.1, 0.9)}

LISTED_STRUCTURE = (
    Kind(
        "lumped_mass", "inertia", True, "kg", 0.003, 0.012,
        "a point in the mass integrals of the wing itself; Steiner's theorem for the whole body", _lump,
        shape=_PLACE, genes=_lump_genes, before=True,
    ),
    Kind(
        "mass_offset", "inertia", True, "1", 0.05, 0.3,
        "mass aft by the same fraction of every chord; the library moves it by the same distance, so that no distance "
        "is the true one: near the tip, where it acts most, it is less than at the mean chord", _aft, before=True,
    ),
    Kind(
        "tether", "structure", True, "N/m", 1.0, 20.0,
        "rubber cord with damper in parallel: Treloar, The Physics of Rubber Elasticity (1975), ch. 4; the library "
        "has a linear spring", _tethered,
        shape={"span": (0.8, 0.4, 0.95), "chord": (0.5, 0.2, 0.8), "time": (0.01, 0.004, 0.02)}, genes=_tether_genes,
    ),
    Kind(
        "cable", "structure", True, "N m/rad", 0.4, 2.0,
        "round cable that bends and twists (Timoshenko, Strength of Materials (1955)), with moments in proportion to "
        "its angles; the library has one stiffness for all axes, and the sine of the angle", _cabled,
        shape={"span": (0.45, 0.25, 0.7), "time": (0.01, 0.004, 0.02)}, genes=_cable_genes,
    ),
    Kind(
        "damage", "structure", True, "1", 0.6, 0.9,
        "a beam with a notch of even depth: Cawley and Adams (1979); sharp ends; the library has a bell shape", _damage,
        shape={"span": (0.5, 0.2, 0.8), "width": (0.15, 0.1, 0.25)}, genes=_damage_genes,
    ),
    Kind(
        "cubic_stiffness", "structure", True, "1", 1.5, 200.0,
        "hardening as a hyperbolic sine (like Ogden's and Fung's exponential laws); the library is cubic",
        _hardening,
    ),
    Kind(
        "viscoelastic", "structure", True, "1", 0.2, 4.0,
        "Prony series of two Maxwell branches (Ferry 1980, ch. 1); the library has one", _relaxing,
        shape={"time": (0.03, 0.015, 0.06)},
    ),
    Kind(
        "hysteresis", "structure", True, "1", 0.25, 4.0,
        "three elements of Dahl (1968) in parallel as in Iwan's model (1966); the library has Bouc and Wen",
        _yielding, shape={"angle": (0.1, 0.05, 0.2)},
    ),
    Kind(
        "rod_slip", "structure", True, "rad", 0.04, 1.0,
        "Prandtl's slider (1928) with a spring, sharp; the library has Dahl's friction with play", _slipping,
        shape={"stick": (0.4, 0.3, 0.6)},
    ),
)  # fmt: skip
