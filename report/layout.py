"""Blocks of a page: the document itself, figures, details. Templates (Jinja) are in templates/."""

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
    """A template, filled in: one HTML file with no script that loads nothing, for screen, phone and paper."""
    return _TEMPLATES.get_template(template).render(**values)


def figure(caption: str, *parts: object, note: object = None) -> Markup:
    """A figure whose caption states its result; ``note`` explains the drawing."""
    return tag("figure", tag("figcaption", caption), *parts, None if note is None else tag("p", note, class_="note"))


def panels(*drawings: object, size: str = "") -> Markup:
    """Drawings side by side where there is room, else below each other; ``size``: "small", "wide", or the usual one."""
    return tag("div", *drawings, class_=f"panels {size}".strip())


def folded(summary: str, *parts: object) -> Markup:
    """Details that open on a click, and are open on paper."""
    return tag("details", tag("summary", summary), *parts)
