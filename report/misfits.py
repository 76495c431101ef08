"""Draw the misfit before and after effects are added: over the floor, by recording, and in the samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

from wingfit.diagnosis.finding import Finding, Interval, Overlay, Proof, RecordingMisfit
from wingfit.report.gaps import pieces
from wingfit.report.layout import figure, panels
from wingfit.report.markup import Markup, tag
from wingfit.report.number_format import (
    Scale,
    bounds,
    change,
    channel_scale,
    condition,
    number,
    scale_for,
    shortened,
    stages,
)
from wingfit.report.svg import Axis, axis, curve, dots, drawing, legend, line, places, text, whisker, x_axis, y_axis

WIDTH, LEFT, RIGHT = 360.0, 12.0, 348.0
ROW, MOST_ROWS, MOST_OVERLAYS = 38.0, 18, 12
DECADE = 12.0  # ratio of the ends from which an axis is logarithmic
BEATS = (0.0, 0.25, 0.5, 0.75, 1.0)


def proof(finding: Finding) -> Markup | None:
    """Draw the misfit on held-out recordings as multiples of the floor, the misfit to be expected.

    Without any, a warning that the result is not validated; None then for an adequate model.
    """
    given = finding.proof
    if given is None:
        if finding.verdict == "adequate":
            return None
        held_out = any(r.held_out for r in finding.recordings)
        why = "The held-out recordings were not evaluated together" if held_out else "No recording was held out"
        words = f"{why}, so the improvement is not validated."
        return tag("p", words, class_="warning")
    rows: list[tuple[str, Interval]] = [(stage, getattr(given, stage)) for stage in stages(finding)]
    ends = [v for _, i in rows for v in (i.value, i.low, i.high) if v is not None]
    along = _along([*ends, 1.0])
    parts: list[Markup | None] = [x_axis(along, 8, 88, "misfit on held-out recordings / floor")]
    for k, (name, interval) in enumerate(rows):
        y = 34.0 + 38 * k
        value = f"{number(interval.value)} (90 %: {bounds(interval, Scale(1.0, ''))})"
        parts.append(text(LEFT, y - 10, f"{name}: {value}" if len(rows) > 1 else value, class_="value"))
        parts.append(line(along.at(1.0), y - 6, along.at(1.0), y + 8, "floor"))
        parts.append(whisker(along, y + 1, interval, name))
    return figure(
        _proof_caption(finding, given),
        panels(drawing(WIDTH, 120, _proof_caption(finding, given), *parts)),
        legend(*stages(finding).items(), ("floor", "floor: expected misfit of a correct model")),
        note=given.words or None,
    )


def _proof_caption(finding: Finding, given: Proof) -> str:
    """Return the result of the validation in one sentence."""
    if "after" not in stages(finding):
        return f"On held-out recordings the misfit is {number(given.before.value)} times the floor"
    times = f"from {number(given.before.value)} to {number(given.after.value)} times the floor"
    if given.improved:
        return f"On held-out recordings the misfit falls {times}"
    return f"On held-out recordings the misfit does not improve significantly: {times}"


def recordings(finding: Finding) -> Markup | None:
    """Draw the misfit with interval of every recording, held-out ones first; None without recordings."""
    if not finding.recordings:
        return None
    scale = channel_scale(finding)
    along = _along([v * scale.factor for r in finding.recordings for v in _values(r)])
    drawings: list[Markup] = []
    for held_out, name in ((True, "Held out"), (False, "Fitted")):
        group = [r for r in finding.recordings if r.held_out == held_out]
        chunks = [group[k : k + MOST_ROWS] for k in range(0, len(group), MOST_ROWS)]
        for k, chunk in enumerate(chunks, 1):
            part = f"{k} of {len(chunks)}" if len(chunks) > 1 else len(group)
            drawings.append(_recordings(finding, f"{name} ({part})", chunk, along, scale))
    return figure(
        _recordings_caption(finding),
        panels(*drawings),
        legend(*stages(finding).items(), ("floor", "floor")),
        note="Root mean square of one channel, with 90 % intervals.",
    )


def _recordings_caption(finding: Finding) -> str:
    """Return the result by recording in one sentence."""
    scale = channel_scale(finding)
    group = [r for r in finding.recordings if r.held_out] or list(finding.recordings)
    kind = "held-out" if group[0].held_out else "fitted"
    better = sum(r.after.value < r.before.value for r in group)
    before, after = (median([getattr(r, name).value for r in group]) for name in ("before", "after"))
    values = change(finding, scale.text(before), scale.text(after))
    if len(group) == 1:
        return f"The {kind} recording: {values}"
    if "after" not in stages(finding):
        return f"Over {len(group)} {kind} recordings the median misfit is {values}"
    return f"{better} of {len(group)} {kind} recordings improve; median {values}"


def overlays(finding: Finding) -> Markup | None:
    """Draw recorded samples with both simulations, one small chart for each recorded channel; None without any."""
    shown = [o for o in finding.overlays if o.recorded][:MOST_OVERLAYS]
    if not shown:
        return None
    scale = channel_scale(finding)
    left = len(finding.overlays) - len(shown)
    return figure(
        _overlays_caption(finding, shown, scale),
        panels(*(_overlay(finding, o, _own_scale(o) or scale) for o in shown), size="small"),
        legend(("recorded", "recorded"), *((f"{stage}-line", name) for stage, name in stages(finding).items())),
        note=f"{left} more in the JSON." if left else None,
    )


def _overlays_caption(finding: Finding, shown: Sequence[Overlay], scale: Scale) -> str:
    """Return the typical distance between simulation and recording in one sentence."""
    if finding.kind == "series":
        return "Recorded and simulated samples of the channels that the added effects change most"
    before, after = (
        median([math.dist(o.recorded, getattr(o, name)) / len(o.phase) ** 0.5 for o in shown])
        for name in ("before", "after")
    )
    values = change(finding, scale.text(before), scale.text(after))
    return f"Median distance between simulated and recorded beats: {values}"


def _own_scale(overlay: Overlay) -> Scale | None:
    """Return a scale for an overlay with a unit of its own; None for one in the unit of the finding."""
    return scale_for((*overlay.recorded, *overlay.before), overlay.unit) if overlay.unit else None


def _recordings(finding: Finding, title: str, rows: Sequence[RecordingMisfit], along: Axis, scale: Scale) -> Markup:
    bottom = 24 + ROW * len(rows)
    parts: list[Markup] = [x_axis(along, 22, bottom, f"misfit, {scale.unit}")]
    for k, row in enumerate(rows):
        y = 24 + ROW * k
        about = condition(row)
        label = f"{shortened(row.name, max(14, 48 - len(about)))} \u2002 {about}"
        parts.append(tag("text", tag("title", row.name), label, x=LEFT, y=y + 11, class_="value"))
        floor = along.at(row.floor * scale.factor)
        parts.append(line(floor, y + 15, floor, y + 35, "floor"))
        for at, name in zip((y + 21, y + 29), stages(finding), strict=False):
            parts.append(whisker(along, at, getattr(row, name), name, scale.factor))
    label = f"{title}: misfit by recording"
    return drawing(WIDTH, bottom + 30, label, text(LEFT, 14, title, class_="title"), *parts)


def _overlay(finding: Finding, overlay: Overlay, scale: Scale) -> Markup:
    """Draw the recorded and simulated beat or series, and below it, to another scale, the residuals."""
    left, right = 50.0, 292.0
    simulated = {name: [v * scale.factor for v in getattr(overlay, name)] for name in stages(finding)}
    recorded = [v * scale.factor for v in overlay.recorded]
    residuals = {n: [r - v for r, v in zip(recorded, values, strict=True)] for n, values in simulated.items()}
    if overlay.times:
        over, label, at, ticks = "time", "time, s", overlay.times, None
        across, parts = Axis(at[0], at[-1], left, right), pieces(at)
    else:
        over, label, at, ticks = "one beat", "phase of the beat", overlay.phase, BEATS
        across, parts = Axis(0, 1, left, right), [slice(None)]
    up = axis([*recorded, *(v for values in simulated.values() for v in values)], 142, 42)
    rest = axis([v for values in residuals.values() for v in values], 226, 160, zero=True)
    title = shortened(overlay.channel, 28)
    below = f"{shortened(overlay.recording, 30)}, {_use(overlay)}"
    return drawing(
        300,
        258,
        f"{title}, {below}: recorded and simulated over {over}, and the residuals",
        text(left, 14, title, class_="title"),
        text(left, 30, below, class_="tick"),
        x_axis(across, 42, 226, label, ticks),
        y_axis(up, left, right, scale.unit),
        y_axis(rest, left, right, f"residual, {scale.unit}", count=3),
        line(left, rest.at(0), right, rest.at(0), "axis"),
        dots(places(across, at, up, recorded), "samples"),
        *(
            curve(places(across, at[piece], on, values[stage][piece]), f"curve {stage}")
            for on, values in ((up, simulated), (rest, residuals))
            for stage in simulated
            for piece in parts
        ),
    )


def table(finding: Finding) -> tuple[list[str], list[list[str]]]:
    """Return the headings of the columns of misfits in the table of recordings, and the rows of that table."""
    scale = channel_scale(finding)

    def cell(interval: Interval) -> str:
        return f"{number(interval.value * scale.factor)} ({bounds(interval, scale)})"

    rows = [
        [r.name, _use(r), condition(r), *(cell(getattr(r, s)) for s in stages(finding)), number(r.floor * scale.factor)]
        for r in finding.recordings
    ]
    return [f"{name}, {scale.unit}" for name in (*stages(finding), "floor")], rows


def _use(recording: RecordingMisfit | Overlay) -> str:
    return "held out" if recording.held_out else "fitted"


def _along(values: Sequence[float]) -> Axis:
    """Return an axis from zero that holds ``values``; logarithmic where their ratios exceed DECADE."""
    positive = [v for v in values if v > 0]
    low, high = min(positive, default=1.0), max(positive, default=1.0)
    if high > DECADE * low:
        return Axis(low / 1.3, high * 1.3, LEFT, RIGHT, logarithmic=True)
    return Axis(0.0, 1.08 * high, LEFT, RIGHT)


def _values(row: RecordingMisfit) -> list[float]:
    ends = [v for i in (row.before, row.after) for v in (i.value, i.low, i.high)]
    return [v for v in (*ends, row.floor) if v is not None]
