"""The look of all figures: colours of the light theme of the web page and of the report, axes and fonts."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

INK, QUIET, FAINT, LINE, GROUND = "#1d2422", "#5d6865", "#9aa5a2", "#dfe1de", "#ffffff"
SERIES = ("#1a6c72", "#c2591a", "#6a4fa3", "#5d6865", "#8a6a00", "#b0306a")
ACCENT = SERIES[0]
# Before and after effects are added; they also differ in their dashes (Okabe and Ito 2008).
BEFORE, AFTER = "#d55e00", "#0072b2"
BAND = "rgba(154, 165, 162, 0.35)"
PHASE = "phase of the beat"
PHASE_TICKS = {"range": [0, 1], "dtick": 0.25}
TOP, BOTTOM = 70, 90  # pixels above and below the charts
DECADES = 3  # of a logarithmic axis, from which only powers of ten are labelled
ROW = 210  # pixels of height for one chart over the beat

Figure = Any  # plotly.graph_objects.Figure: plotly has no types, and is imported with the first figure


def objects() -> Any:
    """Return the module plotly.graph_objects."""
    return import_module("plotly.graph_objects")


def grid(rows: int, columns: int = 1, **options: Any) -> Figure:
    """Return an empty figure with ``rows`` x ``columns`` charts; ``options``: those of plotly's make_subplots."""
    return import_module("plotly.subplots").make_subplots(rows=rows, cols=columns, **options)


def finish(figure: Figure, title: str, height: int, **layout: Any) -> Figure:
    """Give ``figure`` its ``title``, ``height`` (pixels) and the common look; return it."""
    figure.update_layout(
        title={"text": plain(title), "x": 0, "xref": "paper", "font": {"size": 15, "color": INK}},
        height=height,
        template="plotly_white",
        paper_bgcolor=GROUND,
        plot_bgcolor=GROUND,
        font={"size": 12, "color": QUIET},
        legend={"orientation": "h", "x": 0, "yref": "container", "y": 0.0, "yanchor": "bottom", "font": {"color": INK}},
        margin={"l": 60, "r": 20, "t": TOP, "b": BOTTOM},
        **layout,
    )
    figure.update_xaxes(gridcolor=LINE, linecolor=LINE, zeroline=False, automargin=True)
    figure.update_yaxes(gridcolor=LINE, linecolor=LINE, zerolinecolor=FAINT, automargin=True)
    figure.update_annotations(font={"size": 12, "color": QUIET})
    return figure


def log_axis(low: float, high: float) -> dict[str, Any]:
    """Return a logarithmic axis from ``low`` to ``high``, both positive; ticks are at 1, 2, 5 x 10^n, or at 10^n."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    digits = (1, 2, 5) if math.log10(high / low) < DECADES else (1,)
    ticks = [digit * 10.0**power for power in powers for digit in digits]
    shown = [tick for tick in ticks if low <= tick <= high]
    ends = [math.log10(low), math.log10(high)]
    return {"type": "log", "range": ends, "tickvals": shown, "ticktext": [f"{tick:.3g}" for tick in shown]}


def plain(text: str) -> str:
    """Return ``text``, such as the name of a recording, without characters that plotly would read as markup."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def spoken(name: str) -> str:
    """Return the name of an effect or setting in words: underscores become spaces."""
    return name.replace("_", " ")
