"""Draw a page of line charts as one HTML file, for the plots of the command line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from wingfit.records.array_types import Array
from wingfit.report.layout import figure, panels, render
from wingfit.report.markup import Markup, tag
from wingfit.report.svg import SERIES, Axis, axis, band, curve, dots, drawing, legend, x_axis, y_axis

WIDTH, LEFT, RIGHT, TOP, BOTTOM = 480.0, 62.0, 470.0, 10.0, 210.0
Values = Sequence[float] | Array
DECADES = 8  # shown of a logarithmic axis: smaller values are rounding errors


@dataclass(frozen=True)
class Curve:
    """Values ``y`` over ``x``, drawn as a line, as ``dots``, or as a ``band`` between its lower and its upper ends.

    ``name``: its text in the legend.
    """

    name: str
    x: Values
    y: Values
    dots: bool = False
    band: tuple[Values, ...] = ()


@dataclass(frozen=True)
class Chart:
    """Curves on common axes; ``logarithmic``: the y axis."""

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    logarithmic: bool = False


def chart_page(title: str, charts: Sequence[Chart]) -> str:
    """Return one HTML file with all ``charts`` that have values; it contains no script and loads nothing."""
    figures = [_figure(chart) for chart in charts if any(map(_finite, chart.curves))]
    body = tag("main", tag("h1", title), panels(*figures, size="wide"))
    return render("document.html", title=title, body=body)


def _figure(chart: Chart) -> Markup:
    across = axis([x for one in chart.curves for x, _ in _finite(one)], LEFT, RIGHT, room=0)
    up = _y_axis(chart)
    entries, drawn, colour = [], [], 0
    for one in chart.curves:
        kind = "band" if one.band else "points" if one.dots else f"s{colour % SERIES}"
        colour += kind.startswith("s")
        entries.append((kind, one.name))
        drawn += _drawn(one, kind, across, up)
    return figure(
        chart.title,
        drawing(
            WIDTH,
            BOTTOM + 34,
            f"{chart.title}: {', '.join(one.name for one in chart.curves)}",
            x_axis(across, TOP, BOTTOM, chart.x_label),
            y_axis(up, LEFT, RIGHT, chart.y_label),
            *drawn,
        ),
        legend(*entries),
    )


def _drawn(one: Curve, kind: str, across: Axis, up: Axis) -> list[Markup | None]:
    if one.band:
        low, high = ([(across.at(x), up.at(y)) for x, y in _pairs(one.x, edge)] for edge in one.band)
        return [band(low, high)]
    if one.dots:
        return [dots([(across.at(x), up.at(y)) for x, y in _finite(one)], "points")]
    runs = groupby(zip(one.x, one.y, strict=True), key=lambda point: math.isfinite(point[1]))
    pieces = [[(across.at(x), up.at(y)) for x, y in run] for seen, run in runs if seen]
    return [curve(piece, f"curve {kind}") for piece in pieces]  # a gap in the data is a gap in the curve


def _y_axis(chart: Chart) -> Axis:
    values = [y for one in chart.curves for edge in (one.band or (one.y,)) for _, y in _pairs(one.x, edge)]
    highest = max(values, default=0.0)
    if not chart.logarithmic or highest <= 0:
        return axis(values, BOTTOM, TOP)
    return Axis(highest / 10**DECADES, 2 * highest, BOTTOM, TOP, logarithmic=True)


def _finite(one: Curve) -> list[tuple[float, float]]:
    return _pairs(one.x, one.y)


def _pairs(x: Values, y: Values) -> list[tuple[float, float]]:
    return [(float(a), float(b)) for a, b in zip(x, y, strict=True) if math.isfinite(a) and math.isfinite(b)]
