"""Blocks of the page: sections, figures with the finding as their title, tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from wingfit.report.markup import Markup, tag


def section(heading: str, *parts: object) -> Markup:
    """A part of the page under its heading."""
    return tag("section", tag("h2", heading), *parts)


def figure(told: str, *parts: object, note: object = None) -> Markup:
    """A figure whose title says what one sees; ``note`` says how it is drawn."""
    below = None if note is None else tag("p", note, class_="note")
    return tag("figure", tag("figcaption", told), *parts, below)


def panels(*drawings: object, small: bool = False) -> Markup:
    """Drawings side by side where there is room, else below each other."""
    return tag("div", *drawings, class_="panels small" if small else "panels")


def table(head: Sequence[str], rows: Iterable[Sequence[object]], *, numbers: int = 0) -> Markup:
    """A table that scrolls by itself where it is too wide; the last ``numbers`` columns are set to the right."""
    first = len(head) - numbers
    top = tag("tr", *(tag("th", name, scope="col", class_=_side(k, first)) for k, name in enumerate(head)))
    body = [tag("tr", *(tag("td", cell, class_=_side(k, first)) for k, cell in enumerate(row))) for row in rows]
    return tag("div", tag("table", tag("thead", top), tag("tbody", *body)), class_="scroll", tabindex="0")


def folded(summary: str, *parts: object) -> Markup:
    """Details that open on a click, and are always open on paper."""
    return tag("details", tag("summary", summary), *parts)


def _side(column: int, first: int) -> str | None:
    return "number" if column >= first else None
