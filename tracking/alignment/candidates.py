"""Global search: which track is which marker, seen on the flattened wing, for each way the wing can lie in its plane.

The rigid motion of the tracks gives the plane of the wing, the direction of its hinge and the side on which the hinge
lies. What remains is which end of the hinge is aft, a shift along the hinge, and small corrections of the estimated
hinge, because an elastic wing seems to turn about another axis than its root. All are searched on a grid, and the best
are refined by alternating assignment and registration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree

from wingfit.records.array_types import Array, Index
from wingfit.tracking.alignment.fit import Fit
from wingfit.tracking.alignment.rigid_motion import RigidMotion
from wingfit.tracking.alignment.wing_model import STATES, Strip

_TURNS = np.radians(np.arange(-18.0, 19.0, 4.5))  # of the grid, about the normal of the wing
_SHIFTS = np.arange(-0.24, 0.25, 0.04)  # along the span, spans
_BEST = 12  # points of the grid that are refined, for each end of the hinge
_ROUNDS = 12
_GATE = 0.6  # of the median distance between neighbouring markers: farther tracks are not that marker
_MOST_TRACKS = 60  # of the grid


@dataclass(frozen=True, eq=False)
class Layout:
    """The flattened wing of the tracks: in-plane coordinates, and axes to place it.

    Attributes:
        points: [K, 2] along the hinge axis and outboard from it, m; NaN for tracks without a place.
        axis, outboard, pivot: [3] each, in the axes of the rigid motion's shape.
        weight: [K] of the tracks.
    """

    points: Array
    axis: Array
    outboard: Array
    pivot: Array
    weight: Array


@dataclass(frozen=True, eq=False)
class Candidate:
    """One way to lay the described wing on the tracks.

    Attributes:
        sense: 1 if x of the wing is along the layout's axis, -1 if it is against it.
        marker: [K] index of the marker of each track; -1 for none.
        turn, shift: registration: wing x, Y = rotation by ``turn`` of (sense, 1) * points, plus ``shift`` [2].
        misfit: RMS distance in the plane, m; distances are cut off at the gate, which unmatched tracks have.
    """

    sense: int
    marker: Index
    turn: float
    shift: Array
    misfit: float


def layout_of(motion: RigidMotion) -> Layout:
    """Return the flattened wing of ``motion``."""
    known = np.isfinite(motion.shape[:, 0])
    weight = np.where(known, motion.weight, 0.0)
    shape = np.nan_to_num(motion.shape)
    middle = weight @ shape / weight.sum()
    away = shape - middle
    normal = np.linalg.eigh(np.einsum("k,ki,kj->ij", weight, away, away))[1][:, 0]
    axis = motion.axis - (motion.axis @ normal) * normal
    axis /= np.linalg.norm(axis)
    outboard = np.cross(normal, axis)
    if (middle - motion.pivot) @ outboard < 0:
        outboard = -outboard
    points = np.stack([(shape - motion.pivot) @ axis, (shape - motion.pivot) @ outboard], axis=-1)
    return Layout(np.where(known[:, None], points, np.nan), axis, outboard, motion.pivot, weight)


def candidates(layout: Layout, rest: Array, span: float, given: Index | None) -> list[Candidate]:
    """Return the best candidates, best first, with at least one for each sense of x.

    ``rest`` [M, 2]: described x and Y of the markers, m. ``given`` [K]: markers that the tracks must be (-1: not
    given); with at least three of them no others are tried.
    """
    found = []
    for sense in (1, -1):
        points = layout.points * (sense, 1)
        if given is not None and (given >= 0).sum() >= 3:
            starts = [_registered(points, rest, given, layout.weight)]
        else:
            starts = _grid(points, rest, span, layout.weight)
        ends = [_refined(points, rest, turn, shift, layout.weight, given, sense) for turn, shift in starts]
        found += _distinct(sorted(ends, key=lambda one: one.misfit))
    return sorted(found, key=lambda one: one.misfit)


def gate_of(rest: Array) -> float:
    """Return the distance beyond which a track is not a marker, m: a fraction of that between neighbours."""
    near = KDTree(rest).query(rest, k=2)[0][:, 1] if len(rest) > 1 else np.array([np.inf])
    return float(_GATE * np.median(near))


def _grid(points: Array, rest: Array, span: float, weight: Array) -> list[tuple[float, Array]]:
    use = np.flatnonzero(np.isfinite(points[:, 0]) & (weight > 0))
    use = use[np.argsort(-weight[use])][:_MOST_TRACKS]
    tree, gate, scored = KDTree(rest), gate_of(rest), list[tuple[float, float, Array]]()
    for turn in _TURNS:
        turned = points[use] @ _rotation(turn).T
        low, high = rest[:, 0].min() - turned[:, 0].max(), rest[:, 0].max() - turned[:, 0].min()
        for along in np.arange(low, high, gate / 2):
            shifts = np.stack([np.full(len(_SHIFTS), along), span * _SHIFTS], axis=-1)
            away = tree.query(turned[None] + shifts[:, None], distance_upper_bound=2 * gate)[0]
            cost = (np.minimum(away, 2 * gate) ** 2 @ weight[use]) / weight[use].sum()
            scored += [(float(one), float(turn), shift) for one, shift in zip(cost, shifts, strict=True)]
    scored.sort(key=lambda one: one[0])
    kept = list[tuple[float, Array]]()
    for _, turn, shift in scored:
        near = any(abs(turn - t) < 0.1 and np.abs(shift - s).max() < 1.5 * gate for t, s in kept)
        if not near:
            kept.append((turn, shift))
        if len(kept) == _BEST:
            break
    return kept


def _refined(
    points: Array, rest: Array, turn: float, shift: Array, weight: Array, given: Index | None, sense: int
) -> Candidate:
    known, gate = np.isfinite(points[:, 0]), gate_of(rest)
    marker, misfit = np.full(len(points), -1), np.inf
    for round_ in range(_ROUNDS):
        wide = gate * max(1.0, 2.5 - 0.3 * round_)
        placed = points @ _rotation(turn).T + shift
        away = np.linalg.norm(np.nan_to_num(placed)[:, None] - rest[None], axis=-1)
        away[~known] = 1e3
        before, marker = marker, assigned(away, wide, given)
        hit = marker >= 0
        squares = np.where(hit, np.minimum(away[np.arange(len(points)), marker], gate) ** 2, gate**2)
        misfit = float(np.sqrt((weight * squares)[known].sum() / weight[known].sum()))
        if hit.sum() < 2 or (round_ > 5 and np.array_equal(before, marker)):
            break
        turn, shift = _registered(points, rest, marker, weight)
    return Candidate(sense, marker, turn, shift, misfit)


def assigned(away: Array, gate: float, given: Index | None = None) -> Index:
    """Return the marker [K] of each track (-1: none) with the least sum of squares of ``away`` [K, M].

    Each is at most ``gate``, m.

    ``given`` [K] markers are fixed, whatever their distance.
    """
    K, M = away.shape
    cost = np.full((K, M + K), gate**2)
    cost[:, :M] = np.where(away < gate, away**2, 1e6 * gate**2)
    if given is not None:
        for track, one in enumerate(given):
            if one >= 0:
                cost[:, one] = 1e9 * gate**2
                cost[track, one] = -1e9 * gate**2
    _, columns = linear_sum_assignment(cost)
    return np.where(columns < M, columns, -1)


def _registered(points: Array, rest: Array, marker: Index, weight: Array) -> tuple[float, Array]:
    hit = (marker >= 0) & np.isfinite(points[:, 0])
    w = np.maximum(weight[hit], 1e-3)
    a, b = points[hit], rest[marker[hit]]
    a0, b0 = w @ a / w.sum(), w @ b / w.sum()
    a, b = a - a0, b - b0
    turn = float(np.arctan2(w @ (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), w @ (a * b).sum(axis=1)))
    return turn, b0 - _rotation(turn) @ a0


def _rotation(turn: float) -> Array:
    return np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])


def _distinct(found: list[Candidate]) -> list[Candidate]:
    kept = list[Candidate]()
    for one in found:
        if not any(np.array_equal(one.marker, other.marker) for other in kept):
            kept.append(one)
    return kept[:3]


def start_of(candidate: Candidate, layout: Layout, motion: RigidMotion, right: bool, rest: Array, strip: Strip) -> Fit:
    """Return where a fit begins: the described wing as a rigid one, in the pose of ``candidate``.

    ``right``: whether it is a right wing. ``rest`` [M, 3]: described hinge coordinates, m.
    """
    fitted = np.isfinite(motion.rotation[:, 0, 0])
    R, p = motion.rotation[fitted], motion.shift[fitted]
    # In-plane axes of the described wing, in the axes of the shape.
    c, s = np.cos(candidate.turn), np.sin(candidate.turn)
    along = candidate.sense * layout.axis
    x, y = c * along - s * layout.outboard, s * along + c * layout.outboard
    hinge = layout.pivot - candidate.shift[0] * x - candidate.shift[1] * y
    mean = R.mean(axis=0)
    ex = mean @ x / np.linalg.norm(mean @ x)
    ey = mean @ y - (mean @ y @ ex) * ex
    ey /= np.linalg.norm(ey)
    ez = np.cross(ex, ey) * (1 if right else -1)
    states = np.zeros((len(motion.rotation), STATES))
    turned = R @ y
    angle = np.arctan2(turned @ ez, turned @ ey)
    instants = np.arange(len(states))
    states[:, 0] = np.interp(instants, instants[fitted], np.unwrap(angle))
    origin = (R @ hinge + p).mean(axis=0)
    empty = np.zeros((0, 0))
    return Fit(
        np.stack([ex, ey, ez]),
        origin,
        states,
        np.zeros((len(states), 5)),
        np.zeros((0, 5)),
        np.array(strip.line),
        rest,
        1.0,
        1.0,
        1.0,
        0.0,
        np.inf,
        0.0,
        empty,
        empty,
        np.zeros(0),
    )


def with_all(start: Fit, rest: Array) -> Fit:
    """Return ``start`` with the ``rest`` positions [M, 3] of other markers, whose covariance is not known."""
    return replace(start, rest=rest, covariance=np.zeros((0, 0)))
