"""Detections of a flapping wing in two or three cameras, in place of films: what ``track`` is given in tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.cameras.track.moving_wing import moved
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.markers.detections import Detections
from wingfit.cameras.track import procedure
from wingfit.cameras.track.film_detections import FilmDetections, FilmTask
from wingfit.cameras.track.labels import Label
from wingfit.cameras.track.procedure import Request
from wingfit.cameras.video.source import Film, Frames
from wingfit.cameras.video.strobe import FlashMark
from wingfit.records.array_types import Array, Index

SIZE, NOISE_PX = (1024, 800), 0.05


def grid(rows: int = 5, columns: int = 6) -> Array:
    """Places [K, 3] of a regular grid, which looks the same after a turn by half about three axes."""
    x, y = np.linspace(-0.1, 0.1, rows), np.linspace(0.05, 0.55, columns)
    return np.array([[one, two, 0.0] for one in x for two in y])


def around(angles: Sequence[float]) -> tuple[Camera, ...]:
    """Cameras that look at the wing, at these angles (deg) about y; 1 m away."""
    found = []
    for number, angle in enumerate(angles):
        turn = Rotation.from_euler("y", angle, degrees=True).as_matrix()
        matrix = np.array([[1150.0, 0, 512], [0, 1150.0, 400], [0, 0, 1]])
        found.append(Camera(f"c{number}", SIZE, matrix, Lens(), turn, np.array([0, 0, 1.0])))
    return tuple(found)


def wing_at(rest: Array, time: float) -> Array:
    """Places [K, 3] of the markers in the axes of the cameras, which look down on the wing."""
    span, up, chord = (moved(rest, time, bend=0.4) - [0.1, -0.2, 0.9]).T
    return np.column_stack([span - 0.3, chord, up])


class _Opened(Frames):
    def __init__(self, rate: float, count: int) -> None:
        self.path, self.size_px, self.rate_hz, self.count = Path("film"), SIZE, rate, count


@dataclass(frozen=True)
class SimulatedFilm(Film):
    count: int = 0

    def opened(self) -> Frames:
        return _Opened(self.rate_hz or 1.0, self.count)


@dataclass(frozen=True, eq=False)
class Filmed:
    """A request, the pixels [C, F, K, 2] of the markers in each frame, and places [F, K, 3] at those of the first."""

    request: Request
    names: tuple[str, ...]
    pixels: Array
    true: Array
    frames: Index  # [C, F], number of each frame

    def labels(self, frames: Sequence[int], markers: Sequence[int]) -> list[Label]:
        """Labels of ``markers`` in the frames with these indices of each camera, 1 px beside their pixels."""
        return [
            Label(camera.name, int(self.frames[k, at]), self.names[marker], tuple(self.pixels[k, at, marker] + 0.7))
            for k, (camera, at) in enumerate(zip(self.request.cameras, frames, strict=True))
            for marker in markers
        ]

    def with_labels(self, labels: Sequence[Label], **changes: Any) -> Request:
        return replace(self.request, labels=tuple(labels), **changes)


def filmed(
    monkeypatch: pytest.MonkeyPatch,
    rest: Array,
    *,
    angles: Sequence[float] = (-15.0, 15.0),
    frames: int = 30,
    rate: float = 120.0,
    strobe: bool = False,
    late: Sequence[float] = (0.0, 0.0, 0.0),
    hidden: Callable[[int], bool] = lambda _: False,
) -> Filmed:
    """Make ``track`` detect the markers ``rest`` [K, 3] as they move; ``late``: by how much each clock is ahead (s).

    With a strobe there is a flash in every fourth frame. Nothing is detected in the frames that are ``hidden``.
    """
    cameras, rng = around(angles), np.random.default_rng(3)
    names = tuple(f"m{number:02d}" for number in range(len(rest)))
    times = np.arange(frames) / rate
    pixels = np.array([
        [camera.project(wing_at(rest, time - behind)) for time in times]
        for camera, behind in zip(cameras, late, strict=False)
    ])  # fmt: skip
    pixels += NOISE_PX * rng.standard_normal(pixels.shape)
    numbers = np.tile(4 * np.arange(frames) + 2 if strobe else np.arange(frames), (len(cameras), 1))
    films = tuple(
        SimulatedFilm(Path(camera.name), 4 * rate if strobe else rate, 4 * frames if strobe else frames)
        for camera in cameras
    )

    def detect(task: FilmTask, _progress: object) -> FilmDetections:
        camera = [camera.name for camera in cameras].index(task.film.path.name)
        seen, marks = [], []
        for at in range(frames):
            own = pixels[camera, at][rng.permutation(len(rest))][: 0 if hidden(at) else None]
            count = len(own)
            spread = np.tile(NOISE_PX**2 * np.eye(2), (count, 1, 1))
            seen.append(
                Detections(own, spread, np.full(count, 4.0), np.full(count, 100.0), np.full((count, 2), np.nan))
            )
            marks.append(FlashMark(int(numbers[camera, at]), 0.0, (-np.inf, np.inf)))
        return FilmDetections(seen, marks, ())

    monkeypatch.setattr(procedure, "detect_film", detect)
    request = Request(cameras, films, "dot", "strobe" if strobe else "continuous", names, rest)
    true = np.array([wing_at(rest, time) for time in times])
    return Filmed(request, names, pixels, true, numbers)
