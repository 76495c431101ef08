"""Blocks of a page: the document itself, sections, figures, tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

from wingfit.report.markup import Markup, tag

_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def document(title: str, *body: object) -> str:
    """One HTML file with no script that loads nothing, for screen, phone and paper."""
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
        tag("title", title),
        tag("style", _style_sheet()),
    )
    return f"<!DOCTYPE html>\n{tag('html', head, tag('body', *body), lang='en')}\n"


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


def folded(summary: str, *parts: object) -> Markup:
    """Details that open on a click, and are open on paper."""
    return tag("details", tag("summary", summary), *parts)


def _side(column: int, first: int) -> str | None:
    return "number" if column >= first else None


@cache
def _style_sheet() -> Markup:
    return Markup(Path(__file__).with_name("style.css").read_text(encoding="utf-8"))
