"""Line charts in a terminal: dots of Braille, or plain ASCII where the output is no terminal or not UTF-8.

Drawn here, because plotext, the library for it, is built for single platforms since its version 6 and keeps one figure
for the whole process; rich has no charts.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from rich.text import Text

from wingfit.cli.base.output import number, out, printable

PLAIN_WIDTH, PLAIN_HEIGHT = 80, 16  # characters, where there is no terminal
LEAST_WIDTH, LEAST_HEIGHT, MOST_HEIGHT = 40, 8, 24
AROUND = 6  # lines of a terminal that stay free: title, axis, legend, prompt
GLYPHS = "*ox+"
STYLES = ("cyan", "yellow", "magenta", "green")
# A Braille character has two columns of four dots; these are their bits, from the top.
BITS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
BRAILLE = 0x2800
STEPS = (1, 2, 5, 10)


@dataclass(frozen=True)
class Line:
    """A curve of N points; ``y`` None or NaN: a gap."""

    name: str
    x: Sequence[float]
    y: Sequence[float | None]


@dataclass(frozen=True)
class Chart:
    """Curves on common axes; ``breaks``: places on the x axis with a vertical line; ``zero``: show y = 0."""

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    logarithmic: bool = False
    zero: bool = False
    breaks: Sequence[float] = ()


@dataclass
class _Canvas:
    """Cells of ``width`` x ``height`` characters; each holds a bit pattern (Braille) or the number of a curve."""

    width: int
    height: int
    braille: bool
    dots: dict[tuple[int, int], int] = field(default_factory=dict)
    owner: dict[tuple[int, int], int] = field(default_factory=dict)

    @property
    def columns(self) -> int:
        return self.width * (2 if self.braille else 1)

    @property
    def rows(self) -> int:
        return self.height * (4 if self.braille else 1)

    def mark(self, column: int, row: int, curve: int) -> None:
        """Set the dot at ``column`` and ``row`` from the top left, if it lies on the canvas."""
        if not (0 <= column < self.columns and 0 <= row < self.rows):
            return
        if self.braille:
            cell = column // 2, row // 4
            self.dots[cell] = self.dots.get(cell, 0) | BITS[column % 2][row % 4]
            self.owner.setdefault(cell, curve)
            return
        cell = column, row
        if self.owner.get(cell, curve) != curve and column % 2:
            return  # two curves in one place: they alternate, and neither hides the other
        self.owner[cell] = curve

    def cell(self, column: int, row: int) -> tuple[str, str] | None:
        """Return character and style of a cell, None where it is empty."""
        curve = self.owner.get((column, row))
        if curve is None:
            return None
        if self.braille:
            return chr(BRAILLE + self.dots[column, row]), STYLES[curve % len(STYLES)]
        return GLYPHS[curve % len(GLYPHS)], ""


def show_chart(chart: Chart) -> None:
    """Print ``chart`` to standard output, in the size of the terminal."""
    console = out()
    terminal = console.is_terminal
    if terminal:
        width, height = max(console.width, LEAST_WIDTH), min(max(console.height - AROUND, LEAST_HEIGHT), MOST_HEIGHT)
    else:
        width, height = PLAIN_WIDTH, PLAIN_HEIGHT
    encoding = (sys.stdout.encoding or "").lower().replace("-", "")
    for line in drawn(chart, width, height, braille=terminal and encoding == "utf8"):
        console.print(line, soft_wrap=True)


def drawn(chart: Chart, width: int, height: int, *, braille: bool) -> list[Text]:
    """Return ``chart`` as lines of at most ``width`` characters; the curves take ``height`` lines."""
    points = [_points(line, chart.logarithmic) for line in chart.lines]
    every = [point for one in points for point in one if point is not None]
    title = [Text(_safe(chart.title, braille)[:width], style="bold")]
    if not every:
        return [*title, Text("no values to draw")]
    left, right = _ends([x for x, _ in every])
    low, high = _ends([y for _, y in every] + ([0.0] if chart.zero and not chart.logarithmic else []), room=0.04)
    choose = _log_ticks if chart.logarithmic else _ticks
    ticks = [(at, number(10**at if chart.logarithmic else at, 3)) for at in choose(low, high, max(2, height // 4))]
    margin = max(len(text) for _, text in ticks) + 1
    canvas = _Canvas(width - margin - 1, height, braille)
    for curve, one in enumerate(points):
        for column, row in _dots(one, canvas, (left, right), (low, high), dash=curve if braille else 0):
            canvas.mark(column, row, curve)
    beside = {_place(at, high, low, height): text for at, text in ticks}
    zero = _place(0.0, high, low, height) if chart.zero and low < 0 < high else None
    breaks = {_place(at, left, right, canvas.width) for at in chart.breaks}
    body = [_row(canvas, row, beside.get(row), margin, row == zero, breaks) for row in range(height)]
    return [
        *title,
        *([Text(_safe(chart.y_label, braille))] if chart.y_label else []),
        *body,
        Text(" " * margin + ("└" + "─" * canvas.width if braille else "+" + "-" * canvas.width)),
        Text(" " * (margin + 1) + _under(left, right, _safe(chart.x_label, braille), canvas.width)),
        _legend(chart, braille),
    ]


def _row(canvas: _Canvas, row: int, label: str | None, margin: int, zero: bool, breaks: set[int]) -> Text:
    plain = not canvas.braille
    edge = ("|" if plain else "│") if label is None else ("+" if plain else "┤")
    text = Text((label or "").rjust(margin - 1) + " " + edge)
    for column in range(canvas.width):
        empty = (":" if plain else "┊") if column in breaks else ("-" if plain else "╌") if zero else " "
        text.append(*(canvas.cell(column, row) or (empty, "dim")))
    text.rstrip()
    return text


def _points(line: Line, logarithmic: bool) -> list[tuple[float, float] | None]:
    """Return the points of a curve, None for a gap; the logarithms of y, where these are wanted."""
    found: list[tuple[float, float] | None] = []
    for x, y in zip(line.x, line.y, strict=True):
        if y is None or not math.isfinite(y) or (logarithmic and y <= 0):
            found.append(None)
        else:
            found.append((float(x), math.log10(y) if logarithmic else float(y)))
    return found


def _dots(
    points: list[tuple[float, float] | None],
    canvas: _Canvas,
    across: tuple[float, float],
    up: tuple[float, float],
    dash: int,
) -> Iterator[tuple[int, int]]:
    """Yield columns and rows of the dots of a curve; ``dash``: 0 all, 1 dashes, else single dots."""
    before: tuple[int, int] | None = None
    for point in points:
        if point is None:
            before = None
            continue
        here = _place(point[0], *across, canvas.columns), _place(point[1], up[1], up[0], canvas.rows)
        start = before or here
        steps = max(abs(here[0] - start[0]), abs(here[1] - start[1]), 1)
        for k in range(steps + 1):
            column = round(start[0] + (here[0] - start[0]) * k / steps)
            row = round(start[1] + (here[1] - start[1]) * k / steps)
            if dash == 0 or (dash == 1 and column % 6 < 3) or (dash > 1 and column % 4 == 0):
                yield column, row
        before = here


def _place(at: float, first: float, last: float, count: int) -> int:
    """Return the index, from 0, of the cell in which ``at`` lies on an axis from ``first`` to ``last``."""
    return min(max(int((at - first) / (last - first) * count), 0), count - 1)


def _ends(values: list[float], room: float = 0.0) -> tuple[float, float]:
    low, high = min(values), max(values)
    margin = room * (high - low) or (0.0 if high > low else 0.5 * abs(high) or 0.5)
    return low - margin, high + margin


def _ticks(low: float, high: float, most: int) -> list[float]:
    """Return at most ``most`` + 1 round numbers from ``low`` to ``high``."""
    power = 10.0 ** math.floor(math.log10((high - low) / most))
    step = next(digit * power for digit in STEPS if digit * power >= (high - low) / most * (1 - 1e-9))
    first = math.ceil(low / step)
    return [step * k for k in range(first, math.floor(high / step) + 1)]


def _log_ticks(low: float, high: float, most: int) -> list[float]:
    """Return logarithms of round numbers: 1, 2 and 5 x 10^n, or in a narrow or wide range as on a linear axis."""
    powers = range(math.floor(low), math.ceil(high) + 1)
    round_ones = [power + math.log10(digit) for power in powers for digit in (1, 2, 5)]
    inside = [at for at in round_ones if low <= at <= high]
    if len(inside) < 2:
        return [math.log10(value) for value in _ticks(10**low, 10**high, most)]
    return inside if len(inside) <= most + 1 else [at for at in inside if at == round(at)] or inside[:: len(inside)]


def _under(left: float, right: float, label: str, width: int) -> str:
    """Return the line below the axis: its ends and, in the middle, what it is."""
    first, last = number(left, 3), number(right, 3)
    return f"{first}{label.center(max(width - len(first) - len(last), 0))}{last}"


def _legend(chart: Chart, braille: bool) -> Text:
    text = Text()
    for k, line in enumerate(chart.lines):
        sample = ("⠤⠤⠤", "⠤ ⠤", "⠄ ⠄")[min(k, 2)] if braille else GLYPHS[k % len(GLYPHS)]
        text.append(f"{'   ' if k else ''}{sample} ", STYLES[k % len(STYLES)] if braille else "")
        text.append(_safe(line.name, braille))
    return text


def _safe(text: str, braille: bool) -> str:
    """Return ``text`` without control characters, and for a plain chart with ASCII alone."""
    text = printable(text).replace("\n", " ")
    if braille:
        return text
    for given, plain in (("×", "x"), ("²", "^2"), ("°", "deg "), ("−", "-"), ("–", "-")):
        text = text.replace(given, plain)
    return text.encode("ascii", "replace").decode()
