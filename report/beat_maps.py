"""Draw maps of the misfit and of the missing load over span and phase."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from wingfit.diagnosis.evidence.intervals import standard_errors
from wingfit.diagnosis.finding import Finding, MissingLoad, PhaseMap, Table
from wingfit.records.array_types import Array, ArrayLike
from wingfit.report import svg
from wingfit.report.layout import figure, folded, panels
from wingfit.report.markup import Markup, joined, tag
from wingfit.report.number_format import (
    Scale,
    capital,
    change,
    channel_scale,
    number,
    scale_for,
    share,
    shortened,
    stages,
)

WIDTH, LEFT, RIGHT, TOP, HEIGHT = 360.0, 52.0, 348.0, 26.0, 150.0
BOTTOM = TOP + HEIGHT
ACROSS = svg.Axis(0, 1, LEFT, RIGHT)
PHASE = "phase of the beat"
BEATS = (0.0, 0.25, 0.5, 0.75, 1.0)
NINETY = standard_errors()
MOST_ROWS, MOST_COLUMNS = 32, 64
MOST_LOADS, MOST_FOLDED = 6, 30  # recordings whose missing load is drawn, and drawn at least in folded details
Classes = Sequence[Sequence[str | None]]


def misfit_maps(finding: Finding) -> Markup | None:
    """Draw the misfit over span and phase, before and after effects are added, with the noise.

    Curves over the phase where there is a single row, as for forces; None without data.
    """
    given = finding.phase_map
    if given is None or not given.bands or not given.phase:
        return None
    scale = channel_scale(finding)
    if len(given.bands) == 1:
        lines = [(f"{stage}-line", name) for stage, name in stages(finding).items()]
        key = svg.legend(*lines, ("noise-line", "expected from noise alone"))
        return figure(_misfit_caption(finding, given, scale), panels(_misfit_curves(finding, given, scale)), key)
    most = max(max(map(max, given.before)), max(map(max, given.after)), given.noise)
    drawings = panels(
        *(_misfit_map(capital(name), given, getattr(given, s), most, scale) for s, name in stages(finding).items())
    )
    note = "Root mean square over all recordings. The line on the colour bar is the misfit expected from noise alone."
    return figure(_misfit_caption(finding, given, scale), drawings, note=note)


def missing_kind(finding: Finding) -> str:
    """Return the kind of the missing physics: "load" or "motion of the drive"."""
    return _kind(finding.missing[0]) if finding.missing else "load"


def _kind(load: MissingLoad) -> str:
    return "motion of the drive" if load.unit == "rad" else "load"


def _name(load: MissingLoad, letters: int) -> str:
    """Return a title of ``load``: its recording, shortened to ``letters``, and the rod where it belongs to one."""
    of = f"{load.rod} rod, " if load.rod else ""
    return of + shortened(load.recording, letters - len(of))


def missing_loads(finding: Finding) -> Markup | None:
    """Draw the missing load, or motion of the drive, in the recordings where it is most significant, or None."""
    loads = [m for m in finding.missing if m.stations and m.phase]
    if not loads:
        return None
    loads.sort(key=lambda load: -_peak(load)[2])
    shown, more = loads[:MOST_LOADS], loads[MOST_LOADS:MOST_FOLDED]
    single = all(len(load.stations) == 1 for load in shown)
    note = None if single else "Positive along the flap normal. Each map has its own scale."
    key = svg.legend(("band", "90 % interval") if single else ("hatched", "not significant (90 %)"))
    hidden = len(loads) - len(shown) - len(more)
    return joined(
        figure(_load_caption(shown[0], _load_scale(shown)), _load_panels(shown), key, note=note),
        folded(f"{len(more)} more, with smaller loads", _load_panels(more)) if more else None,
        tag("p", f"{hidden} more, with smaller loads, are in the JSON.", class_="note") if hidden else None,
    )


def _load_panels(loads: Sequence[MissingLoad]) -> Markup:
    scale = _load_scale(loads)
    return panels(*((_load_curve if len(load.stations) == 1 else _load_map)(load, scale) for load in loads))


def _load_scale(loads: Sequence[MissingLoad]) -> Scale:
    return scale_for((v for load in loads for row in load.values for v in row), loads[0].unit)


def _misfit_caption(finding: Finding, given: PhaseMap, scale: Scale) -> str:
    i, j = _largest(given.before)
    before, after = given.before[i][j], given.after[i][j]
    where = f"phase {number(given.phase[j], 2)}"
    if len(given.bands) > 1:
        where += f" and {share(given.bands[i])} of the span"
    if before <= given.noise:
        return f"The misfit does not exceed the noise of {scale.text(given.noise)} at any phase of the beat"
    return (
        f"The misfit peaks at {where}: {change(finding, scale.text(before), scale.text(after))}, "
        f"noise alone gives {scale.text(given.noise)}"
    )


def _misfit_map(title: str, given: PhaseMap, values: Table, most: float, scale: Scale) -> Markup:
    bands = _pooled(given.bands)
    classes = [[f"l{svg.level(v, most)}" for v in row] for row in _pooled(values, _rms)]
    along = svg.Axis(0, (most or 1.0) * scale.factor, LEFT, RIGHT)
    mark = (given.noise * scale.factor, "noise")
    bar = svg.colour_bar(along, BOTTOM + 52, svg.LEVEL_CLASSES, f"misfit, {scale.unit}", mark)
    return svg.drawing(WIDTH, BOTTOM + 94, f"{title}: misfit over span and phase", _grid(title, bands, classes), bar)


def _misfit_curves(finding: Finding, given: PhaseMap, scale: Scale) -> Markup:
    rows = {stage: [v * scale.factor for v in getattr(given, stage)[0]] for stage in stages(finding)}
    noise = given.noise * scale.factor
    up = svg.axis([noise, *(v for row in rows.values() for v in row)], BOTTOM, TOP, zero=True)
    parts = [svg.curve(svg.places(ACROSS, given.phase, up, row), f"curve {stage}") for stage, row in rows.items()]
    parts.insert(0, svg.line(LEFT, up.at(noise), RIGHT, up.at(noise), "noise"))
    label = _misfit_caption(finding, given, scale)
    return _curves(label, "Misfit over the beat", up, f"misfit, {scale.unit}", *parts)


def _curves(label: str, title: str, up: svg.Axis, y_label: str, *parts: object) -> Markup:
    """Draw ``parts``, curves over the beat, with axes (``up``: vertical); ``label``: text alternative of the whole."""
    axes = svg.x_axis(ACROSS, TOP, BOTTOM, PHASE, BEATS), svg.y_axis(up, LEFT, RIGHT, y_label)
    return svg.drawing(WIDTH, BOTTOM + 34, label, svg.text(LEFT, 14, title, class_="title"), *axes, *parts)


def _load_caption(load: MissingLoad, scale: Scale) -> str:
    i, j, ratio = _peak(load)
    if ratio < NINETY:
        return f"No missing {_kind(load)} is significant"
    where = f"phase {number(load.phase[j], 2)}"
    if len(load.stations) > 1:
        where += f" and {share(load.stations[i])} of the span"
    size = number(load.values[i][j] * scale.factor)
    error = number(NINETY * load.errors[i][j] * scale.factor, 2)
    value = f"{size} ± {error} {scale.unit} ({_name(load, 40)})"
    return f"The missing {_kind(load)} is most significant at {where}: {value}"


def _load_map(load: MissingLoad, scale: Scale) -> Markup:
    stations = _pooled(load.stations)
    values, errors = _pooled(load.values), _pooled(load.errors, _rms)
    most = max(abs(v) for row in values for v in row) or 1.0
    classes = [[f"d{svg.side(v, most)}" for v in row] for row in values]
    faint = [
        ["faint" if abs(v) < NINETY * e else None for v, e in zip(row, errs, strict=True)]
        for row, errs in zip(values, errors, strict=True)
    ]
    along = svg.Axis(-most * scale.factor, most * scale.factor, LEFT, RIGHT)
    bar = svg.colour_bar(along, BOTTOM + 44, svg.SIDE_CLASSES, f"missing load, {scale.unit}")
    title = _name(load, 42)
    return svg.drawing(WIDTH, BOTTOM + 86, f"Missing load, {title}", _grid(title, stations, classes, faint), bar)


def _load_curve(load: MissingLoad, scale: Scale) -> Markup:
    values, errors = (np.array(table[0]) * scale.factor for table in (load.values, load.errors))
    low, high = values - NINETY * errors, values + NINETY * errors
    up, title = svg.axis([*low, *high], BOTTOM, TOP, zero=True), _name(load, 42)
    return _curves(
        f"Missing {_kind(load)} over the beat, {title}",
        title,
        up,
        f"missing {_kind(load)}, {scale.unit}",
        svg.band(svg.places(ACROSS, load.phase, up, low), svg.places(ACROSS, load.phase, up, high)),
        svg.line(LEFT, up.at(0), RIGHT, up.at(0), "axis"),
        svg.curve(svg.places(ACROSS, load.phase, up, values), "curve after"),
    )


def _grid(title: str, bands: Sequence[float], classes: Classes, over: Classes | None = None) -> Markup:
    """Draw cells over phase (to the right) and span (tip on top), with axes.

    ``bands``: span of each row (0 to 1); ``classes``: CSS class of each cell, [rows][columns]; ``over``: of a second
    layer.
    """
    down = svg.Axis(0, 1, TOP, BOTTOM)
    tall = HEIGHT / len(bands)
    every = math.ceil(13 / tall)
    labels = [
        svg.text(LEFT - 4, TOP + (k + 0.5) * tall + 3.5, number(round(100 * span), 3), anchor="end", class_="tick")
        for k, span in list(enumerate(reversed(bands)))[::every]
    ]
    return joined(
        svg.text(LEFT, 14, title, class_="title"),
        svg.cells(classes[::-1], ACROSS, down),
        svg.cells(over[::-1], ACROSS, down) if over else None,
        svg.x_axis(ACROSS, BOTTOM, BOTTOM + 3, PHASE, BEATS),
        *labels,
        svg.turned_text(14, (TOP + BOTTOM) / 2, "span, % (tip on top)"),
    )


def _largest(table: ArrayLike) -> tuple[int, int]:
    """Return row and column of the largest value in ``table``."""
    i, j = np.unravel_index(np.argmax(table), np.shape(table))
    return int(i), int(j)


def _peak(load: MissingLoad) -> tuple[int, int, float]:
    """Return row and column where ``load`` is largest in standard errors, and its ratio to the standard error there."""
    values, errors = np.abs(load.values), np.array(load.errors)
    ratios = np.divide(values, errors, out=np.zeros_like(values), where=errors > 0)
    i, j = _largest(ratios)
    return i, j, float(ratios[i, j])


def _pooled(values: ArrayLike, pool: Callable[..., Any] = np.mean) -> list[Any]:
    """Return ``values`` of at most MOST_ROWS and MOST_COLUMNS; the function ``pool`` combines neighbours."""
    pooled = np.asarray(values, dtype=np.float64)
    for k, most in zip(range(pooled.ndim), (MOST_ROWS, MOST_COLUMNS), strict=False):
        size = pooled.shape[k]
        if size > most:
            parts = np.split(pooled, [round(j * size / most) for j in range(1, most)], axis=k)
            pooled = np.stack([pool(part, axis=k) for part in parts], axis=k)
    return list(pooled.tolist())


def _rms(values: Array, axis: int) -> Any:
    return np.sqrt(np.mean(values**2, axis=axis))
