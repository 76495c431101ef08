"""What is detected in one image: places of markers in pixels, with covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float, Index, Mask

FIELDS = ("pixels", "covariance", "size_px", "contrast", "edges")


@dataclass(frozen=True, eq=False)
class Detections:
    """Markers seen in one image.

    Attributes:
        pixels: [N, 2], x and y of the centres.
        covariance: [N, 2, 2] (pixels squared), of the noise of the image and of what the pattern does not follow.
        size_px: [N], smallest distance from the centre to the edge of the marker.
        contrast: [N], brightness of the marker above that of its surroundings.
        edges: [N, 2], directions (rad, from x to y) of two edges of a chequer, with a bright square between them; NaN
            for a dot.
    """

    pixels: Float[Array, "N 2"]
    covariance: Float[Array, "N 2 2"]
    size_px: Float[Array, " N"]
    contrast: Float[Array, " N"]
    edges: Float[Array, "N 2"]

    def __len__(self) -> int:
        return len(self.pixels)

    def only(self, keep: Mask | Index) -> Detections:
        """Return the detections in ``keep`` [N], a mask or indices."""
        return Detections(*(getattr(self, name)[keep] for name in FIELDS))


def no_detections() -> Detections:
    """Return an image in which nothing is detected."""
    return Detections(np.empty((0, 2)), np.empty((0, 2, 2)), np.empty(0), np.empty(0), np.empty((0, 2)))


def joined(parts: Sequence[Detections]) -> Detections:
    """Return the detections of all ``parts``, one after the other."""
    if not parts:
        return no_detections()
    return Detections(*(np.concatenate([getattr(part, name) for part in parts]) for name in FIELDS))
