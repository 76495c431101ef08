"""The result of a calibration: cameras, their covariance, errors of the pixels, what was rejected, and warnings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.cameras.calibrate.board import Rejection
from wingfit.cameras.calibrate.bundle import Free, Observations, parameter_starts
from wingfit.cameras.calibrate.outliers import Screened
from wingfit.cameras.camera import COEFFICIENTS, FOCAL_AND_CENTRE, Camera
from wingfit.records.array_types import Array, Float, Index, Int, Mask
from wingfit.records.errors import DatasetError, fail

MOST_FOCAL_ERROR_PERCENT = 5.0
LEAST_EIGENVALUE = 1e-13  # of the normal matrix scaled to a unit diagonal: smaller ones are rounding errors
CELLS = 10  # along each side of an image, for the share of its area that was seen
CORNER_CELLS = 3  # along each side of the part of an image that counts as its corner
CORNERS = ("upper left", "upper right", "lower left", "lower right")


@dataclass(frozen=True, eq=False)
class PixelErrors:
    """Errors in one camera: numbers of the ``image`` of each point, its ``pixels``, and predicted less observed."""

    image: Int[Index, " N"]
    pixels: Float[Array, "N 2"]
    errors: Float[Array, "N 2"]

    @property
    def rms_px(self) -> float:
        """Return the root of the mean square of the distances (px), as OpenCV gives it."""
        return float(np.sqrt(np.mean(np.sum(self.errors**2, axis=1)))) if len(self.errors) else 0.0


@dataclass(frozen=True)
class Coverage:
    """How much of the image of a camera the points cover: ``fraction`` of its area; ``unseen`` corners by name."""

    fraction: float
    unseen: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class WandErrors:
    """Errors of triangulated lengths of the wand in percent of the true ones, in frames used and in those held out."""

    used_percent: Float[Array, "F D"]
    held_out_percent: Float[Array, "H D"]

    @property
    def used_rms_percent(self) -> float:
        """Return the RMS error (percent) in the frames that the calibration used."""
        return float(np.sqrt(np.mean(self.used_percent**2)))

    @property
    def held_out_rms_percent(self) -> float:
        """Return the RMS error (percent) in the frames that the calibration did not use."""
        return float(np.sqrt(np.mean(self.held_out_percent**2)))


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibrated cameras.

    Attributes:
        cameras: the cameras, in the space that ``world`` describes.
        parameters: name of each parameter, ``CAMERA.PARAMETER`` with those of ``Camera.parameter_names``, camera after
            camera.
        covariance: of ``parameters``; rows and columns of those that were held are zero.
        free: whether each parameter was estimated.
        sigma0_px: standard deviation of one coordinate of a pixel, from the residuals.
        degrees_of_freedom: number of coordinates less that of estimated parameters and motions.
        images: name of each image (view of a board, frame of a wand), to which the errors refer.
        errors: errors of the pixels that were used, for each camera.
        coverage: of the image of each camera.
        rejected: what was not used, and why.
        warnings: what limits the use of the result.
        world: origin and axes of the space.
        wand: errors of the lengths of the wand, if there was one.
    """

    cameras: tuple[Camera, ...]
    parameters: tuple[str, ...]
    covariance: Float[Array, "P P"]
    free: tuple[bool, ...]
    sigma0_px: float
    degrees_of_freedom: int
    images: tuple[str, ...]
    errors: tuple[PixelErrors, ...]
    coverage: tuple[Coverage, ...]
    rejected: tuple[Rejection, ...]
    warnings: tuple[str, ...]
    world: str
    wand: WandErrors | None = None

    @property
    def rms_px(self) -> float:
        """Return the RMS distance (px) over the points of all cameras."""
        return float(np.sqrt(np.mean(np.concatenate([np.sum(one.errors**2, axis=1) for one in self.errors]))))

    @property
    def standard_errors(self) -> Float[Array, " P"]:
        """Return the standard error of each of ``parameters``; zero for those held."""
        return np.sqrt(np.diag(self.covariance))

    def image_rms_px(self, camera: int) -> dict[str, float]:
        """Return the RMS distance (px) in each image of the camera with this number, by name of the image."""
        own = self.errors[camera]
        return {
            self.images[i]: float(np.sqrt(np.mean(np.sum(own.errors[own.image == i] ** 2, axis=1))))
            for i in np.unique(own.image)
        }


def summarise(
    found: Screened,
    seen: Observations,
    images: Sequence[str],
    rejected: Sequence[Rejection],
    world: str,
    remedy: str,
    wand: WandErrors | None = None,
) -> Calibration:
    """Return the Calibration for the screened fit ``found`` to ``seen``, of bodies with the names ``images``.

    DatasetError, with the ``remedy``, if a focal length or a combination of parameters is not determined.
    """
    cameras = found.fit.scene.cameras
    sigma0, freedom = _sigma0(found)
    covariance = sigma0**2 * _inverse(found.fit.information, found.free, parameter_names(cameras), remedy)
    _check_focal_lengths(cameras, covariance, remedy)
    used, camera = seen.only(found.used), seen.camera[found.used]
    errors = tuple(
        PixelErrors(used.body[camera == c], used.pixels[camera == c], found.fit.errors[camera == c])
        for c in range(len(cameras))
    )
    coverage = tuple(_coverage(one, own.pixels) for one, own in zip(cameras, errors, strict=True))
    listed = (*rejected, *_rejections(found, seen, cameras, images))
    return Calibration(
        cameras,
        parameter_names(cameras),
        covariance,
        tuple(found.free.parameters.tolist()),
        sigma0,
        freedom,
        tuple(images),
        errors,
        coverage,
        listed,
        tuple(_warnings(cameras, coverage, found.free.parameters)),
        world,
        wand,
    )


def parameter_names(cameras: Sequence[Camera]) -> tuple[str, ...]:
    """Return the names of the parameters of all ``cameras``, as in ``Calibration.parameters``."""
    return tuple(f"{camera.name}.{name}" for camera in cameras for name in camera.parameter_names)


def _sigma0(found: Screened) -> tuple[float, int]:
    """Return the standard deviation (px) of one coordinate, and its degrees of freedom."""
    errors = found.fit.errors
    freedom = errors.size - int(found.free.parameters.sum()) - int(found.free.motions.sum())
    if freedom < 1:
        message = f"{errors.size} coordinates for {errors.size - freedom} unknowns, more are needed: give more images"
        raise fail("calibration", errors.size, message)
    return float(np.sqrt(np.sum(errors**2) / freedom)), freedom


def _inverse(information: Array, free: Free, names: Sequence[str], remedy: str) -> Array:
    """Return the inverse of the ``information`` of what is free; DatasetError names what is not determined."""
    rows = np.nonzero(free.parameters)[0]
    matrix = information[np.ix_(rows, rows)]
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    if len(values) and values[0] < LEAST_EIGENVALUE:
        name = names[rows[int(np.argmax(np.abs(vectors[:, 0])))]]
        camera, _, parameter = name.rpartition(".")
        what = f"the focal length of camera {camera}" if parameter in FOCAL_AND_CENTRE[:2] else name
        why = f"smallest eigenvalue of the scaled normal matrix {values[0]:.1g}, at least {LEAST_EIGENVALUE:g}"
        raise _not_determined(name, f"{what} ({why})", remedy)
    inverse = np.zeros_like(information)
    inverse[np.ix_(rows, rows)] = (vectors / values) @ vectors.T * np.outer(scale, scale)
    return inverse


def _check_focal_lengths(cameras: Sequence[Camera], covariance: Array, remedy: str) -> None:
    for camera, start in zip(cameras, parameter_starts(tuple(cameras)), strict=False):
        deviations = np.sqrt(np.diag(covariance)[start : start + 2])
        relative = 100 * float(np.max(deviations / np.abs(np.diag(camera.matrix)[:2])))
        if not relative <= MOST_FOCAL_ERROR_PERCENT:
            what = f"the focal length of camera {camera.name}"
            why = f"standard error {relative:.2g} %, at most {MOST_FOCAL_ERROR_PERCENT:g} %"
            raise _not_determined(f"{relative:.2g} %", f"{what} ({why})", remedy)


def _not_determined(value: str, what: str, remedy: str) -> DatasetError:
    simpler = "or hold parameters, or choose a simpler lens"
    return fail("calibration", value, f"the images do not determine {what}: {remedy}, {simpler}")


def _coverage(camera: Camera, pixels: Array) -> Coverage:
    cells = np.floor((pixels + 0.5) / np.array(camera.size_px) * CELLS).astype(int)
    cells = np.clip(cells, 0, CELLS - 1)
    seen = np.zeros((CELLS, CELLS), bool)
    seen[cells[:, 1], cells[:, 0]] = True
    near, far = slice(None, CORNER_CELLS), slice(-CORNER_CELLS, None)
    parts = ((near, near), (near, far), (far, near), (far, far))
    unseen = tuple(name for name, part in zip(CORNERS, parts, strict=True) if not seen[part].any())
    return Coverage(float(seen.mean()), unseen)


def _warnings(cameras: Sequence[Camera], coverage: Sequence[Coverage], free: Mask) -> list[str]:
    """Return warnings about corners of images that no point shows, if the distortion was estimated."""
    warnings = []
    for camera, one, start in zip(cameras, coverage, parameter_starts(tuple(cameras)), strict=False):
        first = start + len(FOCAL_AND_CENTRE)
        if one.unseen and free[first : first + len(COEFFICIENTS[camera.lens.model])].any():
            warnings.append(
                f"camera {camera.name}: no point lies in the {' and '.join(one.unseen)} corner of its images; the "
                "distortion is extrapolated there: show the board or wand there too"
            )
    return warnings


def _rejections(
    found: Screened, seen: Observations, cameras: Sequence[Camera], images: Sequence[str]
) -> list[Rejection]:
    reasons = (
        (found.far_images, True, "its median error is more than 3 times that of the other images"),
        (found.far_points, False, "errors of more than 5 standard deviations"),
        (~(found.used | found.far_images | found.far_points), False, "too few points are seen with those rejected"),
    )
    listed = []
    for mask, whole, reason in reasons:
        for camera, body in sorted({(int(c), int(b)) for c, b in zip(seen.camera[mask], seen.body[mask], strict=True)}):
            count = int(np.sum(mask & (seen.camera == camera) & (seen.body == body)))
            listed.append(Rejection(cameras[camera].name, images[body], None if whole else count, reason))
    return listed
