"""Fits without gross errors: points and whole images that do not agree with the rest are rejected, and listed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wingfit.cameras.calibrate.bundle import CONVERGED, Adjusted, Free, Observations, Scene, adjust, projection_errors
from wingfit.records.array_types import Array, Bool, Index, Int, Mask

POINT_LIMIT = 5.0  # standard deviations: Gaussian errors in two directions exceed it once in 270,000 points
IMAGE_LIMIT = 3.0  # median distance of the points of an image over the median of those of its camera
HUBER_LIMIT = 1.5  # standard deviations of one coordinate
LEAST_PX = 1e-3  # errors below it are of no concern, and zero in noise-free tests
ROUNDS = 20
ROUGHLY_CONVERGED = 1e-4  # of robust fits, after which outliers are rejected
# The median absolute value of a Gaussian variable is 0.6745 of its standard deviation.
MEDIAN_TO_DEVIATION = 1 / 0.6745

Pruned = Callable[[Mask], Mask]


@dataclass(frozen=True, eq=False)
class Screened:
    """A fit to the observations that are ``used``; the others were rejected for the reasons that the masks give."""

    fit: Adjusted
    free: Free
    used: Bool[Mask, " N"]
    far_points: Bool[Mask, " N"]
    far_images: Bool[Mask, " N"]


def fit_screened(
    scene: Scene, seen: Observations, free: Free, prune: Pruned, *, images: bool, reject: bool = True
) -> Screened:
    """Fit ``scene`` to ``seen`` and reject outliers until none remains.

    ``prune`` returns the given selection without the observations that are of no use without the rejected ones.
    ``images``: whole images are rejected too. With ``reject`` false, all observations are used.
    """
    count = len(seen.pixels)
    used, far_points, far_images = prune(np.ones(count, bool)), np.zeros(count, bool), np.zeros(count, bool)
    if reject:
        # The first fit is robust, so that gross errors do not hide each other.
        huber = HUBER_LIMIT * max(_deviation(projection_errors(scene, seen)[used]), LEAST_PX)
        scene = _fit(scene, seen, free, used, huber)[0].scene
        scene = _fit(scene, seen, free, used, _huber(scene, seen, used))[0].scene
    for _ in range(ROUNDS if reject else 0):
        errors = projection_errors(scene, seen)
        image = used & _far_images(errors, seen, used) if images else np.zeros(count, bool)
        point = used & ~image & _far_points(errors, seen, used & ~image)
        if not (image | point).any():
            break
        far_points, far_images = far_points | point, far_images | image
        used = prune(used & ~image & ~point)
        scene = _fit(scene, seen, free, used, None)[0].scene
    fit, free = _fit(scene, seen, free, used, None)
    return Screened(fit, free, used, far_points, far_images)


def image_numbers(seen: Observations, bodies: int) -> Int[Index, " N"]:
    """Return the number of the image of each observation: one for each pair of camera and body."""
    return np.asarray(seen.camera * bodies + seen.body)


def _fit(scene: Scene, seen: Observations, free: Free, used: Mask, huber: float | None) -> tuple[Adjusted, Free]:
    """Fit to those ``used``; bodies without observations stay where they are."""
    present = np.bincount(seen.body[used], minlength=len(scene.rotations)) > 0
    seen_only = Free(free.parameters, free.motions & present[:, None])
    tolerance = CONVERGED if huber is None else ROUGHLY_CONVERGED
    return adjust(scene, seen.only(used), seen_only, huber, tolerance), seen_only


def _huber(scene: Scene, seen: Observations, used: Mask) -> float:
    return HUBER_LIMIT * max(_deviation(projection_errors(scene, seen)[used]), LEAST_PX)


def _deviation(errors: Array) -> float:
    """Return the standard deviation of one coordinate, from the median, so that outliers do not matter."""
    return float(np.median(np.abs(errors)) * MEDIAN_TO_DEVIATION)


def _far_points(errors: Array, seen: Observations, used: Mask) -> Mask:
    far = np.zeros(len(errors), bool)
    for camera in np.unique(seen.camera[used]):
        mine = used & (seen.camera == camera)
        far[mine] = np.linalg.norm(errors[mine], axis=1) > POINT_LIMIT * max(_deviation(errors[mine]), LEAST_PX)
    return far


def _far_images(errors: Array, seen: Observations, used: Mask) -> Mask:
    """Return the points of images of which the median distance is large: single bad points do not make it so."""
    far = np.zeros(len(errors), bool)
    image, distances = image_numbers(seen, int(seen.body.max()) + 1), np.linalg.norm(errors, axis=1)
    for camera in np.unique(seen.camera[used]):
        mine = used & (seen.camera == camera)
        numbers, place = np.unique(image[mine], return_inverse=True)
        medians = np.array([np.median(distances[mine][place == i]) for i in range(len(numbers))])
        far[mine] = (medians > max(IMAGE_LIMIT * float(np.median(medians)), LEAST_PX))[place]
    return far
