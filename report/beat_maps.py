"""Maps of the misfit and of the missing load over span and phase."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from statistics import fmean

from wingfit.diagnosis.evidence.intervals import reach
from wingfit.diagnosis.finding import Finding, MissingLoad, Numbers, PhaseMap, Table
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
from wingfit.report.svg import (
    LEVELS,
    SIDES,
    Axis,
    axis,
    band,
    cells,
    colour_bar,
    curve,
    drawing,
    legend,
    level,
    line,
    places,
    side,
    text,
    turned_text,
    x_axis,
    y_axis,
)

WIDTH, LEFT, RIGHT, TOP, HEIGHT = 360.0, 52.0, 348.0, 26.0, 150.0
BOTTOM = TOP + HEIGHT
ACROSS = Axis(0, 1, LEFT, RIGHT)
PHASE = "phase of the beat"
BEATS = (0.0, 0.25, 0.5, 0.75, 1.0)
NINETY = reach()
MOST_ROWS, MOST_COLUMNS = 32, 64
MOST_LOADS, MOST_FOLDED = 6, 30  # recordings whose missing load is drawn, and drawn at least in folded details
Pool = Callable[[Sequence[float]], float]


def misfit_maps(finding: Finding) -> Markup | None:
    """Misfit over span and phase, before and after, with the noise; curves where there is one row."""
    given = finding.phase_map
    if given is None or not given.bands or not given.phase:
        return None
    scale = channel_scale(finding)
    if len(given.bands) == 1:
        lines = [(f"{stage}-line", name) for stage, name in stages(finding).items()]
        key = legend(*lines, ("noise-line", "expected from noise alone"))
        return figure(_misfit_caption(finding, given, scale), panels(_misfit_curves(finding, given, scale)), key)
    most = max(max(map(max, given.before)), max(map(max, given.after)), given.noise)
    drawings = panels(
        *(_misfit_map(capital(name), given, getattr(given, s), most, scale) for s, name in stages(finding).items())
    )
    note = "Root mean square over all recordings. The line on the colour bar is the misfit expected from noise alone."
    return figure(_misfit_caption(finding, given, scale), drawings, note=note)


def missing_kind(finding: Finding) -> str:
    """Kind of the missing physics: "load" or "motion of the drive"."""
    return _kind(finding.missing[0]) if finding.missing else "load"


def _kind(load: MissingLoad) -> str:
    return "motion of the drive" if load.unit == "rad" else "load"


def _name(load: MissingLoad, letters: int) -> str:
    """The recording, and the rod where the load belongs to one."""
    of = f"{load.rod} rod, " if load.rod else ""
    return of + shortened(load.recording, letters - len(of))


def missing_loads(finding: Finding) -> Markup | None:
    """The load, or motion, missing from the nominal model, in the recordings where it is largest."""
    loads = [m for m in finding.missing if m.stations and m.phase]
    if not loads:
        return None
    loads.sort(key=lambda load: -_peak(load)[2])
    shown, more = loads[:MOST_LOADS], loads[MOST_LOADS:MOST_FOLDED]
    single = all(len(load.stations) == 1 for load in shown)
    note = None if single else "Positive along the flap normal. Each map has its own scale."
    key = legend(("band", "90 % interval") if single else ("hatched", "not significant (90 %)"))
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
    bands = _pooled([given.bands], MOST_ROWS, fmean)[0]
    classes: list[list[str | None]] = [[f"l{level(v, most)}" for v in row] for row in _small(values, _rms)]
    bar = colour_bar(
        Axis(0, (most or 1.0) * scale.factor, LEFT, RIGHT),
        BOTTOM + 52,
        [f"l{k}" for k in range(LEVELS)],
        f"misfit, {scale.unit}",
        (given.noise * scale.factor, "noise"),
    )
    return drawing(WIDTH, BOTTOM + 94, f"{title}: misfit over span and phase", _grid(title, bands, classes), bar)


def _misfit_curves(finding: Finding, given: PhaseMap, scale: Scale) -> Markup:
    rows = {stage: [v * scale.factor for v in getattr(given, stage)[0]] for stage in stages(finding)}
    noise = given.noise * scale.factor
    up = axis([noise, *(v for row in rows.values() for v in row)], BOTTOM, TOP, zero=True)
    parts = [curve(places(ACROSS, given.phase, up, row), f"curve {stage}") for stage, row in rows.items()]
    parts.insert(0, line(LEFT, up.at(noise), RIGHT, up.at(noise), "noise"))
    label = _misfit_caption(finding, given, scale)
    return _curves(label, "Misfit over the beat", up, f"misfit, {scale.unit}", *parts)


def _curves(label: str, title: str, up: Axis, y_label: str, *parts: object) -> Markup:
    """Curves over the beat, with their axes."""
    axes = x_axis(ACROSS, TOP, BOTTOM, PHASE, BEATS), y_axis(up, LEFT, RIGHT, y_label)
    return drawing(WIDTH, BOTTOM + 34, label, text(LEFT, 14, title, class_="title"), *axes, *parts)


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
    stations = _pooled([load.stations], MOST_ROWS, fmean)[0]
    values, errors = _small(load.values, fmean), _small(load.errors, _rms)
    most = max(abs(v) for row in values for v in row) or 1.0
    classes: list[list[str | None]] = [[f"d{side(v, most)}" for v in row] for row in values]
    faint: list[list[str | None]] = [
        ["faint" if abs(v) < NINETY * e else None for v, e in zip(row, errs, strict=True)]
        for row, errs in zip(values, errors, strict=True)
    ]
    bar = colour_bar(
        Axis(-most * scale.factor, most * scale.factor, LEFT, RIGHT),
        BOTTOM + 44,
        [f"d{k}" for k in range(2 * SIDES + 1)],
        f"missing load, {scale.unit}",
    )
    title = _name(load, 42)
    return drawing(WIDTH, BOTTOM + 86, f"Missing load, {title}", _grid(title, stations, classes, faint), bar)


def _load_curve(load: MissingLoad, scale: Scale) -> Markup:
    values, errors = ([v * scale.factor for v in table[0]] for table in (load.values, load.errors))
    low = [v - NINETY * e for v, e in zip(values, errors, strict=True)]
    high = [v + NINETY * e for v, e in zip(values, errors, strict=True)]
    up, title = axis([*low, *high], BOTTOM, TOP, zero=True), _name(load, 42)
    return _curves(
        f"Missing {_kind(load)} over the beat, {title}",
        title,
        up,
        f"missing {_kind(load)}, {scale.unit}",
        band(places(ACROSS, load.phase, up, low), places(ACROSS, load.phase, up, high)),
        line(LEFT, up.at(0), RIGHT, up.at(0), "axis"),
        curve(places(ACROSS, load.phase, up, values), "curve after"),
    )


def _grid(
    title: str, bands: Numbers, classes: list[list[str | None]], over: list[list[str | None]] | None = None
) -> Markup:
    """Cells over phase (to the right) and span (tip on top), with axes."""
    down = Axis(0, 1, TOP, BOTTOM)
    tall = HEIGHT / len(bands)
    labels: list[Markup] = []
    every = math.ceil(13 / tall)
    for k, span in enumerate(reversed(bands)):
        if k % every == 0:
            y = TOP + (k + 0.5) * tall
            labels.append(text(LEFT - 4, y + 3.5, number(round(100 * span), 3), anchor="end", class_="tick"))
    return joined(
        text(LEFT, 14, title, class_="title"),
        cells(classes[::-1], ACROSS, down),
        cells(over[::-1], ACROSS, down) if over else None,
        x_axis(ACROSS, BOTTOM, BOTTOM + 3, PHASE, BEATS),
        *labels,
        turned_text(14, (TOP + BOTTOM) / 2, "span, % (tip on top)"),
    )


def _largest(table: Table) -> tuple[int, int]:
    places = [(i, j) for i, row in enumerate(table) for j in range(len(row))]
    return max(places, key=lambda place: table[place[0]][place[1]])


def _peak(load: MissingLoad) -> tuple[int, int, float]:
    """Row and column where the load is largest in standard errors, and that ratio."""
    ratios = tuple(
        tuple(abs(v) / e if e > 0 else 0.0 for v, e in zip(row, errs, strict=True))
        for row, errs in zip(load.values, load.errors, strict=True)
    )
    i, j = _largest(ratios)
    return i, j, ratios[i][j]


def _pooled(table: Sequence[Sequence[float]], most: int, pool: Pool) -> list[tuple[float, ...]]:
    """``table`` with at most ``most`` columns: neighbours are pooled."""
    columns = len(table[0])
    if columns <= most:
        return [tuple(row) for row in table]
    ends = [round(k * columns / most) for k in range(most + 1)]
    return [tuple(pool(row[a:b]) for a, b in pairwise(ends)) for row in table]


def _small(table: Sequence[Sequence[float]], pool: Pool) -> list[tuple[float, ...]]:
    """``table`` with at most MOST_ROWS rows and MOST_COLUMNS columns."""
    rows = _turned(_pooled(_turned(table), MOST_ROWS, pool))
    return _pooled(rows, MOST_COLUMNS, pool)


def _turned(table: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    return [tuple(column) for column in zip(*table, strict=True)]


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values))
