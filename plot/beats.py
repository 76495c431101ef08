"""Figures over the beat or over time: recorded and simulated values, residuals, forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wingfit.plot.curves import PHASE, QUANTITIES, Curves, curves_of, force_scale
from wingfit.plot.misfits import Misfit, misfits_of
from wingfit.plot.style import (
    ACCENT,
    AFTER,
    BAND,
    BEFORE,
    BOTTOM,
    FAINT,
    INK,
    PHASE_TICKS,
    ROW,
    SERIES,
    TOP,
    Figure,
    finish,
    grid,
    objects,
    plain,
)
from wingfit.records.array_types import Array

MOST_CURVES = 6  # drawn, unless recording or channels are named
VALUES, RESIDUAL = 0.66, 0.34  # parts of the height of a pair of charts
SYMBOLS = ("circle", "x")
Line = dict[str, Any]


def comparison(source: object, recording: str | None = None, channels: Sequence[str] | None = None) -> Figure:
    """Draw recorded and simulated values over the beat or over time, and the residual of each channel below it.

    Recorded values are dots, or a line with a band of one standard deviation between beats; each simulation has its own
    colour and dash. Residuals are recorded minus simulated values, in the unit of the channel, on an axis of their own.

    Args:
        source: a :class:`wingfit.Finding` or its JSON, an answer of :meth:`wingfit.Client.comparison`, ``simulate``,
            ``forces`` or ``simulate_forces``, or the result of a run on series (:class:`wingfit.SeriesResult` or JSON).
        recording: draw only its channels; None: of all that ``source`` has.
        channels: names of the channels to draw: of tracks "MARKER_x", "MARKER_y", "MARKER_z" (mm), of forces "x",
            "z", "lift", "drag" (N or mN). None: up to 6; of tracks the heights z of up to 4 markers from root to tip.

    Raises:
        TypeError: ``source`` has no recorded and simulated values.
        ValueError: there are none of this recording or of these channels; the message names those that there are.
    """
    curves = curves_of(source, recording, channels)
    shown = curves if channels else curves[:MOST_CURVES]
    titles = [title for one in shown for title in (plain(one.title), "")]
    gap = min(0.06, 0.5 / len(titles))
    figure = grid(
        2 * len(shown), row_heights=[VALUES, RESIDUAL] * len(shown), subplot_titles=titles, vertical_spacing=gap
    )
    for k, one in enumerate(shown):
        # A title of the axis would reach into the title of the next channel.
        below = shown[k + 1].x_label if k + 1 < len(shown) else ""
        _pair(figure, one, 2 * k + 1, x_title="" if one.x_label == below else one.x_label)
    left = len(curves) - len(shown)
    more = f"; {left} more channels are not drawn" if left else ""
    return finish(
        figure, f"Recorded and simulated{more}", TOP + BOTTOM + int(1.6 * ROW) * len(shown), hovermode="x unified"
    )


def residual(source: object, recording: str | None = None) -> Figure:
    """Draw the misfit over the beat.

    Of a finding: root mean square over all recordings, before and after effects are added, on one colour scale over
    span and phase for tracks, as curves for forces; with the misfit by noise alone. Of tracks: distance between
    recorded and simulated markers in mm, the mean of the markers and the largest. Of forces and series: recorded minus
    simulated values.

    Args:
        source: as for :func:`comparison`.
        recording: draw the residuals of its channels; None: all.

    Raises:
        TypeError, ValueError: as :func:`comparison`.
    """
    found = misfits_of(source, recording)[:MOST_CURVES]
    if found[0].maps:
        return _maps(found[0])
    figure = grid(len(found), subplot_titles=[plain(one.title) for one in found], vertical_spacing=0.3 / len(found))
    for row, one in enumerate(found, 1):
        for k, (name, values) in enumerate(one.lines.items()):
            figure.add_trace(_line(name, one.x, values, _look(name, k), row == 1), row, 1)
        if one.noise is not None:
            figure.add_hline(one.noise, line={"color": INK, "dash": "dot", "width": 1.3}, row=row, col=1)
            figure.add_annotation(
                text="noise", x=1, xref="x domain", y=one.noise, xanchor="right", yanchor="bottom", showarrow=False
            )
        _axes(figure, row, one.x_label, f"{'residual' if one.signed else 'misfit'}, {one.unit}", zero=True)
    return finish(figure, "Residual over the beat", TOP + BOTTOM + ROW * len(found), hovermode="x unified")


def forces(source: Mapping[str, Any], quantities: Sequence[str] | None = None) -> Figure:
    """Draw forces over the beat.

    Args:
        source: an answer of :meth:`wingfit.Client.forces` or ``simulate_forces`` (drawn as by :func:`comparison`), of
            ``predict``, ``loads``, or of ``simulate`` with loads (lift and thrust, in N or mN, over the phase [N]).
        quantities: "lift", "drag", "x", "z" or "thrust"; None: all that ``source`` has.

    Raises:
        TypeError: ``source`` has no forces.
        ValueError: a quantity is not among its forces; the message names those that are.
    """
    if "recorded_n" in source:
        return comparison(source, channels=quantities)
    outputs = source.get("outputs", source)
    known = {name: outputs[f"{name}_n"] for name in ("lift", "drag", "thrust", "x", "z") if f"{name}_n" in outputs}
    if not known or "phase" not in outputs:
        raise TypeError("there are no forces over the beat; give Client.forces(...), predict(...) or loads(...)")
    wrong = [name for name in quantities or () if name not in known]
    if wrong:
        raise ValueError(f"there are no forces {', '.join(wrong)}; there are {', '.join(known)}")
    values = {name: np.array(known[name], dtype=float) for name in quantities or known}
    factor, unit = force_scale(*values.values())
    figure = objects().Figure()
    phase = np.array(outputs["phase"], dtype=float)
    for k, (name, force) in enumerate(values.items()):
        look = {
            "color": SERIES[k % len(SERIES)],
            "dash": ("solid", "dash", "dot", "dashdot", "longdash")[k % 5],
            "width": 2,
        }
        figure.add_trace(_line(QUANTITIES.get(name, name), phase, factor * force, look, True))
    _axes(figure, None, PHASE, unit)
    return finish(figure, "Simulated forces over the beat", TOP + BOTTOM + int(1.3 * ROW), hovermode="x unified")


def _pair(figure: Figure, one: Curves, row: int, *, x_title: str) -> None:
    """Draw the curves of one channel into ``row``, and their residuals into the row below."""
    first = row == 1
    trace = objects().Scatter
    if one.spread is not None:
        for sign, fill in ((-1, None), (1, "tonexty")):
            edge = one.recorded + sign * one.spread
            look: Line = {"mode": "lines", "line": {"width": 0}, "fill": fill, "fillcolor": BAND, "hoverinfo": "skip"}
            figure.add_trace(trace(x=one.x, y=edge, showlegend=False, **look), row, 1)
        recorded: Line = {"mode": "lines", "line": {"color": INK, "width": 1.5}}
    else:
        recorded = {"mode": "markers", "marker": {"size": 5, "symbol": "circle-open", "color": INK}}
    figure.add_trace(
        trace(x=one.x, y=one.recorded, name="recorded", legendgroup="recorded", showlegend=first, **recorded), row, 1
    )
    for k, (name, values) in enumerate(one.models.items()):
        look = _look(name, k)
        figure.add_trace(_line(name, one.x, values, look, first), row, 1)
        left = _line(name, one.x, one.residual(name), look, False)
        if one.several_beats:  # a line would run to and fro
            left.update(mode="markers", marker={"size": 4, "color": look["color"], "symbol": SYMBOLS[k % 2]})
        figure.add_trace(left, row + 1, 1)
    _axes(figure, row, "", one.unit, one)
    _axes(figure, row + 1, x_title, f"residual{', ' if one.unit else ''}{one.unit}", one, zero=True)
    figure.update_xaxes(showticklabels=False, row=row, col=1)


def _line(name: str, x: Array, y: Array, look: Line, legend: bool) -> Any:
    return objects().Scatter(
        x=x, y=y, name=plain(name), mode="lines", line=look, legendgroup=name, showlegend=legend, connectgaps=False
    )


def _look(name: str, k: int) -> Line:
    """Return colour and dash of a simulation: before and after as in the report, nominal and best as on the page."""
    if name.startswith("before") or name == "nominal model, refitted":
        return {"color": BEFORE, "dash": "dash", "width": 2}
    if name.startswith("after"):
        return {"color": AFTER, "width": 2}
    if name == "nominal genome":
        return {"color": FAINT, "dash": "dot", "width": 2}
    if name.startswith("modelled"):  # over the line of the recorded mean beat, which shows between the dashes
        return {"color": ACCENT, "dash": "dash", "width": 2.5}
    return {"color": (ACCENT, SERIES[1])[k % 2], "dash": ("solid", "dash")[k % 2], "width": 2}


def _axes(figure: Figure, row: int | None, x: str, y: str, one: Curves | None = None, *, zero: bool = False) -> None:
    place = {} if row is None else {"row": row, "col": 1}
    ends = PHASE_TICKS if x == PHASE or (one is not None and one.x_label == PHASE) else {}
    if not ends and one is not None:
        ends = {"range": [float(one.x[0]), float(one.x[-1])]}
    figure.update_xaxes(title_text=x, title_standoff=4, showgrid=False, **ends, **place)
    figure.update_yaxes(title_text=y, nticks=6, zeroline=True, **({"rangemode": "tozero"} if zero else {}), **place)


def _maps(found: Misfit) -> Figure:
    """Draw the misfit of each model over span and phase, on one colour scale."""
    assert found.bands is not None  # noqa: S101  a misfit with maps has bands
    names = list(found.maps)
    figure = grid(1, len(names), subplot_titles=[plain(name) for name in names], shared_yaxes=True)
    for column, values in enumerate(found.maps.values(), 1):
        heat = objects().Heatmap(
            x=found.x,
            y=100 * found.bands,
            z=values,
            coloraxis="coloraxis",
            hovertemplate=f"phase %{{x:.2f}}, %{{y:.0f}} % of the span: %{{z:.3g}} {found.unit}<extra></extra>",
        )
        figure.add_trace(heat, 1, column)
        figure.update_xaxes(title_text=found.x_label, **PHASE_TICKS, row=1, col=column)
    figure.update_yaxes(title_text="part of the span, %", row=1, col=1)
    bar = {"title": {"text": f"misfit, {found.unit}"}}
    highest = max(float(np.nanmax(values)) for values in found.maps.values())
    noise = "" if found.noise is None else f"; noise alone gives {found.noise:.3g} {found.unit}"
    title = f"Residual over the beat: root mean square over all recordings{noise}"
    scale = {"colorscale": "Viridis", "cmin": 0, "cmax": highest, "colorbar": bar}
    return finish(figure, title, TOP + BOTTOM + int(1.3 * ROW), coloraxis=scale)
