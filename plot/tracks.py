"""The figure of the wing: recorded and simulated markers in 3-D, and their difference."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wingfit.plot.curves import kind_of, track_arrays
from wingfit.plot.style import ACCENT, INK, LINE, QUIET, SERIES, Figure, finish, objects, plain
from wingfit.records.array_types import Array

MOST_FRAMES = 40  # that the slider shows: more make a file of many megabytes
MARGIN_MM = 10.0
SEEN = 0.05  # part of the wing that a difference takes when it is easily seen
AXES = ("x aft, mm", "y span, mm", "z up, mm")
CAMERA = {"eye": {"x": 1.5, "y": -0.75, "z": 0.7}, "projection": {"type": "orthographic"}}


def wing(tracks: Mapping[str, Any], phase: float | None = None, magnify: float | None = None) -> Figure:
    """Draw the markers of a wing in 3-D, to scale: recorded, simulated, and lines of the difference, magnified.

    The lines start at the simulated markers and point to the recorded ones.

    Args:
        tracks: an answer of :meth:`wingfit.Client.comparison` or ``simulate``: T instants, M markers, [T][M][3] in mm.
        phase: draw only the instant nearest to this phase of the beat, in [0, 1]; None: all instants, with a slider
            (at most 40, evenly chosen).
        magnify: factor by which the lines of difference are lengthened; None: 1, 2, 5, 10, ... so that they are seen.

    Raises:
        TypeError: ``tracks`` has no marker positions.
        ValueError: ``phase`` is not in [0, 1], or ``magnify`` is not positive.
    """
    if kind_of(tracks) != "tracks":
        raise TypeError("there are no marker positions; give Client.comparison(...) or Client.simulate(...)")
    if phase is not None and not 0 <= phase <= 1:
        raise ValueError(f"phase is {phase}; it must lie in [0, 1], the fraction of the beat")
    if magnify is not None and not magnify > 0:
        raise ValueError(f"magnify is {magnify}; it must be positive, such as 10")
    phases, recorded, simulated = track_arrays(tracks)
    at = _instants(phases, phase)
    names = [plain(name) for name in tracks["markers"]]
    go = objects()
    factor = magnify or _factor(recorded, simulated)
    pictures = [_traces(names, recorded[t], simulated[t], factor) for t in at]
    figure = go.Figure(data=pictures[0])
    if len(at) > 1:
        figure.frames = [go.Frame(data=one, name=f"{phases[t]:.2f}") for t, one in zip(at, pictures, strict=True)]
        figure.update_layout(sliders=[_slider([f"{phases[t]:.2f}" for t in at])])
    distance = float(np.nanmean(np.linalg.norm(recorded[at] - simulated[at], axis=2)))
    where = f" at phase {phases[at[0]]:.2f}" if phase is not None else ""
    title = f"{tracks['recording']}{where}: mean distance {distance:.2f} mm per marker"
    finish(figure, title, 560, scene=_scene(np.concatenate([recorded, simulated]).reshape(-1, 3)))
    figure.update_layout(
        legend={"y": 1.0, "yanchor": "bottom", "yref": "paper"}, margin={"l": 0, "r": 0, "t": 80, "b": 0}
    )
    return figure


def _instants(phases: Array, phase: float | None) -> list[int]:
    if phase is not None:
        apart = np.abs(phases - phase)
        return [int(np.argmin(np.minimum(apart, 1 - apart)))]
    _, first = np.unique(phases.round(2), return_index=True)  # frames of several beats may have the same phase
    count = min(len(first), MOST_FRAMES)
    return [int(first[k]) for k in np.unique(np.linspace(0, len(first) - 1, count).round().astype(int))]


def _factor(recorded: Array, simulated: Array) -> float:
    """Return the factor 1, 2, 5, 10, ... that makes the mean difference about a twentieth of the wing."""
    apart = float(np.nanmean(np.linalg.norm(recorded - simulated, axis=2)))
    most = SEEN * float((np.nanmax(simulated, axis=(0, 1)) - np.nanmin(simulated, axis=(0, 1))).max())
    steps = [digit * 10.0**power for power in range(4) for digit in (1, 2, 5)]
    return max((step for step in steps if step * apart <= most), default=1.0)


def _traces(names: list[str], recorded: Array, simulated: Array, factor: float) -> list[Any]:
    go = objects()
    both = np.isfinite(recorded).all(axis=1) & np.isfinite(simulated).all(axis=1)
    lines = np.full((3 * int(both.sum()), 3), np.nan)  # pairs of ends, with a gap after each
    lines[0::3], lines[1::3] = simulated[both], (simulated + factor * (recorded - simulated))[both]
    apart = np.linalg.norm(recorded - simulated, axis=1)
    label = "difference" if factor == 1 else f"difference × {factor:g}"
    hover = "%{text}<br>x %{x:.1f}, y %{y:.1f}, z %{z:.1f} mm"

    def points(name: str, places: Array, text: list[str], **look: Any) -> Any:
        return go.Scatter3d(
            **_xyz(places),
            mode="markers",
            name=name,
            text=text,
            marker=look,
            hovertemplate=f"{hover}<extra>{name}</extra>",
        )

    off = [f"{name}: {d:.2f} mm apart" if np.isfinite(d) else name for name, d in zip(names, apart, strict=True)]
    solid = simulated[np.isfinite(simulated).all(axis=1)]
    return [
        go.Mesh3d(**_xyz(solid), delaunayaxis="z", color=ACCENT, opacity=0.18, hoverinfo="skip", flatshading=True),
        go.Scatter3d(**_xyz(lines), mode="lines", name=label, line={"color": SERIES[1], "width": 5}, hoverinfo="skip"),
        points("recorded", recorded, off, size=5, color=INK, symbol="circle-open", line={"width": 1}),
        points("simulated", simulated, names, size=3.5, color=ACCENT),
    ]


def _xyz(places: Array) -> dict[str, Array]:
    return {"x": places[:, 0], "y": places[:, 1], "z": places[:, 2]}


def _scene(places: Array) -> dict[str, Any]:
    """Return axes in mm that hold all ``places`` of the beat, to scale."""
    low, high = np.nanmin(places, axis=0) - MARGIN_MM, np.nanmax(places, axis=0) + MARGIN_MM
    zoom = 1.6 / float((high - low).max())
    box = {"gridcolor": LINE, "zeroline": False, "showbackground": False, "color": QUIET, "nticks": 5}
    axes = {
        f"{axis}axis": {"title": {"text": AXES[k]}, "range": [low[k], high[k]], **box} for k, axis in enumerate("xyz")
    }
    ratio = {axis: zoom * float(high[k] - low[k]) for k, axis in enumerate("xyz")}
    return {"aspectmode": "manual", "aspectratio": ratio, "camera": CAMERA, "dragmode": "turntable", **axes}


def _slider(names: list[str]) -> dict[str, Any]:
    show = {"mode": "immediate", "frame": {"duration": 0, "redraw": True}, "transition": {"duration": 0}}
    steps = [{"method": "animate", "label": name, "args": [[name], show]} for name in names]
    return {
        "steps": steps,
        "currentvalue": {"prefix": "phase of the beat "},
        "pad": {"t": 10, "b": 10, "l": 20, "r": 20},
    }
