"""Make the report of a finding: verdict, validation, location, ranking of hypotheses, numbers."""

from __future__ import annotations

from wingfit.diagnosis.finding import CONFIDENT, UNCERTAIN, VERDICTS, Finding, of_the_library
from wingfit.report import beat_maps, location, misfits, number_format, ranking, svg, tables, wing_map
from wingfit.report.layout import figure, panels, render
from wingfit.report.markup import Markup, tag
from wingfit.report.number_format import (
    added_effects,
    best_of,
    channel_scale,
    listed,
    number,
    percent,
    scale_for,
    stages,
    titles_of,
)
from wingfit.report.svg import Axis, drawing, text, x_axis

MOST_NOISES = 2  # channels whose noise is shown at the top


def html(finding: Finding) -> str:
    """Return the report as one HTML file, which contains no script and loads nothing."""
    return render(
        "finding.html",
        title=f"{headline(finding)} ({finding.dataset})",
        headline=headline(finding),
        finding=finding,
        verdicts=[*VERDICTS, *(name for name in finding.probabilities if name not in VERDICTS)],
        tiles=_tiles(finding),
        floors=_floors(finding),
        made=_made(finding),
        scale=channel_scale(finding),
        n=number_format,
        **{
            part.__name__.rpartition(".")[2]: part
            for part in (beat_maps, location, misfits, ranking, svg, tables, wing_map)
        },
    )


def headline(finding: Finding) -> str:
    """Return the verdict in one line."""
    named = titles_of(finding.named, finding)
    together = " + ".join(named)
    if finding.verdict == "ambiguous" and named:
        return f"Missing physics: {listed(named, 'or')}; these recordings cannot distinguish them"
    if finding.verdict == "adequate" and finding.probabilities.get("adequate", 1.0) < CONFIDENT:
        return "The model may be adequate: these recordings show no missing physics, and cannot exclude it"
    if finding.verdict == "unnamed" and of_the_library(finding.probabilities) >= UNCERTAIN:
        return "Missing physics; whether an effect of the library explains it is not certain"
    return {
        "adequate": "The model is adequate: these recordings show no missing physics",
        "named": f"Missing physics: {together or 'a known effect'}",
        "partly named": f"A part of what is missing: {together or 'a known effect'}; more remains",
        "ambiguous": "Several hypotheses fit equally well",
        "unnamed": "Missing physics that no effect of the library explains",
        "measurement fault": f"Measurement fault: {together}" if named else "Measurement fault",
    }[finding.verdict]


def _tiles(finding: Finding) -> list[tuple[str, str, str]]:
    """Return name, value and meaning of each of the main numbers."""
    scale = channel_scale(finding)
    correlation = number(finding.floors.lag1_autocorrelation, 2)
    noise, floor = scale.text(finding.floors.noise), scale.text(finding.floors.total)
    if finding.channels:
        noise = ", ".join(scale_for([one.noise], one.unit).text(one.noise) for one in finding.channels[:MOST_NOISES])
    tiles = [
        ("Strength d", number(finding.strength), "residual of the refitted nominal model / noise"),
        ("Noise", noise, f"lag-1 autocorrelation {correlation}"),
        ("Floor", floor, "expected misfit of a correct model"),
    ]
    if finding.proof is not None and "after" in stages(finding):
        change = f"{number(finding.proof.before.value)} → {number(finding.proof.after.value)}"
        tiles.append(("Held-out misfit / floor", change, f"nominal model → with {added_effects(finding)}"))
    best = best_of(finding)
    if best is not None and finding.verdict != "adequate":
        by = best.title if finding.added_effects else f"{best.title}, the closest"
        tiles.append(("Explained", percent(best.explained), f"of the misfit beyond the noise, by {by}"))
    return tiles


def _floors(finding: Finding) -> Markup:
    scale = channel_scale(finding)
    floors = finding.floors
    rows = [
        ("noise" if finding.kind == "series" else "noise, from the scatter between beats", floors.noise, "pale"),
        ("tolerance of the simulation", floors.simulation, "pale"),
        ("floor: root sum of squares of these", floors.total, "strong"),
        ("nominal model, refitted", finding.strength * floors.noise, "plain"),
    ]
    if floors.discretisation is not None:
        source = ", from a finer model" if floors.finer else " that the last refinement leaves"
        rows.insert(1, (f"discretisation error{source}", floors.discretisation, "pale"))
    if floors.marker_positions > 0.0:
        rows.insert(-2, ("rest positions of the markers, what all share", floors.marker_positions, "pale"))
    most = max(value for _, value, _ in rows) * scale.factor or 1.0
    along = Axis(0, 1.1 * most, 12, 348)
    bottom = 8 + 34.0 * len(rows)
    parts: list[Markup] = [x_axis(along, 6, bottom, f"root mean square of one channel, {scale.unit}")]
    for k, (name, value, class_) in enumerate(rows):
        y = 34.0 * k + 8
        wide = along.at(value * scale.factor) - along.at(0)
        parts.append(text(12, y + 12, f"{name}: {number(value * scale.factor)}", class_="value"))
        parts.append(tag("rect", x=12.0, y=y + 17, width=max(wide, 0.5), height=9.0, class_=class_))
    note = f"The finer model: {floors.finer}." if floors.finer else None
    residual = scale.text(finding.strength * floors.noise)
    caption = (
        f"The expected misfit of a correct model is {scale.text(floors.total)}; the residual of the nominal model, "
        f"refitted, is {residual} (strength d = {number(finding.strength)})"
    )
    return figure(caption, panels(drawing(360, bottom + 30, "Floors", *parts)), note=note)


def _made(finding: Finding) -> list[str]:
    """Return lines of text on the model, the computation and the versions."""
    versions = ", ".join(f"{name} {version}" for name, version in finding.versions.items())
    size, unit = (60, "minutes") if finding.seconds >= 60 else (1, "seconds")
    spent = f"{number(finding.seconds / size, 2)} {unit}"
    if finding.evaluations:
        spent += f", {finding.evaluations} evaluations"
    lines = [f"Model: {finding.model}", f"Computed in {spent}" if finding.seconds else "", versions]
    return [words for words in lines if words]
