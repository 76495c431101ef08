"""Places on a wing where further markers could be: those described that were not tracked, and a grid over the wing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.diagnosis.advice.advised import AdvisedPlace
from wingfit.records import Marker, Wing
from wingfit.records.array_types import Array, Float
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.planform import Planform

SPAN, CHORD = (0.35, 0.6, 0.85, 1.0), (0.1, 0.5, 0.9)  # of the grid; near the root a wing hardly moves
MOST_PLACES = 4  # that are proposed
NAME = "place-{}"  # of a marker that does not exist


@dataclass(frozen=True)
class Place:
    """A ``marker`` on the wing, at ``span`` and ``chord`` (0 to 1); ``new``: it is not described."""

    marker: Marker
    span: float
    chord: float
    new: bool

    def advised(self, separation: float) -> AdvisedPlace:
        """Return the place for the finding, where predictions differ by ``separation``."""
        x, y, _ = self.marker.position
        return AdvisedPlace(self.span, self.chord, x, y, separation, None if self.new else self.marker.name)


def places_on(wing: Wing, tracked: Sequence[str]) -> tuple[Place, ...]:
    """Return the described markers that are not ``tracked``, and the places of a grid."""
    planform, root = Planform(wing), wing.stations[0].y
    found = list[Place]()
    for one in wing.markers:
        x, y, _ = one.position
        if one.name not in tracked:
            span = float(np.clip((y - root) / wing.span, 0.0, 1.0))
            found.append(Place(one, span, float(planform.fraction(x, y)), new=False))
    stations = np.array([(s.y, s.leading_edge, s.chord) for s in wing.stations])
    height = float(np.mean([one.position[2] for one in wing.markers])) if wing.markers else 0.0
    for span in SPAN:
        y = root + span * wing.span
        edge, width = (float(np.interp(y, stations[:, 0], stations[:, k])) for k in (1, 2))
        for chord in CHORD:
            marker = Marker(NAME.format(len(found) + 1), (edge + chord * width, y, height), 0.0)
            found.append(Place(marker, span, chord, new=True))
    return tuple(found)


def with_markers(model: FlexibleWing, places: Sequence[Place]) -> FlexibleWing:
    """Return ``model`` with markers without mass at the ``places`` that are not described."""
    added = tuple(one.marker for one in places if one.new)
    return replace(model, wing=replace(model.wing, markers=(*model.wing.markers, *added)))


def best_places(places: Sequence[Place], squares: Float[Array, " N"], extent: float) -> list[int]:
    """Return the numbers of up to MOST_PLACES of N ``places`` with the largest ``squares``, none beside another.

    ``extent``: length of the wing, m; places nearer than a tenth of it are one.
    """
    chosen = list[int]()
    for k in np.argsort(-squares, kind="stable"):
        here = np.array(places[k].marker.position)
        if all(np.linalg.norm(here - places[j].marker.position) > 0.1 * extent for j in chosen):
            chosen.append(int(k))
        if len(chosen) == MOST_PLACES:
            break
    return chosen
