"""The truth about a film: where each marker was, and where, when and how well each camera saw it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.cameras.renderer.exposure import Nodes, corners, nodes
from benchmarks.cameras.renderer.film import Film
from benchmarks.cameras.renderer.film_camera import FilmCamera
from benchmarks.cameras.renderer.kernels import BALL, hidden
from benchmarks.cameras.renderer.light import Strobe
from benchmarks.cameras.renderer.scene import KINDS, Scene
from wingfit.records.array_types import Array, Index

_GRID = np.array([-0.8, -0.4, 0.0, 0.4, 0.8])  # of points of a marker, in units of half its width
_STEPS = 40  # of the search for the instant at which a marker's own row is exposed
_SAME = 1e-10  # s: less than a millionth of a pixel


@dataclass(frozen=True, eq=False)
class Truth:
    """Truth about K markers at T flashes, or in T frames if light is continuous, seen by C cameras.

    Attributes:
        names: of the markers [K].
        times: [T] middle of each flash, or of the exposure of the first camera's middle row, s.
        positions: [T, K, 3] at ``times``, m.
        instants: [C, T, K] middle of the exposure in which the camera saw the marker, s; the flash's if there is one.
        seen: [C, T, K, 3] positions at ``instants``, m.
        pixels: [C, T, K, 2] images of ``seen``, also if hidden or outside.
        frames: [C, T, K] frame in which the marker's own row is lit most; -1 if none.
        lit: [C, T, K] share of the flash that falls on this row in that frame; 1 if light is continuous.
        visible: [C, T, K] share of the marker that is in the image, faces the camera and is not hidden, 0 to 1.
    """

    names: tuple[str, ...]
    times: Array
    positions: Array
    instants: Array
    seen: Array
    pixels: Array
    frames: Index
    lit: Array
    visible: Array

    def save(self, path: Path) -> None:
        """Write all attributes into an .npz file under their names."""
        values: dict[str, Any] = {field.name: np.asarray(getattr(self, field.name)) for field in fields(self)}
        np.savez_compressed(path, **values)


class View(NamedTuple):
    """What one camera saw at one time: the last six attributes of :class:`Truth` without [C, T]."""

    instants: Array
    seen: Array
    pixels: Array
    frames: Index
    lit: Array
    visible: Array


def truth_of(film: Film, tell: Callable[[int, int], None] | None = None) -> Truth:
    """Compute the truth about ``film``; ``tell`` is called with the number of done and of all times."""
    strobe, first = film.light.strobe, film.cameras[0]
    if strobe:
        starts = strobe.starts(0.0, film.until)
        times = starts[starts + strobe.duration <= film.until] + strobe.duration / 2
    else:
        count = min(film.frames(camera) for camera in film.cameras)
        times = first.begin(np.arange(count)) + first.row_time * (first.size[1] - 1) / 2 + first.exposure / 2
    views = []
    for t, time in enumerate(times.tolist()):
        at_once = [_flash(film.scene, c, strobe, time) if strobe else _frame(film.scene, c, t) for c in film.cameras]
        views.append(at_once)
        if tell:
            tell(t + 1, len(times))

    def stacked(part: str) -> Array:
        return np.stack([[getattr(view[c], part) for view in views] for c in range(len(film.cameras))])

    parts = {part: stacked(part) for part in View._fields}
    frames = parts.pop("frames").astype(np.int64)
    return Truth(film.scene.names, times, film.scene.poses(times).positions, frames=frames, **parts)


def _flash(scene: Scene, camera: FilmCamera, strobe: Strobe, time: float) -> View:
    """What ``camera`` sees of the flash whose middle is at ``time``."""
    first, last = time - strobe.duration / 2, time + strobe.duration / 2
    found = nodes(scene, camera, first, last)
    instants = np.full(len(scene.names), time)
    local, visible = visibility(scene, camera, found, instants)
    pixels = camera.image(local)
    row = np.rint(pixels[:, 1])
    frames, lit = np.full(len(instants), -1), np.zeros(len(instants))
    for frame in camera.frames(first, last):
        start = camera.begin(frame) + camera.row_time * row
        share = (np.minimum(start + camera.exposure, last) - np.maximum(start, first)) / strobe.duration
        better = share > lit
        frames[better], lit[better] = frame, share[better]
    return View(instants, _world(camera, local), pixels, frames, lit, visible)


def _frame(scene: Scene, camera: FilmCamera, frame: int) -> View:
    """What ``camera`` sees in ``frame`` under continuous light."""
    starts, ends = camera.rows(frame)
    found = nodes(scene, camera, float(starts[0]), float(ends[-1]))
    count = len(scene.names)
    rows, instants = np.full(count, camera.size[1] / 2), np.zeros(count)
    for _ in range(_STEPS):
        before, instants = instants, starts[0] + camera.row_time * rows + camera.exposure / 2
        if camera.row_time == 0 or np.abs(instants - before).max() < _SAME:
            break
        local = np.stack([found.at(instants[k : k + 1], k)[0][0] for k in range(count)])
        rows = np.clip(np.nan_to_num(camera.image(local)[:, 1]), 0, camera.size[1] - 1)
    local, visible = visibility(scene, camera, found, instants)
    pixels = camera.image(local)
    return View(instants, _world(camera, local), pixels, np.full(count, frame), np.ones(count), visible)


def visibility(scene: Scene, camera: FilmCamera, found: Nodes, instants: Array) -> tuple[Array, Array]:
    """Positions [K, 3] of markers at their ``instants`` [K], in camera coordinates, and their visible shares [K]."""
    ball = KINDS[scene.kind] == BALL
    margin = scene.surface.margin if scene.surface else 0.0
    local, shares = np.empty((len(instants), 3)), np.zeros(len(instants))
    covers: dict[float, tuple[Array, Array]] = {}
    for k, time in enumerate(instants.tolist()):
        centre, axes = found.at(instants[k : k + 1], k)
        local[k] = centre[0]
        if not ball and axes[0, 2] @ centre[0] >= 0:  # it faces away
            continue
        if time not in covers:
            triangles, rods = found.covers(instants[k : k + 1])
            covers[time] = triangles[0], rods[0]
        points = corners(centre[0], axes[0], float(scene.sizes[k]), ball, _GRID)
        clear = ~hidden(points, margin, *covers[time], scene.radii)
        shares[k] = np.mean(clear & camera.inside(camera.image(points)))
    return local, shares


def _world(camera: FilmCamera, local: Array) -> Array:
    """World coordinates of points in camera coordinates [..., 3]."""
    return np.asarray((local - camera.translation) @ camera.rotation)
