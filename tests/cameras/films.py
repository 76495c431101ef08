"""A small film of a moving wing, in continuous light, as files of a user: film.yaml, cameras.yaml, images, markers."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from tests.cameras.markers.drawing import Mark, disc, drawn, noisy
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.project import write_cameras
from wingfit.records.array_types import Array

SIZE, RATE, FRAMES = (320, 240), 100.0, 25
NAMES = tuple(f"m{number:02d}" for number in range(12))
PLACES = np.array([[0.05 * (k % 4) ** 1.1, 0.06 * (k // 4) + 0.013 * (k % 4), 0.0] for k in range(12)])
FILM = """format: wingfit film
version: 1
cameras: cameras.yaml
light: continuous
films:
  left: {path: left, rate_hz: 100}
  right: {path: right, rate_hz: 100}
markers:
  kind: dot
  places: markers.csv
"""


def cameras() -> tuple[Camera, Camera]:
    found = []
    for name, angle in (("left", -15.0), ("right", 18.0)):
        turn = Rotation.from_euler("y", angle, degrees=True).as_matrix()
        matrix = np.array([[700.0, 0, 160], [0, 700.0, 118], [0, 0, 1]])
        lens = Lens("brown", (-0.1, 0.02, 0.0, 0.0, 0.0))
        found.append(Camera(name, SIZE, matrix, lens, turn, np.array([0, 0, 0.8])))
    return found[0], found[1]


def wing(time: float) -> Array:
    """Places [12, 3] (m) of the markers, in the axes of the cameras."""
    turn = Rotation.from_rotvec([0.3 * np.sin(2 * np.pi * 3 * time), 0.1, 0.0]).as_matrix()
    return np.asarray((PLACES - PLACES.mean(0)) @ turn.T + [0.002, 0.004, 0.01 * np.cos(2 * np.pi * 3 * time)])


def write_film(folder: Path, frames: int = FRAMES) -> Path:
    """Write the film into ``folder``; returns the path of film.yaml."""
    rng = np.random.default_rng(10)
    write_cameras(folder / "cameras.yaml", CameraSet(cameras()))
    rows = [f"{name},{','.join(f'{value:.6f}' for value in place)}" for name, place in zip(NAMES, PLACES, strict=True)]
    (folder / "markers.csv").write_text("\n".join(["marker,x_m,y_m,z_m", *rows]) + "\n")
    for camera in cameras():
        (folder / camera.name).mkdir()
        for number in range(frames):
            places = camera.project(wing(number / RATE))
            marks: list[Mark] = [(disc, place, 4.0 * np.eye(2)) for place in places]
            image = noisy(drawn(SIZE, marks), 1.0, rng)
            cv2.imwrite(str(folder / camera.name / f"{number}.png"), image)
    (folder / "film.yaml").write_text(FILM)
    return folder / "film.yaml"
