"""Noise of the sensor and its grey levels."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from benchmarks.cameras.renderer.film_camera import FilmCamera
from wingfit.records.array_types import Array

Image = npt.NDArray[np.uint8]
_DARK = 1e-3  # grey levels of light below which a pixel counts as dark
_MARGIN = 256  # pixels by which the pool of dark pixels is larger than an image, along both sides


class Readout:
    """Turns the light of a frame into grey levels, reproducibly from a seed, the frame and the camera.

    Dark frames are cut from a pool of dark pixels, at random places and mirrored at random.
    """

    def __init__(self, camera: FilmCamera, seed: tuple[int, ...]) -> None:
        self.camera, self.seed = camera, seed

    @cached_property
    def _pool(self) -> Image:
        w, h = self.camera.size
        sensor = self.camera.sensor
        noise = np.random.default_rng([*self.seed, 0]).standard_normal((h + _MARGIN, w + _MARGIN), np.float32)
        return quantised(sensor.black + sensor.read * noise)

    @cached_property
    def _shading(self) -> Array:
        return self.camera.shading()

    def dark(self, frame: int) -> Image:
        """A frame without light, [height, width]."""
        return self._dark(np.random.default_rng([*self.seed, 1, frame]))

    def _dark(self, rng: np.random.Generator) -> Image:
        w, h = self.camera.size
        i, j = rng.integers(0, _MARGIN, 2)
        cut = self._pool[i : i + h, j : j + w]
        return np.ascontiguousarray(cut[:: rng.choice([-1, 1]), :: rng.choice([-1, 1])])

    def read(self, frame: int, light: Array) -> Image:
        """Grey levels of a frame that receives ``light`` [height, width], with noise."""
        sensor, rng = self.camera.sensor, np.random.default_rng([*self.seed, 1, frame])
        image = self._dark(rng)
        rows, columns = (np.flatnonzero(light.max(axis=axis) > _DARK) for axis in (1, 0))
        if len(rows):
            part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            level = light[part] * self._shading[part] * sensor.gain
            noise = rng.standard_normal(level.shape, np.float32) * np.sqrt(sensor.variance(level))
            image[part] = quantised(sensor.black + level + noise)
        return image


def quantised(levels: npt.NDArray[np.floating]) -> Image:
    """Round to whole grey levels from 0 to 255."""
    return np.asarray(np.clip(np.rint(levels), 0, 255).astype(np.uint8))
