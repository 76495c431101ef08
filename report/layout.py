"""Blocks of a page: the document itself, sections, figures, tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import TypeVar

from wingfit.report.markup import Markup, escaped, joined, tag

T = TypeVar("T")


def document(title: str, *body: object) -> str:
    """One HTML file with no script that loads nothing, for screen, phone and paper."""
    page = Template(content("document.html"))
    return page.substitute(title=escaped(title), style=content("style.css"), body=joined(*body))


def content(name: str) -> Markup:
    """A file of this folder, as markup."""
    return Markup(Path(__file__).with_name(name).read_text(encoding="utf-8"))


def section(heading: str, *parts: object) -> Markup:
    """A section with a heading."""
    return tag("section", tag("h2", heading), *parts)


def figure(caption: str, *parts: object, note: object = None) -> Markup:
    """A figure whose caption states its result; ``note`` explains the drawing."""
    below = None if note is None else tag("p", note, class_="note")
    return tag("figure", tag("figcaption", caption), *parts, below)


def panels(*drawings: object, size: str = "") -> Markup:
    """Drawings side by side where there is room, else below each other; ``size``: "small", "wide", or the usual one."""
    return tag("div", *drawings, class_=f"panels {size}".strip())


def table(head: Sequence[str], rows: Iterable[Sequence[object]], *, numbers: int = 0) -> Markup:
    """A table that scrolls where it is too wide; the last ``numbers`` columns are right-aligned."""
    first = len(head) - numbers
    top = tag("tr", *(tag("th", name, scope="col", class_=_side(k, first)) for k, name in enumerate(head)))
    body = [tag("tr", *(tag("td", cell, class_=_side(k, first)) for k, cell in enumerate(row))) for row in rows]
    return tag("div", tag("table", tag("thead", top), tag("tbody", *body)), class_="scroll", tabindex="0")


def table_of(items: Iterable[T], columns: Mapping[str, Callable[[T], object]], *, numbers: int = 0) -> Markup:
    """A table of a row for each of ``items``; ``columns``: of each heading, the function that gives the cell."""
    return table([*columns], [[cell(item) for cell in columns.values()] for item in items], numbers=numbers)


def folded(summary: str, *parts: object) -> Markup:
    """Details that open on a click, and are open on paper."""
    return tag("details", tag("summary", summary), *parts)


def _side(column: int, first: int) -> str | None:
    return "number" if column >= first else None
