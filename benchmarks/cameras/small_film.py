"""Writes a film of twelve bright dots on a stiff plate that flaps, which is tracked in seconds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.cameras.write import Image, write_video
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.project import write_cameras
from wingfit.records.array_types import Array

SIZE, RATE_HZ, FRAMES = (480, 360), 100.0, 50
BEAT_HZ, SWING_RAD = 4.0, 0.35
DOT_PX, BRIGHT, NOISE = 2.4, 220.0, 1.0  # radius of a dot (one standard deviation), and grey levels
NAMES = tuple(f"m{k + 1}" for k in range(12))
# Unevenly spaced, so that each marker has neighbours of its own.
PLACES = np.array([[0.05 * (k % 4) ** 1.1, 0.06 * (k // 4) + 0.013 * (k % 4), 0.0] for k in range(12)])


def write_small_film(folder: Path) -> dict[str, Path]:
    """Write cameras.yaml and the video of each camera into ``folder``; return the files by the names of the uploads."""
    cameras = [_camera("left", -15.0), _camera("right", 18.0)]
    files = {"cameras": folder / "cameras.yaml"}
    write_cameras(files["cameras"], CameraSet(tuple(cameras)))
    for camera in cameras:
        files[camera.name] = folder / f"{camera.name}.avi"
        write_video(files[camera.name], _images(camera), SIZE, RATE_HZ)
    return files


def places() -> list[dict[str, str | float]]:
    """Return the markers at rest, as a request for a tracking names them (m)."""
    return [
        {"marker": name, "x_m": float(x), "y_m": float(y), "z_m": float(z)}
        for name, (x, y, z) in zip(NAMES, PLACES.round(6), strict=True)
    ]


def _camera(name: str, degrees: float) -> Camera:
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    matrix = np.array([[1050.0, 0.0, SIZE[0] / 2], [0.0, 1050.0, SIZE[1] / 2 - 2], [0.0, 0.0, 1.0]])
    return Camera(name, SIZE, matrix, Lens("brown", (-0.1, 0.02, 0.0, 0.0, 0.0)), turn, np.array([0.0, 0.0, 0.8]))


def _images(camera: Camera) -> Iterator[Image]:
    rng = np.random.default_rng(1)
    across, down = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    for frame in range(FRAMES):
        grey = 12.0 + NOISE * rng.standard_normal(across.shape)
        for x, y in camera.project(_plate(frame / RATE_HZ)):
            grey += BRIGHT * np.exp(-((across - x) ** 2 + (down - y) ** 2) / (2 * DOT_PX**2))
        yield grey.clip(0, 255).astype(np.uint8)


def _plate(time: float) -> Array:
    """Places [12, 3] (m) of the markers at ``time`` (s), in the axes of the cameras."""
    phase = 2 * np.pi * BEAT_HZ * time
    turn = Rotation.from_rotvec([SWING_RAD * np.sin(phase), 0.1, 0.0]).as_matrix()
    return np.asarray((PLACES - PLACES.mean(axis=0)) @ turn.T + [0.002, 0.004, 0.01 * np.cos(phase)])
