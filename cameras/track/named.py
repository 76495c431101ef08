"""At which instants which detections are labelled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.cameras.track.labels import Spot
from wingfit.cameras.track.tracklets import Tracklets, owned_at_time
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail

# Of each camera, the index of the detection of each labelled marker.
Named = tuple[Mapping[str, int], ...]


@dataclass(frozen=True, eq=False)
class Clock:
    """The detections of a camera over time.

    Attributes:
        tracklets: its detections, joined.
        times: [F] (s), when the middle rows of its frames were exposed, on its clock.
        offset: what is added to times (s) of instants to get those of this camera.
        frame_s: time between frames (s).
        longest: time (s) between samples of a tracklet that is read.
    """

    tracklets: Tracklets
    times: Float[Array, " F"]
    offset: float
    frame_s: float
    longest: float


def named_flashes(labelled: Sequence[Spot], instant_of: Sequence[Mapping[int, int]]) -> dict[int, Named]:
    """Return what is ``labelled`` at each instant; ``instant_of``: that of each flash of each camera.

    Raises:
        DatasetError: a labelled flash was not seen by all cameras.
    """
    found: dict[int, tuple[dict[str, int], ...]] = {}
    for spot in labelled:
        instant = instant_of[spot.camera].get(spot.at)
        if instant is None:
            label = spot.label
            message = f"the flash in frame {label.frame} of {label.camera} was not seen by all cameras"
            raise fail(label.place, label.frame, f"{message}; label another one")
        found.setdefault(instant, tuple({} for _ in instant_of))[spot.camera][spot.label.marker] = spot.detection
    return dict(found)


def named_frames(
    labelled: Sequence[Spot],
    clocks: Sequence[Clock],
    instants: Float[Array, " T"],
    within_s: float,
) -> dict[int, Named]:
    """Return what is ``labelled`` at each instant, of cameras without strobe.

    Frames of different cameras belong together if they are at most ``within_s`` (s) and a frame apart: those who label
    do not know by how much clocks differ. Markers are followed in the image to the instant of the first camera's frame.

    Raises:
        DatasetError: a labelled frame is at no instant that all cameras saw.
    """
    home = {(spot.camera, spot.at): _home(spot, clocks[spot.camera], instants) for spot in labelled}
    reach = within_s + 1.5 * max(clock.frame_s for clock in clocks)
    result = dict[int, Named]()
    for group in _groups(home, instants, reach):
        instant = home[min(group)]
        names = tuple(dict[str, int]() for _ in clocks)
        owners = [owned_at_time(one.tracklets, instants[instant] + one.offset, one.longest)[1] for one in clocks]
        for spot in labelled:
            if (spot.camera, spot.at) not in group:
                continue
            of = clocks[spot.camera].tracklets
            index = np.flatnonzero(owners[spot.camera] == of.owner[of.starts[spot.at] + spot.detection])
            if len(index):
                names[spot.camera][spot.label.marker] = int(index[0])
        result[instant] = names
    return result


def _home(spot: Spot, clock: Clock, instants: Float[Array, " T"]) -> int:
    """Return the instant nearest to the frame of ``spot``."""
    apart = np.abs(instants + clock.offset - clock.times[spot.at])
    if apart.min() > 1.5 * clock.frame_s:
        label = spot.label
        message = f"frame {label.frame} of {label.camera} is not within the films of all cameras"
        raise fail(label.place, label.frame, f"{message}; label another one")
    return int(apart.argmin())


def _groups(
    home: Mapping[tuple[int, int], int], instants: Float[Array, " T"], reach: float
) -> list[set[tuple[int, int]]]:
    """Return which labelled frames (camera, number) belong together: one of each camera, within ``reach`` (s)."""
    groups = list[set[tuple[int, int]]]()
    for one in sorted(home, key=lambda one: (home[one], one)):
        if groups:
            begin = min(instants[home[other]] for other in groups[-1])
            if all(other[0] != one[0] for other in groups[-1]) and instants[home[one]] - begin <= reach:
                groups[-1].add(one)
                continue
        groups.append({one})
    return groups
