"""Calibrate cameras from the corners of a chessboard."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from wingfit.cameras.calibrate.board import Sightings
from wingfit.cameras.calibrate.bundle import BODY_MOTIONS, Free, Observations, Scene
from wingfit.cameras.calibrate.graph import Pose
from wingfit.cameras.calibrate.outliers import Pruned, fit_screened, image_numbers
from wingfit.cameras.calibrate.result import Calibration, summarise
from wingfit.cameras.calibrate.starts import TILT, Start, start_boards, start_camera
from wingfit.cameras.camera import COEFFICIENTS, POSE, Camera, LensModel
from wingfit.records.array_types import Index, Mask
from wingfit.records.blas_threads import one_blas_thread
from wingfit.records.errors import fail, nearest

LEAST_VIEWS = 5
LEAST_POINTS = 6  # corners of a board in one image
MOST_CAMERAS = 8


@one_blas_thread
def calibrate_boards(
    seen: Sightings,
    *,
    lens: LensModel = "brown",
    fixed: Collection[str] = (),
    world: str | None = None,
    reject: bool = True,
) -> Calibration:
    """Estimate lenses and poses of cameras from the corners of a chessboard.

    Args:
        seen: the corners, from ``find_boards`` or elsewhere.
        lens: the model of all lenses.
        fixed: parameters of lenses that are held in all cameras: ``c_x`` and ``c_y`` at the centre of the image,
            coefficients of the distortion at zero.
        world: name of the view of which the board gives origin and axes of the space; None: those of the first camera.
        reject: whether corners and images that do not agree with the others are rejected.

    Raises:
        DatasetError: for fewer than five views in a camera, cameras that share no views, focal lengths that the views
            do not determine, and corners that are not finite or have the wrong number.
    """
    _check(seen)
    _check_fixed(lens, fixed)
    if world is not None and world not in seen.views:
        raise fail("calibration, world", world, f"there is no view {world!r}; {nearest(world, seen.views)}")
    alone = [start_camera(seen, c, lens, fixed) for c in range(len(seen.cameras))]
    start = start_boards(seen, alone)
    views = sorted(start.boards)
    held = None if world is None else seen.views.index(world)
    if held is not None and held not in start.boards:
        raise fail("calibration, world", world, f"no camera sees the board in view {world}; choose another view")
    scene = _scene(seen, start, views, held)
    free = _free(scene, fixed, None if held is None else views.index(held))
    observed = _observations(seen, start, views)
    found = fit_screened(scene, observed, free, _pruner(observed, len(views)), images=True, reject=reject)
    _check_views(seen, observed, found.used)
    if world is not None and not (found.used & (observed.body == views.index(seen.views.index(world)))).any():
        message = f"all images of view {world} disagree with the others; choose another view"
        raise fail("calibration, world", world, message)
    described = f"axes of camera {seen.cameras[0]}" if world is None else f"axes of the board in view {world}"
    return summarise(found, observed, [seen.views[v] for v in views], seen.unseen, described, TILT)


def _scene(seen: Sightings, start: Start, views: list[int], held: int | None) -> Scene:
    """Return the start, in the axes of the first camera or of the board in the view ``held``."""
    rotations = np.stack([start.boards[v].rotation for v in views])
    boards = Pose(rotations, np.stack([start.boards[v].translation for v in views]))
    cameras = start.cameras
    if held is not None:
        origin = start.boards[held]
        boards = origin.inverse.after(boards)
        cameras = tuple(_seen_from(camera, origin) for camera in cameras)
    return Scene(cameras, seen.board.corners, boards.rotation, boards.translation)


def _seen_from(camera: Camera, origin: Pose) -> Camera:
    pose = Pose(camera.rotation, camera.translation).after(origin)
    return Camera(
        camera.name, camera.size_px, camera.matrix, camera.lens, pose.rotation, pose.translation, camera.row_s
    )


def _free(scene: Scene, fixed: Collection[str], held: int | None) -> Free:
    first, *others = (np.array([name not in fixed for name in one.parameter_names]) for one in scene.cameras)
    motions = np.ones((len(scene.rotations), BODY_MOTIONS), bool)
    if held is None:
        first[-len(POSE) :] = False
    else:
        motions[held] = False
    return Free(np.concatenate([first, *others]), motions)


def _observations(seen: Sightings, start: Start, views: list[int]) -> Observations:
    rows: list[tuple[Index, Index, Index]] = []
    pixels = []
    for (camera, view), corners in sorted(seen.corners.items()):
        finite = np.isfinite(corners).all(axis=1)
        numbers = np.asarray(start.turns[camera, view])[finite]
        rows.append((np.full_like(numbers, camera), np.full_like(numbers, views.index(view)), numbers))
        pixels.append(corners[finite])
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    return Observations(columns[0], columns[1], columns[2], np.concatenate(pixels))


def _pruner(observed: Observations, bodies: int) -> Pruned:
    """Return a function that drops images with too few corners."""
    image = image_numbers(observed, bodies)

    def prune(used: Mask) -> Mask:
        counts = np.bincount(image[used], minlength=int(image.max()) + 1)
        return used & (counts[image] >= LEAST_POINTS)

    return prune


def _check(seen: Sightings) -> None:
    if not 1 <= len(seen.cameras) <= MOST_CAMERAS:
        count = len(seen.cameras)
        raise fail("calibration, cameras", count, f"{count} cameras; from 1 to {MOST_CAMERAS} are calibrated together")
    for (camera, view), corners in seen.corners.items():
        where = f"camera {seen.cameras[camera]}, view {seen.views[view]}"
        if corners.shape != (seen.board.count, 2):
            message = f"{len(corners)} corners, but the board has {seen.board.columns} x {seen.board.rows}"
            raise fail(where, len(corners), f"{message} = {seen.board.count}; mark corners that are not seen with NaN")
        if np.isinf(corners).any() or (np.isnan(corners[:, 0]) != np.isnan(corners[:, 1])).any():
            raise fail(
                where, None, "a corner has an infinite pixel, or only one; give two finite numbers, or NaN twice"
            )
        count = int(np.isfinite(corners[:, 0]).sum())
        if count < LEAST_POINTS:
            raise fail(where, count, f"{count} corners; at least {LEAST_POINTS} are needed: omit this image")
    for camera, name in enumerate(seen.cameras):
        _check_count(name, len(seen.of_camera(camera)))


def _check_count(name: str, views: int) -> None:
    if views < LEAST_VIEWS:
        message = f"{views} images with a board; at least {LEAST_VIEWS} are needed: show it in more positions"
        raise fail(f"camera {name}", views, message)


def _check_views(seen: Sightings, observed: Observations, used: Mask) -> None:
    """Refuse a calibration of which too few images remain."""
    for camera, name in enumerate(seen.cameras):
        views = len(np.unique(observed.body[used & (observed.camera == camera)]))
        if views < LEAST_VIEWS:
            message = (
                f"{views} images agree with the others; at least {LEAST_VIEWS} must: hold the board still, and flat"
            )
            raise fail(f"camera {name}", views, message)


def _check_fixed(lens: LensModel, fixed: Collection[str]) -> None:
    if lens not in COEFFICIENTS:
        raise fail("calibration, lens", lens, f"is no model of a lens; {nearest(lens, COEFFICIENTS)}")
    known = ("c_x", "c_y", *COEFFICIENTS[lens])
    for name in fixed:
        if name not in known:
            raise fail(
                "calibration, fixed", name, f"{name!r} cannot be held with the lens {lens}; {nearest(name, known)}"
            )
