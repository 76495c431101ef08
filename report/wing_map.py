"""Draw the misfit of each marker on the wing, before and after effects are added, and its direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter

from wingfit.diagnosis.finding import Finding, Interval, MarkerMisfit
from wingfit.report import svg
from wingfit.report.layout import figure, panels
from wingfit.report.markup import Markup, joined, tag
from wingfit.report.number_format import Scale, capital, change, channel_scale, number, share, shortened, stages

WIDTH, LEFT, RIGHT, TOP = 360.0, 16.0, 344.0, 34.0
SLANT = 0.45  # oblique view from above and behind: drawn length, and sideways shift, of a unit length along x
ARROW = 46.0  # length of the longest arrow
MOST_ROWS = 24


def wing_map(finding: Finding) -> Markup | None:
    """Draw markers on the planform, or force axes, which have no position, as a list; None without either."""
    placed = [m for m in finding.markers if m.x is not None and m.y is not None]
    scale = channel_scale(finding)
    if placed:
        return _planforms(finding, placed, scale)
    return _axes(finding, scale) if finding.markers else None


def caption(finding: Finding, scale: Scale) -> str:
    """Return a sentence on the largest misfit."""
    worst = max(finding.markers, key=lambda m: m.before)
    what = "marker" if finding.kind == "tracks" else "force axis"
    if worst.before <= 0:
        return f"The misfit of every {what} is within the noise"
    place = "" if worst.span is None else f" at {share(worst.span)} of the span"
    return (
        f"Largest misfit beyond the noise, {what} {shortened(worst.name, 40)}{place}: "
        f"{change(finding, scale.text(worst.before), scale.text(worst.after))}"
    )


def _planforms(finding: Finding, placed: Sequence[MarkerMisfit], scale: Scale) -> Markup:
    plan = _Plan(finding, placed)
    most = max(max(m.before, m.after) for m in placed)
    maps = [
        plan.drawn(capital(name), [getattr(m, stage) for m in placed], most, scale)
        for stage, name in stages(finding).items()
    ]
    place = [("place", "estimated location")] if plan.place(finding) else []
    return figure(
        caption(finding, scale),
        panels(*maps, _directions(placed, plan, scale)),
        svg.legend(*place) if place else None,
        note="Seen from above, root left, leading edge on top. Circles: markers, coloured by the root mean square "
        "misfit beyond the noise over all recordings.",
    )


class _Plan:
    """Coordinates of the drawing: span to the right, chord downwards, to one scale."""

    def __init__(self, finding: Finding, placed: Sequence[MarkerMisfit]) -> None:
        self.finding, self.placed = finding, placed
        self.outline = [(p[0], p[1]) for p in finding.outline]
        points = [*self.outline, *((m.x or 0.0, m.y or 0.0) for m in placed)]
        self.x0, self.x1 = min(p[0] for p in points), max(p[0] for p in points)
        self.y0, self.y1 = min(p[1] for p in points), max(p[1] for p in points)
        self.size = min((RIGHT - LEFT - 12) / (self.y1 - self.y0 or 1.0), 240 / (self.x1 - self.x0 or 1e-9))
        self.bottom = TOP + 12 + (self.x1 - self.x0) * self.size
        self.points = [self.at(m.x or 0.0, m.y or 0.0) for m in placed]
        self.radius = _radius(self.points)

    def at(self, x: float, y: float) -> tuple[float, float]:
        return LEFT + 6 + (y - self.y0) * self.size, TOP + 6 + (x - self.x0) * self.size

    def drawn(self, title: str, values: Sequence[float], most: float, scale: Scale) -> Markup:
        marks = [
            tag(
                "circle",
                tag("title", f"{m.name}: {scale.text(v)}"),
                cx=x,
                cy=y,
                r=self.radius,
                class_=f"marker l{svg.level(v, most)}",
            )
            for m, (x, y), v in sorted(zip(self.placed, self.points, values, strict=True), key=itemgetter(2))
        ]
        k = max(range(len(values)), key=values.__getitem__)
        worst, at = self.placed[k], self.points[k]
        anchor = "end" if at[0] > WIDTH / 2 else "start"
        words = f"largest: {shortened(worst.name, 22)}, {scale.text(values[k])}"
        along = svg.Axis(0, (most or 1.0) * scale.factor, LEFT, RIGHT)
        label = f"misfit beyond the noise, {scale.unit}"
        return svg.drawing(
            WIDTH,
            self.bottom + 66,
            f"{title}; {words}",
            svg.text(LEFT, 14, title, class_="title"),
            svg.area([self.at(*p) for p in self.outline], "outline"),
            self.place(self.finding),
            *marks,
            tag("circle", cx=at[0], cy=at[1], r=self.radius + 2.5, class_="ring") if values[k] > 0 else None,
            svg.text(at[0], self.bottom + 12, words, anchor=anchor, class_="value") if values[k] > 0 else None,
            svg.line(at[0], at[1] + self.radius + 2.5, at[0], self.bottom + 2, "leader") if values[k] > 0 else None,
            svg.colour_bar(along, self.bottom + 24, svg.LEVEL_CLASSES, label),
        )

    def place(self, finding: Finding) -> Markup | None:
        """Draw the estimated location as a box, over the full chord where no part of the chord is estimated."""
        where = finding.where
        if where is None or where.span is None or not self.outline:
            return None
        (a, b), (c, d) = _ends(where.span), _ends(where.chord)
        y0, y1 = min(p[1] for p in self.outline), max(p[1] for p in self.outline)
        x0, x1 = min(p[0] for p in self.outline), max(p[0] for p in self.outline)
        left, right = (self.at(0, y0 + v * (y1 - y0))[0] for v in (a, b))
        top, bottom = (self.at(x0 + v * (x1 - x0), 0)[1] for v in (c, d))
        return tag("rect", x=left, y=top, width=max(right - left, 3), height=max(bottom - top, 3), class_="place")


def _directions(placed: Sequence[MarkerMisfit], plan: _Plan, scale: Scale) -> Markup:
    """Draw an oblique view of the wing, with arrows along the mean direction of the misfit at its largest."""
    reach = (plan.x1 - plan.x0) * SLANT
    size = (RIGHT - LEFT - 30) / (plan.y1 - plan.y0 + reach or 1.0)

    def at(x: float, y: float) -> tuple[float, float]:
        return (LEFT + 15 + (y - plan.y0 + (plan.x1 - x) * SLANT) * size, TOP + ARROW + (x - plan.x0) * SLANT * size)

    most = max(m.before for m in placed)
    arrows: list[Markup] = []
    for m in placed:
        start = at(m.x or 0.0, m.y or 0.0)
        length = ARROW * m.before / most if most > 0 else 0.0
        arrows.append(tag("circle", cx=start[0], cy=start[1], r=1.4, class_="point"))
        if length > 1:
            dx, dy, dz = m.direction
            arrows.append(svg.arrow(*start, length * (dy - SLANT * dx), length * (SLANT * dx - dz), "arrow"))
    bottom = TOP + ARROW + (plan.x1 - plan.x0) * SLANT * size
    base = bottom + 46
    title = "Direction of the largest misfit"
    return svg.drawing(
        WIDTH,
        bottom + 82,
        f"{title}: {_way(placed)}",
        svg.text(LEFT, 14, title, class_="title"),
        svg.text(LEFT, 29, _way(placed), class_="value"),
        svg.area([at(*p) for p in plan.outline], "outline"),
        *arrows,
        _triad(LEFT + 26, base + 8),
        svg.arrow(LEFT + 120, base, ARROW, 0, "arrow"),
        svg.text(LEFT + 126 + ARROW, base + 4, f"{scale.text(most)} beyond the noise", class_="tick"),
        svg.text(LEFT + 120, base + 24, "x aft, y to the tip, z up", class_="tick"),
    )


def _triad(x: float, y: float) -> Markup:
    ends = {"x": (-24 * SLANT, 24 * SLANT), "y": (26.0, 0.0), "z": (0.0, -26.0)}
    parts = [svg.arrow(x, y, dx, dy, "frame") for dx, dy in ends.values()]
    names = [
        svg.text(x + 1.4 * dx - 1, y + 1.4 * dy + (0 if name == "z" else 4), name, class_="tick", anchor="middle")
        for name, (dx, dy) in ends.items()
    ]
    return joined(*parts, *names)


def _way(placed: Sequence[MarkerMisfit]) -> str:
    """Return a text on the axis and the phase of the largest part of the mean-square misfit."""
    weights = [m.before**2 for m in placed]
    if not sum(weights):
        return "no direction: no misfit beyond the noise"
    parts = [sum(w * m.direction[k] ** 2 for w, m in zip(weights, placed, strict=True)) for k in range(3)]
    most = max(range(3), key=parts.__getitem__)
    turn = [
        sum(w * f(2 * math.pi * m.worst) for w, m in zip(weights, placed, strict=True)) for f in (math.cos, math.sin)
    ]
    together = math.hypot(*turn) / sum(weights)
    phase = (math.atan2(turn[1], turn[0]) / (2 * math.pi)) % 1
    when = f"at phase {number(phase, 2)}" if together > 0.5 else "at different phases"
    part = parts[most] / (sum(parts) or 1.0)
    return f"{share(part)} along {'xyz'[most]}, {when} of the beat"


def _radius(points: Sequence[tuple[float, float]]) -> float:
    """Return the radius of the circles at ``points``: small enough that close markers hardly overlap."""
    nearest = sorted(
        min((math.dist(a, b) for j, b in enumerate(points) if j != i), default=16.0) for i, a in enumerate(points)
    )
    return min(8.0, max(3.0, 0.55 * nearest[len(nearest) // 4]))


def _ends(place: Interval | None) -> tuple[float, float]:
    if place is None:
        return 0.0, 1.0
    low, high = (place.value if v is None else v for v in (place.low, place.high))
    return max(0.0, low), min(1.0, high)


def _axes(finding: Finding, scale: Scale) -> Markup:
    """Draw the misfit of every channel without a position, largest first."""
    shown = sorted(finding.markers, key=lambda m: -m.before)[:MOST_ROWS]
    most = max(max(m.before, m.after) for m in shown) * scale.factor or 1.0
    along = svg.Axis(0, 1.05 * most, 12, 348)
    bottom = 12 + 30.0 * len(shown)
    parts: list[Markup] = [svg.x_axis(along, 8, bottom, f"misfit beyond the noise, root mean square, {scale.unit}")]
    for k, m in enumerate(shown):
        y = 34.0 + 30 * k
        name = f"{shortened(m.name, 36)}, largest at phase {number(m.worst, 2)}"
        parts.append(svg.text(12, y - 9, name, class_="value"))
        if "after" in stages(finding):
            parts.append(svg.line(along.at(m.before * scale.factor), y, along.at(m.after * scale.factor), y, "leader"))
        for stage in stages(finding):
            value = getattr(m, stage)
            parts.append(svg.whisker(along, y, Interval(value, value, value), stage, scale.factor))
    left = len(finding.markers) - len(shown)
    return figure(
        caption(finding, scale),
        panels(svg.drawing(WIDTH, bottom + 32, caption(finding, scale), *parts)),
        svg.legend(*stages(finding).items()),
        note=f"{left} more in the JSON." if left else None,
    )
