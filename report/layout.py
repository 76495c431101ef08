"""Make the blocks of a page: the document, figures, details. Templates (Jinja) are in templates/."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from wingfit.report.markup import Markup, joined, tag

# A part that is None is left out; text is escaped by ``joined``, which also replaces control characters.
_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).with_name("templates")),
    autoescape=True,
    finalize=joined,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def render(template: str, **values: Any) -> str:
    """Return the HTML file that ``template``, a file name, gives with ``values``.

    It has no script, loads nothing, and suits screen, phone and paper.
    """
    return _TEMPLATES.get_template(template).render(**values)


def figure(caption: str, *parts: object, note: object = None) -> Markup:
    """Return a figure of ``parts`` whose caption states the result; ``note`` explains the drawing."""
    return tag("figure", tag("figcaption", caption), *parts, None if note is None else tag("p", note, class_="note"))


def panels(*drawings: object, size: str = "") -> Markup:
    """Return drawings side by side where there is room, else stacked; ``size``: "small", "wide", or "", the usual."""
    return tag("div", *drawings, class_=f"panels {size}".strip())


def folded(summary: str, *parts: object) -> Markup:
    """Return ``parts`` as details that open with a click on ``summary``, and are always open on paper."""
    return tag("details", tag("summary", summary), *parts)
