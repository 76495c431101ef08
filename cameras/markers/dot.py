"""Round markers, bright on dark: the centre of an ellipse with blurred edges is the marker's place.

Seen at a slant, the centre of a disc is not the centre of its image, by about its radius squared over the distance: for
a disc of 10 mm, 1 m away, less than 0.03 mm.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from wingfit.cameras.markers.detections import Detections, joined, no_detections
from wingfit.cameras.markers.patch_fit import cut_patches, fit_patches, inside, offsets
from wingfit.cameras.opencv import opencv
from wingfit.records.array_types import Array, Float

_NOISES = 6.0  # contrast above that of noise
_SHARE = 0.25  # of the contrast of other spots
_COMPARED = 6  # the brightest spot but five, so that reflections and lamps do not count; fewer markers are not tracked
_COARSE = 4  # pixels: a step of images of the surroundings
_LEAST_PX, _LARGEST_PX = 3, 40.0  # area; radius
_EXPLAINED = 0.8
_LEAST_SEEN = 0.7  # share of a patch within the image
_FLOOR_PX = 0.01  # as for chequers
_MUCH_LARGER = 3.0
_MOST_SLANT = 6.0  # ratio of the axes of an ellipse


def detect_dots(image: Array, dark: float, noise: float) -> Detections:
    """Return the dots in ``image`` [H, W], brighter than the level ``dark`` by many times ``noise`` (grey levels).

    What is within 65 pixels of a dot decides how bright it must be, and the sixth brightest spot of all: a lamp hides
    its own surroundings.
    """
    cv2 = opencv()
    contrast = _contrast(image, dark)
    bright = contrast > np.maximum(_NOISES * noise, _SHARE * _largest_near(contrast))
    _, labels, boxes, centres = cv2.connectedComponentsWithStats(bright.astype(np.uint8), connectivity=8)
    area = boxes[1:, cv2.CC_STAT_AREA].astype(float)
    sides = boxes[1:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].astype(float)
    usable = (area >= _LEAST_PX) & (sides.max(1) < 2 * _LARGEST_PX) & (sides.max(1) < _MOST_SLANT * sides.min(1) + 2)
    spots = np.flatnonzero(usable)
    if not len(spots):
        return no_detections()
    highest = np.zeros(len(boxes))
    np.maximum.at(highest, labels[bright], contrast[bright])
    peaks = highest[spots + 1]
    level = np.sort(peaks)[-min(_COMPARED, len(peaks))]
    spots = spots[peaks >= _SHARE * level]
    starts, radii = centres[1:][spots], sides[spots] / 2
    # Patches are as large as the largest spot: one much larger than the others, such as a lamp, is fitted alone.
    large = radii.max(1) > _MUCH_LARGER * np.median(radii.max(1))
    found = [_fitted(image, starts[one], radii[one], noise) for one in (~large, large) if one.any()]
    return joined(found)


def _contrast(image: Array, dark: float) -> Float[Array, "H W"]:
    """Return the brightness above that of what is larger than a dot, such as the light around a lamp, or ``dark``."""
    cv2 = opencv()
    smooth = cv2.GaussianBlur(image.astype(np.float32), (0, 0), 0.8)
    height, width = smooth.shape
    small = cv2.resize(smooth, (-(-width // _COARSE), -(-height // _COARSE)), interpolation=cv2.INTER_AREA)
    around = cv2.morphologyEx(small, cv2.MORPH_OPEN, _window())
    return np.asarray(smooth - np.maximum(cv2.resize(around, (width, height)), dark))


def _largest_near(contrast: Float[Array, "H W"]) -> Float[Array, "H W"]:
    """Return the largest contrast within about the radius of the largest dot."""
    cv2 = opencv()
    height, width = contrast.shape
    coarse = cv2.dilate(contrast, np.ones((_COARSE + 1, _COARSE + 1), np.uint8))[::_COARSE, ::_COARSE]
    return np.asarray(cv2.resize(cv2.dilate(coarse, _window()), (width, height), interpolation=cv2.INTER_NEAREST))


def _window() -> Array:
    side = int(2 * _LARGEST_PX / _COARSE) + 3
    return np.ones((side, side), np.uint8)


def _fitted(image: Array, starts: Array, radii: Array, noise: float) -> Detections:
    half = int(np.ceil(1.5 * radii.max())) + 3
    patches, corner = cut_patches(image, starts, half)
    at = offsets(half)
    first = np.column_stack([starts - corner, np.log(np.maximum(radii, 0.7)), np.zeros(len(starts))])
    start = np.column_stack([first, np.log(np.full(len(starts), 0.8))])
    reach = 1.5 * radii.max(1) + 2.5
    weights = np.clip(reach[:, None] + 0.5 - np.linalg.norm(at[None] - start[:, None, :2], axis=2), 0, 1)
    seen = weights * inside(image, corner, half)
    fit = fit_patches(_shape, start, patches, seen, at)
    places = fit.parameters[:, :2] + corner
    size = np.exp(np.clip(fit.parameters[:, 2:4], -3, 5)).min(1)
    none = np.full((len(size), 2), np.nan)
    found = Detections(places, fit.covariance + _FLOOR_PX**2 * np.eye(2), size, fit.contrast, none)
    good = (fit.explained > _EXPLAINED) & (fit.contrast > _NOISES * noise) & np.isfinite(found.covariance).all((1, 2))
    good &= (np.linalg.norm(places - starts, axis=1) < radii.max(1)) & (
        np.trace(found.covariance, axis1=1, axis2=2) < 1
    )
    good &= seen.sum(1) > _LEAST_SEEN * weights.sum(1)
    return found.only(good)


def _shape(parameters: Float[Array, "N 6"], at: Float[Array, "Q 2"]) -> tuple[Array, Array]:
    """Return a blurred ellipse and its derivatives: centre, logarithms of two radii, shear, logarithm of the blur."""
    value = _ellipse(parameters, at)
    step = 1e-5
    changes = []
    for column in range(parameters.shape[1]):
        moved = parameters.copy()
        moved[:, column] += step
        changes.append((_ellipse(moved, at) - value) / step)
    return value, np.stack(changes, axis=2)


def _ellipse(parameters: Float[Array, "N 6"], at: Float[Array, "Q 2"]) -> Float[Array, "N Q"]:
    x, y = (at[None, :, k] - parameters[:, k, None] for k in (0, 1))
    wide, high = (np.exp(np.clip(parameters[:, k, None], -3, 5)) for k in (2, 3))
    one, two = x / wide, y / high - parameters[:, 4, None] * x / wide
    radius = np.sqrt(one**2 + two**2 + 1e-12)
    # Distance from the edge (pixels): of the radius from 1, over its slope.
    slope_x = (one - parameters[:, 4, None] * two) / (wide * radius)
    slope_y = two / (high * radius)
    distance = (radius - 1) / np.sqrt(slope_x**2 + slope_y**2 + 1e-12)
    blur = np.exp(np.clip(parameters[:, 5, None], -1.5, 2.0))
    return np.asarray(0.5 * (1 - erf(distance / (np.sqrt(2) * blur))))
