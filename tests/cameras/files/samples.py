"""Cameras that files describe in the tests."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tests.cameras.calibrate.simulated import LENSES, SIZE, ring
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.files.camera_set import CameraSet

POINTS = np.random.default_rng(0).uniform(-0.05, 0.05, (30, 3)) + np.array([0, 0, 0.6])


def cameras() -> tuple[Camera, ...]:
    """One camera of each model of a lens; the last one has a rolling shutter."""
    found = []
    for i, (model, coefficients) in enumerate(LENSES.items()):
        matrix = np.array([[900.123456789 + i, 0, 511.5 + i / 3], [0, 901.0 + i, 399.5 - i / 7], [0, 0, 1.0]])
        rotation = Rotation.from_rotvec([0.1 * i, -0.2, 1 / 3]).as_matrix()
        move = np.array([0.01, -0.02 * i, 0.5])
        row_s = 12.5e-6 if model == "fisheye" else 0.0
        found.append(Camera(f"camera {i}", SIZE, matrix, Lens(model, coefficients), rotation, move, row_s))
    return tuple(found)


def with_covariance() -> CameraSet:
    """The cameras with a covariance that is positive definite."""
    found = CameraSet(cameras())
    parts = np.random.default_rng(1).standard_normal((200, len(found.parameters))) * 1e-3
    return CameraSet(found.cameras, parts.T @ parts)


def pinholes() -> tuple[Camera, ...]:
    """Three cameras without distortion."""
    return ring((0.0, 30.0, 75.0), "pinhole")


def assert_same(found: tuple[Camera, ...], expected: tuple[Camera, ...], tolerance: float = 1e-9) -> None:
    """Fail unless the cameras show the same points at the same pixels, within ``tolerance`` (px)."""
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.size_px == other.size_px
        assert one.row_s == other.row_s
        np.testing.assert_allclose(one.project(POINTS), other.project(POINTS), rtol=0, atol=tolerance)
        np.testing.assert_allclose(one.centre, other.centre, rtol=0, atol=1e-9)
