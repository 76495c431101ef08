"""Simulated cameras that look at a board or a wand, with known poses."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.cameras.calibrate.board import Board, Sightings
from wingfit.cameras.camera import COEFFICIENTS, Camera, Lens, LensModel

SIZE = (1024, 800)
DISTANCE = 0.6
LENSES: dict[LensModel, tuple[float, ...]] = {
    "pinhole": (),
    "brown": (-0.12, 0.06, 0.0008, -0.0005, -0.02),
    "rational": (0.3, 0.05, 0.0004, -0.0003, 0.01, 0.42, 0.08, 0.01),
    "fisheye": (0.02, -0.01, 0.004, -0.001),
}


def ring(angles: tuple[float, ...], lens: LensModel = "brown", focal: float = 1100.0) -> tuple[Camera, ...]:
    """Cameras in a circle around the origin, at these angles (deg) about y; space has the axes of the first."""
    first: Camera | None = None
    cameras = []
    for i, angle in enumerate(angles):
        turn = Rotation.from_euler("yx", [angle, 4.0 * i], degrees=True).as_matrix()
        matrix = np.array([[focal + 7 * i, 0, 515.0 + 3 * i], [0, focal + 9 * i, 402.0 - 2 * i], [0, 0, 1.0]])
        one = Camera("abcdefgh"[i], SIZE, matrix, Lens(lens, LENSES[lens]), turn, np.array([0, 0, DISTANCE]))
        first = first or one
        cameras.append(_seen_from(one, first))
    return tuple(cameras)


def _seen_from(camera: Camera, first: Camera) -> Camera:
    rotation = camera.rotation @ first.rotation.T
    move = camera.translation - rotation @ first.translation
    return Camera(camera.name, camera.size_px, camera.matrix, camera.lens, rotation, move)


def board_poses(
    rng: np.random.Generator, count: int, board: Board, tilt: float = 40.0, near: float = 0.05
) -> tuple[np.ndarray, np.ndarray]:
    """Rotations and translations of a board near the point that all cameras look at."""
    turns = np.column_stack([rng.uniform(-tilt, tilt, (count, 2)), rng.uniform(-20, 20, count)])
    rotations = Rotation.from_euler("xyz", turns, degrees=True).as_matrix()
    middles = np.array([0, 0, DISTANCE]) + rng.uniform(-near, near, (count, 3))
    return rotations, middles - rotations @ board.corners.mean(axis=0)


def sightings(
    cameras: tuple[Camera, ...],
    board: Board,
    poses: tuple[np.ndarray, np.ndarray],
    rng: np.random.Generator,
    noise: float = 0.2,
    seen_by: dict[int, tuple[int, ...]] | None = None,
) -> Sightings:
    """What the cameras see of a board, with Gaussian ``noise`` (px); ``seen_by``: the cameras of each view."""
    corners = {}
    for view, (rotation, translation) in enumerate(zip(*poses, strict=True)):
        points = board.corners @ rotation.T + translation
        for c, camera in enumerate(cameras):
            if seen_by is not None and c not in seen_by[view]:
                continue
            pixels = camera.project(points)
            inside = ((pixels > 0) & (pixels < np.array(camera.size_px) - 1)).all()
            if inside and (camera.depth(points) > 0).all():
                corners[c, view] = pixels + noise * rng.standard_normal(pixels.shape)
    names, sizes = tuple(one.name for one in cameras), tuple(one.size_px for one in cameras)
    return Sightings(board, names, sizes, tuple(f"{view:02d}" for view in range(len(poses[0]))), corners)


def parameter_errors(found: tuple[Camera, ...], true: tuple[Camera, ...]) -> np.ndarray:
    """Estimated less true values of all parameters, with turns and moves as ``Camera`` defines them."""
    errors = []
    for one, other in zip(found, true, strict=True):
        lens = np.array(one.lens.coefficients) - np.array(other.lens.coefficients)
        inner = (one.matrix - other.matrix)[[0, 1, 0, 1], [0, 1, 2, 2]]
        turn = Rotation.from_matrix(one.rotation @ other.rotation.T).as_rotvec()
        errors += [inner, lens, turn, one.translation - other.translation]
    assert len(COEFFICIENTS[found[0].lens.model]) == len(found[0].lens.coefficients)
    return np.concatenate(errors)


def wand_tracks(
    cameras: tuple[Camera, ...], shape: np.ndarray, frames: int, rng: np.random.Generator, noise: float = 0.2
) -> dict[str, np.ndarray]:
    """Pixels [T, M, 2] of the markers ``shape`` [M, 3] of a wand that moves near the point all cameras look at."""
    rotations = Rotation.random(frames, rng=rng).as_matrix()
    middles = np.array([0, 0, DISTANCE]) + rng.uniform(-0.1, 0.1, (frames, 3))
    points = np.einsum("tij,mj->tmi", rotations, shape) + middles[:, None]
    tracks = {}
    for camera in cameras:
        pixels = camera.project(points.reshape(-1, 3)).reshape(frames, -1, 2)
        pixels += noise * rng.standard_normal(pixels.shape)
        outside = np.asarray(((pixels < 0) | (pixels > np.array(camera.size_px) - 1)).any(axis=2))
        tracks[camera.name] = np.where(outside[:, :, None], np.nan, pixels)
    return tracks
