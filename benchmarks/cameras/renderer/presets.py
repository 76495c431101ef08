"""Ready experiments: what is filmed, by which cameras, and the material of their calibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.cameras.renderer.boards import Board, BoardPose, Wand, board_poses
from benchmarks.cameras.renderer.film import Film
from benchmarks.cameras.renderer.film_camera import FilmCamera, Sensor, aimed
from benchmarks.cameras.renderer.light import Light, Strobe
from benchmarks.cameras.renderer.scene import Rod, Scene
from benchmarks.cameras.renderer.wings import Flapping, analytic_scene
from wingfit.records.array_types import Array

AIM = np.array([0.11, 0.27, 0.03])  # middle of the wing's volume, m
BEAT = 3.0  # Hz
_RIGHT = np.array([0.0, 1.0, 0.0])  # the span is to the right in the images
_GOPRO = (-0.24, 0.075, 0.0006, -0.0004, -0.009)
_LENS = (-0.11, 0.06, -0.0003, 0.0005, 0.0)


@dataclass(frozen=True, eq=False)
class Experiment:
    """A film of a wing, and what its cameras saw before: boards and a waved wand.

    Attributes:
        film: of the wing.
        board: the chessboard; ``poses``: where it was held.
        wand: the film of the wand, in continuous light.
    """

    film: Film
    board: Board
    poses: tuple[BoardPose, ...]
    wand: Film


def thesis_strobe(scale: float = 1.0, flashes: int = 90, seed: int = 1, scene: Scene | None = None) -> Experiment:
    """Two action cameras side by side film 49 chequers in the dark, under a strobe.

    31 flashes in 30 beats show one apparent beat. The cameras have rolling shutters and clocks of their own.

    Args:
        scale: width of the images relative to 1920 pixels.
        flashes: number of flashes.
        seed: of everything drawn.
        scene: another scene than the analytic wing.
    """
    rng = np.random.default_rng([seed, 3])
    strobe = Strobe(frequency=BEAT * 31 / 30, first=0.02 + 0.01 * rng.uniform(), duration=4e-4, brightness=150.0)
    strobe = replace(strobe, flashes=flashes)
    sensor = Sensor(blur=0.75, electrons=30.0, read=1.1, black=3.0)
    cameras = tuple(
        FilmCamera(
            name, (1920, 1080), _matrix(1900.0 + 12 * k, 959.5 + 9 * k, 539.5 - 7 * k), np.array(_GOPRO),
            *aimed(AIM + np.array([0.02 * k, side, 1.0]), AIM, _RIGHT),
            rate=60.0, start=-rng.uniform(0, 1 / 60), clock_error=error, exposure=1 / 60 / (1 + 1e-4), row_time=14e-6,
            sensor=sensor,
        ).scaled(scale)
        for k, (name, side, error) in enumerate((("left", -0.15, 2e-5), ("right", 0.15, -3e-5)))
    )  # fmt: skip
    until = strobe.first + (flashes - 1) / strobe.frequency + 0.05
    return _experiment("wing", scene or analytic_scene(Flapping(BEAT)), Light(strobe), cameras, until, seed)


def continuous(scale: float = 1.0, beats: float = 3.0, seed: int = 1, scene: Scene | None = None) -> Experiment:
    """Two synchronised fast cameras (global shutter, 500 frames per second) film the wing in continuous light.

    ``beats``: number of beats filmed; the other arguments are those of :func:`thesis_strobe`.
    """
    sensor = Sensor(blur=0.6, electrons=40.0, read=1.5, black=4.0, vignetting=0.1)
    cameras = tuple(
        _fast(name, AIM + np.array([0.0, side, 1.0]), 0.0, sensor).scaled(scale)
        for name, side in (("left", -0.15), ("right", 0.15))
    )
    light = Light(continuous=130.0 / cameras[0].exposure)
    scene = scene or analytic_scene(Flapping(BEAT))
    return _experiment("wing", scene, light, cameras, beats / BEAT - 1e-4, seed)


def three_cameras_late(scale: float = 1.0, beats: float = 2.0, seed: int = 1, scene: Scene | None = None) -> Experiment:
    """Three such cameras around the wing, of which the last starts 2 ms late, although their frames count as equal."""
    sensor = Sensor(blur=0.6, electrons=40.0, read=1.5, black=4.0, vignetting=0.1)
    places = (
        ("left", (0.0, -0.35, 0.95), 0.0),
        ("middle", (-0.25, 0.0, 1.0), 0.0),
        ("right", (0.05, 0.35, 0.95), 2e-3),
    )
    cameras = tuple(
        replace(_fast(name, AIM + np.array(place), late, sensor), rate=240.0).scaled(scale)
        for name, place, late in places
    )
    light = Light(continuous=130.0 / cameras[0].exposure)
    scene = scene or analytic_scene(Flapping(BEAT))
    return _experiment("wing", scene, light, cameras, beats / BEAT + 1.9e-3, seed)


PRESETS: dict[str, Callable[..., Experiment]] = {
    "thesis_strobe": thesis_strobe,
    "continuous": continuous,
    "three_cameras_late": three_cameras_late,
}


def with_rod(scene: Scene) -> Scene:
    """Add a rod at rest between the wing and cameras above it, which hides a few markers from each."""
    ends = np.array([[-0.10, 0.34, 0.40], [0.35, 0.38, 0.40]])
    return replace(scene, rods=(*scene.rods, Rod(lambda times: np.broadcast_to(ends, (len(times), 2, 3)), 0.006)))


def _fast(name: str, place: Array, late: float, sensor: Sensor) -> FilmCamera:
    pose = aimed(place, AIM, _RIGHT)
    lens = _matrix(1600.0, 639.5, 511.5), np.array(_LENS)
    return FilmCamera(name, (1280, 1024), *lens, *pose, rate=500.0, start=late, exposure=4e-4, sensor=sensor)


def _matrix(focal: float, x: float, y: float) -> Array:
    return np.array([[focal, 0.0, x], [0.0, focal * 1.001, y], [0.0, 0.0, 1.0]])


def _experiment(
    name: str, scene: Scene, light: Light, cameras: tuple[FilmCamera, ...], until: float, seed: int
) -> Experiment:
    """Add calibration material: boards in all parts of the volume, and a wand, filmed at up to 60 frames per second."""
    towards = np.mean([camera.centre for camera in cameras], axis=0) - AIM
    poses = tuple(board_poses(AIM, towards, _RIGHT, 24, np.array([0.24, 0.12, 0.15]), seed))
    slow = tuple(replace(camera, rate=min(60.0, camera.rate), exposure=1e-3, clock_error=0.0) for camera in cameras)
    waved = Wand(middle=(AIM[0], AIM[1], AIM[2])).scene()
    wand = Film("wand", waved, Light(continuous=180.0 / 1e-3), slow, 6.0, seed + 1000)
    return Experiment(Film(name, scene, light, cameras, until, seed), Board(), poses, wand)
