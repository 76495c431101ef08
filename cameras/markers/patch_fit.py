"""Least-squares fit of a pattern to many small patches of an image at once.

Levenberg-Marquardt with one damping per patch. All patterns share one form: ``background + contrast * shape``, of which
the shape depends on the centre and on a few parameters more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float

# Values [N, Q] of a shape at the offsets [Q, 2] of pixels, and their derivatives [N, Q, P], from parameters [N, P]. The
# first two parameters are the centre.
Shape = Callable[[Float[Array, "N P"], Float[Array, "Q 2"]], tuple[Float[Array, "N Q"], Float[Array, "N Q P"]]]
_STEPS = 25
_SMALL_STEP_PX = 1e-3
_CORRELATED_PX = 6


@dataclass(frozen=True, eq=False)
class PatchFit:
    """Result of a fit: ``parameters`` [N, P] with the centre first, ``contrast`` and ``background`` [N].

    ``covariance`` [N, 2, 2] of the centre follows from the residuals; ``explained`` [N] is the share of the patch's
    variance that the pattern explains.
    """

    parameters: Float[Array, "N P"]
    contrast: Float[Array, " N"]
    background: Float[Array, " N"]
    covariance: Float[Array, "N 2 2"]
    explained: Float[Array, " N"]


def cut_patches(image: Array, centres: Float[Array, "N 2"], half: int) -> tuple[Float[Array, "N Q"], Array]:
    """Return the pixels [N, Q] of squares of ``2 half + 1`` pixels around the nearest pixels [N, 2] to ``centres``."""
    corner = np.rint(centres).astype(int)
    height, width = image.shape
    steps = np.arange(-half, half + 1)
    rows = np.clip(corner[:, 1, None] + steps, 0, height - 1)
    columns = np.clip(corner[:, 0, None] + steps, 0, width - 1)
    patches = image[rows[:, :, None], columns[:, None, :]].astype(float)
    return patches.reshape(len(centres), -1), corner


def inside(image: Array, corner: Array, half: int) -> Float[Array, "N Q"]:
    """Return 1 for the pixels of the patches of ``cut_patches`` that lie in the image, 0 for repeats of its border."""
    height, width = image.shape
    steps = np.arange(-half, half + 1)
    rows, columns = corner[:, 1, None] + steps, corner[:, 0, None] + steps
    good = ((rows >= 0) & (rows < height))[:, :, None] & ((columns >= 0) & (columns < width))[:, None, :]
    return np.asarray(good.reshape(len(corner), -1), dtype=float)


def offsets(half: int) -> Float[Array, "Q 2"]:
    """Return x and y of the pixels of a patch from its middle, in the order of ``cut_patches``."""
    steps = np.arange(-half, half + 1, dtype=float)
    y, x = np.meshgrid(steps, steps, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()])


def fit_patches(
    shape: Shape, start: Float[Array, "N P"], patches: Float[Array, "N Q"], weights: Float[Array, "N Q"], at: Array
) -> PatchFit:
    """Fit ``shape`` to ``patches`` with the ``weights`` of their pixels, from the parameters ``start``.

    Contrast and background are eliminated: for each set of parameters they are those of least squares.
    """
    parameters, damping = start.copy(), np.full(len(start), 1e-2)
    cost = _reduced(shape, parameters, patches, weights, at)[0]
    active = np.arange(len(start))
    for _ in range(_STEPS):
        if not len(active):
            break
        now = parameters[active]
        _, residuals, changes, _, _ = _reduced(shape, now, patches[active], weights[active], at, derivatives=True)
        step = _damped_step(residuals, changes, weights[active], damping[active])
        tried = now + step
        tried_cost = _reduced(shape, tried, patches[active], weights[active], at)[0]
        better = tried_cost < cost[active]
        parameters[active[better]], cost[active[better]] = tried[better], tried_cost[better]
        damping[active] = np.where(better, damping[active] / 5, damping[active] * 5)
        moved = np.abs(step).max(axis=1) > _SMALL_STEP_PX
        active = active[moved & (damping[active] < 1e6)]
    return _result(shape, parameters, patches, weights, at)


def _reduced(
    shape: Shape,
    parameters: Float[Array, "N P"],
    patches: Float[Array, "N Q"],
    weights: Float[Array, "N Q"],
    at: Array,
    *,
    derivatives: bool = False,
) -> tuple[Array, Array, Array, Array, Array]:
    """Return cost [N], residuals [N, Q], their derivatives [N, Q, P], contrast [N], background [N]."""
    values, by_parameters = shape(parameters, at)
    total = weights.sum(1)
    mean_value, mean_patch = (weights * values).sum(1) / total, (weights * patches).sum(1) / total
    centred, seen = values - mean_value[:, None], patches - mean_patch[:, None]
    spread = np.maximum((weights * centred**2).sum(1), 1e-12)
    contrast = (weights * centred * seen).sum(1) / spread
    residuals = seen - contrast[:, None] * centred
    cost = (weights * residuals**2).sum(1)
    if not derivatives:
        return cost, residuals, by_parameters[:, :0], contrast, mean_patch - contrast * mean_value
    changes = contrast[:, None, None] * by_parameters
    # Kaufman (1975): the derivative of the model, projected on what contrast and background cannot follow.
    changes = changes - ((weights[:, :, None] * changes).sum(1) / total[:, None])[:, None, :]
    along = (weights[:, :, None] * changes * centred[:, :, None]).sum(1) / spread[:, None]
    return cost, residuals, changes - along[:, None, :] * centred[:, :, None], contrast, mean_patch


def _normal(changes: Array, weights: Array) -> Float[Array, "N P P"]:
    """Return the matrices of the normal equations, with a diagonal that is never zero."""
    matrix = np.einsum("nqp,nq,nqr->npr", changes, weights, changes, optimize=True)
    size = matrix.shape[1]
    trace = np.einsum("npp->n", matrix) / size
    return np.asarray(matrix + (1e-9 * trace + 1e-12)[:, None, None] * np.eye(size))


def _damped_step(residuals: Array, changes: Array, weights: Array, damping: Array) -> Float[Array, "N P"]:
    matrix = _normal(changes, weights)
    right = np.einsum("nqp,nq->np", changes, weights * residuals)
    diagonal = np.einsum("npp->np", matrix)
    matrix = matrix + (damping[:, None] * diagonal)[:, :, None] * np.eye(matrix.shape[1])
    return np.asarray(np.linalg.solve(matrix, right[:, :, None])[:, :, 0])


def _result(shape: Shape, parameters: Array, patches: Array, weights: Array, at: Array) -> PatchFit:
    cost, residuals, changes, contrast, _ = _reduced(shape, parameters, patches, weights, at, derivatives=True)
    background = _reduced(shape, parameters, patches, weights, at)[4]
    freedom = np.maximum(weights.sum(1) - parameters.shape[1] - 2, 1.0)
    variance = cost / freedom
    inverse = np.linalg.inv(_normal(changes, weights))
    # Errors of neighbouring pixels resemble each other (compression, light): the covariance is not that of white noise.
    weighted = weights[:, :, None] * changes
    spread = _spread(weighted, _correlation(residuals, weights, variance, at))
    correlated = np.einsum("nqp,nqs->nps", weighted, spread, optimize=True)
    covariance = (inverse @ correlated @ inverse)[:, :2, :2] * variance[:, None, None]
    mean = (weights * patches).sum(1) / weights.sum(1)
    total = (weights * (patches - mean[:, None]) ** 2).sum(1)
    return PatchFit(parameters, contrast, background, covariance, 1 - cost / np.maximum(total, 1e-12))


def _correlation(residuals: Array, weights: Array, variance: Array, at: Float[Array, "Q 2"]) -> Float[Array, "L L"]:
    """Return the correlation of the errors of two pixels by their distance in rows and columns, from -6 to 6.

    It is that which the residuals of all patches together show.
    """
    side = round(np.sqrt(len(at)))
    scaled = (weights * residuals / np.sqrt(np.maximum(variance, 1e-12))[:, None]).reshape(-1, side, side)
    total = (scaled**2).sum()
    size = 2 * max(side, _CORRELATED_PX + 1)
    power = (np.abs(np.fft.rfft2(scaled, (size, size))) ** 2).sum(0)
    by_lag = np.fft.irfft2(power, (size, size)) / max(float(total), 1e-12)
    used = (np.abs(np.fft.rfft2(weights.reshape(-1, side, side), (size, size))) ** 2).sum(0)
    overlap = np.fft.irfft2(used, (size, size))
    by_lag *= overlap[0, 0] / np.maximum(overlap, 1e-3 * overlap[0, 0])
    # A fit with many parameters for its pixels leaves residuals that alternate, although the errors do not.
    by_lag = np.maximum(by_lag, 0)
    lags = np.arange(-_CORRELATED_PX, _CORRELATED_PX + 1)
    near = np.clip(1 - np.hypot(lags[:, None], lags) / (_CORRELATED_PX + 1), 0, 1)
    return np.asarray(by_lag[np.ix_(lags, lags)] * near)


def _spread(weighted: Float[Array, "N Q P"], correlation: Float[Array, "L L"]) -> Float[Array, "N Q P"]:
    """Return the sum over all pixels of ``weighted`` times the ``correlation`` with each pixel, by a convolution."""
    count, pixels, parameters = weighted.shape
    side = round(np.sqrt(pixels))
    size = side + 2 * _CORRELATED_PX
    grid = weighted.reshape(count, side, side, parameters)
    product = np.fft.rfft2(grid, (size, size), axes=(1, 2)) * np.fft.rfft2(correlation, (size, size))[None, :, :, None]
    whole = np.fft.irfft2(product, (size, size), axes=(1, 2))
    inner = slice(_CORRELATED_PX, _CORRELATED_PX + side)
    return np.asarray(whole[:, inner, inner].reshape(count, pixels, parameters))
