"""What the user states about an outline: the options of ``wingfit wing-template``, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import get_args

from wingfit.importers.options import UNITS, Decimal
from wingfit.records.errors import Faults, nearest
from wingfit.records.wing import Structure

SIDES = {"left": "low-x", "right": "high-x", "low-x": "low-x", "high-x": "high-x", "low-y": "low-y", "high-y": "high-y"}
VERTICAL = ("top", "bottom")  # low-y or high-y, depending on where y points in the drawing
PAGE = "page"
LEAST_ACCURACY, MOST_ACCURACY = 1e-5, 0.05


@dataclass(frozen=True)
class OutlineOptions:
    """Statements of the user about an outline; None: not given.

    Attributes:
        root: side of the drawing on which the root is: left, right, top, bottom, or low-x, high-x, low-y, high-y.
        leading_edge: side on which the leading edge is, in the same words.
        unit: of the coordinates, a key of ``UNITS``, or "page": the size on the page of an SVG is the real one.
        mm_per_unit: millimetres per unit of the coordinates.
        span_mm: distance from the root end to the tip of the outline, mm, from which the scale follows.
        hinge_mm: distance from the flapping axis out to the root end of the outline, mm; below 0 if the axis is inside.
        hinge_z_mm: height of the flapping axis above the plane of the wing, mm.
        origin: point (x, y) of the file that is x = 0, y = 0 of the wing.
        outline: name of the outline, where the file has several.
        close: the straight line from the last point to the first belongs to the outline.
        fill_gaps: gaps and overhangs (between feathers, say) count as wing.
        accuracy: largest error of the area of the stations, as a fraction of it.
        structure: "sheet" or "rigid" for a wing without rods; None: a wing of foam and rods.
        mass_g: of the wing without markers, spread evenly over its area; for a wing without rods.
        thickness_mm: of the wing, at its root and its tip, mm; linear in between.
        marker_grid: numbers of markers along span and chord.
        marker_file: path of a table of markers: name,x,y in the coordinates of the outline; optional z_mm, mass_g.
        marker_z_mm, marker_mass_g: height above the plane of the wing, and mass, of each marker.
        name: of the wing.
        decimal: what separates the decimals in a table.
    """

    root: str | None = None
    leading_edge: str | None = None
    unit: str | None = None
    mm_per_unit: float | None = None
    span_mm: float | None = None
    hinge_mm: float | None = None
    hinge_z_mm: float | None = None
    origin: tuple[float, float] | None = None
    outline: str | None = None
    close: bool = False
    fill_gaps: bool = False
    accuracy: float = 0.001
    structure: str | None = None
    mass_g: float | None = None
    thickness_mm: tuple[float, float] | None = None
    marker_grid: tuple[int, int] | None = None
    marker_file: str | None = None
    marker_z_mm: float | None = None
    marker_mass_g: float | None = None
    name: str | None = None
    decimal: Decimal = "point"

    def check(self) -> None:
        """Raise DatasetError, which names all options with a wrong value."""
        faults = Faults()
        for option, side in (("--root", self.root), ("--leading-edge", self.leading_edge)):
            known = [*SIDES, *VERTICAL]
            if side is not None and side not in known:
                faults.add(option, side, f"is {side!r}; it must be one of {', '.join(known)} ({nearest(side, known)})")
        units = [*UNITS, PAGE]
        if self.unit is not None and self.unit not in units:
            faults.add("--unit", self.unit, f"is {self.unit!r}; it must be one of {', '.join(units)}")
        if self.decimal not in get_args(Decimal):
            faults.add("--decimal", self.decimal, f"is {self.decimal!r}; it must be point or comma")
        self._check_numbers(faults)
        scales = [option for option, value in self.scales.items() if value is not None]
        if len(scales) > 1:
            faults.add(scales[1], None, f"states the scale, as {scales[0]} does; give one of them")
        if self.marker_grid and self.marker_file:
            faults.add("--markers", self.marker_file, "lists markers, and --marker-grid too; give one of them")
        faults.raise_any()

    @property
    def scales(self) -> dict[str, object]:
        """Return the options that state the scale, with their values."""
        return {"--unit": self.unit, "--mm-per-unit": self.mm_per_unit, "--span-mm": self.span_mm}

    def _check_numbers(self, faults: Faults) -> None:
        thickness = self.thickness_mm or (None, None)
        for option, value, low, high, unit in (
            ("--mm-per-unit", self.mm_per_unit, 1e-9, 1e9, "mm"),
            ("--span-mm", self.span_mm, 0.1, 10_000, "mm"),
            ("--hinge-mm", self.hinge_mm, -5000, 5000, "mm"),
            ("--hinge-z-mm", self.hinge_z_mm, -1000, 1000, "mm"),
            *(("--thickness-mm", one, 1e-4, 500, "mm") for one in dict.fromkeys(thickness)),
            ("--mass-g", self.mass_g, 1e-6, 1e5, "g"),
            ("--marker-z-mm", self.marker_z_mm, -1000, 1000, "mm"),
            ("--marker-mass-g", self.marker_mass_g, 0, 100, "g"),
            ("--accuracy", self.accuracy, LEAST_ACCURACY, MOST_ACCURACY, ""),
        ):
            if value is not None and not low <= value <= high:
                found, limits = f"{value:g} {unit}".rstrip(), f"[{low:g}, {high:g}] {unit}".rstrip()
                faults.add(option, value, f"is {found}; it must lie in {limits}")
        if self.structure not in (None, *get_args(Structure)):
            faults.add(
                "--structure", self.structure, f"is {self.structure!r}; it must be sheet or rigid, or be left out"
            )
        if self.mass_g is not None and self.structure is None:
            message = "is for a wing without rods; give --structure sheet or rigid, or fill in the densities instead"
            faults.add("--mass-g", self.mass_g, message)
        if self.origin is not None and not all(map(math.isfinite, self.origin)):
            faults.add("--origin", self.origin, "must be two finite numbers, such as 12.5,3")
        if self.marker_grid is not None and not all(1 <= count <= 100 for count in self.marker_grid):
            given = "x".join(map(str, self.marker_grid))
            faults.add("--marker-grid", given, f"is {given}; it must be two numbers from 1 to 100, such as 4x3")
