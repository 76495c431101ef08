"""Draw where the misfit lies in span, chord and phase, and how it scales with the condition."""

from __future__ import annotations

import math

from wingfit.diagnosis.finding import NAMING, Exponent, Finding, Interval, Where
from wingfit.report.layout import figure, panels
from wingfit.report.markup import Markup, joined, tag
from wingfit.report.number_format import Scale, bounds, capital, listed, number, percent, with_unit
from wingfit.report.svg import Axis, drawing, line, text, whisker, x_axis

WIDTH, LEFT, RIGHT = 360.0, 12.0, 348.0
MOST_HARMONICS = 8
LEVEL = 1.0  # an interval of an exponent that contains zero and is narrower shows that there is no dependence


def place(finding: Finding) -> Markup | None:
    """Draw bars for the location in span, chord and phase; harmonics; exponents. None for an adequate model."""
    where = finding.where
    if where is None:
        return None
    subject = "the named effect" if finding.verdict in NAMING else "the misfit"
    drawings = [d for d in (_strips(where), _harmonics(where, subject)) if d is not None]
    found = figure(where.words or "Location of the misfit", panels(*drawings)) if drawings else tag("p", where.words)
    return joined(found, _powers(where.exponents, subject))


def _strips(where: Where) -> Markup | None:
    named = (
        ("span", where.span, "root", "tip", 100.0, "%"),
        ("chord", where.chord, "leading edge", "trailing edge", 100.0, "%"),
        ("phase of the beat", where.phase, "0", "1", 1.0, ""),
    )
    rows = [row for row in named if row[1] is not None]
    if not rows:
        return None
    along = Axis(0, 1, LEFT, RIGHT)
    parts: list[Markup] = []
    for k, (name, interval, first, last, factor, unit) in enumerate(rows):
        y = 40.0 + 54 * k
        if interval is None:
            continue
        turns = interval is where.phase
        centre = with_unit(number(interval.value * factor), unit)
        at = along.at(interval.value % 1 if turns else interval.value)
        extent = f"{name}: {centre}"
        if interval.low is not None or interval.high is not None:
            extent += f", 90 % within {with_unit(bounds(interval, Scale(factor, unit)), unit)}"
        parts += [
            text(LEFT, y - 6, extent, class_="value"),
            tag("rect", x=LEFT, y=y, width=RIGHT - LEFT, height=12.0, class_="trough"),
            *(
                tag("rect", x=along.at(a), y=y, width=max(along.at(b) - along.at(a), 2.0), height=12.0, class_="strong")
                for a, b in _pieces(interval, turns=turns)
            ),
            line(at, y - 2, at, y + 14, "mark"),
            text(LEFT, y + 24, first, class_="tick"),
            text(RIGHT, y + 24, last, anchor="end", class_="tick"),
        ]
    title = f"Location, mainly along {where.axis}" if where.axis else "Location"
    return drawing(WIDTH, 22 + 54.0 * len(rows) + 4, title, text(LEFT, 14, title, class_="title"), *parts)


def _harmonics(where: Where, subject: str) -> Markup | None:
    shown = where.harmonics[:MOST_HARMONICS]
    if not shown or not any(shown):
        return None
    top, bottom = 50.0, 156.0
    wide = (RIGHT - LEFT) / len(shown)
    most = max(shown)
    parts: list[Markup] = []
    for k, part in enumerate(shown):
        x, tall = LEFT + wide * k, (bottom - top) * max(part, 0.0) / most
        parts.append(tag("rect", x=x + 0.15 * wide, y=bottom - tall, width=0.7 * wide, height=tall, class_="strong"))
        parts.append(text(x + wide / 2, bottom - tall - 4, percent(part), anchor="middle", class_="tick"))
        parts.append(text(x + wide / 2, bottom + 13, "mean" if k == 0 else str(k), anchor="middle", class_="tick"))
    title = "Harmonics of the flap frequency"
    return drawing(
        WIDTH,
        bottom + 32,
        title,
        text(LEFT, 14, title, class_="title"),
        text(LEFT, 29, f"fraction of the mean square of {subject}", class_="tick"),
        *parts,
        line(LEFT, bottom, RIGHT, bottom, "axis"),
        text((LEFT + RIGHT) / 2, bottom + 28, "harmonic", anchor="middle", class_="label"),
    )


def _powers(exponents: tuple[Exponent, ...], subject: str) -> Markup | None:
    if not exponents:
        return None
    ends = [v for e in exponents for v in (e.power.value, e.power.low, e.power.high) if v is not None]
    low, high = min(-1, math.floor(min(ends))), max(3, math.ceil(max(ends)))
    every = math.ceil((high - low) / 8)
    along = Axis(low - 0.3, high + 0.3, LEFT, RIGHT)
    bottom = 10 + 44.0 * len(exponents)
    parts: list[Markup] = [
        x_axis(along, 8, bottom, "exponent", [float(v) for v in range(low, high + 1, every)]),
        line(along.at(0), 8, along.at(0), bottom, "axis"),
    ]
    for k, e in enumerate(exponents):
        y = 44.0 * k + 40
        span = f"{number(e.low)} to {with_unit(number(e.high), e.unit)}"
        parts.append(text(LEFT, y - 12, f"{e.variable}: {number(e.power.value, 2)} ({span})", class_="value"))
        parts.append(whisker(along, y, e.power, "after"))
    caption = _scaling(exponents, subject)
    return figure(
        caption,
        panels(drawing(WIDTH, bottom + 30, caption, *parts)),
        note="Exponents of power laws in each variable, with 90 % intervals; in brackets the range of the recordings.",
    )


def _scaling(exponents: tuple[Exponent, ...], subject: str) -> str:
    """Return a sentence on how ``subject`` scales with the condition, as the intervals of the exponents show."""
    bounded = [
        (e, e.power.low, e.power.high) for e in exponents if e.power.low is not None and e.power.high is not None
    ]
    sure = [e for e, low, high in bounded if low * high > 0]
    level = [e.variable for e, low, high in bounded if low * high <= 0 and high - low < LEVEL]
    if not sure and not level:
        return f"The scaling of {subject} is not identifiable from these conditions"
    if not sure:
        return f"{capital(subject)} does not depend on " + listed(level, "or")
    return f"{capital(subject)} scales with " + listed(f"{e.variable}^{number(e.power.value, 2)}" for e in sure)


def _pieces(interval: Interval, *, turns: bool) -> list[tuple[float, float]]:
    """Return the parts of 0 to 1 that ``interval`` covers; with ``turns`` it is one of phases, which are periodic."""
    low, high = (interval.value if v is None else v for v in (interval.low, interval.high))
    if not turns:
        return [(max(low, 0.0), min(high, 1.0))]
    if high - low >= 1:
        return [(0.0, 1.0)]
    low, high = low % 1, high % 1 or 1.0
    return [(low, high)] if low <= high else [(0.0, high), (low, 1.0)]
