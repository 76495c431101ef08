"""A camera of the renderer: projection, lens distortion, shutter and sensor. It shares no code with the product's.

A world point X has the camera coordinates R X + t (x right, y down, z forward, m). The point (x, y) of the plane z = 1
is distorted by the model of Brown (1966, Photogrammetric Engineering 32, 444) with the coefficients k1, k2, p1, p2, k3,
and the matrix K makes it a pixel; (0, 0) is the centre of the upper left pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.cameras.renderer.kernels import ray_table
from wingfit.records.array_types import Array, ArrayLike, Mask

PAD = 24  # pixels beyond each edge for which rays are known, so that markers may be cut by the edge


@dataclass(frozen=True)
class Sensor:
    """How light becomes grey levels.

    The noise of a pixel whose expected value is v grey levels above ``black`` has the variance v / electrons + read^2;
    rounding to whole levels adds 1/12, and levels are cut at 0 and 255.

    Attributes:
        blur: standard deviation of the Gaussian point-spread function, pixels.
        gain: factor of all light.
        black: grey level without light.
        electrons: electrons per grey level; infinite: no shot noise.
        read: standard deviation of the noise without light, grey levels.
        vignetting: relative loss of light in the corners; it grows with the squared distance from the centre.
    """

    blur: float = 0.7
    gain: float = 1.0
    black: float = 3.0
    electrons: float = 40.0
    read: float = 1.2
    vignetting: float = 0.15

    def variance(self, level: ArrayLike) -> Array:
        """Variance of pixels with the expected values ``level`` above black, without rounding and cut, levels^2."""
        return np.asarray(np.maximum(level, 0.0) / self.electrons + self.read**2)


@dataclass(frozen=True, eq=False)
class FilmCamera:
    """A camera at rest.

    Row r of frame f is exposed from start + f / (rate (1 + clock_error)) + r row_time, for ``exposure`` seconds.

    Attributes:
        name: of its files.
        size: width and height, pixels.
        matrix: K [3, 3].
        distortion: k1, k2, p1, p2, k3.
        rotation: R [3, 3].
        translation: t [3], m.
        rate: nominal frames per second.
        start: true time at which row 0 of frame 0 starts to be exposed, s.
        clock_error: relative error of the frame rate.
        exposure: duration of a row's exposure, s.
        row_time: delay between consecutive rows, s; 0: global shutter.
        sensor: see :class:`Sensor`.
    """

    name: str
    size: tuple[int, int]
    matrix: Array
    distortion: Array
    rotation: Array
    translation: Array
    rate: float
    start: float = 0.0
    clock_error: float = 0.0
    exposure: float = 1e-3
    row_time: float = 0.0
    sensor: Sensor = Sensor()

    def __post_init__(self) -> None:
        if not 0 < self.exposure * self.rate * (1 + self.clock_error) <= 1 + 1e-9:
            raise ValueError(
                f"{self.name}: an exposure of {self.exposure} s does not fit between frames at {self.rate} per second; "
                f"use at most {1 / self.rate / (1 + self.clock_error):.6g} s"
            )

    @cached_property
    def rays(self) -> Array:
        """Table of the rays of all pixel centres, with PAD pixels beyond each edge; see :func:`ray_table`."""
        inverse: Array = np.linalg.inv(self.matrix).astype(float)
        return ray_table(self.size[0], self.size[1], PAD, inverse, np.asarray(self.distortion, float))

    @property
    def centre(self) -> Array:
        """Centre of projection in the world [3], m."""
        return np.asarray(-self.rotation.T @ self.translation)

    def local(self, points: ArrayLike) -> Array:
        """Camera coordinates of world points [..., 3], m."""
        return np.asarray(np.asarray(points) @ self.rotation.T + self.translation)

    def image(self, local: ArrayLike) -> Array:
        """Pixels [..., 2] of points in camera coordinates [..., 3]; NaN for those behind the camera."""
        p = np.asarray(local, float)
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = np.where(p[..., 2] > 0, p[..., 0] / p[..., 2], np.nan), p[..., 1] / p[..., 2]
        k1, k2, p1, p2, k3 = self.distortion
        rr = x * x + y * y
        radial = 1 + rr * (k1 + rr * (k2 + rr * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (rr + 2 * x * x)
        v = y * radial + p1 * (rr + 2 * y * y) + 2 * p2 * x * y
        k = self.matrix
        return np.stack([k[0, 0] * u + k[0, 1] * v + k[0, 2], k[1, 1] * v + k[1, 2]], axis=-1)

    def slopes(self, centres: Array, axes: Array) -> Array:
        """Change [..., 2, 2] of the two coordinates of a plane when the pixel moves along x and y, at a point of it.

        ``centres`` [..., 3] and ``axes`` [..., 3, 3] are in camera coordinates, m; the plane has the first two axes.
        """
        step = 1e-5 * centres[..., 2, None]
        u, v = step * axes[..., 0, :], step * axes[..., 1, :]
        right, left, low, high = self.image(centres + np.stack([u, -u, v, -v]))
        u, v = (right - left) / (2 * step), (low - high) / (2 * step)
        det = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
        det = np.where(np.abs(det) < 1e-3, 1e-3, det)  # seen edge-on
        inverse = np.stack([v[..., 1], -v[..., 0], -u[..., 1], u[..., 0]], axis=-1) / det[..., None]
        return np.asarray(inverse.reshape(*det.shape, 2, 2))

    def project(self, points: ArrayLike) -> Array:
        """Pixels [..., 2] of world points [..., 3]."""
        return self.image(self.local(points))

    def inside(self, pixels: Array) -> Mask:
        """Whether pixels [..., 2] are in the image, [...]."""
        low, high = -0.5, np.array(self.size) - 0.5
        return np.asarray(np.all((pixels >= low) & (pixels < high), axis=-1))

    def begin(self, frame: ArrayLike) -> Array:
        """True times at which row 0 of ``frame`` starts to be exposed, s."""
        return np.asarray(self.start + np.asarray(frame) / (self.rate * (1 + self.clock_error)))

    def rows(self, frame: int) -> tuple[Array, Array]:
        """True times at which the exposure of each row of ``frame`` starts and ends, [height] each, s."""
        starts = self.begin(frame) + self.row_time * np.arange(self.size[1])
        return starts, starts + self.exposure

    def frames(self, first: float, last: float) -> range:
        """The frames that are exposed at any time from ``first`` to ``last``, s."""
        rate, late = self.rate * (1 + self.clock_error), self.row_time * (self.size[1] - 1) + self.exposure
        return range(
            max(0, int(np.floor((first - late - self.start) * rate)) + 1),
            int(np.floor((last - self.start) * rate)) + 1,
        )

    def shading(self) -> Array:
        """Factor of the light in each pixel by vignetting, [height, width]."""
        w, h = self.size
        x, y = (np.arange(w) - (w - 1) / 2) / (w / 2), (np.arange(h) - (h - 1) / 2) / (h / 2)
        return np.asarray(1 - self.sensor.vignetting * (x[None] ** 2 + y[:, None] ** 2) / 2)

    def scaled(self, factor: float) -> FilmCamera:
        """The same camera with images ``factor`` times as wide; readout, exposure and blur in pixels are unchanged."""
        w, h = (max(1, round(side * factor)) for side in self.size)
        sx, sy = w / self.size[0], h / self.size[1]
        # The image, whose edges lie half a pixel outside the centres of its outer pixels, is scaled as a whole.
        change = np.array([[sx, 0, (sx - 1) / 2], [0, sy, (sy - 1) / 2], [0, 0, 1]])
        return replace(self, size=(w, h), matrix=change @ self.matrix, row_time=self.row_time * self.size[1] / h)

    def as_json(self) -> dict[str, Any]:
        """Everything that is true of the camera, as JSON."""
        return {
            "name": self.name,
            "size": list(self.size),
            "matrix": self.matrix.tolist(),
            "distortion": np.asarray(self.distortion).tolist(),
            "rotation": self.rotation.tolist(),
            "translation": self.translation.tolist(),
            "rate": self.rate,
            "start": self.start,
            "clock_error": self.clock_error,
            "exposure": self.exposure,
            "row_time": self.row_time,
        }


def aimed(centre: ArrayLike, target: ArrayLike, right: ArrayLike) -> tuple[Array, Array]:
    """Rotation [3, 3] and translation [3] of a camera at ``centre`` that looks at ``target``, all in world coordinates.

    ``right``: direction whose part across the view points right in the image.
    """
    c = np.asarray(centre, float)
    z = np.asarray(target, float) - c
    z = z / np.linalg.norm(z)
    x = np.asarray(right, float) - np.dot(right, z) * z
    x = x / np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    return rotation, -rotation @ c
