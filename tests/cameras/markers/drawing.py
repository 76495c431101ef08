"""Images of markers by supersampling: every pixel is the mean over its area, then blurred and noisy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import gaussian_filter

from wingfit.records.array_types import Array

_OVER = 8  # samples along the edge of a pixel
_AROUND = 40  # pixels around the image, from which light is blurred into it
Inside = Callable[[Array, Array], Array]  # whether places (u, v) on the marker are bright
Mark = tuple[Inside, Array, Array]  # what is bright, the place (px), the axes [2, 2] (px)


def chequer(u: Array, v: Array) -> Array:
    """Two bright and two dark squares of the side 1."""
    return np.asarray((np.abs(u) < 1) & (np.abs(v) < 1) & (u * v > 0))


def disc(u: Array, v: Array) -> Array:
    """A disc of the radius 1."""
    return np.asarray(u**2 + v**2 < 1)


def drawn(
    size: tuple[int, int],
    marks: list[Mark],
    blur: float = 0.7,
    levels: tuple[float, float] = (10.0, 150.0),
) -> Array:
    """The image [H, W] of ``size`` (width, height), with markers: what is bright, the place (px), the axes [2, 2] (px).

    The columns of the axes are the images of the unit vectors on the marker.
    """
    width, height = size[0] + 2 * _AROUND, size[1] + 2 * _AROUND
    image = np.zeros((height, width))
    step = (np.arange(_OVER) + 0.5) / _OVER - 0.5
    for inside, place, axes in ((one, at + _AROUND, axes) for one, at, axes in marks):
        reach = int(np.ceil(np.abs(axes).sum(1).max())) + 2
        middle = np.rint(place).astype(int)
        rows = np.arange(max(middle[1] - reach, 0), min(middle[1] + reach + 1, height))
        columns = np.arange(max(middle[0] - reach, 0), min(middle[0] + reach + 1, width))
        y = (rows[:, None] + step).ravel()[:, None] - place[1]
        x = (columns[:, None] + step).ravel()[None, :] - place[0]
        back = np.linalg.inv(axes)
        bright = inside(back[0, 0] * x + back[0, 1] * y, back[1, 0] * x + back[1, 1] * y).astype(float)
        mean = bright.reshape(len(rows), _OVER, len(columns), _OVER).mean((1, 3))
        image[np.ix_(rows, columns)] += mean
    image = gaussian_filter(image, blur) if blur else image
    image = image[_AROUND:-_AROUND, _AROUND:-_AROUND]
    return np.asarray(levels[0] + (levels[1] - levels[0]) * image)


def noisy(image: Array, noise: float, rng: np.random.Generator) -> Array:
    """The image as a camera with 8 bits stores it."""
    return np.clip(np.rint(image + noise * rng.standard_normal(image.shape)), 0, 255).astype(np.uint8)


def affine(rng: np.random.Generator, size: float) -> Array:
    """Axes [2, 2] of a marker turned in its plane and seen at a slant of up to 55 degrees."""
    turn, around, slant = rng.uniform(0, 2 * np.pi), rng.uniform(0, np.pi), np.cos(np.radians(rng.uniform(0, 55)))

    def rotation(angle: float) -> Array:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    return np.asarray(size * rotation(around) @ np.diag([1.0, slant]) @ rotation(-around) @ rotation(turn))


def lattice(rng: np.random.Generator, count: int, spacing: float) -> tuple[tuple[int, int], Array]:
    """The size of an image and places [N, 2] of markers on a lattice, moved by parts of a pixel at random."""
    y, x = np.divmod(np.arange(count), int(np.ceil(np.sqrt(count))))
    places = spacing * (np.column_stack([x, y]) + 0.7) + rng.uniform(-0.5, 0.5, (count, 2))
    side = int(np.ceil(spacing * (np.ceil(np.sqrt(count)) + 0.4)))
    return (side, side), places
