"""Reads the lines of an SVG drawing: paths, polygons, polylines, rectangles, circles and ellipses, with transforms.

Coordinates are user units of the outermost element. Its ``width`` and ``viewBox`` state their size on the page.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from wingfit.importers.planform.shapes import Drawn, Scale, Shape
from wingfit.importers.planform.svg_path import subpaths
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail, shown

_PAGE_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "pt": 0.0254 / 72, "pc": 0.0254 / 6}
_LENGTH = re.compile(r"\s*([0-9.eE+-]+?)\s*(mm|cm|in|pt|pc|m)\s*")
_UNSEEN = {"defs", "clipPath", "mask", "symbol", "pattern", "marker", "metadata", "title", "desc", "style", "namedview"}
_NOT_LINES = {"use", "text", "image", "svg", "foreignObject"}
_TRANSFORM = re.compile(r"\s*,?\s*([A-Za-z]+)\s*\(([^)]*)\)")
_HIDDEN = re.compile(r"(?:^|;)\s*(?:display\s*:\s*none|visibility\s*:\s*hidden)")
_UNEQUAL = 1e-3


def read_svg(text: str, file: str) -> Drawn:
    """Return the lines of an SVG; DatasetError says what cannot be read."""
    if "<!ENTITY" in text:
        raise fail(file, "<!ENTITY", "defines entities, which are not read; save it as plain SVG")
    try:
        root = ElementTree.fromstring(text)  # noqa: S314  # entities are refused above
    except ElementTree.ParseError as error:
        raise fail(file, None, f"is not valid XML: {error}; save it again as plain SVG") from None
    if _tag(root) != "svg":
        raise fail(file, _tag(root), f"is XML of the kind {_tag(root)!r}, not SVG; export the drawing as SVG")
    found = Drawn("svg", [], y_up=False)
    counts: dict[str, int] = {}
    for element, matrix in _elements(root, np.eye(3), found, file):
        tag = _tag(element)
        counts[tag] = counts.get(tag, 0) + 1
        name = element.get("id") or f"{tag}-{counts[tag]}"
        try:
            parts = _lines(element, tag)
        except ValueError as error:
            raise fail(f"{file}, {tag} {name!r}", None, f"{error}; save the drawing again as plain SVG") from None
        for number, (points, closed) in enumerate(parts, 1):
            turned = points @ matrix[:2, :2].T + matrix[:2, 2]
            found.shapes.append(Shape(name if len(parts) == 1 else f"{name}.{number}", turned, closed))
    found.page = _page(root)
    return found


def _tag(element: ElementTree.Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _elements(
    parent: ElementTree.Element, matrix: Float[Array, "3 3"], found: Drawn, file: str
) -> Iterator[tuple[ElementTree.Element, Float[Array, "3 3"]]]:
    """Yield the visible shapes below ``parent`` with their transforms to the user units of the outermost element."""
    for element in parent:
        tag = _tag(element)
        if tag in _UNSEEN or element.get("display") == "none" or _HIDDEN.search(element.get("style", "")):
            continue
        if tag in _NOT_LINES:
            remark = f"not read: {tag} {element.get('id') or ''}".rstrip()
            found.remarks.append(remark + "; convert it to a path if it is the outline")
            continue
        if "transform" in element.get("style", ""):
            where = f"{file}, {tag} {element.get('id') or ''}".rstrip()
            raise fail(where, None, "has a transform in its style, which is not read; save the drawing as plain SVG")
        here = matrix @ _transform(element.get("transform", ""), file)
        if tag in _SHAPES:
            yield element, here
        yield from _elements(element, here, found, file)


def _transform(text: str, file: str) -> Float[Array, "3 3"]:
    """Return the matrix of an attribute ``transform``; DatasetError for one that is not known."""
    matrix, at = np.eye(3), 0
    while text[at:].strip(" ,\n\t"):
        match = _TRANSFORM.match(text, at)
        try:
            numbers = [float(one) for one in re.split(r"[\s,]+", match[2].strip()) if one] if match else []
            step = _matrix(match[1], numbers) if match else None
        except (ValueError, IndexError):
            step = None
        if match is None or step is None or not np.isfinite(step).all():
            raise fail(file, text, f"has the transform {shown(text)!r}, which is not read; save it as plain SVG")
        matrix, at = matrix @ step, match.end()
    return matrix


def _matrix(name: str, n: list[float]) -> Array | None:
    """Return the matrix [3, 3] of one transform with the numbers ``n``; None for an unknown name."""
    if name == "rotate":
        c, s = math.cos(math.radians(n[0])), math.sin(math.radians(n[0]))
        x, y = (n[1], n[2]) if len(n) > 1 else (0.0, 0.0)
        return np.array([[c, -s, x - c * x + s * y], [s, c, y - s * x - c * y], [0, 0, 1.0]])
    rows: list[list[float]]
    match name:
        case "matrix":
            rows = [[n[0], n[2], n[4]], [n[1], n[3], n[5]]]
        case "translate":
            rows = [[1, 0, n[0]], [0, 1, n[1] if len(n) > 1 else 0]]
        case "scale":
            rows = [[n[0], 0, 0], [0, n[1] if len(n) > 1 else n[0], 0]]
        case "skewX":
            rows = [[1, math.tan(math.radians(n[0])), 0], [0, 1, 0]]
        case "skewY":
            rows = [[1, 0, 0], [math.tan(math.radians(n[0])), 1, 0]]
        case _:
            return None
    return np.array([*rows, [0, 0, 1]], dtype=np.float64)


def _path(element: ElementTree.Element) -> list[tuple[Array, bool]]:
    return subpaths(element.get("d", ""))


def _polygon(element: ElementTree.Element) -> list[tuple[Array, bool]]:
    numbers = [float(one) for one in re.split(r"[\s,]+", element.get("points", "").strip()) if one]
    if len(numbers) % 2:
        raise ValueError(f"has {len(numbers)} coordinates, an odd number")
    return [(np.reshape(numbers, (-1, 2)), _tag(element) == "polygon")] if numbers else []


def _number(element: ElementTree.Element, name: str, default: float = 0.0) -> float:
    text = element.get(name)
    try:
        return default if text is None else float(text.removesuffix("px"))
    except ValueError:
        raise ValueError(f"has {name} = {shown(text)!r}, which is no number of user units") from None


def _line(element: ElementTree.Element) -> list[tuple[Array, bool]]:
    return [(np.reshape([_number(element, name) for name in ("x1", "y1", "x2", "y2")], (2, 2)), False)]


def _rect(element: ElementTree.Element) -> list[tuple[Array, bool]]:
    if element.get("rx") or element.get("ry"):
        raise ValueError("is a rectangle with round corners; convert it to a path")
    x, y, w, h = (_number(element, name) for name in ("x", "y", "width", "height"))
    return [(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]), True)]


def _ellipse(element: ElementTree.Element) -> list[tuple[Array, bool]]:
    x, y, r = (_number(element, name) for name in ("cx", "cy", "r"))
    a, b = _number(element, "rx", r), _number(element, "ry", r)
    if not (a > 0 and b > 0):
        raise ValueError("has no radius above 0")
    arcs = f"M{x - a!r} {y!r}A{a!r} {b!r} 0 0 1 {x + a!r} {y!r}A{a!r} {b!r} 0 0 1 {x - a!r} {y!r}Z"
    return subpaths(arcs)


_SHAPES = {
    "path": _path,
    "polygon": _polygon,
    "polyline": _polygon,
    "line": _line,
    "rect": _rect,
    "circle": _ellipse,
    "ellipse": _ellipse,
}


def _lines(element: ElementTree.Element, tag: str) -> list[tuple[Array, bool]]:
    """Return the lines of one element as points [N, 2] and whether each is closed; ValueError for what is no line."""
    lines = _SHAPES[tag](element)
    if not all(np.isfinite(points).all() for points, _ in lines):
        raise ValueError("has a coordinate that is no finite number")
    return lines


def _page(root: ElementTree.Element) -> Scale | None:
    """Return the size of a user unit on the page; None if the file does not state it in units of length."""
    sizes = [_LENGTH.fullmatch(root.get(name, "")) for name in ("width", "height")]
    box = re.split(r"[\s,]+", root.get("viewBox", "").strip())
    if not all(sizes) or len(box) != 4:
        return None
    try:
        pairs = zip(sizes, box[2:], strict=True)
        metres = [float(size[1]) * _PAGE_UNITS[size[2]] / float(extent) for size, extent in pairs if size]
    except (ValueError, ZeroDivisionError):
        return None
    if not all(math.isfinite(one) and one > 0 for one in metres):
        return None
    if max(metres) > (1 + _UNEQUAL) * min(metres) and root.get("preserveAspectRatio", "").startswith("none"):
        return None
    return Scale(min(metres), f"{min(metres) * 1e3:.6g} mm", "width, height and viewBox")
