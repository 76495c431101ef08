"""Draws panels of curves as SVG: black on white, round numbers on the axes, a legend below each panel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 360.0, 272.0, 56.0, 12.0, 26.0, 62.0
COLOURS = ("#222222", "#0b6fb8", "#c4500b")
WIDTHS = (3.2, 1.4, 1.4)  # the first curve is wider, so that it remains visible below another one
LETTER = 5.5  # approximate width of a letter


@dataclass(frozen=True)
class Line:
    """One curve with coordinates ``x`` [n] and ``y`` [n]; ``name``: its text in the legend.

    ``crosses``: draw a cross at each point instead of a curve; ``dots``: also mark the points of the curve with dots.
    """

    name: str
    x: Array
    y: Array
    crosses: bool = False
    dots: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes with at most three curves; ``x`` and ``y``: labels of the axes.

    ``shaded``: interval of x that is shaded; ``logarithmic``: whether the y axis is; ``holds``: values that the range
    of the y axis must include (their log10 on a logarithmic axis).
    """

    title: str
    x: str
    y: str
    lines: tuple[Line, ...]
    shaded: tuple[float, float] | None = None
    logarithmic: bool = False
    holds: tuple[float, ...] = ()


def svg(panels: Sequence[Panel], *, columns: int = 0) -> str:
    """Return ``panels`` as SVG text, in rows of ``columns`` panels; 0 puts all panels into one row."""
    across = columns or len(panels)
    width, height = WIDTH * across, HEIGHT * -(-len(panels) // across)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
        f'font-family="sans-serif" font-size="11"><rect width="100%" height="100%" fill="#ffffff"/>'
    ]
    for k, panel in enumerate(panels):
        x, y = WIDTH * (k % across), HEIGHT * (k // across)
        parts.append(f'<g transform="translate({x:g},{y:g})">{_panel(panel)}</g>')
    return "\n".join([*parts, "</svg>\n"])


def _panel(panel: Panel) -> str:
    x = np.concatenate([line.x for line in panel.lines])
    y = np.concatenate([*(_scaled(line.y, panel) for line in panel.lines), panel.holds])
    xs, ys = _ticks(x.min(), x.max()), _ticks(y.min(), y.max())
    parts = [f'<text x="{LEFT:g}" y="16" font-weight="bold">{escape(panel.title)}</text>']
    if panel.shaded:
        a, b = (_along(v, xs, LEFT, WIDTH - RIGHT) for v in panel.shaded)
        parts.append(
            f'<rect x="{a:.1f}" y="{TOP:g}" width="{b - a:.1f}" height="{HEIGHT - TOP - BOTTOM:g}" fill="#f0d9c8"/>'
        )
    parts += _axes(panel, xs, ys)
    for colour, stroke, line in zip(COLOURS, WIDTHS, panel.lines, strict=False):
        at_x, at_y = _along(line.x, xs, LEFT, WIDTH - RIGHT), _along(_scaled(line.y, panel), ys, HEIGHT - BOTTOM, TOP)
        parts.append(_drawn(at_x, at_y, colour, stroke, line))
    return "".join([*parts, *_legend(panel)])


def _axes(panel: Panel, xs: Array, ys: Array) -> list[str]:
    parts = []
    for value in xs:
        at_x = _along(value, xs, LEFT, WIDTH - RIGHT)
        parts.append(f'<line x1="{at_x:.1f}" x2="{at_x:.1f}" y1="{TOP:g}" y2="{HEIGHT - BOTTOM:g}" stroke="#dddddd"/>')
        parts.append(f'<text x="{at_x:.1f}" y="{HEIGHT - BOTTOM + 14:g}" text-anchor="middle">{value:g}</text>')
    for value in ys:
        at_y = _along(value, ys, HEIGHT - BOTTOM, TOP)
        shown = f"1e{value:g}" if panel.logarithmic else f"{value:g}"
        parts.append(f'<line x1="{LEFT:g}" x2="{WIDTH - RIGHT:g}" y1="{at_y:.1f}" y2="{at_y:.1f}" stroke="#dddddd"/>')
        parts.append(f'<text x="{LEFT - 4:g}" y="{at_y + 4:.1f}" text-anchor="end">{shown}</text>')
    centre, middle = (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2
    parts.append(f'<text x="{centre:g}" y="{HEIGHT - BOTTOM + 30:g}" text-anchor="middle">{escape(panel.x)}</text>')
    parts.append(
        f'<text transform="translate(12,{middle:g}) rotate(-90)" text-anchor="middle">{escape(panel.y)}</text>'
    )
    return parts


def _legend(panel: Panel) -> list[str]:
    parts, x, y = [], RIGHT, HEIGHT - 14
    for colour, line in zip(COLOURS, panel.lines, strict=False):
        parts.append(f'<rect x="{x:g}" y="{y - 6:g}" width="14" height="4" fill="{colour}"/>')
        parts.append(f'<text x="{x + 19:g}" y="{y:g}">{escape(line.name)}</text>')
        x += 19 + LETTER * len(line.name) + 10
    return parts


def _scaled(y: Array, panel: Panel) -> Array:
    return np.asarray(np.log10(y)) if panel.logarithmic else y


def _ticks(low: float, high: float) -> Array:
    """Return about six equally spaced round numbers that enclose [low, high]; the outer two are the axis limits."""
    raw = (high - low) / 5
    size = 10.0 ** np.floor(np.log10(raw))
    step = next(m * size for m in (1, 2, 2.5, 5, 10) if m * size >= raw)
    return np.asarray(np.round(np.arange(np.floor(low / step), np.ceil(high / step) + 1) * step, 10))


def _along(value: Array | float, ticks: Array, start: float, end: float) -> Array:
    """Map ``value`` on an axis with the given ``ticks`` to a position in the panel, from ``start`` to ``end``."""
    return np.asarray(start + (np.asarray(value) - ticks[0]) / (ticks[-1] - ticks[0]) * (end - start))


def _drawn(x: Array, y: Array, colour: str, stroke: float, line: Line) -> str:
    points = list(zip(x.tolist(), y.tolist(), strict=True))
    if line.crosses:
        path = "".join(f"M{a - 4:.1f} {b - 4:.1f}l8 8m0 -8l-8 8" for a, b in points)
    else:
        path = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in points)
    dots = "".join(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.5" fill="{colour}"/>' for a, b in points if line.dots)
    return f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="{stroke:g}"/>{dots}'
