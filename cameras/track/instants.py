"""The detections of all cameras at common instants: flashes of a strobe, or times between frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.computed import Computed
from wingfit.cameras.markers.detections import Detections
from wingfit.cameras.track.cloud import possible_points
from wingfit.cameras.track.film_detections import FilmDetections
from wingfit.cameras.track.labels import Spot
from wingfit.cameras.track.named import Clock, Named, named_flashes, named_frames
from wingfit.cameras.track.synchronise import Offset, common_times, offset_between
from wingfit.cameras.track.tracklets import at_time, join
from wingfit.cameras.video.source import Frames
from wingfit.cameras.video.strobe import FlashTimes, flash_times
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail

_SHIFTS = 3  # flashes by which the films of two cameras may begin apart
_COMPARED = 25  # instants
_APART = 1.5  # frames between samples of a marker, at most


@dataclass(frozen=True, eq=False)
class Instants:
    """Detections of all cameras at the same instants.

    Attributes:
        times: [T] (s), on the clock of the first camera.
        seen: of each instant, of each camera; computed when they are read.
        frames: [T, C], number of the first frame of each camera that shows the instant; -1 if there is none.
        remarks: what was estimated or is doubtful.
        named: of each labelled instant, of each camera: the index of the detection of each labelled marker.
    """

    times: Float[Array, " T"]
    seen: Sequence[tuple[Detections, ...]]
    frames: Array
    remarks: tuple[str, ...]
    named: Mapping[int, Named]

    def shown(self, instant: int, cameras: Sequence[str]) -> str:
        """Return the frames of the ``cameras`` that show the ``instant``, as text."""
        pairs = zip(cameras, self.frames[instant], strict=True)
        return ", ".join(f"frame {frame} of {name}" for name, frame in pairs)


def flash_instants(
    cameras: Sequence[Camera],
    films: Sequence[Frames],
    found: Sequence[FilmDetections],
    tolerance_px: float,
    labelled: Sequence[Spot] = (),
) -> Instants:
    """Return the flashes that all cameras saw, matched by where their rays meet best, and what is ``labelled``."""
    timed = [
        flash_times(one.marks, frames, camera.row_s or None)
        for camera, frames, one in zip(cameras, films, found, strict=True)
    ]
    remarks = _clock_remarks(cameras, films, found, timed)
    shifts = [0]
    for other in range(1, len(cameras)):
        shifts.append(_best_shift(cameras, found, timed, other, tolerance_px))
        if shifts[-1]:
            remarks.append(
                f"the film of {cameras[other].name} begins {-shifts[-1]} flashes before that of {cameras[0].name}"
            )
    index = [
        {int(number) + shift: k for k, number in enumerate(one.numbers)}
        for one, shift in zip(timed, shifts, strict=True)
    ]
    common = sorted(set(index[0]).intersection(*index[1:]))
    if len(common) < 3:
        raise fail("films", len(common), f"{len(common)} flashes are seen by all cameras; at least 3 are needed")
    lost = len(index[0]) - len(common)
    if lost:
        remarks.append(f"{lost} of {len(index[0])} flashes were not seen by all cameras, and are left out")
    rows = [[one[number] for one in index] for number in common]
    instant_of = [{row[camera]: instant for instant, row in enumerate(rows)} for camera in range(len(cameras))]
    return Instants(
        times=np.array([timed[0].times[row[0]] for row in rows]),
        seen=Computed(len(rows), lambda instant: _flash(found, rows[instant])),
        frames=np.array([[one.marks[k].frame for one, k in zip(found, row, strict=True)] for row in rows]),
        remarks=tuple(remarks),
        named=named_flashes(labelled, instant_of),
    )


def _flash(found: Sequence[FilmDetections], numbers: Sequence[int]) -> tuple[Detections, ...]:
    """Return the detections of the flashes with these ``numbers``, one of each camera."""
    return tuple(one.seen[number] for one, number in zip(found, numbers, strict=True))


def _clock_remarks(
    cameras: Sequence[Camera],
    films: Sequence[Frames],
    found: Sequence[FilmDetections],
    timed: Sequence[FlashTimes],
) -> list[str]:
    known = [(camera.name, one.row_s) for camera, one in zip(cameras, timed, strict=True) if one.row_s > 0]
    rows = ", ".join(f"{1e6 * row_s:.2f} us in {name}" for name, row_s in known)
    remarks = [
        f"the strobe flashes every {1e3 * timed[0].period:.3f} ms" + (f"; from row to row {rows}" if rows else "")
    ]
    for camera, film, seen, one in zip(cameras, films, found, timed, strict=True):
        if one.row_s == 0 and any(np.isfinite(mark.between).all() for mark in seen.marks):
            remarks.append(
                f"the flashes do not show the time from row to row in the film of {camera.name}, as too few of them "
                f"divide at different rows: their times are exact to a frame, {1e3 / film.rate_hz:.3g} ms; track more"
            )
        apart = one.period / timed[0].period - 1
        frame = 1 / film.rate_hz / (one.numbers[-1] * one.period)  # of the length: what rows may hide
        if abs(apart) > max(1e-3, frame):
            remarks.append(
                f"the strobe's period in the film of {camera.name} differs by {apart * 100:+.2f} % from that in the "
                f"film of {cameras[0].name}: check rate_hz of both"
            )
    return remarks


def _best_shift(
    cameras: Sequence[Camera],
    found: Sequence[FilmDetections],
    timed: Sequence[FlashTimes],
    other: int,
    tolerance_px: float,
) -> int:
    """Return what is added to the numbers of flashes of camera ``other`` to get those of the first."""
    first = {int(number): k for k, number in enumerate(timed[0].numbers)}
    second = {int(number): k for k, number in enumerate(timed[other].numbers)}
    pair = (cameras[0], cameras[other])
    scores = {}
    for shift in sorted(range(-_SHIFTS, _SHIFTS + 1), key=abs):
        both = [number for number in first if number - shift in second]
        used = [both[k] for k in np.unique(np.linspace(0, len(both) - 1, _COMPARED).astype(int))] if both else []
        points = 0.0
        for number in used:
            seen = (found[0].seen[first[number]], found[other].seen[second[number - shift]])
            cloud = possible_points(pair, seen, tolerance_px, (0.0, np.inf))
            points += len(np.unique(cloud.detections[0])) - cloud.points.misfit.sum() / 16
        scores[shift] = points / max(len(used), 1)
    return max(scores, key=lambda shift: (scores[shift], -abs(shift)))


def frame_instants(
    cameras: Sequence[Camera],
    films: Sequence[Frames],
    found: Sequence[FilmDetections],
    tolerance_px: float,
    within_s: float,
    labelled: Sequence[Spot] = (),
) -> Instants:
    """Return the detections at the times of the first camera's frames; clocks up to ``within_s`` apart are compared.

    With ``within_s`` zero the cameras are synchronised. What is ``labelled`` is found again at the instants.
    """
    times = [
        np.array([one.frame for one in of.marks]) / frames.rate_hz for of, frames in zip(found, films, strict=True)
    ]
    joined = [join(of.seen, at, camera.row_s) for of, at, camera in zip(found, times, cameras, strict=True)]
    middle = cameras[0].row_s * cameras[0].size_px[1] / 2
    frame_s = max(1 / frames.rate_hz for frames in films)
    offsets = [Offset(0.0, 0.0)]
    for other in range(1, len(cameras)):
        if within_s == 0:
            offsets.append(Offset(0.0, 0.0))
            continue
        pair, two = (cameras[0], cameras[other]), (joined[0], joined[other])
        offsets.append(offset_between(pair, two, times[0] + middle, frame_s, within_s, tolerance_px))
    seconds = [one.seconds for one in offsets]
    instants = common_times(joined, seconds, times[0] + middle)
    if len(instants) < 3:
        raise fail("films", len(instants), "the films of all cameras have fewer than 3 frames in common")

    def at_instant(number: int) -> tuple[Detections, ...]:
        pairs = zip(joined, seconds, strict=True)
        return tuple(at_time(one, instants[number] + offset, _APART * frame_s) for one, offset in pairs)

    frames = np.column_stack(
        [
            np.rint((instants + offset - middle) * of.rate_hz).astype(int)
            for of, offset in zip(films, seconds, strict=True)
        ]
    )
    clocks = [
        Clock(one, at + camera.row_s * camera.size_px[1] / 2, offset, 1 / of.rate_hz, _APART * frame_s)
        for camera, one, at, offset, of in zip(cameras, joined, times, seconds, films, strict=True)
    ]
    named = named_frames(labelled, clocks, instants, within_s)
    seen = Computed(len(instants), at_instant)
    return Instants(instants, seen, frames, _offset_remarks(cameras, offsets, within_s), named)


def _offset_remarks(cameras: Sequence[Camera], offsets: Sequence[Offset], within_s: float) -> tuple[str, ...]:
    if within_s == 0:
        return ()
    return tuple(
        f"the clock of {camera.name} is {1e3 * one.seconds:+.3f} ms ({1e3 * one.standard_error:.3f} ms standard error) "
        f"from that of {cameras[0].name}"
        for camera, one in zip(cameras[1:], offsets[1:], strict=True)
    )
