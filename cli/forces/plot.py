"""Recorded and modelled forces over the beat and their spectra, as a page that needs nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wingfit.cli.base.files import write_text
from wingfit.cli.base.output import note
from wingfit.cli.loads import COLOURS
from wingfit.client import force_answers as f

QUANTITIES = {"lift": "lift", "drag": "drag", "x": "X (forward)", "z": "Z (down)"}
DECADES = 8  # of a spectrum that are drawn: below, there is only rounding
BAND = "rgba(0, 114, 178, 0.2)"  # the colour of what was recorded, thinned
HEAD = 0.3  # decades left free above the highest peak

Drawn = list[dict[str, Any]]


def write_plot(answer: f.Forces, path: Path) -> None:
    """Write the page: a row for each force, the beat at the left, the spectrum at the right."""
    from plotly import graph_objects
    from plotly.subplots import make_subplots

    names = list(answer["recorded_n"])
    titles = [f"{QUANTITIES[name]}{what}" for name in names for what in ("", ", spectrum")]
    figure = make_subplots(rows=len(names), cols=2, subplot_titles=titles, vertical_spacing=0.08)
    for row, name in enumerate(names, 1):
        for column, traces in ((1, _beat(answer, name)), (2, _spectra(answer, name))):
            for trace in traces:
                legend = {"legendgroup": trace["name"], "showlegend": row == column == 1}
                figure.add_trace(graph_objects.Scatter(**trace, **legend), row=row, col=column)
        figure.update_yaxes(title_text="N", exponentformat="power", row=row, col=1)
        figure.update_yaxes(title_text="N²/Hz", type="log", exponentformat="power", dtick=2, row=row, col=2)
        if limits := _range(answer, name):
            figure.update_yaxes(range=limits, row=row, col=2)
    figure.update_xaxes(title_text="t*, beats", row=len(names), col=1)
    figure.update_xaxes(title_text="Hz", row=len(names), col=2)
    title = f"Forces of {answer['recording']}, coefficients: {answer['source']}"
    figure.update_layout(title=title, height=330 * len(names), template="plotly_white")
    write_text(path, figure.to_html(include_plotlyjs=True))
    note(f"plots written to {path}; open it in a browser")


def _beat(answer: f.Forces, name: f.Quantity) -> Drawn:
    """The band of one standard deviation between beats, where there are several, and both mean beats over it."""
    phase, recorded, spread = answer["phase"], answer["recorded_n"][name], answer["standard_deviation_n"].get(name)
    band: Drawn = []
    if spread:
        upper = [value + wide for value, wide in zip(recorded, spread, strict=True)]
        lower = [value - wide for value, wide in zip(recorded, spread, strict=True)]
        edges = {"x": [*phase, *phase[::-1]], "y": [*upper, *lower[::-1]], "name": "between beats, 1 sd"}
        band = [edges | {"fill": "toself", "fillcolor": BAND, "line": {"width": 0}, "hoverinfo": "skip"}]
    return [*band, _line(phase, recorded, "recorded"), _line(phase, answer["modelled_n"][name], "modelled")]


def _spectra(answer: f.Forces, name: f.Quantity) -> Drawn:
    """Both spectra, without the mean at 0 Hz, which has been taken off."""
    frequency = answer["frequency_hz"][1:]
    spectra = {"recorded": answer["recorded_spectrum_n2_hz"], "modelled": answer["modelled_spectrum_n2_hz"]}
    return [_line(frequency, found[name][1:], what) for what, found in spectra.items() if name in found]


def _range(answer: f.Forces, name: f.Quantity) -> list[float] | None:
    """Powers of ten between which a spectrum is drawn; None where there is none."""
    spectra = (answer["recorded_spectrum_n2_hz"], answer["modelled_spectrum_n2_hz"])
    highest = max((value for found in spectra for value in found.get(name, [])[1:]), default=0.0)
    if highest <= 0:
        return None
    top = math.log10(highest)
    return [top - DECADES, top + HEAD]


def _line(x: Sequence[float], y: Sequence[float], what: str) -> dict[str, Any]:
    colour = COLOURS[("recorded", "modelled").index(what)]
    return {"x": x, "y": y, "name": what, "mode": "lines", "line": {"width": 2, "simplify": False, "color": colour}}
