"""An HTML page about a calibration: errors of the pixels as magnified vectors and histograms, and what was rejected."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from importlib import import_module
from typing import Any

import numpy as np

from wingfit.cameras.calibrate.result import Calibration, PixelErrors
from wingfit.cameras.camera import Camera
from wingfit.records.array_types import Array

ARROW_SHARE = (
    0.05  # the root of the mean square of the vectors is drawn as long as this share of the width of the image
)
ROUND = (1, 2, 5)
BINS = 40
PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Calibration of cameras</title>
<style>
body {{ font-family: sans-serif; margin: 2rem; }}
td, th {{ padding: 0.2rem 0.8rem; text-align: left; white-space: nowrap; }}
</style>
</head><body><h1>Calibration of cameras</h1>
{body}
</body></html>
"""


def calibration_report(result: Calibration) -> str:
    """Return one HTML page about ``result``; it contains its script and loads nothing."""
    parts = [_summary(result), _table_of_cameras(result), _warnings(result), _rejected(result)]
    for number, (camera, errors) in enumerate(zip(result.cameras, result.errors, strict=True)):
        figure = _figure(camera, errors, [result.images[i] for i in errors.image])
        parts.append(figure.to_html(full_html=False, include_plotlyjs=number == 0))
    return PAGE.format(body="\n".join(parts))


def magnification(errors: Array, width: float) -> float:
    """Return by what ``errors`` [N, 2] (px) are magnified in an image of ``width`` px: 1, 2 or 5 times 10^n."""
    rms = float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) if len(errors) else 0.0
    if rms == 0:
        return 1.0
    wanted = ARROW_SHARE * width / rms
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in ROUND if step * power <= wanted * (1 + 1e-9)))


def _figure(camera: Camera, errors: PixelErrors, images: Sequence[str]) -> Any:
    """Return a plotly figure: vectors of errors in the image, and histograms of both coordinates."""
    go = import_module("plotly.graph_objects")
    larger = magnification(errors.errors, camera.size_px[0])
    titles = (f"Camera {camera.name}: errors, magnified {larger:g} times", f"RMS distance {errors.rms_px:.3f} px")
    figure = import_module("plotly.subplots").make_subplots(1, 2, column_widths=[0.65, 0.35], subplot_titles=titles)
    ends = errors.pixels + larger * errors.errors
    gap = np.full(len(ends), np.nan)
    x, y = (np.column_stack([errors.pixels[:, i], ends[:, i], gap]).ravel() for i in (0, 1))
    figure.add_trace(go.Scatter(x=x, y=y, mode="lines", name="predicted less observed", hoverinfo="skip"), 1, 1)
    points = errors.pixels.T
    dots = {"mode": "markers", "marker": {"size": 3}, "text": list(images), "name": "observed"}
    figure.add_trace(go.Scatter(x=points[0], y=points[1], **dots), 1, 1)
    # The same bins for both coordinates, so that their heights can be compared.
    end = float(np.abs(errors.errors).max(initial=0.0)) or 1.0
    bins = {"start": -end, "end": end, "size": 2 * end / BINS}
    for axis, name in enumerate("xy"):
        shown = {"xbins": bins, "autobinx": False, "opacity": 0.6, "name": f"error in {name}"}
        figure.add_trace(go.Histogram(x=errors.errors[:, axis], **shown), 1, 2)
    width, height = camera.size_px
    figure.update_xaxes(title_text="x (px)", range=[-0.5, width - 0.5], constrain="domain", row=1, col=1)
    figure.update_yaxes(title_text="y (px)", range=[height - 0.5, -0.5], scaleanchor="x", row=1, col=1)
    figure.update_xaxes(title_text="error (px)", row=1, col=2)
    figure.update_yaxes(title_text="points", row=1, col=2)
    figure.update_layout(barmode="overlay", height=560, template="plotly_white")
    return figure


def _summary(result: Calibration) -> str:
    lines = [
        f"RMS distance {result.rms_px:.4f} px; standard deviation of one coordinate {result.sigma0_px:.4f} px "
        f"({result.degrees_of_freedom} degrees of freedom).",
        f"Space: {result.world}.",
    ]
    if result.wand is not None:
        lines.append(
            f"Lengths of the wand: RMS error {result.wand.used_rms_percent:.3g} % in the frames used, "
            f"{result.wand.held_out_rms_percent:.3g} % in {len(result.wand.held_out_percent)} frames held out."
        )
    return "".join(f"<p>{escape(line)}</p>" for line in lines)


def _table_of_cameras(result: Calibration) -> str:
    rows = []
    errors = dict(zip(result.parameters, result.standard_errors, strict=True))
    for camera, own, coverage in zip(result.cameras, result.errors, result.coverage, strict=True):
        focal, centre = np.diag(camera.matrix)[:2], camera.matrix[:2, 2]
        values = [
            f"{value:.2f} ± {errors[f'{camera.name}.f_{axis}']:.2f}" for value, axis in zip(focal, "xy", strict=True)
        ]
        values += [
            f"{value:.2f} ± {errors[f'{camera.name}.c_{axis}']:.2f}" for value, axis in zip(centre, "xy", strict=True)
        ]
        place = ", ".join(f"{value:.4f}" for value in camera.centre)
        counts = [
            f"{len(np.unique(own.image))}",
            f"{len(own.pixels)}",
            f"{own.rms_px:.4f}",
            f"{100 * coverage.fraction:.0f}",
        ]
        rows.append([camera.name, *counts, *values, place])
    head = (
        "camera", "images", "points", "RMS distance (px)", "image covered (%)",
        "f_x (px)", "f_y (px)", "c_x (px)", "c_y (px)", "place (m)",
    )  # fmt: skip
    return _table(head, rows)


def _warnings(result: Calibration) -> str:
    return "".join(f"<p><strong>Warning:</strong> {escape(one)}.</p>" for one in result.warnings)


def _rejected(result: Calibration) -> str:
    if not result.rejected:
        return "<p>Nothing was rejected.</p>"
    rows = [
        [one.camera, one.image, "all" if one.points is None else str(one.points), one.reason] for one in result.rejected
    ]
    return "<h2>Rejected</h2>" + _table(("camera", "image", "points", "reason"), rows)


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"
