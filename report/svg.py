"""Draw SVG charts: axes with round numbers, marks, colour levels, legends.

Coordinates are in units of which a drawing is about 360 wide, so that text keeps its size on a phone, where each
drawing fills the width. Colours are CSS classes, defined in style.css for light and dark.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby

from wingfit.diagnosis.finding import Interval
from wingfit.report.markup import Markup, joined, tag
from wingfit.report.number_format import number

LEVELS = 12  # colours of a map from zero to the maximum
SERIES = 6  # colours of curves, classes s0 to s5
SIDES = 6  # colours of a map on either side of zero
LEVEL_CLASSES = [f"l{k}" for k in range(LEVELS)]
SIDE_CLASSES = [f"d{k}" for k in range(2 * SIDES + 1)]
Points = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Axis:
    """Maps values from ``low`` to ``high`` to coordinates from ``start`` to ``end``."""

    low: float
    high: float
    start: float
    end: float
    logarithmic: bool = False

    def at(self, value: float) -> float:
        """Return the coordinate of ``value``; values beyond the ends are moved to them."""
        value = min(max(value, self.low), self.high)
        if self.logarithmic:
            part = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            part = (value - self.low) / (self.high - self.low)
        return self.start + part * (self.end - self.start)

    def ticks(self, count: int = 5) -> list[float]:
        """Return round values on the axis, about ``count`` of them."""
        if self.logarithmic:
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            found = [m * 10.0**p for p in powers for m in (1, 2, 5)]
            inside = [v for v in found if self.low * 0.999 <= v <= self.high * 1.001]
            return inside if len(inside) <= count + 3 else [v for v in inside if f"{v:e}"[0] == "1"]
        step = _step(self.high - self.low, count)
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        return [round(k * step, 12) for k in range(first, last + 1)]


def axis(values: Sequence[float], start: float, end: float, *, zero: bool = False, room: float = 0.05) -> Axis:
    """Return a linear axis from ``start`` to ``end`` that holds all ``values``, and the value 0 if ``zero``.

    ``room``: free part of the range at each end.
    """
    held = [*values, 0.0] if zero or not values else list(values)
    low, high = min(held), max(held)
    free = room * (high - low) if high > low else abs(high) * 0.1 or 1.0
    bottom = 0.0 if zero and low == 0 else low - free
    return Axis(bottom, high + free, start, end)


def drawing(width: float, height: float, label: str, *parts: object) -> Markup:
    """Return an SVG of ``parts`` that fills the width of its parent; ``label`` is its text alternative."""
    return tag("svg", *parts, viewBox=f"0 0 {width:g} {height:g}", role="img", aria_label=label)


def text(x: float, y: float, words: object, *, anchor: str = "start", class_: str | None = None) -> Markup:
    """Draw ``words`` at ``x`` with the baseline at ``y``; ``anchor``: which end, or the middle, is at ``x``."""
    return tag("text", words, x=x, y=y, text_anchor=None if anchor == "start" else anchor, class_=class_)


def turned_text(x: float, y: float, words: str) -> Markup:
    """Draw the label of a vertical axis, centred at (x, y)."""
    return tag("text", words, transform=f"translate({x:g},{y:g}) rotate(-90)", text_anchor="middle", class_="label")


def line(x1: float, y1: float, x2: float, y2: float, class_: str = "grid") -> Markup:
    """Draw a straight line from (x1, y1) to (x2, y2)."""
    return tag("line", x1=x1, y1=y1, x2=x2, y2=y2, class_=class_)


def places(across: Axis, x: Iterable[float], up: Axis, y: Iterable[float]) -> Points:
    """Return the coordinates of the points (x, y) on the axes ``across`` and ``up``."""
    return [(across.at(a), up.at(b)) for a, b in zip(x, y, strict=True)]


def curve(points: Points, class_: str, end: str = "") -> Markup | None:
    """Draw a line through ``points``, None without any; ``end`` "Z" closes the line."""
    return tag("path", d="M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + end, class_=class_) if points else None


def area(points: Points, class_: str) -> Markup | None:
    """Draw the area inside ``points``."""
    return curve(points, class_, "Z")


def band(low: Points, high: Points) -> Markup | None:
    """Draw the area between two lines."""
    return area([*low, *reversed(high)], "band")


def dots(points: Points, class_: str) -> Markup | None:
    """Draw ``points`` as one path with round line ends; the CSS class sets their size. None without points."""
    return tag("path", d="".join(f"M{x:.1f} {y:.1f}h0" for x, y in points), class_=class_) if points else None


def arrow(x: float, y: float, dx: float, dy: float, class_: str) -> Markup:
    """Draw an arrow from (x, y) along (dx, dy); the head of a short arrow is smaller."""
    length = math.hypot(dx, dy)
    if length < 0.5:
        return tag("circle", cx=x, cy=y, r=1.2, class_=class_)
    head = min(5.0, 0.5 * length) / length
    ends = "".join(
        f"M{x + dx:.1f} {y + dy:.1f}L{x + dx - head * (dx + s * dy):.1f} {y + dy - head * (dy - s * dx):.1f}"
        for s in (0.55, -0.55)
    )
    return tag("path", d=f"M{x:.1f} {y:.1f}L{x + dx:.1f} {y + dy:.1f}{ends}", class_=class_)


def whisker(along: Axis, y: float, interval: Interval, class_: str, factor: float = 1.0) -> Markup:
    """Draw a dot with its interval at the height ``y``; values are multiplied by ``factor``.

    An end without a bound is an arrow to the end of the axis.
    """
    parts: list[Markup] = []
    value = along.at(interval.value * factor)
    for bound, edge in ((interval.low, along.start), (interval.high, along.end)):
        if bound is None:
            parts.append(arrow(value, y, edge - value, 0, f"whisker {class_}"))
        else:
            end = along.at(bound * factor)
            parts.append(line(value, y, end, y, f"whisker {class_}"))
            if abs(end - value) > 5:
                parts.append(line(end, y - 2.5, end, y + 2.5, f"whisker {class_}"))
    return joined(*parts, tag("circle", cx=value, cy=y, r=3.6, class_=f"dot {class_}"))


def x_axis(along: Axis, top: float, bottom: float, label: str, ticks: Sequence[float] | None = None) -> Markup:
    """Draw grid lines, their numbers below, and the label below these (27 units in all)."""
    parts: list[Markup] = []
    for value in along.ticks() if ticks is None else ticks:
        at = along.at(value)
        parts += [line(at, top, at, bottom), text(at, bottom + 12, number(value), anchor="middle", class_="tick")]
    middle = (along.start + along.end) / 2
    return joined(*parts, text(middle, bottom + 25, label, anchor="middle", class_="label"))


def y_axis(up: Axis, left: float, right: float, label: str, *, count: int = 4) -> Markup:
    """Draw grid lines, their numbers to the left, and beside these the rotated label (about 46 units in all)."""
    parts: list[Markup] = []
    room = 36.0  # between the axis and the middle of the label
    for value in up.ticks(count):
        at, room = up.at(value), max(room, 12 + 6.2 * len(number(value)))
        parts += [line(left, at, right, at), text(left - 4, at + 3.5, number(value), anchor="end", class_="tick")]
    return joined(*parts, turned_text(left - room, (up.start + up.end) / 2, label))


def level(value: float, most: float) -> int:
    """Return the number of the colour of ``value`` on a map from 0 to ``most``: 0 to LEVELS - 1."""
    return min(LEVELS - 1, max(0, int(LEVELS * value / most))) if most > 0 else 0


def side(value: float, most: float) -> int:
    """Return the number of the colour of ``value`` on a map from -``most`` to ``most``: 0 to 2 SIDES; zero is SIDES."""
    return SIDES + max(-SIDES, min(SIDES, round(SIDES * value / most))) if most > 0 else SIDES


def cells(classes: Sequence[Sequence[str | None]], across: Axis, down: Axis) -> Markup:
    """Draw a grid of cells with the CSS ``classes`` [rows][columns], rows downwards; None: no cell.

    Equal neighbours of a row become one rectangle.
    """
    rows, columns = len(classes), len(classes[0])
    width, height = (across.end - across.start) / columns, (down.end - down.start) / rows
    paths: dict[str, list[str]] = {}
    for i, row in enumerate(classes):
        j, y = 0, down.start + i * height
        for name, run in groupby(row):
            count = len(list(run))
            x, wide = across.start + j * width, count * width + 0.2  # slightly wider, so that no gap shows
            j += count
            if name is not None:
                paths.setdefault(name, []).append(f"M{x:.2f} {y:.2f}h{wide:.2f}v{height + 0.2:.2f}h-{wide:.2f}z")
    return joined(*(tag("path", d="".join(pieces), class_=name) for name, pieces in sorted(paths.items())))


def colour_bar(
    across: Axis, y: float, classes: Sequence[str], label: str, mark: tuple[float, str] | None = None
) -> Markup:
    """Draw a bar of the colours ``classes`` over ``across``, 44 units high; ``mark``: a value and its name."""
    width = (across.end - across.start) / len(classes)
    parts = [
        tag("rect", x=across.start + k * width, y=y, width=width + 0.3, height=9.0, class_=name)
        for k, name in enumerate(classes)
    ]
    for value in across.ticks(4):
        at = across.at(value)
        parts += [line(at, y + 9, at, y + 12, "axis"), text(at, y + 23, number(value), anchor="middle", class_="tick")]
    if mark is not None:
        at = across.at(mark[0])
        anchor = "start" if at < (across.start + across.end) / 2 else "end"
        parts += [line(at, y - 4, at, y + 11, "mark"), text(at, y - 6, mark[1], anchor=anchor, class_="tick")]
    middle = (across.start + across.end) / 2
    return joined(*parts, text(middle, y + 37, label, anchor="middle", class_="label"))


def bar(part: float, class_: str) -> Markup:
    """Draw a bar that fills the fraction ``part`` (0 to 1) of the width of its parent."""
    shown = min(1.0, max(0.0, part))
    return tag(
        "svg",
        tag("rect", x=0, y=0, width=100, height=8, class_="trough"),
        tag("rect", x=0, y=0, width=100 * shown, height=8, class_=class_) if shown else None,
        viewBox="0 0 100 8",
        preserveAspectRatio="none",
        aria_hidden="true",
        class_="bar",
    )


def legend(*entries: tuple[str, str]) -> Markup:
    """Draw a legend; each entry is (kind, name), and ``kind`` is one of the symbols defined below."""
    swatches: dict[str, Callable[[], object]] = {
        "before": lambda: tag("circle", cx=9, cy=6, r=3.6, class_="dot before"),
        "after": lambda: tag("circle", cx=9, cy=6, r=3.6, class_="dot after"),
        "floor": lambda: line(9, 1, 9, 11, "floor"),
        "before-line": lambda: line(1, 6, 17, 6, "curve before"),
        "after-line": lambda: line(1, 6, 17, 6, "curve after"),
        "noise-line": lambda: line(1, 6, 17, 6, "noise"),
        "recorded": lambda: dots([(3, 6), (9, 6), (15, 6)], "samples"),
        "hatched": lambda: tag("rect", x=2, y=1, width=14, height=10, class_="faint"),
        "points": lambda: dots([(3, 6), (9, 6), (15, 6)], "points"),
        "band": lambda: tag("rect", x=2, y=2, width=14, height=8, class_="band"),
        "place": lambda: tag("rect", x=2, y=1, width=14, height=10, class_="place"),
    }
    swatches |= {f"s{k}": partial(line, 1, 6, 17, 6, f"curve s{k}") for k in range(SERIES)}
    items = [
        tag("li", tag("svg", swatches[kind](), viewBox="0 0 18 12", aria_hidden="true"), name) for kind, name in entries
    ]
    return tag("ul", *items, class_="legend")


def _step(extent: float, count: int) -> float:
    raw = extent / count
    size = 10.0 ** math.floor(math.log10(raw))
    return next(m * size for m in (1, 2, 2.5, 5, 10) if m * size >= raw * 0.999)
