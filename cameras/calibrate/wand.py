"""Calibrate the poses of cameras from the tracks of a wand, of which the distances between markers are known."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wingfit.cameras.calibrate.bundle import BODY_MOTIONS, Free, Observations, Scene
from wingfit.cameras.calibrate.from_boards import MOST_CAMERAS
from wingfit.cameras.calibrate.graph import UNMOVED, Link, Pose, camera_poses
from wingfit.cameras.calibrate.outliers import Pruned, Screened, fit_screened
from wingfit.cameras.calibrate.result import Calibration, WandErrors, summarise
from wingfit.cameras.camera import COEFFICIENTS, FOCAL_AND_CENTRE, POSE, Camera
from wingfit.cameras.opencv import opencv
from wingfit.cameras.triangulation import LEAST_CAMERAS, nearest_points, triangulate
from wingfit.records.array_types import Array, Float, Mask
from wingfit.records.blas_threads import one_blas_thread
from wingfit.records.errors import fail, nearest

LEAST_FRAMES = 20
LEAST_SHARED = 10  # frames in which two cameras see all markers
RANSAC_PX = 3.0
HELD_OUT = 5  # every fifth frame is not used for the fit
STRAIGHT = 1e-6  # excess of the two short distances over the long one, in parts of it, below which markers are in line
LARGEST_M = 10.0
NEAR_AND_FAR = "move the wand through the whole space, near and far"
SEPARATE = f"move the wand where both see all its markers, in {LEAST_SHARED} frames or more"


@dataclass(frozen=True)
class Wand:
    """A stiff wand with two or three markers.

    ``distances_m``: that of two markers; or those of the first and second, second and third, and first and third.
    """

    distances_m: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.distances_m) not in (1, 3):
            count = len(self.distances_m)
            raise fail(
                "wand, distances", count, f"{count} distances; give 1 for two markers, or 3 (1-2, 2-3, 1-3) for three"
            )
        for distance in self.distances_m:
            if not (np.isfinite(distance) and 0 < distance <= LARGEST_M):
                message = f"{distance} m; it must lie in (0, {LARGEST_M:g}] m: give metres, 120 mm is 0.12"
                raise fail("wand, distance", distance, message)
        longest = max(self.distances_m)
        if len(self.distances_m) > 1 and 2 * longest > sum(self.distances_m) * (1 + STRAIGHT):
            message = f"{longest:g} m is more than the sum of the two other distances: measure again"
            raise fail("wand, distance", longest, message)

    @property
    def markers(self) -> int:
        """Return the number of markers."""
        return 2 if len(self.distances_m) == 1 else 3

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Return the numbers of the markers of each distance."""
        return ((0, 1),) if self.markers == 2 else ((0, 1), (1, 2), (0, 2))

    @cached_property
    def shape(self) -> Float[Array, "M 3"]:
        """Return the markers (m) in axes of the wand, with their mean as origin; x is the direction of the first two.

        They lie exactly on x if they are in line.
        """
        first, *others = self.distances_m
        points = np.zeros((self.markers, 3))
        points[1, 0] = first
        if others:
            second, third = others
            x = (first**2 + third**2 - second**2) / (2 * first)
            height = third**2 - x**2
            points[2, :2] = x, np.sqrt(height) if height > (STRAIGHT * third) ** 2 and not self.straight else 0.0
        return np.asarray(points - points.mean(axis=0))

    @property
    def straight(self) -> bool:
        """Return whether the markers are in line, so that a turn about it cannot be seen."""
        longest, total = max(self.distances_m), sum(self.distances_m)
        return self.markers == 2 or total - 2 * longest <= STRAIGHT * longest


@one_blas_thread
def calibrate_wand(
    tracks: Mapping[str, Float[Array, "T M 2"]],
    cameras: Sequence[Camera],
    wand: Wand,
    *,
    free: Collection[str] = (),
    reject: bool = True,
) -> Calibration:
    """Estimate the poses of cameras from tracks of the markers of a wand; space has the axes of the first camera.

    Args:
        tracks: pixels of the markers in each frame, by name of the camera; NaN where a marker is not seen. The order of
            the markers is that of ``wand`` in all cameras.
        cameras: with known, or roughly known, lenses; their poses are not used.
        wand: distances of the markers.
        free: parameters of the lenses that are estimated too, such as ``f_x`` and ``f_y``.
        reject: whether points that do not agree with the others are rejected.

    Raises:
        DatasetError: for tracks that do not suit cameras and wand, too few frames, cameras that share too few frames,
            and focal lengths that the frames do not determine.
    """
    pixels = _pixels(tracks, cameras, wand)
    _check_free(cameras, free)
    placed = _placed(cameras, pixels, wand)
    points = np.stack([nearest_points(placed, pixels[:, :, m]) for m in range(wand.markers)], axis=1)
    usable = np.nonzero(np.isfinite(points).all(axis=(1, 2)))[0]
    if len(usable) < LEAST_FRAMES:
        message = (
            f"{len(usable)} frames with every marker in two cameras; at least {LEAST_FRAMES} are needed: record more"
        )
        raise fail("wand, frames", len(usable), message)
    held_out = np.arange(len(usable)) % HELD_OUT == HELD_OUT - 1
    frames, tested = usable[~held_out], usable[held_out]
    bodies = wand_poses(points[frames], wand)
    scene = Scene(tuple(placed), wand.shape, bodies.rotation, bodies.translation)
    seen = _observations(pixels[:, frames])
    found = fit_screened(scene, seen, _free(scene, free, wand), _pruner(seen, scene), images=False, reject=reject)
    fitted = found.fit.scene.cameras
    errors = WandErrors(
        _length_errors(fitted, _used_pixels(pixels[:, frames], seen, found), wand),
        _length_errors(fitted, pixels[:, tested], wand),
    )
    described = f"axes of camera {cameras[0].name}"
    return summarise(found, seen, [str(frame) for frame in frames], (), described, NEAR_AND_FAR, errors)


def wand_poses(points: Float[Array, "F M 3"], wand: Wand) -> Pose:
    """Return the poses [F] of ``wand`` that bring its markers near ``points`` (m; Kabsch 1976)."""
    centre = points.mean(axis=1)
    u, _, vt = np.linalg.svd(np.einsum("fmi,mj->fij", points - centre[:, None], wand.shape))
    signs = np.ones((len(points), 3))
    signs[:, 2] = np.linalg.det(u @ vt)
    return Pose((u * signs[:, None]) @ vt, centre)


def _pixels(tracks: Mapping[str, Array], cameras: Sequence[Camera], wand: Wand) -> Array:
    """Return the tracks as one array [C, T, M, 2], NaN where a marker is not seen."""
    names = [camera.name for camera in cameras]
    if not LEAST_CAMERAS <= len(names) <= MOST_CAMERAS or len(set(names)) < len(names):
        count = len(set(names))
        message = f"{count} different cameras; from {LEAST_CAMERAS} to {MOST_CAMERAS} are calibrated together"
        raise fail("wand, cameras", ", ".join(names), message)
    if set(names) != set(tracks):
        odd = ", ".join(sorted(set(names) ^ set(tracks)))
        raise fail("wand, cameras", odd, f"either a camera or its tracks are missing: {odd}; give both for each camera")
    lengths = {len(one) for one in tracks.values()}
    if len(lengths) > 1:
        listed = ", ".join(f"{name}: {len(one)}" for name, one in tracks.items())
        raise fail(
            "wand, tracks", listed, f"different numbers of frames ({listed}); give the same frames of each camera"
        )
    for camera in cameras:
        _check_track(camera, tracks[camera.name], wand)
    pixels = np.stack([np.asarray(tracks[name], dtype=float) for name in names])
    return np.where(np.isnan(pixels).any(axis=3, keepdims=True), np.nan, pixels)


def _check_track(camera: Camera, track: Array, wand: Wand) -> None:
    where = f"wand, tracks of camera {camera.name}"
    if track.ndim != 3 or track.shape[1:] != (wand.markers, 2):
        shape = " x ".join(map(str, track.shape))
        raise fail(
            where, shape, f"an array of {shape}; frames x {wand.markers} markers x 2 are needed, as the wand has"
        )
    if np.isinf(track).any():
        raise fail(where, "inf", "a pixel is infinite; give NaN where a marker is not seen")
    size = np.array(camera.size_px)
    outside = np.abs(track - size / 2) > 1.5 * size
    if outside.any():
        value = float(track[outside][0])
        message = f"{value:g} px is far outside the image of {size[0]} x {size[1]} px: give pixels, from the upper left"
        raise fail(where, value, message)


def _check_free(cameras: Sequence[Camera], free: Collection[str]) -> None:
    for camera in cameras:
        known = (*FOCAL_AND_CENTRE, *COEFFICIENTS[camera.lens.model])
        for name in free:
            if name not in known:
                raise fail(
                    "wand, free", name, f"camera {camera.name} has no parameter {name!r}; {nearest(name, known)}"
                )


def _placed(cameras: Sequence[Camera], pixels: Array, wand: Wand) -> list[Camera]:
    """Return the cameras with poses from the pairs of cameras that share most frames."""
    links: dict[tuple[int, int], Link] = {}
    for i in range(len(cameras)):
        for j in range(i + 1, len(cameras)):
            link = relative_pose((cameras[i], cameras[j]), pixels[[i, j]], wand)
            if link is not None:
                links[i, j] = link
    poses = camera_poses([camera.name for camera in cameras], links, SEPARATE)
    return [_at(camera, pose) for camera, pose in zip(cameras, poses, strict=True)]


def _at(camera: Camera, pose: Pose) -> Camera:
    return replace(camera, rotation=pose.rotation, translation=pose.translation)


def relative_pose(cameras: tuple[Camera, Camera], pixels: Array, wand: Wand) -> Link | None:
    """Return the pose from the first camera to the second by the essential matrix, with the length of the wand."""
    cv2 = opencv()
    shared = np.asarray(np.isfinite(pixels).all(axis=(0, 2, 3)))
    count = int(shared.sum())
    if count < LEAST_SHARED:
        return None
    first, second = (camera.rays(own[shared].reshape(-1, 2)) for camera, own in zip(cameras, pixels, strict=True))
    threshold = RANSAC_PX / float(np.mean([camera.matrix[0, 0] for camera in cameras]))
    essential, inliers = cv2.findEssentialMat(
        first, second, np.eye(3), method=cv2.RANSAC, prob=0.9999, threshold=threshold
    )
    if essential is None or np.shape(essential) != (3, 3):
        return None
    agreeing, rotation, move, _ = cv2.recoverPose(essential, first, second, np.eye(3), mask=inliers)
    if agreeing < LEAST_SHARED:
        return None
    unit = [_at(cameras[0], UNMOVED), _at(cameras[1], Pose(np.asarray(rotation), np.ravel(move)))]
    points = np.stack([nearest_points(unit, pixels[:, shared][:, :, m]) for m in range(wand.markers)], axis=1)
    ratios = np.concatenate([
        distance / np.linalg.norm(points[:, a] - points[:, b], axis=1)
        for (a, b), distance in zip(wand.pairs, wand.distances_m, strict=True)
    ])  # fmt: skip
    if not np.isfinite(ratios).any():
        return None
    return Link(Pose(unit[1].rotation, unit[1].translation * float(np.nanmedian(ratios))), count)


def _observations(pixels: Array) -> Observations:
    """Return the observations of the markers in ``pixels`` [C, F, M, 2]."""
    camera, frame, marker = np.nonzero(np.asarray(np.isfinite(pixels).all(axis=3)))
    return Observations(camera, frame, marker, pixels[camera, frame, marker])


def _free(scene: Scene, free: Collection[str], wand: Wand) -> Free:
    parts = [np.array([name in (*free, *POSE) for name in camera.parameter_names]) for camera in scene.cameras]
    parts[0][-len(POSE) :] = False
    motions = np.ones((len(scene.rotations), BODY_MOTIONS), bool)
    motions[:, 0] = not wand.straight
    return Free(np.concatenate(parts), motions)


def _pruner(seen: Observations, scene: Scene) -> Pruned:
    """Return a function that drops frames in which fewer than two cameras see some marker."""
    markers = len(scene.shape)
    place = seen.body * markers + seen.point

    def prune(used: Mask) -> Mask:
        counts = np.bincount(place[used], minlength=len(scene.rotations) * markers)
        enough = counts.reshape(-1, markers).min(axis=1) >= LEAST_CAMERAS
        return np.asarray(used & enough[seen.body])

    return prune


def _used_pixels(pixels: Array, seen: Observations, found: Screened) -> Array:
    """Return ``pixels`` [C, F, M, 2] with NaN for what was rejected."""
    result = np.full_like(pixels, np.nan)
    used = seen.only(found.used)
    result[used.camera, used.body, used.point] = used.pixels
    return result


def _length_errors(cameras: Sequence[Camera], pixels: Array, wand: Wand) -> Array:
    """Return the errors (percent) of the distances [F, D] of markers that are triangulated one by one."""
    equal = np.broadcast_to(np.eye(2), (*pixels[:, :, 0].shape, 2))
    points = [triangulate(cameras, pixels[:, :, m], equal).positions for m in range(wand.markers)]
    lengths = np.stack([np.linalg.norm(points[a] - points[b], axis=1) for a, b in wand.pairs], axis=1)
    errors = 100 * (lengths / np.array(wand.distances_m) - 1)
    return np.asarray(errors[np.isfinite(errors).all(axis=1)])
