"""Two simulated pinhole cameras: projection, possible faults, and 3-D points from the intersection of the rays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.concealed.plant.law import Concealed, Parameters, strength
from wingfit.records import Wing

Array = npt.NDArray[np.float64]
Tracks = Callable[[Array], Array]  # true positions [T, M, 3] at phases [T, M] in beats

_SAME = 0.995  # error of the second camera relative to the first: their mount is slightly flexible
_ROUNDS = 4  # iterations for the instant at which a row is read
_SOFT = 0.02  # width of the joint between two panes, as a fraction of the span
_GLARE = (0.08, 0.12, 0.05)  # extent of glare, as fractions of span, chord and beat


@dataclass(frozen=True)
class Cameras:
    """Poses of a pair of pinhole cameras.

    Attributes:
        centres: [2, 3] centres of projection, m, in the wing frame.
        middle: [2, 2], the middle of each image in focal lengths from the camera's axis. The lenses are shifted so that
            both images show the wing; distortion is relative to this point.
        axes: [2, 3, 3]: rows are right, down and forward of each camera in the wing frame. Rows of an image run along
            the chord, columns along the span.
        span: of the wing, m; an image shows a height of one span at the distance of the wing.
    """

    centres: Array
    axes: Array
    middle: Array
    span: float

    def image(self, points: Array, k: int) -> Array:
        """Image coordinates [..., 2] of ``points`` [..., 3] (m) in camera ``k``, in focal lengths from ``middle``."""
        seen = (points - self.centres[k]) @ self.axes[k].T
        return np.asarray(seen[..., :2] / seen[..., 2:] - self.middle[k])

    def points(self, images: tuple[Array, Array]) -> Array:
        """Triangulate: points [..., 3] (m) midway between the two rays at their closest approach.

        ``images``: coordinates [..., 2] in each camera, as from :meth:`image`.
        """
        whole = [image + middle for image, middle in zip(images, self.middle, strict=True)]
        rays = [np.concatenate([image, np.ones((*image.shape[:-1], 1))], axis=-1) for image in whole]
        one, two = (
            ray @ axes / np.linalg.norm(ray, axis=-1, keepdims=True) for ray, axes in zip(rays, self.axes, strict=True)
        )
        apart = self.centres[1] - self.centres[0]
        cosine, first, second = (one * two).sum(-1), one @ apart, two @ apart
        sine2 = 1.0 - cosine**2
        along = ((first - cosine * second) / sine2)[..., None] * one
        back = ((cosine * first - second) / sine2)[..., None] * two
        return np.asarray(0.5 * (self.centres[0] + along + self.centres[1] + back))

    @property
    def distance(self) -> float:
        """Mean height of the cameras above the plane of the wing at rest, m."""
        return float(self.centres[:, 2].mean())


def draw_cameras(wing: Wing, rng: np.random.Generator) -> Cameras:
    """Random poses of two cameras above the wing, side by side along the span and inclined towards each other."""
    aim = np.mean([marker.position for marker in wing.markers], axis=0) * [1.0, 1.0, 0.0]
    height, base, lean = (float(v) for v in rng.uniform([2.05, 0.3, 0.0], [2.8, 0.5, 0.1]))
    height *= wing.span
    centres = aim + np.array([[0.0, side * 0.5 * base * height, height] for side in (-1.0, 1.0)])
    down = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    turned = [down @ Rotation.from_euler("x", side * lean * np.arctan(0.5 * base)).as_matrix() for side in (-1.0, 1.0)]
    level = Cameras(centres, np.array(turned), np.zeros((2, 2)), wing.span)
    return replace(level, middle=np.array([level.image(aim, k) for k in (0, 1)]))


def seen(tracks: Tracks, beats: Array, frequency: float, cameras: Cameras, wing: Wing, hidden: Concealed) -> Array:
    """Positions [T, M, 3] (m, wing frame) that the two cameras measure, with the faults ``hidden``.

    ``tracks``: function from phases in beats to true marker positions; ``beats`` [T]: phase of each frame;
    ``frequency``: flapping frequency, Hz.
    """
    images = [_image(tracks, beats, frequency, cameras, k, wing, hidden) for k in (0, 1)]
    return _assumed(cameras, wing, hidden).points((images[0], images[1]))


def _image(
    tracks: Tracks, beats: Array, frequency: float, cameras: Cameras, k: int, wing: Wing, hidden: Concealed
) -> Array:
    """Image coordinates [T, M, 2] of all markers in camera ``k`` (focal lengths), with the faults of time and lens."""
    at = np.repeat(beats[:, None], len(wing.markers), axis=1)
    if k == 1:
        at = at + strength(hidden, "camera_desync") * frequency
    points = tracks(at)
    readout = strength(hidden, "rolling_shutter") * frequency
    for _ in range(_ROUNDS if readout else 0):  # a marker is imaged when the row in which it lies is read
        rows = cameras.image(points, k)[..., 1] * -cameras.distance / cameras.span
        points = tracks(at + readout * rows)
    image = cameras.image(points, k)
    if strength(hidden, "lens_distortion"):
        image = divided(image, hidden["lens_distortion"]["strength"])
    if strength(hidden, "pane_edge") and k == 1:
        image = image + _beyond_pane(points, cameras, wing, hidden["pane_edge"])
    if strength(hidden, "glare"):
        image = image + _pulled(at, cameras, wing, hidden["glare"])
    return image


def divided(image: Array, amount: float) -> Array:
    """Image coordinates [..., 2] after lens distortion by the division model (Fitzgibbon 2001).

    r_u = r_d / (1 + amount r_d^2) for undistorted and distorted radius r_u and r_d, solved for r_d.
    """
    r2 = (image**2).sum(axis=-1, keepdims=True)
    return np.asarray(image * 2.0 / (1.0 + np.sqrt(1.0 - 4.0 * amount * r2)))


def _assumed(cameras: Cameras, wing: Wing, hidden: Concealed) -> Cameras:
    """Camera poses that the triangulation assumes; they differ from the true ones by rotation, shift or scale error.

    Rotation and scaling are about the hinge of the wing.
    """
    hinge = np.array([0.0, wing.hinge.y, wing.hinge.z])
    centres, axes = cameras.centres - hinge, cameras.axes
    if strength(hidden, "camera_rotation"):
        p = hidden["camera_rotation"]
        turns = [Rotation.from_euler("YXZ", part * p["strength"] * _direction(p)[[1, 0, 2]]) for part in (1.0, _SAME)]
        centres = np.array([turn.apply(centre) for turn, centre in zip(turns[:1] * 2, centres, strict=True)])
        axes = np.array([axis @ turn.as_matrix().T for turn, axis in zip(turns, axes, strict=True)])
    if strength(hidden, "scale_error"):
        centres = centres * (1.0 + strength(hidden, "scale_error"))  # their distance is overestimated
    if strength(hidden, "camera_shift"):
        p = hidden["camera_shift"]
        centres = centres + p["strength"] * _direction(p) * np.array([[1.0], [_SAME]])
    return replace(cameras, centres=centres + hinge, axes=axes)


def _direction(p: Parameters) -> Array:
    """Unit vector [3] whose angles (rad) in ``p`` are "azimuth" and "height" (elevation)."""
    flat = np.cos(p["height"])
    return np.array([flat * np.cos(p["azimuth"]), flat * np.sin(p["azimuth"]), np.sin(p["height"])])


def direction_values(name: str, p: Parameters) -> dict[str, float]:
    """True genes ``name``.x, .y and .z of an effect that is a vector: "strength" times the direction in ``p``."""
    return {f"{name}.{axis}": float(p["strength"] * u) for axis, u in zip("xyz", _direction(p), strict=True)}


def _beyond_pane(points: Array, cameras: Cameras, wing: Wing, p: Parameters) -> Array:
    """Image displacement [..., 2] (focal lengths) of points outboard of a window joint, seen through a tilted pane.

    A plate of thickness d shifts a ray by d sin(i) (1 - cos(i) / sqrt(n^2 - sin^2 i)) (Born and Wolf 1999, sect. 1.5),
    nearly the same for all rays through it; ``strength`` is this shift at the wing, m.
    """
    joint = wing.stations[0].y + p["span"] * wing.span
    part = 0.5 * (1.0 + np.tanh((points[..., 1] - joint) / (_SOFT * wing.span)))
    way = np.array([np.cos(p["azimuth"]), np.sin(p["azimuth"])])
    return np.asarray(p["strength"] / cameras.distance * part[..., None] * way)


def _pulled(beats: Array, cameras: Cameras, wing: Wing, p: Parameters) -> Array:
    """Image displacement [T, M, 2] (focal lengths) of markers near a lamp's reflection, which appears at one phase.

    ``beats`` [T, M]: phase at which each marker is imaged.
    """
    span, chord = places(wing).T
    apart = (beats - p["phase"] + 0.5) % 1.0 - 0.5
    near = ((span - p["span"]) / _GLARE[0]) ** 2 + ((chord - p["chord"]) / _GLARE[1]) ** 2
    part = np.exp(-0.5 * (near[None] + (apart / _GLARE[2]) ** 2))
    return np.asarray(p["strength"] / cameras.distance * part[..., None] * [np.cos(p["azimuth"]), np.sin(p["azimuth"])])


def places(wing: Wing) -> Array:
    """Position [M, 2] of each of M markers at rest, as fractions of the span and of the local chord."""
    rest = np.array([marker.position for marker in wing.markers])
    y, edge, chord = (np.array([getattr(s, name) for s in wing.stations]) for name in ("y", "leading_edge", "chord"))
    along = (rest[:, 0] - np.interp(rest[:, 1], y, edge)) / np.interp(rest[:, 1], y, chord)
    return np.stack([(rest[:, 1] - y[0]) / wing.span, along], axis=1)
