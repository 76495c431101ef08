"""Markers of two by two squares, two bright and two dark: the saddle in the middle is the marker's place.

The pattern near the saddle is ``background + contrast * erf(d1 / w1) * erf(d2 / w2)``, with the distances d1 and d2
from the two lines of edges, which need not be perpendicular, and one blur for each.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from wingfit.cameras.markers.detections import Detections, no_detections
from wingfit.cameras.markers.patch_fit import PatchFit, cut_patches, fit_patches, inside, offsets
from wingfit.cameras.opencv import opencv
from wingfit.records.array_types import Array, Float, Mask

SMALLEST_PX = 3.0
"""Smallest distance (pixels) from the saddle to the end of a square, along it, that can be fitted."""
_LARGEST_RADIUS = 11.0  # of a patch, pixels
_SCALES = (1.2, 2.4)  # pixels
_EXPLAINED = 0.75
_LEAST_SEEN = 0.8  # share of a patch within the image
_NOISES = 6.0  # contrast above that of noise
# What the pattern does not follow (uneven light, gamma, compression), as measured on rendered films.
_FLOOR_PX = 0.01


def detect_chequers(image: Array, dark: float, noise: float) -> Detections:
    """Return the chequers in ``image`` [H, W], whose dark level and noise (grey levels) are given."""
    starts = _saddles(image, noise)
    if not len(starts):
        return no_detections()
    angles, reach = _edges_and_reach(image, starts, dark)
    usable = (reach >= SMALLEST_PX) & np.isfinite(angles).all(1)
    starts, angles, reach = starts[usable], angles[usable], reach[usable]
    if not len(starts):
        return no_detections()
    fit, places, whole = _fit(image, starts, angles, reach)
    covariance = fit.covariance + _FLOOR_PX**2 * np.eye(2)
    found = Detections(places, covariance, reach, 2 * np.abs(fit.contrast), _edges(fit))
    moved = np.linalg.norm(places - starts, axis=1)
    good = (fit.explained > _EXPLAINED) & (found.contrast > _NOISES * noise) & (moved < 0.6 * reach)
    good &= np.isfinite(found.covariance).all((1, 2)) & (_variance(found) < 1.0) & _crossing(fit) & whole
    return _apart(found.only(good))


def _saddles(image: Array, noise: float) -> Float[Array, "N 2"]:
    """Return the places where the brightness has a saddle: strongest within a few pixels, and above noise."""
    cv2 = opencv()
    grey = image.astype(np.float32)
    found = []
    for scale in _SCALES:
        smooth = cv2.GaussianBlur(grey, (0, 0), scale)
        second = [cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (1, 1), (0, 2))]
        # Sobel's second derivatives weigh pixels by 4, the mixed one by 4 too.
        xx, xy, yy = (one / 4 for one in second)
        saddle = np.maximum(xy * xy - xx * yy, 0) * scale**4
        peak = saddle == cv2.dilate(saddle, np.ones((5, 5), np.uint8))
        # An ideal chequer of contrast C has the saddle (C / 4 / pi)^2 * 4 at its centre, whatever the scale.
        contrast = np.sqrt(saddle) * 2 * np.pi
        rows, columns = np.nonzero(peak & (contrast > _NOISES * noise))
        slope = [cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3)[rows, columns] / 8 for order in ((1, 0), (0, 1))]
        step = _newton(np.array(slope), *(one[rows, columns] for one in (xx, xy, yy)))
        found.append(np.column_stack([columns, rows]) + step)
    return np.concatenate(found)


def _newton(slope: Float[Array, "2 N"], xx: Array, xy: Array, yy: Array) -> Float[Array, "N 2"]:
    """Return the steps (pixels) to the places where the slope vanishes, at most 1.5 pixels."""
    determinant = np.where(xx * yy - xy * xy == 0, -1.0, xx * yy - xy * xy)
    step = -np.column_stack([yy * slope[0] - xy * slope[1], xx * slope[1] - xy * slope[0]]) / determinant[:, None]
    return np.asarray(step * np.minimum(1, 1.5 / np.maximum(np.linalg.norm(step, axis=1), 1e-9))[:, None], dtype=float)


def _edges_and_reach(
    image: Array, starts: Float[Array, "N 2"], dark: float
) -> tuple[Float[Array, "N 2"], Float[Array, " N"]]:
    """Return the angles of the two edges at each saddle, and how far its squares reach (pixels).

    The brightness on circles around the saddle has two bright and two dark arcs; the edges are where it crosses the
    mean.
    """
    steps = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    circle = np.column_stack([np.cos(steps), np.sin(steps)])
    radii = np.array([2.0, 3.0, 4.5, 6.5, 9.0, 12.0, 17.0, 24.0, 34.0, 48.0])
    rings = np.stack([_sampled(image, starts[:, None, :] + radius * circle) for radius in radii], axis=1)
    second = np.fft.rfft(rings, axis=2)[:, :, :5] / len(steps)
    strength = 2 * np.abs(second[:, :, 2])
    odd = 2 * np.sqrt((np.abs(second[:, :, [1, 3]]) ** 2).sum(2))
    level = 2 * np.maximum(np.abs(second[:, :, 0]) - dark, 1.0)
    # A ring belongs to the marker as long as it has two bright arcs, of which the strength does not fall.
    good = (strength > 1.5 * odd) & (strength > 0.1 * level)
    good &= strength > 0.6 * np.maximum.accumulate(strength, axis=1)
    inside = np.cumprod(good, axis=1).sum(1)
    reach = np.where(inside > 0, radii[np.maximum(inside - 1, 0)], 0.0)
    best = np.maximum(inside - 1, 0)
    ring = rings[np.arange(len(starts)), best]
    return _crossings(ring, steps), reach


def _crossings(ring: Float[Array, "N S"], steps: Float[Array, " S"]) -> Float[Array, "N 2"]:
    """Return the angles of two lines through the middle, on which the brightness of a ring is its mean; NaN if none."""
    folded = ring.reshape(len(ring), 2, -1).mean(1)
    folded = folded - folded.mean(1, keepdims=True)
    after = np.roll(folded, -1, axis=1)
    crosses = (folded > 0) != (after > 0)
    angles = np.full((len(ring), 2), np.nan)
    width = steps[1] - steps[0]
    for row in np.flatnonzero(crosses.sum(1) == 2):
        at = np.flatnonzero(crosses[row])
        share = folded[row, at] / (folded[row, at] - after[row, at])
        angles[row] = (at + share) * width
    return angles


def _sampled(image: Array, at: Float[Array, "N S 2"]) -> Float[Array, "N S"]:
    """Return the brightness between pixels, by bilinear interpolation; outside, that of the nearest pixel."""
    cv2 = opencv()
    grid = at.astype(np.float32)
    found = cv2.remap(
        image.astype(np.float32), grid[..., 0], grid[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(found, dtype=float)


def _fit(image: Array, starts: Array, angles: Array, reach: Array) -> tuple[PatchFit, Float[Array, "N 2"], Mask]:
    """Fit the pattern around ``starts``; returns the fit, the places of the saddles, and which the border leaves."""
    # Squares end at the reach along their diagonals; a disc within them is about 0.6 of it.
    radius = np.clip(0.6 * reach, 2.5, _LARGEST_RADIUS)
    half = int(np.ceil(radius.max())) + 1
    patches, corner = cut_patches(image, starts, half)
    at = offsets(half)
    start = np.column_stack([starts - corner, angles, np.zeros((len(starts), 2))])
    weights = np.clip(radius[:, None] + 0.5 - np.linalg.norm(at[None] - start[:, None, :2], axis=2), 0, 1)
    seen = weights * inside(image, corner, half)
    fit = fit_patches(_shape, start, patches, seen, at)
    whole = seen.sum(1) > _LEAST_SEEN * weights.sum(1)
    return fit, fit.parameters[:, :2] + corner, whole


def _shape(parameters: Float[Array, "N 6"], at: Float[Array, "Q 2"]) -> tuple[Array, Array]:
    """Return the pattern of a saddle and its derivatives: centre, two angles, logarithms of two blurs."""
    x, y = (at[None, :, k] - parameters[:, k, None] for k in (0, 1))
    edges = []
    for k in (0, 1):
        angle, width = parameters[:, 2 + k, None], np.exp(np.clip(parameters[:, 4 + k, None], -2, 2.5))
        sine, cosine = np.sin(angle), np.cos(angle)
        distance, along = cosine * y - sine * x, cosine * x + sine * y
        ratio = distance / width
        slope = 2 / np.sqrt(np.pi) * np.exp(-(ratio**2)) / width
        edges.append((erf(ratio), slope * sine, -slope * cosine, -slope * along, -slope * distance))
    (one, *by_one), (two, *by_two) = edges
    changes = [
        by_one[0] * two + one * by_two[0],
        by_one[1] * two + one * by_two[1],
        by_one[2] * two,
        one * by_two[2],
        by_one[3] * two,
        one * by_two[3],
    ]
    return one * two, np.stack(changes, axis=2)


def _crossing(fit: PatchFit) -> Mask:
    """Whether the edges of a fit cross at 15 degrees or more, so that the saddle is a point."""
    return np.asarray(np.abs(np.sin(fit.parameters[:, 2] - fit.parameters[:, 3])) > np.sin(np.radians(15)))


def _edges(fit: PatchFit) -> Float[Array, "N 2"]:
    """Return the directions (rad) of the two edges, turned so that a bright square lies between them."""
    one, two = fit.parameters[:, 2:4].T
    x, y = np.cos(one) + np.cos(two), np.sin(one) + np.sin(two)
    between = (np.cos(one) * y - np.sin(one) * x) * (np.cos(two) * y - np.sin(two) * x)
    return np.stack([one, np.where(fit.contrast * between > 0, two, two + np.pi)], axis=1)


def _variance(found: Detections) -> Float[Array, " N"]:
    return np.asarray(np.trace(found.covariance, axis1=1, axis2=2))


def _apart(found: Detections) -> Detections:
    """Leave out the worse of detections that are the same saddle."""
    order = np.argsort(_variance(found), kind="stable")
    kept: list[int] = []
    for index in order:
        near = np.linalg.norm(found.pixels[kept] - found.pixels[index], axis=1) if kept else np.empty(0)
        if not (near < np.maximum(2.0, 0.5 * found.size_px[index])).any():
            kept.append(int(index))
    return found.only(np.sort(np.array(kept, dtype=int)))
