"""Figures of what was estimated: hypotheses of a finding, and genes with their intervals and bounds."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any

from wingfit.plot.curves import finding_data
from wingfit.plot.gene_rows import GeneRow, Point, gene_rows
from wingfit.plot.style import (
    ACCENT,
    BOTTOM,
    FAINT,
    INK,
    LINE,
    QUIET,
    SERIES,
    TOP,
    Figure,
    finish,
    grid,
    log_axis,
    objects,
    plain,
)

MOST_HYPOTHESES = 12
NOMINAL = "nominal model alone"
WITH_WORDS = 190.0  # end of the axis of probabilities, %: the words stand beside the bars
LINE_PX, GAP_PX = 30, 52  # height of one interval, and room for ticks and title between genes
WIDE = 20.0  # ratio of the bounds from which their axis is logarithmic


def ranking(finding: object) -> Figure:
    """Draw the hypotheses of a finding, the most probable first: probability, misfit explained and predicted.

    Explained: fraction of the nominal model's mean-square misfit beyond the noise that a refit removes; pale where the
    hypothesis was not refitted, so that it is a linear estimate. Predicted: the same in recordings left out of the
    refit. Up to 12 hypotheses are drawn; the nominal model is among them.

    Args:
        finding: a :class:`wingfit.Finding`, or its JSON (:meth:`wingfit.Client.finding`).

    Raises:
        TypeError: ``finding`` is none.
        ValueError: it compares no hypotheses.
    """
    data = finding_data(finding)
    every = data["hypotheses"]
    if not every:
        raise ValueError("the finding compares no hypotheses")
    shown = [one for k, one in enumerate(every) if k < MOST_HYPOTHESES or not one["effects"]]
    names = [plain(" + ".join(one["effects"]) or NOMINAL) for one in shown]
    go = objects()
    figure = grid(1, 2, shared_yaxes=True, subplot_titles=["probability", "misfit explained"], horizontal_spacing=0.04)
    chances = [100 * one["probability"] for one in shown]
    words = [f"{_chance(one['probability'])}, ln evidence {one['evidence'] + 0.0:.1f}" for one in shown]
    colour = [ACCENT if set(one["effects"]) == set(data["named"]) and one["effects"] else QUIET for one in shown]
    bars = {"orientation": "h", "textposition": "outside", "cliponaxis": False, "showlegend": False}
    figure.add_trace(go.Bar(x=chances, y=names, text=words, marker={"color": colour}, **bars), 1, 1)
    explained = [100 * one["explained"] for one in shown]
    sure = [1.0 if one["refitted"] or not one["effects"] else 0.4 for one in shown]
    marker = {"color": SERIES[0], "opacity": sure}
    bar = go.Bar(x=explained, y=names, orientation="h", name="explained (pale: not refitted)", marker=marker)
    figure.add_trace(bar, 1, 2)
    known = [
        (100 * one["predicted"], name) for one, name in zip(shown, names, strict=True) if one["predicted"] is not None
    ]
    if known:
        x, y = zip(*known, strict=True)
        diamond = {"symbol": "diamond", "size": 9, "color": SERIES[1], "line": {"color": "#ffffff", "width": 1}}
        figure.add_trace(go.Scatter(x=x, y=y, mode="markers", name="predicted when left out", marker=diamond), 1, 2)
    figure.update_yaxes(autorange="reversed", ticks="")
    figure.update_xaxes(title_text="%", tickvals=[0, 25, 50, 75, 100])
    figure.update_xaxes(range=[0, WITH_WORDS], row=1, col=1)
    figure.update_xaxes(range=[min(0.0, *explained), 105], row=1, col=2)
    left = len(every) - len(shown)
    more = f"; {left} less probable ones are not drawn" if left else ""
    return finish(figure, f"Hypotheses: verdict {data['verdict']}{more}", TOP + BOTTOM + 34 * (len(shown) + 1))


def _chance(part: float) -> str:
    """Return a probability in per cent, with < 1 % and > 99 % instead of 0 and 100 %."""
    return "< 1 %" if part < 0.005 else "> 99 %" if part > 0.995 else f"{part:.0%}".replace("%", " %")


def intervals(source: object, level: float = 0.95) -> Figure:
    """Draw the estimated genes with their intervals and bounds, each on an axis in its own unit.

    The interval of a result is the estimate ± z standard errors, with z of the normal distribution for ``level``. A
    finding states 90 % intervals, which are drawn as they are. The pale bar spans the bounds of the search, the hollow
    circle is the nominal value; of a finding, the value without effect. An end that the recordings do not bound is
    open. Axes whose bounds differ by more than a factor of 20 are logarithmic.

    Args:
        source: the result of a calibration (:class:`wingfit.Result`, :class:`wingfit.ForceResult`,
            :class:`wingfit.SeriesResult`, or an answer of :meth:`wingfit.Client.result` or ``genome``), or a finding
            (:class:`wingfit.Finding` or its JSON): the genes of its effects, or all if it has none.
        level: probability of the intervals of a result, in (0, 1).

    Raises:
        TypeError: ``source`` has no estimated genes.
        ValueError: ``level`` is not in (0, 1), or no gene was estimated.
    """
    if not 0 < level < 1:
        raise ValueError(f"level is {level}; it must lie in (0, 1), such as 0.95")
    found = gene_rows(source, NormalDist().inv_cdf(0.5 + level / 2))
    if not found.rows:
        raise ValueError("no gene was estimated")
    counts = [len(row.points) for row in found.rows]
    height = sum(LINE_PX * count for count in counts) + GAP_PX * (len(counts) - 1)
    titles = [plain(row.title) for row in found.rows]
    gap = GAP_PX / height if len(counts) > 1 else 0.0
    figure = grid(len(counts), subplot_titles=titles, row_heights=counts, vertical_spacing=gap)
    for k, row in enumerate(found.rows, 1):
        _row(figure, row, k)
    figure.update_layout(showlegend=False)
    finish(figure, f"Estimates with {100 * (found.level or level):g} % intervals", height + TOP + BOTTOM)
    figure.update_annotations(x=0, xanchor="left", font={"color": INK})
    return figure


def _row(figure: Figure, row: GeneRow, k: int) -> None:
    """Draw one gene: bounds, nominal value, and each estimate with its interval."""
    trace = objects().Scatter
    labels = [plain(point.label) for point in row.points]
    low, high = _range(row)
    bar = {"mode": "lines", "line": {"color": LINE, "width": 12}, "hoverinfo": "skip"}
    span = {"mode": "lines", "line": {"color": ACCENT, "width": 3}, "hoverinfo": "skip"}
    for label, point in zip(labels, row.points, strict=True):
        if row.bounds is not None:
            figure.add_trace(trace(x=list(row.bounds), y=[label, label], **bar), k, 1)
        if point.low is not None and point.high is not None:
            ends = [max(low, point.low), min(high, point.high)]
            figure.add_trace(trace(x=ends, y=[label, label], **span), k, 1)
        figure.add_trace(_dot(point, label, row.unit), k, 1)
    if row.nominal is not None:
        circle = {"symbol": "circle-open", "size": 10, "color": FAINT, "line": {"width": 2}}
        hover = "nominal %{x:.4g}<extra></extra>"
        x = [row.nominal] * len(labels)
        figure.add_trace(trace(x=x, y=labels, mode="markers", marker=circle, hovertemplate=hover), k, 1)
    figure.update_yaxes(showgrid=False, showticklabels=len(labels) > 1, autorange="reversed", row=k, col=1)
    wide = low > 0 and high / low > WIDE
    figure.update_xaxes(**(log_axis(low, high) if wide else {"range": [low, high], "nticks": 8}), row=k, col=1)


def _dot(point: Point, label: str, unit: str) -> Any:
    shown = {"color": ACCENT, "size": 9}
    text = f"{label}: %{{x:.4g}} {unit}<extra></extra>"
    return objects().Scatter(x=[point.value], y=[label], mode="markers", marker=shown, hovertemplate=text)


def _range(row: GeneRow) -> tuple[float, float]:
    """Return the ends of the axis of a gene: its bounds, or its intervals, and the values, with a margin."""
    ends = row.bounds or [v for p in row.points for v in (p.low, p.high) if v is not None and math.isfinite(v)]
    values = [*ends, *(p.value for p in row.points), *([] if row.nominal is None else [row.nominal])]
    low, high = min(values), max(values)
    if low > 0 and high / low > WIDE:
        return low / 1.15, high * 1.15
    margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    return low - margin, high + margin
