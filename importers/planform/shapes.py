"""What the readers of outlines return: lines in the coordinates of the file, and what the file states about them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from wingfit.records.array_types import Array, Float

FLATTENING = 1e-5  # largest distance of a flattened curve from the curve, in extents of that curve
LARGEST = 1e9  # magnitude of a coordinate, in any unit
Format = Literal["svg", "dxf", "points", "stations"]


@dataclass(frozen=True)
class Fact:
    """One fact about an outline: its ``value`` as text, stated ``by`` whom, and ``where`` (a place or an option).

    A fact stated by convention is the same for every outline (docs/outlines.md).
    """

    fact: str
    value: str
    by: Literal["file", "user", "convention"]
    where: str


@dataclass(frozen=True, eq=False)
class Shape:
    """One line of a drawing: its ``name`` in the file, its ``points`` [N, 2], and whether the file closes it."""

    name: str
    points: Float[Array, "N 2"]
    closed: bool


@dataclass(frozen=True)
class Scale:
    """Metres per unit of the coordinates as the file states them; ``text`` names the unit, ``where`` the place."""

    metres: float
    text: str
    where: str


@dataclass
class Drawn:
    """The lines in a file.

    Attributes:
        format: kind of the file.
        shapes: lines in the coordinates of the file.
        y_up: whether y points up in the drawing; None: a table, which does not say so.
        unit: real size of a coordinate, where the file states it.
        page: size of a coordinate on the page of an SVG, where the file states it; drawings are often not to scale.
        aft: for stations, the direction in which the chord points aft: "high-x" or "low-x" (y is the span).
        remarks: what was not read.
    """

    format: Format
    shapes: list[Shape]
    y_up: bool | None = None
    unit: Scale | None = None
    page: Scale | None = None
    aft: Literal["low-x", "high-x"] | None = None
    remarks: list[str] = field(default_factory=list)


def extent(points: Float[Array, "N 2"]) -> float:
    """Return the diagonal of the box around ``points``; 0 for a single one."""
    return float(np.hypot(*np.ptp(points, axis=0)))
