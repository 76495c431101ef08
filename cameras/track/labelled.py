"""The markers at instants that a person labelled: which points they are, and whether the names can be right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.track.cloud import Cloud
from wingfit.cameras.track.instants import Instants
from wingfit.cameras.track.labels import LEAST_LABELLED, too_few
from wingfit.cameras.track.reference import reference_with, unused
from wingfit.cameras.track.registration import Deformed, assign, deformed, kabsch, spacing, surface_of
from wingfit.cameras.triangulation import triangulate
from wingfit.records.array_types import Array, Float, Index, Mask
from wingfit.records.errors import Faults, fail

_TRIPLES = 1500
_NARROWEST = 0.05  # breadth of the labelled markers over their length
_SURE = 0.12  # of the distance between neighbours: four such deviations are less than half of it
_DEVIATIONS = 4.0
_STRETCH = 0.03  # of a distance
_LEAST_DEFORMED = 4  # markers that give a deformation

Names = tuple[str, ...]
Starts = Mapping[int, tuple[Index, Array]]


@dataclass(frozen=True, eq=False)
class Labelled:
    """The labelled points: of each instant, the index in its cloud of each named marker."""

    cameras: Sequence[Camera]
    instants: Instants
    clouds: Sequence[Cloud]

    def points(self) -> dict[int, dict[str, int]]:
        """Return the points by instant and name.

        Raises:
            DatasetError: rays of labels with the same name do not meet, or too few markers are labelled in two cameras.
        """
        found, faults = dict[int, dict[str, int]](), Faults()
        for instant, named in sorted(self.instants.named.items()):
            found[instant] = {}
            for name in dict.fromkeys(name for of in named for name in of):
                seen = {camera: of[name] for camera, of in enumerate(named) if name in of}
                if len(seen) < 2:
                    continue
                point = self._point(instant, seen)
                if point is None:
                    message = f"the labels of {name!r} are not the same point: {self._miss(instant, seen)}"
                    faults.add(f"labels at {self._frames(instant)}", name, message)
                else:
                    found[instant][name] = point
        faults.raise_any()
        for instant, points in found.items():
            if len(points) < LEAST_LABELLED:
                where = f"labels at {self._frames(instant)}"
                raise fail(where, len(points), too_few(len(points), "at this instant, which these frames show"))
        return found

    def reference(self, points: Mapping[int, dict[str, int]]) -> tuple[Names, Float[Array, "K 3"]]:
        """Return names and places (m) of markers whose places are not described: those of a labelled instant."""
        best = max(points, key=lambda instant: len(points[instant]))
        names, places = reference_with(self.clouds[best], points[best])
        for instant, named in points.items():
            unknown = [name for name in named if name not in names]
            if unknown:
                message = f"marker {unknown[0]!r} has no label at {self._frames(best)}, which has most labels"
                raise fail(f"labels at {self._frames(instant)}", unknown[0], f"{message}; label it there too")
        return names, places

    def starts(self, points: Mapping[int, dict[str, int]], names: Names, reference: Float[Array, "K 3"]) -> Starts:
        """Return the identification [K] at each labelled instant, and where the markers are predicted.

        Raises:
            DatasetError: a name does not fit to the others, by the places of the markers on the wing.
        """
        found, faults = dict[int, tuple[Index, Array]](), Faults()
        for instant, named in points.items():
            fixed = np.array([named.get(name, -1) for name in names])
            places = np.where((fixed >= 0)[:, None], self.clouds[instant].positions[fixed], np.nan)
            where = f"labels at {self._frames(instant)}"
            _check_breadth(reference[fixed >= 0], where)
            wrong = misplaced(reference, places)
            for marker, (other, away) in wrong.items():
                faults.add(where, names[marker], _misplaced(names, marker, other, away, wrong))
            if not wrong:
                found[instant] = completed(reference, self.clouds[instant], fixed)
        faults.raise_any()
        return found

    def _point(self, instant: int, seen: Mapping[int, int]) -> int | None:
        """Return the point that has the detections ``seen``, that of most cameras, with the least misfit."""
        cloud = self.clouds[instant]
        fits = np.all([cloud.detections[camera] == index for camera, index in seen.items()], axis=0)
        points = np.flatnonzero(fits)
        if not len(points):
            return None
        order = np.lexsort((cloud.points.misfit[points], -(cloud.detections[:, points] >= 0).sum(0)))
        return int(points[order[0]])

    def _miss(self, instant: int, seen: Mapping[int, int]) -> str:
        pixels = np.full((len(self.cameras), 1, 2), np.nan)
        for camera, index in seen.items():
            pixels[camera, 0] = self.instants.seen[instant][camera].pixels[index]
        points = triangulate(self.cameras, pixels, np.broadcast_to(np.eye(2), (*pixels.shape, 2)))
        remedy = "is another marker meant in one of them?"
        if not np.isfinite(points.misfit[0]):
            return f"their rays do not meet before the cameras; {remedy}"
        return f"their rays miss each other by {np.sqrt(points.misfit[0]):.1f} px; {remedy}"

    def _frames(self, instant: int) -> str:
        return self.instants.shown(instant, [camera.name for camera in self.cameras])


def _misplaced(
    names: Names, marker: int, other: int | None, away: float, wrong: Mapping[int, tuple[int | None, float]]
) -> str:
    """Return the message about a ``marker`` that is labelled where the ``other`` one is, or no marker."""
    by = "by the other labels and the places of the markers on the wing"
    if other is None:
        return (
            f"{names[marker]!r} is labelled {1e3 * away:.0f} mm from where it is {by}; check its labels in all cameras"
        )
    remedy = "are the names exchanged?" if wrong.get(other, (None,))[0] == marker else "correct its name"
    return f"{names[marker]!r} is labelled where {names[other]!r} is {by}; {remedy}"


def _check_breadth(places: Float[Array, "N 3"], where: str) -> None:
    spread = np.linalg.svd(places - places.mean(0), compute_uv=False)
    if spread[1] < _NARROWEST * spread[0]:
        value = f"{spread[1] / spread[0]:.3f}"
        message = (
            f"the labelled markers are nearly on a line: {value} as broad as long, at least {_NARROWEST} is needed"
        )
        raise fail(where, value, f"{message}; label others beside it")


def misplaced(reference: Float[Array, "K 3"], places: Float[Array, "K 3"]) -> dict[int, tuple[int | None, float]]:
    """Return the markers whose labels are wrong: the marker that is there, if it is one, and the distance (m).

    ``reference`` are the markers on the wing, in any axes; ``places`` (m) those labelled, NaN where there is no label.
    All are placed by the smooth deformation of those labelled markers that agree. A label is wrong if it is further
    from its marker's place than half of the distance to the nearest other marker, and if no bending can explain it: or
    if such a label is where this marker is.
    """
    known = np.flatnonzero(np.isfinite(places).all(1))
    gap = np.linalg.norm(reference[:, None] - reference[None], axis=2) + np.diag(np.full(len(reference), np.inf))
    half = gap.min(1)[known] / 2
    motion = _most_agreed(reference[known], places[known], half)
    apart = np.linalg.norm(motion - places[known], axis=1)
    # A wing that bends is not rigid: the markers that agree best begin, and the others join by the smooth deformation.
    agree = (apart < half) | (np.argsort(np.argsort(apart)) < _LEAST_DEFORMED)
    smooth = _deformed_by(reference, places, known[agree])
    for _ in range(8):
        again = np.linalg.norm(places - smooth.positions, axis=1)[known] < half
        if (again == agree).all() or again.sum() < _LEAST_DEFORMED:
            break
        agree, smooth = again, _deformed_by(reference, places, known[again])
    to_all = np.linalg.norm(places[known][:, None] - smooth.positions[None], axis=2)
    nearest = to_all.argmin(1)
    own = to_all[np.arange(len(known)), known]
    doubtful = (own > half) & (own > _DEVIATIONS * smooth.deviation[known])
    sure = doubtful & _stretched(reference[known], places[known], agree)
    there = (nearest != known) & (to_all.min(1) < gap.min(1)[nearest] / 2)
    exchanged = np.isin(known, nearest[sure & there])
    return {
        int(known[row]): (int(nearest[row]) if there[row] else None, float(own[row]))
        for row in np.flatnonzero(sure | (doubtful & exchanged))
    }


def _stretched(reference: Float[Array, "N 3"], places: Float[Array, "N 3"], agree: Mask) -> Mask:
    """Return which markers are further from one that agrees than on the wing: bending only brings markers nearer."""
    on_wing, now = (np.linalg.norm(one[:, None] - one[None, agree], axis=2) for one in (reference, places))
    return np.asarray((now > (1 + _STRETCH) * on_wing + 0.1 * spacing(reference)).any(1))


def _deformed_by(reference: Float[Array, "K 3"], places: Float[Array, "K 3"], by: Index) -> Deformed:
    """Return the markers as the smooth deformation of the markers ``by`` places them."""
    seen = np.full_like(places, np.nan)
    seen[by] = places[by]
    return deformed(surface_of(reference), seen, reference)


def _most_agreed(reference: Float[Array, "N 3"], places: Float[Array, "N 3"], half: Array) -> Float[Array, "N 3"]:
    """Return the markers after the rigid motion of three of them with which most others agree best."""
    triples = np.array([*combinations(range(len(reference)), 3)])
    if len(triples) > _TRIPLES:
        triples = triples[np.random.default_rng(0).choice(len(triples), _TRIPLES, replace=False)]
    rotations, moves = kabsch(reference[triples], places[triples])
    moved = reference @ np.swapaxes(rotations, 1, 2) + moves[:, None]
    cost = np.minimum(np.linalg.norm(moved - places, axis=2) / half, 1.0).sum(1)
    return np.asarray(moved[int(cost.argmin())])


def completed(reference: Float[Array, "K 3"], cloud: Cloud, fixed: Index) -> tuple[Index, Float[Array, "K 3"]]:
    """Return the index [K] of the point of each marker, of which some are ``fixed``, and where all are predicted.

    Others are named where the smooth deformation of those known so far predicts them well; this spreads from label to
    label. A marker that is not predicted well is left out: following finds it.
    """
    surface, chosen = surface_of(reference), fixed
    apart = spacing(reference)
    open_points = np.flatnonzero(unused(cloud, fixed[fixed >= 0]))
    places, covariance = cloud.positions[open_points], cloud.points.covariance[open_points]
    smooth = reference
    for _ in range(12):
        found = np.where((chosen >= 0)[:, None], cloud.positions[chosen], np.nan)
        moved = deformed(surface, found, reference)
        smooth = moved.positions
        sure = (moved.deviation < _SURE * apart) & (fixed < 0)
        again = fixed.copy()
        wanted = np.where(sure[:, None], smooth, np.nan)
        picked = assign(wanted, np.maximum(moved.deviation, 0.04 * apart), places, covariance)
        again[picked >= 0] = open_points[picked[picked >= 0]]
        if (again == chosen).all():
            break
        chosen = again
    return chosen, smooth
