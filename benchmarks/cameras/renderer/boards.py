"""Material for the calibration of cameras: images of a chessboard, and a wand with two balls that is waved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from benchmarks.cameras.renderer.film_camera import PAD, FilmCamera
from benchmarks.cameras.renderer.kernels import sample_board
from benchmarks.cameras.renderer.scene import Poses, Scene
from benchmarks.cameras.renderer.sensor import Image, quantised
from wingfit.records.array_types import Array


@dataclass(frozen=True)
class Board:
    """A chessboard with a white margin.

    Attributes:
        inner: numbers of inner corners along its own x and y.
        side: of a square, m.
        shades: grey levels above black of its black and white and of the surroundings, in continuous light.
    """

    inner: tuple[int, int] = (9, 6)
    side: float = 0.03
    shades: tuple[float, float, float] = (18.0, 190.0, 70.0)

    def points(self) -> Array:
        """Inner corners [rows * columns, 3] in the board's frame, whose origin is its middle; row by row."""
        columns, rows = self.inner
        x = (np.arange(columns) - (columns - 1) / 2) * self.side
        y = (np.arange(rows) - (rows - 1) / 2) * self.side
        return np.stack([np.tile(x, rows), np.repeat(y, columns), np.zeros(rows * columns)], axis=1)


@dataclass(frozen=True, eq=False)
class BoardPose:
    """Place of a board: its middle ``centre`` [3] (m), and ``axes`` [3, 3], whose rows are its x, y and normal."""

    centre: Array
    axes: Array

    def world(self, points: Array) -> Array:
        """World coordinates of points of the board's frame [..., 3]."""
        return np.asarray(points @ self.axes + self.centre)


def board_poses(middle: Array, towards: Array, right: Array, count: int, spread: Array, seed: int) -> list[BoardPose]:
    """Draw poses of a board that is held into the view of cameras.

    Args:
        middle: of the volume [3], m.
        towards: direction [3] from there to the cameras.
        right: direction [3] that is to the right in their images.
        count: number of poses.
        spread: largest distances [3] from the middle to the right, down and in depth, m.
        seed: of the draw.
    """
    rng = np.random.default_rng([seed, 7])
    z = -towards / np.linalg.norm(towards)
    x = right - (right @ z) * z
    x = x / np.linalg.norm(x)
    view = np.stack([x, np.cross(z, x), z])
    poses = []
    for _ in range(count):
        tilt, turn = np.deg2rad(rng.uniform(15, 45)), rng.uniform(0, 2 * np.pi)
        axis = np.array([np.cos(turn), np.sin(turn), 0.0])
        axes = _turned(axis, tilt) @ _turned(np.array([0.0, 0.0, 1.0]), rng.uniform(-0.4, 0.4))
        poses.append(BoardPose(middle + (rng.uniform(-1, 1, 3) * spread) @ view, axes.T @ view))
    return poses


def _turned(axis: Array, angle: float) -> Array:
    """Rotation [3, 3] about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def board_image(camera: FilmCamera, board: Board, pose: BoardPose, seed: Sequence[int] | None, over: int = 4) -> Image:
    """Image [height, width] of a board at rest in continuous light; ``seed``: of the noise, None: without noise."""
    light, sensor = board_light(camera, board, pose, over) * camera.shading(), camera.sensor
    if seed is None:
        return quantised(sensor.black + light)
    noise = np.random.default_rng(seed).standard_normal(light.shape) * np.sqrt(sensor.variance(light))
    return quantised(sensor.black + light + noise)


def board_light(camera: FilmCamera, board: Board, pose: BoardPose, over: int = 4) -> Array:
    """Expected grey levels [height, width] above black of a board, without vignetting."""
    width, height = camera.size
    light = np.full((height, width), board.shades[2])
    half = (np.array(board.inner) + 3) / 2 * board.side  # squares and margin
    around = np.linspace(-1, 1, 9)  # the outline bends with the distortion
    ones = np.ones(9)
    outline = np.concatenate(
        [np.stack(sides, axis=1) for sides in ((around, ones), (around, -ones), (ones, around), (-ones, around))]
    )
    edge = camera.project(pose.world(np.column_stack([outline * half, np.zeros(len(outline))])))
    reach = 2 + int(np.ceil(5 * camera.sensor.blur))
    low = np.maximum(np.floor(edge.min(axis=0)).astype(int) - reach, -PAD + 1)
    high = np.minimum(np.ceil(edge.max(axis=0)).astype(int) + reach, np.array(camera.size) + PAD - 2)
    if (high <= low).any():
        return light
    columns, rows = (high - low + 1).tolist()
    axes = pose.axes @ camera.rotation.T
    slope = camera.slopes(camera.local(pose.centre), axes) / over
    samples = np.empty((rows * over, columns * over))
    sample_board(
        camera.rays, int(low[0]) + PAD, int(low[1]) + PAD, over, camera.local(pose.centre),
        axes, slope, np.array(board.inner, float) + 1, board.side, board.side,
        np.array(board.shades), samples,
    )  # fmt: skip
    samples = gaussian_filter(samples, camera.sensor.blur * over, mode="nearest")
    patch = samples.reshape(rows, over, columns, over).mean(axis=(1, 3))
    top, left, bottom, right = max(0, low[1]), max(0, low[0]), min(height - 1, high[1]), min(width - 1, high[0])
    if bottom >= top and right >= left:
        light[top : bottom + 1, left : right + 1] = patch[
            top - low[1] : bottom + 1 - low[1], left - low[0] : right + 1 - low[0]
        ]
    return light


@dataclass(frozen=True)
class Wand:
    """A rod with two bright balls that is waved in a volume.

    Attributes:
        length: distance of the balls' centres, m.
        ball: diameter of a ball, m.
        middle: of the volume [3], m.
        spread: largest distances [3] of the wand's middle from there along x, y, z, m.
        period: of the slowest part of the motion, s.
    """

    length: float = 0.25
    ball: float = 0.012
    middle: tuple[float, float, float] = (0.1, 0.25, 0.0)
    spread: tuple[float, float, float] = (0.08, 0.12, 0.12)
    period: float = 5.0

    def scene(self) -> Scene:
        """The scene of its two balls."""

        def poses(times: Array) -> Poses:
            w = 2 * np.pi * times / self.period
            drift = np.stack([np.sin(2 * w + 0.3), np.sin(3 * w + 1.1), np.sin(w * 1.5)], axis=1)
            middle = np.array(self.middle) + drift * np.array(self.spread)
            yaw, pitch = 2.4 * np.sin(w) + 0.4, 0.6 * np.sin(2.3 * w + 0.8)
            along = np.stack([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)], axis=1)
            offset = self.length / 2 * along
            positions = np.stack([middle - offset, middle + offset], axis=1)
            return Poses(positions, np.broadcast_to(np.eye(3), (len(times), 2, 3, 3)))

        return Scene(poses, ("wand1", "wand2"), np.full(2, self.ball), kind="ball")
