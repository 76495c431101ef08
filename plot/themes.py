"""Figures in the dark colours of the web page and of the report."""

from __future__ import annotations

from typing import Any

from wingfit.plot import style
from wingfit.plot.style import Figure, objects

INK, QUIET, FAINT, LINE, GROUND = "#e6ebe9", "#9aa8a4", "#67736f", "#2e3836", "#121716"
SERIES = ("#5cc2c7", "#f0985c", "#b7a1ee", "#9aa8a4", "#dcc163", "#f08bb8")
BEFORE, AFTER = "#f5924e", "#63b8ee"
BAND = "rgba(103, 115, 111, 0.45)"
DARK = {
    style.INK: INK, style.QUIET: QUIET, style.FAINT: FAINT, style.LINE: LINE, style.GROUND: GROUND,
    style.BEFORE: BEFORE, style.AFTER: AFTER, style.BAND: BAND, **dict(zip(style.SERIES, SERIES, strict=True)),
}  # fmt: skip


def dark(figure: Figure) -> Figure:
    """Return ``figure``, one of this package, in dark colours; the figure itself stays light."""
    plain = figure.to_plotly_json()
    layout = {name: one for name, one in plain["layout"].items() if name != "template"}
    changed = _changed(plain | {"layout": layout | {"template": "plotly_dark"}})
    return objects().Figure(changed["data"], changed["layout"], changed.get("frames"))


def _changed(value: Any) -> Any:
    """Return ``value``, a part of a figure as plain data, with every colour of the light theme replaced."""
    if isinstance(value, dict):
        return {name: _changed(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(_changed(one) for one in value)
    return DARK.get(value, value) if isinstance(value, str) else value
