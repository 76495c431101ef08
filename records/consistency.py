"""What takes several values to judge: references between names, order, markers on the planform."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from records.description import DatasetFile, StationFile, WingFile
from records.errors import nearest
from records.limits import PLANFORM_MARGIN
from records.yaml_text import Path

Inconsistency = tuple[Path, object, str]


def inconsistencies(dataset: DatasetFile) -> Iterator[Inconsistency]:
    """Everything that does not fit together: path, value, message."""
    wing = dataset.wing
    yield from _stations(wing.stations)
    yield from _unique(("wing", "rods"), [rod.name for rod in wing.rods], "name")
    yield from _unique(("wing", "markers"), [marker.name for marker in wing.markers], "name")
    yield from _rods(wing)
    yield from _references(("wing", "driven_rods"), wing.driven_rods, [rod.name for rod in wing.rods], "rod")
    markers = [marker.name for marker in wing.markers]
    yield from _references(("wing", "reference_markers"), wing.reference_markers, markers, "marker")
    yield from _markers(wing)
    recordings = [recording.name for recording in dataset.recordings]
    yield from _unique(("recordings",), recordings, "name", ignore_case=True)
    yield from _references(("held_out",), dataset.held_out, recordings, "recording")


def _stations(stations: Sequence[StationFile]) -> Iterator[Inconsistency]:
    for index in range(1, len(stations)):
        before, here = stations[index - 1].y_m, stations[index].y_m
        if here <= before:
            message = f"is {here} m after {before} m; y must increase from root to tip: sort the stations"
            yield ("wing", "stations", index, "y_m"), here, message


def _unique(
    path: Path, names: Sequence[str], key: str | None = None, *, ignore_case: bool = False
) -> Iterator[Inconsistency]:
    seen: dict[str, str] = {}
    for index, name in enumerate(names):
        folded = name.lower() if ignore_case else name
        here = (*path, index, key) if key else (*path, index)
        if seen.get(folded) == name:
            yield here, name, f"{name!r} stands here a second time; every name must be unique: rename one"
        elif folded in seen:
            message = f"{name!r} differs from {seen[folded]!r} only by case, which files may not keep: rename one"
            yield here, name, message
        seen.setdefault(folded, name)


def _references(path: Path, names: Sequence[str], known: Sequence[str], what: str) -> Iterator[Inconsistency]:
    yield from _unique(path, names)
    for index, name in enumerate(names):
        if name not in known:
            yield (*path, index), name, f"no {what} is called {name!r}; {nearest(name, known)}"


def _rods(wing: WingFile) -> Iterator[Inconsistency]:
    for index, rod in enumerate(wing.rods):
        if (rod.x_root_m, rod.y_root_m) == (rod.x_tip_m, rod.y_tip_m):
            message = f"rod {rod.name!r} starts and ends at the same point; its root and tip must differ"
            yield ("wing", "rods", index), rod.name, message


def _markers(wing: WingFile) -> Iterator[Inconsistency]:
    if list(_stations(wing.stations)):
        return
    outline = planform_outline(wing.stations)
    for index, marker in enumerate(wing.markers):
        distance = distance_outside(outline, float(marker.x_m), float(marker.y_m))
        if distance > PLANFORM_MARGIN:
            message = (
                f"marker {marker.name!r} at x = {marker.x_m} m, y = {marker.y_m} m is "
                f"{distance * 1e3:.1f} mm outside the planform; at most {PLANFORM_MARGIN * 1e3:g} mm "
                "are accepted: check unit (m), sign and whether x and y are swapped"
            )
            yield ("wing", "markers", index), marker.name, message


def planform_outline(stations: Sequence[StationFile]) -> npt.NDArray[np.float64]:
    """Corners of the planform [N, 2] as (x, y): leading edge from root to tip, then trailing edge back."""
    leading = [(float(s.leading_edge_m), float(s.y_m)) for s in stations]
    trailing = [(float(s.leading_edge_m + s.chord_m), float(s.y_m)) for s in stations]
    return np.array(leading + trailing[::-1])


def distance_outside(outline: npt.NDArray[np.float64], x: float, y: float) -> float:
    """Distance from (x, y) to the planform, m; 0 inside."""
    start, end = outline, np.roll(outline, -1, axis=0)
    point, edge = np.array([x, y]), end - start
    # Inside when a ray to +x crosses the outline an odd number of times.
    crosses = (start[:, 1] > y) != (end[:, 1] > y)
    slope = np.divide(edge[:, 0], edge[:, 1], out=np.zeros(len(edge)), where=crosses)
    if np.count_nonzero(crosses & (x < start[:, 0] + (y - start[:, 1]) * slope)) % 2:
        return 0.0
    along = np.clip(((point - start) * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), 1e-300), 0.0, 1.0)
    return float(np.hypot(*(start + along[:, None] * edge - point).T).min())
