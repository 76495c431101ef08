"""Reads the lines of a DXF drawing with ezdxf, an optional library; joins chains of lines, arcs and splines.

Only the model space is read: LINE, ARC, CIRCLE, ELLIPSE, SPLINE, LWPOLYLINE and POLYLINE, in the x-y plane.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import Any

import numpy as np

from wingfit.importers.planform.shapes import FLATTENING, Drawn, Scale, Shape, extent
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError, fail

_READ = {"LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE"}
# Codes of the header variable $INSUNITS, with the metres per unit.
_UNITS = {
    1: ("in", 0.0254),
    2: ("ft", 0.3048),
    4: ("mm", 1e-3),
    5: ("cm", 1e-2),
    6: ("m", 1.0),
    13: ("um", 1e-6),
    14: ("dm", 0.1),
}
_JOINED = 1e-6  # largest distance of two ends that are joined, in extents of the drawing
_FLAT = 1e-6  # largest |z|, in extents of the drawing


def read_dxf(raw: bytes, file: str) -> Drawn:
    """Return the lines of a DXF; DatasetError says what cannot be read, or that ezdxf is not installed."""
    try:
        from ezdxf import path, recover
        from ezdxf.lldxf.const import DXFError
    except ImportError:
        remedy = "pip install 'wingfit[dxf]', or export the drawing as SVG"
        raise fail(file, "DXF", f"is a DXF drawing; reading it needs the library ezdxf: {remedy}") from None
    try:
        document, audit = recover.read(io.BytesIO(raw))
        if audit.has_errors:
            raise fail(file, None, f"is damaged: {audit.errors[0].message}; save the drawing again, or export SVG")
        found = Drawn("dxf", [], y_up=True, unit=_unit(document))
        if audit.has_fixes:
            what = f"{len(audit.fixes)} faults of the file were repaired while reading: {audit.fixes[0].message}"
            found.remarks.append(f"{what}; check the drawing")
        lines, ignored = [], dict[str, int]()
        for entity in document.modelspace():
            if entity.dxftype() in _READ:
                lines.append(_line(path.make_path(entity), entity))
            else:
                ignored[entity.dxftype()] = ignored.get(entity.dxftype(), 0) + 1
    except DatasetError:
        raise
    except (DXFError, OSError, ValueError, TypeError, ArithmeticError, LookupError, AttributeError) as error:
        raise fail(file, None, f"is no DXF that can be read ({error}); save it again, or export SVG") from None
    found.shapes.extend(_chained([line for line in lines if line is not None], file))
    found.remarks.extend(f"not read: {count} x {kind}" for kind, count in sorted(ignored.items()))
    return found


def _unit(document: Any) -> Scale | None:
    name, metres = _UNITS.get(document.header.get("$INSUNITS", 0), ("", 0.0))
    return Scale(metres, name, "header variable $INSUNITS") if name else None


def _line(path: Any, entity: Any) -> Shape | None:
    """Return a path of ezdxf as points; None for one without length."""
    control = np.array([[*point] for point in path.control_vertices()], dtype=np.float64).reshape(-1, 3)
    if len(control) < 2 or not np.isfinite(control).all():
        return None
    size = float(np.linalg.norm(np.ptp(control, axis=0)))
    if size == 0:
        return None
    points = np.array([[*point] for point in path.flattening(FLATTENING * size, 16)], dtype=np.float64)
    return Shape(f"{entity.dxftype()} {entity.dxf.handle}", points, bool(path.is_closed))


def _chained(lines: list[Shape], file: str) -> Iterable[Shape]:
    """Join open lines whose ends meet, each end with one other; DatasetError for lines that are not in a plane."""
    if not lines:
        return
    every = np.concatenate([line.points for line in lines])
    size = extent(every[:, :2])
    if np.ptp(every[:, 2]) > _FLAT * size:
        raise fail(file, float(np.ptp(every[:, 2])), "is not flat: z differs; draw the outline in the x-y plane")
    yield from (Shape(line.name, line.points[:, :2], closed=True) for line in lines if line.closed)
    rest = [line for line in lines if not line.closed]
    while rest:
        first = rest.pop(0)
        points, count = first.points[:, :2], 1
        while (joined := _next(points, rest, _JOINED * size)) is not None:
            points, count = joined, count + 1
        closed = bool(np.hypot(*(points[0] - points[-1])) <= _JOINED * size)
        yield Shape(first.name if count == 1 else f"chain from {first.name}", points, closed)


def _next(points: Array, rest: list[Shape], near: float) -> Array | None:
    """Return ``points`` with the line of ``rest`` that starts or ends where they end, and take it from ``rest``."""
    if np.hypot(*(points[0] - points[-1])) <= near:
        return None
    for back in (False, True):
        line_end = points[0] if back else points[-1]
        for number, line in enumerate(rest):
            for piece in (line.points[:, :2], line.points[::-1, :2]):
                if np.hypot(*(piece[0] - line_end)) <= near:
                    rest.pop(number)
                    return np.concatenate([piece[:0:-1], points]) if back else np.concatenate([points, piece[1:]])
    return None
