"""Draws a described wing from above: outline, stations, flapping axis, rods and markers, to scale.

The drawing stands alone; its colours are attributes, which the classes of a page override.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from wingfit.records import Vehicle, Wing
from wingfit.records.description.wing_plan import WingPlan, plan_of
from wingfit.report.markup import Markup, joined, tag

WIDTH, MARGIN, HEAD, FOOT = 720.0, 56.0, 46.0, 52.0
MOST_NAMES = 60  # markers beyond which their names would cover each other
_INK, _ROD, _MARKER, _FILL, _GRID = "#222222", "#0b6fb8", "#c4500b", "#eef3f7", "#c9d3db"


@dataclass(frozen=True)
class _Paper:
    """Coordinates of the drawing: span to the right, chord downwards, in units of the drawing per metre."""

    scale: float
    y0: float
    x0: float

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the place of the point ``x`` (aft), ``y`` (outboard), m, in the drawing."""
        return MARGIN + (y - self.y0) * self.scale, HEAD + (x - self.x0) * self.scale


def wing_drawing(wing: Wing | Vehicle | WingPlan) -> str:
    """Return an SVG of a described ``wing``, seen from above, with the root on the left and the leading edge on top.

    It shows the outline with its stations, the flapping axis, rods and markers with their names, and a scale.
    """
    plan = wing if isinstance(wing, WingPlan) else plan_of(wing)
    corners = _outline(plan)
    places = [*corners, *((x, y) for _, x, y in plan.markers)]
    for _, x_root, y_root, x_tip, y_tip in plan.rods:
        places += [(x_root, y_root), (x_tip, y_tip)]
    xs, ys = [x for x, _ in places], [y for _, y in places] + ([] if plan.hinge is None else [plan.hinge])
    paper = _Paper((WIDTH - 2 * MARGIN) / (max(ys) - min(ys)), min(ys), min(xs))
    bottom = HEAD + (max(xs) - min(xs)) * paper.scale
    parts = [
        tag("title", f"{plan.name}, seen from above"),
        tag("rect", x=0, y=0, width=WIDTH, height=bottom + FOOT, fill="#ffffff", class_="paper"),
        tag("text", plan.name, x=MARGIN, y=20, font_weight="bold", fill=_INK),
        _planform(plan, corners, paper),
        *_hinge(plan, paper, bottom),
        *(_rod(rod, paper) for rod in plan.rods),
        *_markers(plan, paper),
        _scale_bar(paper, bottom + FOOT - 14),
    ]
    drawn = tag(
        "svg",
        *parts,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {WIDTH:g} {bottom + FOOT:g}",
        role="img",
        font_family="sans-serif",
        font_size=11,
        class_="wing",
    )
    return f"{drawn}\n"


def _outline(plan: WingPlan) -> list[tuple[float, float]]:
    leading = [(edge, y) for y, edge, _ in plan.stations]
    return leading + [(edge + chord, y) for y, edge, chord in reversed(plan.stations)]


def _path(points: list[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{a:.2f} {b:.2f}" for a, b in points)


def _planform(plan: WingPlan, corners: list[tuple[float, float]], paper: _Paper) -> Markup:
    edge = _path([paper.at(*corner) for corner in corners]) + "Z"
    lines = "".join(_path([paper.at(x, y), paper.at(x + chord, y)]) for y, x, chord in plan.stations)
    return joined(
        tag("path", d=edge, fill=_FILL, stroke="none", class_="planform"),
        tag("path", d=lines, fill="none", stroke=_GRID, stroke_width=0.6, class_="stations"),
        tag("path", d=edge, fill="none", stroke=_INK, stroke_width=1.4, class_="outline"),
    )


def _hinge(plan: WingPlan, paper: _Paper, bottom: float) -> list[Markup]:
    if plan.hinge is None:
        return []
    across, _ = paper.at(paper.x0, plan.hinge)
    line = _path([(across, HEAD - 10), (across, bottom + 10)])
    return [
        tag("path", d=line, fill="none", stroke=_INK, stroke_width=1.2, stroke_dasharray="7 3 1.5 3", class_="hinge"),
        tag("text", "flapping axis", x=across + 4, y=HEAD - 6, fill=_INK, class_="hinge"),
    ]


def _rod(rod: tuple[str, float, float, float, float], paper: _Paper) -> Markup:
    name, x_root, y_root, x_tip, y_tip = rod
    root, tip = paper.at(x_root, y_root), paper.at(x_tip, y_tip)
    return joined(
        tag("path", d=_path([root, tip]), fill="none", stroke=_ROD, stroke_width=2.0, class_="rod"),
        tag("text", name, x=(root[0] + tip[0]) / 2, y=(root[1] + tip[1]) / 2 - 4, fill=_ROD, class_="rod"),
    )


def _markers(plan: WingPlan, paper: _Paper) -> list[Markup]:
    drawn = []
    for name, x, y in plan.markers:
        across, down = paper.at(x, y)
        fill = _MARKER if name in plan.reference_markers else "#ffffff"
        drawn.append(tag("circle", cx=across, cy=down, r=3.2, fill=fill, stroke=_MARKER, class_="marker"))
        if len(plan.markers) <= MOST_NAMES:
            drawn.append(tag("text", name, x=across + 5, y=down + 4, font_size=9, fill=_MARKER, class_="marker"))
    return drawn


def _scale_bar(paper: _Paper, down: float) -> Markup:
    """Draw a bar of a round length, about a fifth of the width."""
    raw = (WIDTH - 2 * MARGIN) / 5 / paper.scale
    size = 10.0 ** math.floor(math.log10(raw))
    length = max(m * size for m in (1, 2, 5) if m * size <= raw)
    end = MARGIN + length * paper.scale
    line = _path([(MARGIN, down - 4), (MARGIN, down), (end, down), (end, down - 4)])
    return joined(
        tag("path", d=line, fill="none", stroke=_INK, stroke_width=1.2, class_="scale"),
        tag("text", f"{length * 1e3:g} mm", x=end + 6, y=down, fill=_INK, class_="scale"),
    )
