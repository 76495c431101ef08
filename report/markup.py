"""Build HTML and SVG elements.

Text that is not :class:`Markup` is escaped, so that text of a dataset never becomes markup.
"""

from __future__ import annotations

import re
from html import escape

_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ud800-\udfff]")  # no HTML file may contain these
_EMPTY = frozenset({"meta", "br", "line", "rect", "circle", "path"})


class Markup(str):
    """Text that is already HTML or SVG; neither :func:`escaped` nor Jinja escapes it."""

    __slots__ = ()

    def __html__(self) -> str:
        return self


def escaped(value: object) -> Markup:
    """Return ``value`` as markup: unchanged if it is markup (also that of a Jinja macro), else its text, escaped."""
    return Markup(value if hasattr(value, "__html__") else escape(_CONTROL.sub("\ufffd", str(value))))


def tag(element: str, *children: object, **attributes: object) -> Markup:
    """Return an HTML or SVG element with ``children`` and ``attributes``; those that are None are omitted.

    Names of attributes: ``class_`` is "class", ``stroke_width`` is "stroke-width"; numbers are rounded to 1/100.
    """
    shown = "".join(f' {_name(k)}="{_value(v)}"' for k, v in attributes.items() if v is not None)
    inside = joined(*children)
    if element in _EMPTY and not inside:
        return Markup(f"<{element}{shown}>" if element in {"meta", "br"} else f"<{element}{shown}/>")
    return Markup(f"<{element}{shown}>{inside}</{element}>")


def joined(*children: object) -> Markup:
    """Return ``children`` as one markup, each escaped; those that are None are omitted."""
    return Markup("".join(escaped(child) for child in children if child is not None))


def _name(attribute: str) -> str:
    return attribute.rstrip("_").replace("_", "-")


def _value(value: object) -> str:
    return f"{round(value, 2) + 0.0:g}" if isinstance(value, float) else escape(_CONTROL.sub("\ufffd", str(value)))
