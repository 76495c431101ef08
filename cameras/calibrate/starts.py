"""Starting values from a chessboard: each camera on its own, then the poses of all cameras and boards."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.cameras.calibrate.board import Sightings
from wingfit.cameras.calibrate.graph import Link, Pose, camera_poses
from wingfit.cameras.camera import COEFFICIENTS, Camera, Lens, LensModel
from wingfit.cameras.opencv import opencv
from wingfit.records.array_types import Array, Index
from wingfit.records.errors import fail

Points = Sequence[Any]

# A board that is turned gives another relative pose. It must agree this many times worse with the other views.
CLEARLY_WORSE = 3.0
SEPARATE = "let both see the board in at least two views, or a third camera see it together with each of them"
TILT = "show the board tilted by 30 to 45 degrees about several axes, near and far"
UNDETERMINED = "the focal length of camera {name} is not determined: {why}; " + TILT


@dataclass(frozen=True, eq=False)
class Alone:
    """A camera calibrated on its own, and the pose of the board in its axes for each view."""

    camera: Camera
    boards: Mapping[int, Pose]


@dataclass(frozen=True, eq=False)
class Start:
    """Starting values: cameras, poses of boards in space, numbers of their views, and the turn of each sighting.

    Space has the axes of the first camera. The k-th corner of a sighting is the corner ``turns[sighting][k]`` of the
    board.
    """

    cameras: tuple[Camera, ...]
    boards: Mapping[int, Pose]
    turns: Mapping[tuple[int, int], Index]


def start_camera(seen: Sightings, number: int, lens: LensModel, fixed: Collection[str]) -> Alone:
    """Calibrate the camera ``number`` on its own, with its parameters named in ``fixed`` held."""
    cv2 = opencv()
    name, size, views = seen.cameras[number], seen.sizes_px[number], seen.of_camera(number)
    kept = [np.isfinite(seen.corners[number, view]).all(axis=1) for view in views]
    objects = [np.float32(seen.board.corners[rows]).reshape(-1, 1, 3) for rows in kept]
    pixels = [
        np.float32(seen.corners[number, view][rows]).reshape(-1, 1, 2) for view, rows in zip(views, kept, strict=True)
    ]
    run = _fisheye if lens == "fisheye" else _perspective
    try:
        matrix, coefficients, turns, moves = run(cv2, objects, pixels, size, lens, fixed)
    except cv2.error as error:
        why = " ".join(str(error).split())[:120]
        raise fail(
            f"camera {name}", None, UNDETERMINED.format(name=name, why=f"OpenCV has no solution ({why})")
        ) from None
    matrix, values = np.array(matrix, dtype=float), np.ravel(coefficients)[: len(COEFFICIENTS[lens])].astype(float)
    if not (np.isfinite(matrix).all() and np.isfinite(values).all() and min(matrix[0, 0], matrix[1, 1]) > 0):
        raise fail(f"camera {name}", None, UNDETERMINED.format(name=name, why="OpenCV has no finite solution"))
    matrix[0, 1] = 0.0
    _hold(matrix, values, size, lens, fixed)
    camera = Camera(name, size, matrix, Lens(lens, tuple(values.tolist())), np.eye(3), np.zeros(3))
    rotations = Rotation.from_rotvec(np.reshape(turns, (-1, 3))).as_matrix()
    poses = {view: Pose(rotations[i], np.ravel(moves[i])) for i, view in enumerate(views)}
    return Alone(camera, poses)


def _perspective(
    cv2: Any,
    objects: Points,
    pixels: Points,
    size: tuple[int, int],
    lens: LensModel,
    fixed: Collection[str],
) -> tuple[Any, Any, Any, Any]:
    terms = {f"k{i}": getattr(cv2, f"CALIB_FIX_K{i}") for i in range(1, 7)}
    used = set(COEFFICIENTS[lens]) - set(fixed)
    flags = sum(flag for name, flag in terms.items() if name not in used)
    flags |= cv2.CALIB_RATIONAL_MODEL if lens == "rational" else 0
    flags |= 0 if {"p1", "p2"} <= used else cv2.CALIB_ZERO_TANGENT_DIST
    flags |= cv2.CALIB_FIX_PRINCIPAL_POINT if {"c_x", "c_y"} & set(fixed) else 0
    return tuple(cv2.calibrateCamera(objects, pixels, size, None, None, flags=flags)[1:5])


def _fisheye(
    cv2: Any,
    objects: Points,
    pixels: Points,
    size: tuple[int, int],
    lens: LensModel,
    fixed: Collection[str],
) -> tuple[Any, Any, Any, Any]:
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
    for i, name in enumerate(COEFFICIENTS[lens], start=1):
        flags |= getattr(cv2, f"CALIB_FIX_K{i}") if name in fixed else 0
    # OpenCV 5 takes one row of points here, where calibrateCamera takes one column as well.
    wide = [[np.asarray(one, dtype=float).reshape(1, len(one), -1) for one in many] for many in (objects, pixels)]
    return tuple(cv2.fisheye.calibrate(*wide, size, None, None, flags=flags)[1:5])


def _hold(matrix: Array, values: Array, size: tuple[int, int], lens: LensModel, fixed: Collection[str]) -> None:
    """Set what is held: the principal point to the centre of the image, coefficients to zero."""
    for axis, name in enumerate(("c_x", "c_y")):
        if name in fixed:
            matrix[axis, 2] = (size[axis] - 1) / 2
    for i, name in enumerate(COEFFICIENTS[lens]):
        if name in fixed:
            values[i] = 0.0


def start_boards(seen: Sightings, alone: Sequence[Alone]) -> Start:
    """Return poses of cameras, in the axes of the first one, and of boards, from those of each camera alone."""
    motions = seen.board.motions()
    links: dict[tuple[int, int], Link] = {}
    for i in range(len(alone)):
        for j in range(i + 1, len(alone)):
            link = _relative(alone[i], alone[j], motions)
            if link is not None:
                links[i, j] = link
    poses = camera_poses(seen.cameras, links, SEPARATE)
    boards: dict[int, Pose] = {}
    turns: dict[tuple[int, int], Index] = {}
    for view in range(len(seen.views)):
        for c, one in enumerate(alone):
            if view not in one.boards:
                continue
            # The true pose of the board, where the detected one is the true one after a turn.
            options = poses[c].inverse.after(one.boards[view].after(motions.inverse))
            best = 0 if view not in boards else int(np.argmin(_distance(options, boards[view])))
            boards.setdefault(view, options.at(0))
            turns[c, view] = seen.board.turns[best]
    cameras = tuple(_placed(one.camera, pose) for one, pose in zip(alone, poses, strict=True))
    return Start(cameras, boards, turns)


def _placed(camera: Camera, pose: Pose) -> Camera:
    return replace(camera, rotation=pose.rotation, translation=pose.translation)


def _relative(first: Alone, second: Alone, motions: Pose) -> Link | None:
    """Return the pose from the first camera to the second that agrees best with all views that they share.

    None if they share no view, or if a turned board agrees nearly as well.
    """
    shared = sorted(first.boards.keys() & second.boards.keys())
    turns = len(motions.translation)
    if not shared or (turns > 1 and len(shared) < 2):
        return None
    a = Pose(*(np.stack([getattr(first.boards[v], part) for v in shared]) for part in ("rotation", "translation")))
    b = Pose(*(np.stack([getattr(second.boards[v], part) for v in shared]) for part in ("rotation", "translation")))
    # All poses [turns, views] of the second camera that the turns of the boards allow.
    each = Pose(motions.rotation[:, None], motions.translation[:, None])
    options = b.after(each).after(a.inverse)
    scores = np.empty((turns, len(shared)))
    for turn in range(turns):
        for view in range(len(shared)):
            distances = _distance(options, options.at((turn, view)))
            scores[turn, view] = np.median(distances.min(axis=0))
    turn, view = divmod(int(np.argmin(scores)), len(shared))
    # Another turn of the same view is the same hypothesis only if it is as near to all others.
    others = np.delete(scores[:, view], turn)
    if len(others) and others.min() < CLEARLY_WORSE * scores[turn, view]:
        return None
    return Link(options.at((turn, view)), len(shared))


def _distance(a: Pose, b: Pose) -> Array:
    """Return how far poses are apart: the angle of turn (rad) plus the move in parts of the distance."""
    turn = np.arccos(np.clip((np.einsum("...ij,...ij->...", a.rotation, b.rotation) - 1) / 2, -1, 1))
    size = np.linalg.norm(b.translation, axis=-1)
    move = np.linalg.norm(a.translation - b.translation, axis=-1)
    return np.asarray(turn + move / np.maximum(size, 1e-9))
