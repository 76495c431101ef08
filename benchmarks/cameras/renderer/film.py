"""Films of a scene: frame by frame, as each camera would take them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from benchmarks.cameras.renderer.exposure import add_glare, add_markers, add_surface, nodes, shone
from benchmarks.cameras.renderer.film_camera import FilmCamera
from benchmarks.cameras.renderer.light import Light
from benchmarks.cameras.renderer.scene import Scene
from benchmarks.cameras.renderer.sensor import Image, Readout
from wingfit.records.array_types import Array


@dataclass(frozen=True, eq=False)
class Film:
    """A scene under a light, as cameras film it.

    Attributes:
        name: of the film.
        scene, light, cameras: what is filmed, and how.
        until: true time at which the film ends, s.
        seed: of all noise.
        over: samples of a marker along the edge of each pixel.
    """

    name: str
    scene: Scene
    light: Light
    cameras: tuple[FilmCamera, ...]
    until: float
    seed: int = 1
    over: int = 3

    def frames(self, camera: FilmCamera) -> int:
        """Number of frames of ``camera`` that start before the end of the film."""
        rate = camera.rate * (1 + camera.clock_error)
        return max(0, int(np.floor((self.until - camera.start) * rate)) + 1)

    def light_of(self, camera: FilmCamera, frame: int) -> Array | None:
        """Light [height, width] that a frame receives, in grey levels without gain; None in the dark."""
        starts, ends = camera.rows(frame)
        image = None
        for lit in self.light.intervals(float(starts[0]), float(ends[-1])):
            if lit[1] <= lit[0]:
                continue
            rows = shone(starts, ends, np.array([lit[0]]), np.array([lit[1]]))[:, 0] * lit[2]
            if not rows.any():
                continue
            image = np.zeros((camera.size[1], camera.size[0])) if image is None else image
            seen = nodes(self.scene, camera, lit[0], lit[1])
            add_surface(image, self.scene, camera, rows, seen)
            add_markers(image, self.scene, camera, frame, lit, seen, self.over)
            for glare in self.scene.glares:
                add_glare(image, glare, camera, rows, (lit[0] + lit[1]) / 2)
        return image

    def frame(self, camera: FilmCamera, frame: int) -> Image:
        """One frame of ``camera``, grey levels [height, width]."""
        light, readout = self.light_of(camera, frame), self._readouts[camera.name]
        return readout.dark(frame) if light is None else readout.read(frame, light)

    def images(self, camera: FilmCamera) -> Iterator[Image]:
        """Iterate over all frames of ``camera``; one is in memory at a time."""
        for frame in range(self.frames(camera)):
            yield self.frame(camera, frame)

    @cached_property
    def _readouts(self) -> dict[str, Readout]:
        return {c.name: Readout(c, (self.seed, number)) for number, c in enumerate(self.cameras)}
