"""Chooses the one outline among the lines of a file, and checks that it is closed and does not cross itself."""

from __future__ import annotations

import numpy as np

from wingfit.importers.planform.options import OutlineOptions
from wingfit.importers.planform.shapes import LARGEST, Drawn, Shape, extent
from wingfit.importers.planform.slabs import crossing
from wingfit.importers.planform.table import MAX_POINTS
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import check_most, fail, nearest

_MEETS = 1e-3  # distance of the ends of a line that is closed, in its extents; programs leave them apart by rounding
_LONG_STEP = 5.0  # closing step of a list of points that must be confirmed, in the largest of its other steps
_THIN = 1e-4  # area of an outline below which it is a line, in squares of its extent
_LISTED = 8


def outline_of(drawn: Drawn, options: OutlineOptions, file: str) -> tuple[Float[Array, "N 2"], str, list[str]]:
    """Return the corners of the outline, its name and remarks; DatasetError says what is wrong and the remedy."""
    shape, remarks = _chosen(drawn, options, file)
    where = file if len(drawn.shapes) == 1 else f"{file}, {shape.name!r}"
    if not np.abs(shape.points).max() <= LARGEST:
        message = f"has a coordinate that is no finite number up to {LARGEST:g}; check the drawing and its transforms"
        raise fail(where, None, message)
    check_most(where, "has", len(shape.points), MAX_POINTS, "points", "draw it with fewer, or with curves")
    size = extent(shape.points)
    points = _without_repeats(shape.points, size)
    if len(points) < 3:
        raise fail(where, len(points), f"has {len(points)} different points; an outline needs at least 3")
    _check_closed(shape, points, drawn, options, where)
    area = abs(signed_area(points))
    place = crossing(points)
    if place is not None:
        message = (
            f"crosses itself near x = {place[0]:.6g}, y = {place[1]:.6g} (coordinates of the file); move or remove "
            "points there, so that the outline is one line around the wing"
        )
        raise fail(where, None, message)
    if area < _THIN * size**2:
        message = f"encloses {area:.3g} square units in an extent of {size:.3g}: a line, not an outline"
        raise fail(where, area, f"{message}; choose the outline with --outline, or draw around the wing")
    return points, shape.name, remarks


def signed_area(points: Float[Array, "N 2"]) -> float:
    """Return the area of the closed polygon ``points``, above 0 if it runs counter-clockwise for y up."""
    moved = points - points[0]
    x, y = moved.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _chosen(drawn: Drawn, options: OutlineOptions, file: str) -> tuple[Shape, list[str]]:
    shapes = drawn.shapes
    if not shapes:
        more = f" ({'; '.join(drawn.remarks)})" if drawn.remarks else ""
        raise fail(file, 0, f"has no line that can be an outline{more}; draw the outline as one closed path")
    if options.outline is not None:
        named = [shape for shape in shapes if shape.name == options.outline]
        if not named:
            message = f"{file} has no line {options.outline!r}; {nearest(options.outline, [s.name for s in shapes])}"
            raise fail("--outline", options.outline, message)
        return named[0], []
    if len(shapes) == 1:
        return shapes[0], []
    closed = [shape for shape in shapes if _ends_meet(shape)]
    if len(closed) != 1:
        what = "closed lines" if closed else "lines, none of them closed"
        listed = ", ".join(_size(shape) for shape in (closed or shapes)[:_LISTED])
        more = ", ..." if len(closed or shapes) > _LISTED else ""
        remedy = "say which is the outline: --outline NAME" if closed else "join them to one closed line"
        raise fail(file, len(closed or shapes), f"has {len(closed or shapes)} {what}: {listed}{more}; {remedy}")
    others = [shape.name for shape in shapes if shape is not closed[0]]
    more = f" and {len(others) - _LISTED} more" if len(others) > _LISTED else ""
    return closed[0], [f"open lines, not read: {', '.join(others[:_LISTED])}{more}"]


def _size(shape: Shape) -> str:
    width, height = np.ptp(shape.points, axis=0)
    return f"{shape.name} ({width:.4g} x {height:.4g})"


def _ends_meet(shape: Shape) -> bool:
    return shape.closed or bool(np.hypot(*(shape.points[0] - shape.points[-1])) <= _MEETS * extent(shape.points))


def _check_closed(shape: Shape, points: Float[Array, "N 2"], drawn: Drawn, options: OutlineOptions, where: str) -> None:
    """Raise DatasetError if the ends of a line are apart and nobody says that the line between them belongs to it."""
    if options.close or _ends_meet(shape):
        return
    first, last = points[0], points[-1]
    gap = float(np.hypot(*(first - last)))
    if drawn.format == "points" and gap <= _LONG_STEP * np.hypot(*np.diff(points, axis=0).T).max():
        return
    message = (
        f"is open: its ends ({first[0]:.6g}, {first[1]:.6g}) and ({last[0]:.6g}, {last[1]:.6g}) are {gap:.4g} apart; "
        "close it in the drawing, or give --close if the straight line between them belongs to the outline"
    )
    raise fail(where, gap, message)


def _without_repeats(points: Float[Array, "N 2"], size: float) -> Float[Array, "N 2"]:
    """Return ``points`` without those that repeat the one before; the last is also compared with the first."""
    near = 1e-9 * size
    steps = np.hypot(*(points - np.roll(points, 1, axis=0)).T)
    steps[0] = np.inf if len(points) < 2 else steps[0]
    kept = points[steps > near]
    return kept if len(kept) else points[:1]
