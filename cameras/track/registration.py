"""Which point of a cloud is which marker, from the places of the markers on the wing.

A wing bends, but distances on it hardly change. Triples of markers are sought by their distances; each gives a rigid
motion; the one that brings most markers near to points is refined to a smooth deformation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from wingfit.records.array_types import Array, Float, Index, Mask

_TRIPLES, _HYPOTHESES = 60, 4000
_STRETCH = 0.02  # of a distance, beside a share of the wing's size for bending
# Of the smooth displacement: lengths in sizes of the wing, sizes and noises over the affine part.
_LENGTHS, _SMOOTH, _NOISE = (0.6, 1.2, 2.4), (0.3, 3.0), (0.003, 0.03, 0.3)
_LEAST_DEVIATION_M = 5e-5
_ALIKE = 0.95  # of the best score: motions that fit as well
_SAME_PLACE = 0.01  # of the size of a layout: markers that take the places of others are so near to them


@dataclass(frozen=True, eq=False)
class Surface:
    """A plane through the wing.

    Attributes:
        plane: [K, 2], coordinates of the markers on it, in units of ``size``.
        centre: [3] (m), its middle.
        axes: [3, 3], two directions on it and its normal.
        size: of the wing (m), the largest root of the mean square from the middle.
    """

    plane: Float[Array, "K 2"]
    centre: Array
    axes: Array
    size: float

    def quadratic(self, points: Float[Array, "N 3"]) -> tuple[Float[Array, "N 6"], Float[Array, " N"]]:
        """Return the products of up to two coordinates on the plane, and the height (m) above it, of ``points``."""
        u, v, height = ((points - self.centre) @ self.axes.T).T
        one, two = u / self.size, v / self.size
        return np.column_stack([np.ones(len(points)), one, two, one**2, one * two, two**2]), height


def surface_of(positions: Float[Array, "K 3"]) -> Surface:
    """Return the coordinates of points on the plane that fits them best."""
    known = np.isfinite(positions).all(1)
    centre = positions[known].mean(0)
    _, spread, axes = np.linalg.svd(positions[known] - centre, full_matrices=False)
    size = max(float(spread[0]) / np.sqrt(known.sum()), 1e-9)
    return Surface((positions - centre) @ axes[:2].T / size, centre, axes, size)


def spacing(positions: Float[Array, "K D"]) -> float:
    """Return the median distance of a marker to its nearest neighbour, in space or in an image."""
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=2) + np.diag(np.full(len(positions), np.inf))
    return float(np.median(apart.min(1)))


@dataclass(frozen=True, eq=False)
class Deformed:
    """Markers predicted from those found: ``positions`` [K, 3] and ``deviation`` [K] (m), which grows beyond them."""

    positions: Float[Array, "K 3"]
    deviation: Float[Array, " K"]


def deformed(surface: Surface, found: Float[Array, "K 3"], reference: Float[Array, "K 3"]) -> Deformed:
    """Return where all markers are if the wing moved smoothly from ``reference`` to those ``found`` (NaN: not found).

    The displacement after the best rigid motion is a Gaussian process over the wing, affine plus smooth (Rasmussen and
    Williams 2006, sections 2.7 and 5.4.2). Its length, size and noise predict each marker best from the others.
    """
    known = np.isfinite(found).all(1) & np.isfinite(reference).all(1)
    if known.sum() < 4:
        return Deformed(np.full_like(reference, np.nan), np.full(len(reference), np.inf))
    moved = rigid(reference[known], found[known], reference)
    residual = found[known] - moved[known]
    size = max(float(np.sqrt(np.median(residual**2) / 0.455)), 1e-5)
    best: tuple[float, Array, Array] | None = None
    for length, smooth, noise in product(_LENGTHS, _SMOOTH, _NOISE):
        covariance = _prior(surface.plane, length, smooth)
        inverse = np.linalg.inv(covariance[np.ix_(known, known)] + noise**2 * np.eye(known.sum()))
        weights, variance = inverse @ residual, 1 / np.diag(inverse)
        missed = weights * variance[:, None]
        # One scale for all: the robust mean of the errors over the variances that the process expects.
        scale = max(float(np.median(missed**2 / variance[:, None]) / 0.455), 1e-12)
        score = float(np.log(variance).sum() + len(variance) * np.log(scale))
        if best is None or score < best[0]:
            across = covariance[:, known]
            spread = np.diag(covariance) - np.einsum("kn,nm,km->k", across, inverse, across) + noise**2
            best = (score, moved + across @ weights, np.sqrt(scale * np.maximum(spread, 0)))
    if best is None:
        return Deformed(moved, np.full(len(reference), size))
    return Deformed(best[1], np.maximum(best[2], _LEAST_DEVIATION_M))


def _prior(plane: Float[Array, "K 2"], length: float, smooth: float) -> Float[Array, "K K"]:
    """Return the covariance of displacements at the places ``plane``, whose affine part has the size 1."""
    known = np.nan_to_num(plane)
    squared = ((known[:, None] - known[None]) ** 2).sum(2)
    return np.asarray(1 + known @ known.T + smooth**2 * np.exp(-squared / (2 * length**2)))


def rigid(source: Array, target: Array, points: Array) -> Float[Array, "K 3"]:
    """Return ``points`` after the rigid motion that best takes ``source`` to ``target`` (Kabsch 1976)."""
    rotation, move = kabsch(source[None], target[None])
    return np.asarray(points @ rotation[0].T + move[0])


def kabsch(source: Float[Array, "H N 3"], target: Float[Array, "H N 3"]) -> tuple[Array, Array]:
    """Return rotations [H, 3, 3] and moves [H, 3] that best take ``source`` to ``target`` (Kabsch 1976)."""
    a, b = source.mean(1), target.mean(1)
    covariance = np.einsum("hni,hnj->hij", target - b[:, None], source - a[:, None])
    u, _, vt = np.linalg.svd(covariance)
    sign = np.ones((len(u), 3))
    sign[:, 2] = np.linalg.det(u @ vt)
    rotation = (u * sign[:, None, :]) @ vt
    return rotation, b - np.einsum("hij,hj->hi", rotation, a)


def assign(
    predicted: Float[Array, "K 3"],
    deviation: Float[Array, " K"],
    points: Float[Array, "M 3"],
    covariance: Float[Array, "M 3 3"],
    gate: float = 4.0,
    allowed: Mask | None = None,
) -> Index:
    """Return the index [K] of the point of each marker, -1 for none: least sum of squared distances in deviations.

    ``allowed`` [K, M]: points that a marker can be; None: all.
    """
    chosen = np.full(len(predicted), -1)
    rows = np.flatnonzero(np.isfinite(predicted).all(1) & np.isfinite(deviation))
    if not len(rows) or not len(points):
        return chosen
    apart = points[None] - predicted[rows][:, None]
    spread = covariance[None] + (deviation[rows] ** 2)[:, None, None, None] * np.eye(3)
    squared = np.einsum("kmi,kmi->km", apart, np.linalg.solve(spread, apart[..., None])[..., 0])
    if allowed is not None:
        squared = np.where(allowed[rows], squared, np.inf)
    cost = np.minimum(squared, gate**2)
    at, of = linear_sum_assignment(cost)
    good = squared[at, of] < gate**2
    chosen[rows[at[good]]] = of[good]
    return chosen


def register(
    reference: Float[Array, "K 3"],
    points: Float[Array, "M 3"],
    covariance: Float[Array, "M 3 3"],
    seed: int = 0,
    *,
    nearby: bool = False,
) -> tuple[Index, Float[Array, "K 3"]]:
    """Return the index [K] of the point of each marker (-1: none), and where the markers are predicted.

    ``reference`` are the markers in any axes, for example those of the wing at rest; with ``nearby``, they are where
    the wing was before: of motions that fit alike, as on a symmetric wing, the smallest is taken. Fewer than 6 markers
    that agree are no registration: all indices are -1.
    """
    size = float(np.linalg.norm(np.ptp(reference, axis=0)))
    hypotheses = _hypotheses(reference, points, size, np.random.default_rng(seed))
    nothing = np.full(len(reference), -1)
    if not len(hypotheses):
        return nothing, reference
    tree = cKDTree(points)
    reach = 0.03 * size
    scores, moved = np.empty(len(hypotheses)), np.empty(len(hypotheses))
    for number, (rotation, move) in enumerate(hypotheses):
        placed = reference @ rotation.T + move
        apart, index = tree.query(placed)
        near = apart < reach
        # Each point counts once; closer ones count more, so that a lattice shifted by one row loses.
        scores[number] = len(np.unique(index[near])) - float((apart[near] / reach).sum()) / 2
        moved[number] = float(((placed - reference) ** 2).sum())
    alike = scores >= (_ALIKE * scores.max() if nearby else scores.max())
    best = hypotheses[int(np.flatnonzero(alike)[moved[alike].argmin() if nearby else 0])]
    return _refined(reference, best, points, covariance, reach)


def looks_alike(reference: Float[Array, "K 3"]) -> tuple[int, int] | None:
    """Return a marker, and the one whose place it takes in a turn that takes all markers to places of others.

    None if there is no such turn. Of a flat layout a mirror image is a turn too, by half about the line of the mirror.
    """
    size = float(np.linalg.norm(np.ptp(reference, axis=0)))
    tree, own = cKDTree(reference), np.arange(len(reference))
    for rotation, move in _hypotheses(reference, reference, size, np.random.default_rng(0)):
        apart, index = tree.query(reference @ rotation.T + move)
        if len(np.unique(index)) < len(index) or (index == own).all() or apart.max() > 5 * _SAME_PLACE * size:
            continue
        if np.linalg.norm(rigid(reference, reference[index], reference) - reference[index], axis=1).max() < (
            _SAME_PLACE * size
        ):
            marker = int(np.flatnonzero(index != own)[0])
            return marker, int(index[marker])
    return None


def _hypotheses(reference: Array, points: Array, size: float, random: np.random.Generator) -> list[tuple[Array, Array]]:
    """Return rigid motions, each of three markers to three points with about the same distances."""
    if len(points) < 3 or len(reference) < 3:
        return []
    between = np.linalg.norm(points[:, None] - points[None], axis=2)
    found: list[tuple[Array, Array]] = []
    for _ in range(_TRIPLES):
        triple = random.choice(len(reference), 3, replace=False)
        sides = np.linalg.norm(reference[triple] - reference[np.roll(triple, -1)], axis=1)
        if sides.min() < 0.15 * size or sides.sum() < 2.15 * sides.max():
            continue
        tolerance = _STRETCH * sides + 0.004 * size
        one, two = np.nonzero(np.abs(between - sides[0]) < tolerance[0])
        fits = np.abs(between[two] - sides[1]) < tolerance[1]
        fits &= np.abs(between[one] - sides[2]) < tolerance[2]
        pair, three = np.nonzero(fits)
        if not len(pair):
            continue
        if len(pair) > _HYPOTHESES // 20:
            picked = random.choice(len(pair), _HYPOTHESES // 20, replace=False)
            pair, three = pair[picked], three[picked]
        target = points[np.stack([one[pair], two[pair], three], axis=1)]
        rotations, moves = kabsch(np.broadcast_to(reference[triple], target.shape), target)
        found.extend(zip(rotations, moves, strict=True))
        if len(found) > _HYPOTHESES:
            break
    return found


def _refined(
    reference: Array, motion: tuple[Array, Array], points: Array, covariance: Array, reach: float
) -> tuple[Index, Array]:
    surface = surface_of(reference)
    predicted = reference @ motion[0].T + motion[1]
    deviation = np.full(len(reference), reach / 2.5)
    chosen = assign(predicted, deviation, points, covariance, 2.5)
    for _ in range(12):
        if (chosen >= 0).sum() < 6:
            return np.full(len(reference), -1), reference
        found = np.where((chosen >= 0)[:, None], points[chosen], np.nan)
        smooth = deformed(surface, found, reference)
        wide = np.maximum(smooth.deviation, 1e-4)
        again = assign(smooth.positions, wide, points, covariance)
        predicted = smooth.positions
        if (again == chosen).all():
            break
        chosen = again
    return chosen, predicted
