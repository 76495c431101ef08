"""Follows the markers from one instant to the next, in space.

Each marker is predicted from its last three places. What is found nearest to the predictions gives the smooth motion of
the wing since then, and this predicts the markers again, also those that were not seen for some time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.markers.orientation import Orientation
from wingfit.cameras.track.cloud import Cloud
from wingfit.cameras.track.registration import Deformed, Surface, assign, deformed, register, spacing
from wingfit.records.array_types import Array, Float, Index, Mask

Progress = Callable[[int, int], object]
_STARTS = 12  # instants at which a start is tried
_LEAST_SHARE = 0.5  # of the markers, without which the wing is sought anew
_LEAST_MARKERS = 6
_NARROWEST = 0.04  # of the distance between neighbouring markers, as a standard deviation


@dataclass(frozen=True, eq=False)
class Followed:
    """Which point of the cloud of each instant is which marker.

    Attributes:
        chosen: [T, K], index of a point of the cloud, -1 where a marker was not found.
        detections: [T, C, K], index of the detection in each camera, -1 where there is none.
        predicted: [T, K, 3] (m), where the smooth motion of the wing places the markers; NaN at instants that are lost.
        directions: [T, C, K] (rad), of their bright diagonals on the wing, by camera; NaN if unknown.
        start: the instant at which the markers were identified first.
        again: instants at which the wing was found again, after others at which it was lost.
        renamed: instants at which markers were followed to other points than those that are known there, and these
            markers.
    """

    chosen: Index
    detections: Index
    predicted: Float[Array, "T K 3"]
    directions: Float[Array, "T C K"]
    start: int
    again: tuple[int, ...]
    renamed: Mapping[int, tuple[int, ...]]


def follow(
    clouds: Sequence[Cloud],
    reference: Float[Array, "K 3"],
    surface: Surface,
    progress: Progress,
    known: Mapping[int, tuple[Index, Array]] | None = None,
    cameras: Sequence[Camera] = (),
) -> Followed | None:
    """Identify the markers in the ``clouds`` of all instants; None if the wing is seen in none of those tried.

    ``reference`` are the markers in any axes, for example at rest. ``progress`` is called with the count of instants
    done, and of all. ``known`` are instants at which they are identified, with the index [K] of the point of each
    marker and where the markers are predicted; there the wing is not sought. The clouds are read in order, from the
    start to the last and back from there to the first.
    """
    known = known or {}
    start = min(known) if known else None
    if start is None:
        start, found = _start(clouds, reference)
        if found is None:
            return None
    else:
        found = known[start]
    state = _State(clouds, surface, reference, cameras)
    state.put(start, *found)
    done = 1
    for direction in (1, -1):
        state.restart(start)
        for instant in range(start + direction, len(clouds) if direction > 0 else -1, direction):
            state.step(instant)
            if instant in known:
                state.correct(instant, *known[instant])
            done += 1
            progress(done, len(clouds))
    again = tuple(sorted(state.again))
    return Followed(state.chosen, state.detections, state.predicted, state.directions, start, again, state.renamed)


def _start(clouds: Sequence[Cloud], reference: Float[Array, "K 3"]) -> tuple[int, tuple[Index, Array] | None]:
    """Return the instant at which most markers are identified, of some that are tried, and the identification there."""
    tried = np.unique(np.linspace(0, len(clouds) - 1, min(_STARTS, len(clouds))).astype(int))
    sizes = {int(instant): len(clouds[instant]) for instant in tried}
    best, most, found = 0, 0, None
    for instant in sorted(sizes, key=lambda one: -min(sizes[one], len(reference))):
        cloud = clouds[instant]
        chosen, predicted = register(reference, cloud.positions, cloud.points.covariance)
        count = int((chosen >= 0).sum())
        if count > most:
            best, most, found = instant, count, (chosen, predicted)
        if count >= 0.95 * len(reference):
            break
    return best, found


class _State:
    """The markers at the instants so far, and how well they were predicted."""

    def __init__(
        self,
        clouds: Sequence[Cloud],
        surface: Surface,
        reference: Float[Array, "K 3"],
        cameras: Sequence[Camera],
    ) -> None:
        self.clouds, self.surface, self.reference = clouds, surface, reference
        self.orientation = Orientation(cameras, surface.plane)
        self.directions = np.full((len(clouds), len(cameras), len(reference)), np.nan)
        count = len(reference)
        # Errors of predictions are not all alike; a search that is narrower than this loses markers, and gains nothing.
        self.spacing = spacing(reference)
        self.least = _NARROWEST * self.spacing
        self.chosen = np.full((len(clouds), count), -1)
        self.detections = np.full((len(clouds), len(clouds[0].detections), count), -1)
        self.predicted = np.full((len(clouds), count, 3), np.nan)
        self.places = np.full((len(clouds), count, 3), np.nan)
        self.known: list[int] = []
        self.error = np.inf
        self.again: list[int] = []
        self.renamed: dict[int, tuple[int, ...]] = {}

    def restart(self, instant: int) -> None:
        """Go on from ``instant`` alone."""
        self.known, self.error = [instant], np.inf

    def put(self, instant: int, chosen: Index, smooth: Float[Array, "K 3"]) -> None:
        """Store the markers of one instant; those not found are where the smooth motion places them."""
        found, cloud = chosen >= 0, self.clouds[instant]
        self.chosen[instant], self.predicted[instant] = chosen, smooth
        self.detections[instant] = np.where(found, cloud.detections[:, chosen], -1)
        self.places[instant] = np.where(found[:, None], cloud.positions[chosen], smooth)
        if self.directions.size:
            seen = np.where(found[:, None], cloud.edges[:, chosen], np.nan)[:, :, None]
            self.directions[instant] = self.orientation.directions(smooth, seen)[:, :, 0]
            self.orientation.learn(self.directions[instant])

    def correct(self, instant: int, chosen: Index, smooth: Float[Array, "K 3"]) -> None:
        """Replace what was followed to ``instant`` by what is known there; if they differ, go on from that alone."""
        followed, cloud = self.chosen[instant].copy(), self.clouds[instant]
        both = (followed >= 0) & (chosen >= 0)
        apart = np.linalg.norm(cloud.positions[followed] - cloud.positions[chosen], axis=1)
        other = np.flatnonzero(both & (apart > self.spacing / 2))
        if len(other):
            self.renamed[instant] = tuple(int(marker) for marker in other)
        if len(other) or self.known[-1] != instant:
            self.put(instant, chosen, smooth)
            self.restart(instant)
        else:
            free = np.where(np.isin(followed, chosen), -1, followed)
            self.put(instant, np.where(chosen >= 0, chosen, free), smooth)

    def step(self, instant: int) -> None:
        """Identify the markers at ``instant`` from those of the instants before."""
        cloud = self.clouds[instant]
        expected = self._extrapolated(instant) if np.isfinite(self.error) else None
        found = self._near(expected, cloud) if expected is not None else None
        if found is None or (found[0] >= 0).mean() < _LEAST_SHARE:
            again = self._anew(cloud)
            if found is None or (again is not None and (again[0] >= 0).sum() > (found[0] >= 0).sum()):
                found = again
        if found is None or (found[0] >= 0).sum() < _LEAST_MARKERS:
            return
        if abs(instant - self.known[-1]) > 1:
            self.again.append(instant)
        self.put(instant, *found)
        self._learn(instant)

    def _extrapolated(self, instant: int) -> Float[Array, "K 3"]:
        """Return the places at ``instant`` of the polynomial through the last one to three instants."""
        last = self.known[-3:]
        places = self.places[last]
        total = np.zeros_like(places[0])
        for one, at in enumerate(last):
            weight = 1.0
            for other in last:
                if other != at:
                    weight *= (instant - other) / (at - other)
            total += weight * places[one]
        # The place of a marker that was not found is a prediction itself: errors would grow with each extrapolation.
        return np.where(np.all(self.chosen[last] >= 0, axis=0, keepdims=True).T, total, np.nan)

    def _near(self, expected: Float[Array, "K 3"], cloud: Cloud) -> tuple[Index, Array] | None:
        """Return the identification near the places that are ``expected``."""
        covariance, allowed = cloud.points.covariance, self._allowed(expected, cloud)
        wide = np.full(len(expected), self.error)
        chosen = assign(expected, wide, cloud.positions, covariance, allowed=allowed)
        smooth = expected
        for _ in range(8):
            if (chosen >= 0).sum() < _LEAST_MARKERS:
                return None
            found = np.where((chosen >= 0)[:, None], cloud.positions[chosen], np.nan)
            moved = self._moved(found, expected)
            wide = np.maximum(moved.deviation, self.least)
            again = assign(moved.positions, wide, cloud.positions, covariance, allowed=allowed)
            smooth = moved.positions
            if (again == chosen).all():
                break
            chosen = again
        return chosen, smooth

    def _allowed(self, expected: Float[Array, "K 3"], cloud: Cloud) -> Mask | None:
        """Return the points [K, M] whose bright diagonals are those of the markers; None if cameras are unknown."""
        if not self.directions.size or not len(cloud):
            return None
        places = np.where(np.isfinite(expected), expected, self.places[self.known[-1]])
        seen = np.repeat(cloud.edges[:, None], len(places), axis=1)
        return self.orientation.allowed(self.orientation.directions(places, seen))

    def _moved(self, found: Float[Array, "K 3"], expected: Float[Array, "K 3"]) -> Deformed:
        """Return the markers after the smooth motion that those ``found`` show.

        Markers found at all of the last instants move from the places ``expected``. One that was missing has no
        expectation: it moves with the others from its place at the last instant or, if it was missing at all of them
        and its place may have drifted, from that at rest.
        """
        last = self.chosen[self.known[-3:]] >= 0
        moved = deformed(self.surface, found, expected)
        for group, shape, of in (
            (np.asarray(~last.all(0)), self.places[self.known[-1]], last[-1]),
            (np.asarray(~last.any(0)), self.reference, np.ones(len(found), dtype=bool)),
        ):
            if group.any():
                other = deformed(self.surface, np.where(of[:, None], found, np.nan), shape)
                moved = Deformed(
                    np.where(group[:, None], other.positions, moved.positions),
                    np.where(group, other.deviation, moved.deviation),
                )
        return moved

    def _anew(self, cloud: Cloud) -> tuple[Index, Array] | None:
        """Return the identification by the shape at the last instant, wherever the wing is now."""
        last = self.places[self.known[-1]]
        chosen, smooth = register(last, cloud.positions, cloud.points.covariance, nearby=True)
        return (chosen, smooth) if (chosen >= 0).any() else None

    def _learn(self, instant: int) -> None:
        """Compare the markers with what was expected, so that the next search is as wide as it must be."""
        if len(self.known) >= 3 or (len(self.known) == 2 and not np.isfinite(self.error)):
            apart = np.linalg.norm(self._extrapolated(instant) - self.places[instant], axis=1)
            now = float(np.nanpercentile(apart[self.chosen[instant] >= 0], 90))
            self.error = max(now, 0.7 * self.error if np.isfinite(self.error) else 0.0, 1e-4)
        self.known.append(instant)
