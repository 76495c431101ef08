"""Detects the markers in all frames of a film, one frame in memory at a time, and stores them so that it can go on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from wingfit.cameras.markers.chequer import detect_chequers
from wingfit.cameras.markers.detections import Detections
from wingfit.cameras.markers.dot import detect_dots
from wingfit.cameras.markers.stored import DetectionStore
from wingfit.cameras.video.source import Film, Frames
from wingfit.cameras.video.strobe import FlashMark, background, flashes
from wingfit.records.array_types import Array
from wingfit.records.errors import fail

MarkerKind = Literal["chequer", "dot"]
Light = Literal["strobe", "continuous"]
Progress = Callable[[int, int], object]
_VERSION = 5
_COUNT_OFF = 3  # frames by which the count of a container may be wrong
_LEAST_NOISE = 1.0  # grey levels: quantisation, and compression that removes noise


@dataclass(frozen=True, eq=False)
class FilmDetections:
    """Detections of one camera.

    Attributes:
        seen: of each instant: of each flash with a strobe, else of each frame; they may be read from files.
        marks: where the flashes are; without strobe ``frame`` is the number of the frame, and the rest has no meaning.
        bad_frames: numbers of frames that could not be decoded, or whose size differs.
        ended: number of frames at which the film ends, if its container states more; else None.
    """

    seen: Sequence[Detections]
    marks: Sequence[FlashMark]
    bad_frames: tuple[int, ...]
    ended: int | None = None


@dataclass(frozen=True)
class FilmTask:
    """What is detected in one film: frames ``first`` to ``last`` (excluded), into a folder in ``store``."""

    film: Film
    kind: MarkerKind
    light: Light
    store: Path
    first: int = 0
    last: int | None = None

    @property
    def key(self) -> str:
        """Return a text that differs for another film, and for another way to detect."""
        path = self.film.path
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        of = [(file.name, file.stat().st_size, file.stat().st_mtime_ns) for file in files]
        stated = [_VERSION, str(path.resolve()), of, self.film.rate_hz, self.kind, self.light]
        return hashlib.sha256(json.dumps([*stated, self.first, self.last]).encode()).hexdigest()[:16]


def detect_film(task: FilmTask, progress: Progress) -> FilmDetections:
    """Return the detections of a film; those that an earlier run stored are read.

    ``progress`` is called with the count of frames done, and of all.

    Raises:
        DatasetError: the film cannot be read, or less than half of it, or a strobe's flashes cannot be separated.
    """
    frames = task.film.opened()
    store = DetectionStore(task.store / task.key)
    if not store.complete:
        _detect(task, frames, store, progress)
    return FilmDetections(store.seen(), store.marks(), tuple(store.bad_frames), store.ended)


def _detect(task: FilmTask, frames: Frames, store: DetectionStore, progress: Progress) -> None:
    """Detect the markers in the frames after those that are stored."""
    last = store.last()
    first = task.first if last is None else last.frame + (2 if task.light == "strobe" else 1)
    of = min(frames.count or 10**9, task.last or 10**9) - task.first
    limited = _Limited(frames, task.last)
    for mark, found, missing in _instants(task, limited, first):
        store.add(mark, found, missing)
        progress(mark.frame + 1 - task.first, of)
    bad = limited.bad()
    store.finish(bad, _early_end(task, frames))


def _early_end(task: FilmTask, frames: Frames) -> int | None:
    """Return the number of frames of a film that was read to its end, if its container states more; else None."""
    wanted = min(frames.count, task.last or frames.count)
    if frames.ended is None or wanted - frames.ended <= _COUNT_OFF:
        return None
    if 2 * (frames.ended - task.first) < wanted - task.first:
        raise fail(
            str(task.film.path),
            frames.ended,
            f"ends at frame {frames.ended}, of {frames.count} that the container states: the file is damaged or cut "
            f"off. Copy it again, or state last_frame: {frames.ended}",
        )
    return frames.ended


def detect_frame(frame: Array, kind: MarkerKind) -> Detections:
    """Return the markers in one ``frame`` [H, W] that is lit as a whole."""
    detect = detect_chequers if kind == "chequer" else detect_dots
    return detect(frame, float(np.median(frame)), _noise(frame))


def _instants(task: FilmTask, frames: _Limited, first: int) -> Iterator[tuple[FlashMark, Detections, tuple[int, ...]]]:
    """Return instants with their detections, and the numbers of the bad frames before them."""
    detect = detect_chequers if task.kind == "chequer" else detect_dots
    if task.light == "strobe":
        dark = background(frames.all)
        for flash in flashes(frames, dark, first):
            yield flash.mark, detect(flash.image, 0.0, max(flash.noise, _LEAST_NOISE)), frames.bad()
        return
    # That of the first frame also if an earlier run detected it, so that the detections are the same.
    noise = next((_noise(frame) for _, frame in frames.all.read(task.first) if frame is not None), _LEAST_NOISE)
    for number, frame in frames.read(first):
        if frame is not None:
            found = detect(frame, float(np.median(frame)), noise)
            yield FlashMark(number, 0.0, (0.0, 0.0)), found, frames.bad()


class _Limited(Frames):
    """Frames up to a last one; the numbers of bad ones are collected."""

    def __init__(self, frames: Frames, last: int | None) -> None:
        self.path, self.size_px = frames.path, frames.size_px
        self.rate_hz, self.count = frames.rate_hz, frames.count
        self.all, self._last, self._bad = frames, last, list[int]()

    def read(self, first: int = 0) -> Iterator[tuple[int, Array | None]]:
        for number, frame in self.all.read(first):
            if self._last is not None and number >= self._last:
                return
            if frame is None:
                self._bad.append(number)
            yield number, frame

    def bad(self) -> tuple[int, ...]:
        """Return the numbers of the bad frames since the last call."""
        bad, self._bad = tuple(self._bad), []
        return bad


def _noise(frame: Array) -> float:
    """Return the noise of a frame from differences of neighbouring pixels, most of which show no edge."""
    change = np.diff(frame.astype(np.float32), axis=1)
    return max(float(np.median(np.abs(change)) / 0.6745 / np.sqrt(2)), _LEAST_NOISE)
