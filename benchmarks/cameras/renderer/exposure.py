"""Adds what light shows to the image of one frame: markers, the dark surface and rods, and glare.

All is exact for moving things and shutters that roll: light of a short interval falls on a row of the image as long as
that row is exposed, and is spread by pixel and lens.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from benchmarks.cameras.renderer.film_camera import PAD, FilmCamera
from benchmarks.cameras.renderer.kernels import BALL, fill_rods, fill_triangles, hidden, sample_marker
from benchmarks.cameras.renderer.scene import KINDS, Glare, Scene
from wingfit.records.array_types import Array, Mask

Lit = tuple[float, float, float]
_NODE = 1e-4  # s between the instants at which the scene is evaluated; between them it moves linearly
_SHIFT = 0.4  # pixels that a marker moves at most between two instants that are rendered
_MOST = 64  # such instants
_GRID = np.array([-0.95, -0.5, 0.0, 0.5, 0.95])  # of points of a marker that are tested for occlusion


class Nodes(NamedTuple):
    """The scene in camera coordinates at the instants ``times`` [N] of one interval of light.

    ``centres`` [N, K, 3], ``axes`` [N, K, 3, 3], ``triangles`` [N, M, 3, 3], ``rods`` [N, C, 2, 3].
    """

    times: Array
    centres: Array
    axes: Array
    triangles: Array
    rods: Array

    def at(self, times: Array, marker: int) -> tuple[Array, Array]:
        """Centre [S, 3] and axes [S, 3, 3] of a marker at ``times`` [S], interpolated linearly."""
        k, a = self._weights(times)
        centre = (1 - a)[:, None] * self.centres[k, marker] + a[:, None] * self.centres[k + 1, marker]
        b = a[:, None, None]
        return centre, (1 - b) * self.axes[k, marker] + b * self.axes[k + 1, marker]

    def covers(self, times: Array) -> tuple[Array, Array]:
        """Triangles [S, M, 3, 3] and rods [S, C, 2, 3] at ``times`` [S]."""
        k, a = self._weights(times)
        b = a[:, None, None, None]
        return (1 - b) * self.triangles[k] + b * self.triangles[k + 1], (1 - b) * self.rods[k] + b * self.rods[k + 1]

    def _weights(self, times: Array) -> tuple[Array, Array]:
        place = np.interp(times, self.times, np.arange(len(self.times), dtype=float))
        k = np.minimum(place.astype(int), len(self.times) - 2)
        return k, place - k


def nodes(scene: Scene, camera: FilmCamera, first: float, last: float) -> Nodes:
    """Evaluate the scene between ``first`` and ``last``, s."""
    times = np.linspace(first, last, 2 + int((last - first) / _NODE))
    poses = scene.poses(times)
    axes = poses.axes @ camera.rotation.T
    covers = camera.local(scene.vertices(times)), camera.local(scene.rod_ends(times))
    return Nodes(times, camera.local(poses.positions), axes, *covers)


def shone(starts: Array, ends: Array, first: Array, last: Array) -> Array:
    """Overlap (s) of each row's exposure [H] with each of S intervals, [H, S]."""
    overlap = np.minimum(ends[:, None], last) - np.maximum(starts[:, None], first)
    return np.asarray(np.maximum(overlap, 0.0))


def spread(pixels: int, over: int, first: float, count: int, blur: float) -> Array:
    """Weights [count, pixels * over] of samples in ``count`` pixels.

    A pixel integrates over its area what a Gaussian of standard deviation ``blur`` has spread. ``first``: position of
    the first of these pixels relative to the first sampled one.
    """
    samples = -0.5 + (np.arange(pixels * over) + 0.5) / over
    gap = samples[None] - (first + np.arange(count))[:, None]
    if blur <= 0:
        return np.asarray((np.abs(gap) < 0.5) / over)
    return np.asarray((ndtr((gap + 0.5) / blur) - ndtr((gap - 0.5) / blur)) / over)


def add_markers(image: Array, scene: Scene, camera: FilmCamera, frame: int, lit: Lit, seen: Nodes, over: int) -> None:
    """Add the markers, lit during ``lit`` (start, end, strength), to ``image`` [H, W] (grey levels without gain)."""
    starts, ends = camera.rows(frame)
    for k in range(len(scene.names)):
        span = _window(camera, scene, frame, lit, seen, k)
        if span is None:
            continue
        first, last, box = span
        edges = np.linspace(first, last, 1 + _instants(camera, seen, k, first, last))
        middle = (edges[:-1] + edges[1:]) / 2
        centres, axes = seen.at(middle, k)
        light = strength(scene, centres, axes)
        if not light.any():
            continue
        margin = scene.surface.margin if scene.surface else 0.0
        triangles, rods = seen.covers(middle)
        if not _touched(centres, axes, scene, k, margin, triangles, rods).any():
            triangles, rods = triangles[:, :0], rods[:, :0]
        x0, y0, x1, y1 = box
        facing = np.broadcast_to(np.eye(3), axes.shape) if scene.kind == "ball" else axes
        slopes = camera.slopes(centres, facing) / over
        samples = np.empty((len(middle), (y1 - y0 + 1) * over, (x1 - x0 + 1) * over))
        sample_marker(
            camera.rays, float(x0 + PAD), float(y0 + PAD), over, KINDS[scene.kind], float(scene.sizes[k]) / 2,
            centres, axes, slopes, light, margin, triangles, rods, scene.radii, samples,
        )  # fmt: skip
        _deposit(image, camera, samples, box, over, shone(starts, ends, edges[:-1], edges[1:]) * lit[2])


def _deposit(image: Array, camera: FilmCamera, samples: Array, box: tuple[int, ...], over: int, weights: Array) -> None:
    """Add ``samples`` [S, rows, columns] of the pixels ``box`` to the image, spread; ``weights`` [H, S] of the rows."""
    x0, y0, x1, y1 = box
    reach = int(np.ceil(5 * camera.sensor.blur))
    left, right = max(0, x0 - reach), min(camera.size[0] - 1, x1 + reach)
    top, bottom = max(0, y0 - reach), min(camera.size[1] - 1, y1 + reach)
    if right < left or bottom < top:
        return
    blur = camera.sensor.blur
    across = spread(x1 - x0 + 1, over, left - x0, right - left + 1, blur)
    down = spread(y1 - y0 + 1, over, top - y0, bottom - top + 1, blur)
    patches = down @ (samples @ across.T)
    image[top : bottom + 1, left : right + 1] += np.einsum("is,sij->ij", weights[top : bottom + 1], patches)


def strength(scene: Scene, centres: Array, axes: Array) -> Array:
    """Relative brightness [S] of a marker in camera coordinates: by distance, and by the angle at which it is seen."""
    distance = np.linalg.norm(centres, axis=-1)
    near = np.asarray((centres[..., 2] > 0) / distance**2)
    if KINDS[scene.kind] == BALL:
        return near
    facing = -np.einsum("...i,...i->...", axes[..., 2, :], centres) / distance
    return np.asarray(near * (facing > 0) * np.maximum(facing, 0.0) ** scene.retro)


def corners(centres: Array, axes: Array, size: float, ball: bool, grid: Array) -> Array:
    """Points [..., G * G, 3] of a marker on ``grid`` [G], in units of half its width, in both tangents."""
    half = size / 2
    if ball:  # on a disc that faces the camera, somewhat larger than the outline
        axes = np.broadcast_to(np.eye(3) * 1.1, (*centres.shape[:-1], 3, 3))
    u, v = (g.ravel() * half for g in np.meshgrid(grid, grid))
    return np.asarray(centres[..., None, :] + u[:, None] * axes[..., None, 0, :] + v[:, None] * axes[..., None, 1, :])


def _touched(centres: Array, axes: Array, scene: Scene, k: int, margin: float, triangles: Array, rods: Array) -> Mask:
    """Which points of marker ``k`` are hidden at the middle instant, [25]."""
    s = len(centres) // 2
    points = corners(centres[s], axes[s], scene.sizes[k], KINDS[scene.kind] == BALL, _GRID)
    return hidden(points, margin, triangles[s], rods[s], scene.radii)


def _window(
    camera: FilmCamera, scene: Scene, frame: int, lit: Lit, seen: Nodes, k: int
) -> tuple[float, float, tuple[int, int, int, int]] | None:
    """When ``frame`` sees marker ``k`` lit, and the pixels (x0, y0, x1, y1) in which it then is; None if never."""
    begin, first, last = float(camera.begin(frame)), lit[0], lit[1]
    size, ball = float(scene.sizes[k]), KINDS[scene.kind] == BALL
    for _ in range(3):  # each time, the rows limit the time better
        edges = np.linspace(first, last, 2 + 2 * int((last - first) / _NODE / 4))
        pixels = camera.image(corners(*seen.at(edges, k), size, ball, np.array([-1.0, 1.0])))
        if not np.isfinite(pixels).all():
            return None
        low, high = np.floor(pixels.min(axis=(0, 1)) + 0.5) - 1, np.ceil(pixels.max(axis=(0, 1)) - 0.5) + 1
        reach = np.ceil(5 * camera.sensor.blur)
        before = first, last
        first = max(first, begin + camera.row_time * max(0.0, low[1] - reach))
        last = min(last, begin + camera.row_time * min(camera.size[1] - 1.0, high[1] + reach) + camera.exposure)
        if last <= first:
            return None
        if (first, last) == before:
            break
    x0, y0 = np.maximum(low, 1 - PAD)
    x1, y1 = np.minimum(high, np.array(camera.size) + PAD - 2)
    return (first, last, (int(x0), int(y0), int(x1), int(y1))) if x1 >= x0 and y1 >= y0 else None


def _instants(camera: FilmCamera, seen: Nodes, k: int, first: float, last: float) -> int:
    """Number of instants at which to render marker ``k`` between ``first`` and ``last``."""
    path = camera.image(seen.at(np.linspace(first, last, 5), k)[0])
    moved = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    return min(_MOST, 1 + int(moved / _SHIFT))


def add_surface(image: Array, scene: Scene, camera: FilmCamera, weights: Array, seen: Nodes) -> None:
    """Add the dark surface and the rods, as they are in the middle of the interval of ``seen``.

    ``weights`` [H]: grey levels that a reflecting point gains in each row.
    """
    n = len(seen.times) // 2
    dark = np.zeros(image.shape)
    if scene.surface:
        triangles = seen.triangles[n]
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        centre = triangles.mean(axis=1)
        cosine = np.abs(np.einsum("mi,mi->m", normal, centre))
        cosine /= np.linalg.norm(normal, axis=1) * np.linalg.norm(centre, axis=1) ** 3
        order = np.argsort(-centre[:, 2])
        pixels = camera.image(triangles)
        order = order[np.isfinite(pixels[order]).all(axis=(1, 2))]
        fill_triangles(dark, pixels[order], scene.surface.albedo * cosine[order])
    if scene.rods:
        ends = camera.image(seen.rods[n]).reshape(-1, 2)
        reach = 2 + scene.radii.max() * camera.matrix[0, 0] / max(seen.rods[n][..., 2].min(), 1e-3)
        sides = np.array([camera.size[1], camera.size[1], camera.size[0], camera.size[0]]) - 1
        low, high = ends.min(axis=0) - reach, ends.max(axis=0) + reach
        box = np.clip(np.array([low[1], high[1], low[0], high[0]]), 0, sides).astype(np.int64)
        values = np.array([rod.albedo for rod in scene.rods])
        fill_rods(dark, camera.rays, PAD, seen.rods[n], scene.radii, values, box)
    rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
    if len(rows) == 0:
        return
    reach = int(np.ceil(5 * camera.sensor.blur))
    part = np.s_[max(0, rows[0] - reach) : rows[-1] + reach + 1, max(0, columns[0] - reach) : columns[-1] + reach + 1]
    image[part] += gaussian_filter(dark[part], camera.sensor.blur) * weights[part[0], None]


def add_glare(image: Array, glare: Glare, camera: FilmCamera, weights: Array, time: float) -> None:
    """Add a bright spot as it is at ``time``; ``weights`` [H] as for :func:`add_surface`."""
    place = np.array(glare.pixel) if glare.pixel else None
    if glare.path is not None:
        place = camera.project(glare.path(np.array([time])))[0]
    if place is None or not np.isfinite(place).all():
        return
    reach = 5 * glare.blur
    x = np.arange(max(0, int(place[0] - reach)), min(camera.size[0], int(place[0] + reach) + 1))
    y = np.arange(max(0, int(place[1] - reach)), min(camera.size[1], int(place[1] + reach) + 1))
    if len(x) and len(y):
        spot = np.exp(-((y[:, None] - place[1]) ** 2 + (x - place[0]) ** 2) / (2 * glare.blur**2))
        image[y[0] : y[-1] + 1, x[0] : x[-1] + 1] += glare.brightness * spot * weights[y, None]
