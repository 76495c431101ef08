"""An HTML page about tracked films: the tracks, when each marker was found, and the residuals in each camera."""

from __future__ import annotations

from html import escape
from importlib import import_module
from typing import Any

import numpy as np

from wingfit.cameras.track.result import TrackedFilm

MOST_POINTS = 20_000  # drawn in one figure
PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Tracks of a wing</title>
<style>body {{ font-family: sans-serif; margin: 2rem; }}</style>
</head><body><h1>Tracks of a wing</h1>
{body}
</body></html>
"""


def film_report(found: TrackedFilm) -> str:
    """Return one HTML page about the tracks; it contains its script and loads nothing."""
    summary = found.as_json()
    lines = [
        f"{summary['instants']} instants over {summary['seconds']:.3f} s; {summary['markers_found_median']:g} of "
        f"{len(found.names)} markers in the median.",
        f"Error of a pixel beside that of its detection: {summary['pixel_error_px']} px.",
        *summary["remarks"],
    ]
    figures = [_found(found), _tracks(found), *(_residuals(found, k) for k in range(len(found.cameras)))]
    parts = [f"<p>{escape(line)}</p>" for line in lines]
    parts += [one.to_html(full_html=False, include_plotlyjs=number == 0) for number, one in enumerate(figures)]
    return PAGE.format(body="\n".join(parts))


def _found(found: TrackedFilm) -> Any:
    """Return a map of standard deviations over instants and markers; empty where a marker was not found."""
    go = import_module("plotly.graph_objects")
    deviation = 1e3 * np.sqrt(np.trace(found.covariance, axis1=2, axis2=3) / 3)
    rows = _some(len(found.times), len(found.names))
    scale = {"title": "mm"}
    heat = go.Heatmap(z=deviation[rows].T, x=rows, y=list(found.names), colorscale="Viridis", colorbar=scale)
    figure = go.Figure(heat)
    figure.update_layout(title="Standard deviation of each place", height=700, template="plotly_white")
    figure.update_xaxes(title_text="instant")
    return figure


def _tracks(found: TrackedFilm) -> Any:
    go = import_module("plotly.graph_objects")
    figure = go.Figure()
    rows = _some(len(found.times), len(found.names))
    for number, name in enumerate(found.names):
        x, y, z = found.positions[rows, number].T
        figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="lines+markers", name=name, marker={"size": 2}))
    axes = {axis: {"title": f"{axis[0]} (m)"} for axis in ("xaxis", "yaxis", "zaxis")}
    figure.update_layout(title="Tracks", height=800, scene={"aspectmode": "data", **axes}, template="plotly_white")
    return figure


def _residuals(found: TrackedFilm, camera: int) -> Any:
    """Return the residuals in one camera as vectors from the pixels, magnified."""
    go = import_module("plotly.graph_objects")
    rows = _some(len(found.times), len(found.names))
    pixels = found.pixels[rows, camera].reshape(-1, 2)
    errors = found.residuals[rows, camera].reshape(-1, 2)
    known = np.isfinite(errors).all(1)
    pixels, errors = pixels[known], errors[known]
    rms = float(np.sqrt(np.mean(errors**2))) if len(errors) else 0.0
    larger = round(20 / max(rms, 1e-3), -1)
    ends, gap = pixels + larger * errors, np.full(len(errors), np.nan)
    x, y = (np.column_stack([pixels[:, i], ends[:, i], gap]).ravel() for i in (0, 1))
    figure = go.Figure(go.Scattergl(x=x, y=y, mode="lines", hoverinfo="skip"))
    title = f"Camera {found.cameras[camera]}: residuals magnified {larger:g} times; RMS {rms:.3f} px"
    figure.update_layout(title=title, height=600, template="plotly_white")
    figure.update_xaxes(title_text="x (px)", constrain="domain")
    figure.update_yaxes(title_text="y (px)", autorange="reversed", scaleanchor="x")
    return figure


def _some(instants: int, markers: int) -> list[int]:
    """Return the numbers of instants that are drawn."""
    step = max(instants * markers // MOST_POINTS, 1)
    return list(range(0, instants, step))
