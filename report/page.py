"""The report of a finding: verdict, validation, location, ranking, numbers."""

from __future__ import annotations

from wingfit.diagnosis.finding import VERDICTS, Finding, Floors
from wingfit.report import beat_maps, location, misfits, ranking, tables, wing_map
from wingfit.report.layout import content, document, figure, panels, section
from wingfit.report.markup import Markup, tag
from wingfit.report.number_format import (
    Scale,
    added_effects,
    best_of,
    channel_scale,
    listed,
    number,
    percent,
    stages,
    title_of,
    titles,
)
from wingfit.report.svg import Axis, bar, drawing, text, x_axis

_VALIDATION = "Is the fit better on held-out recordings?"


def html(finding: Finding) -> str:
    """The report as one HTML file, without scripts or anything to load."""
    title = f"{headline(finding)} ({finding.dataset})"
    return document(title, content("hatching.svg"), tag("main", *_parts(finding)))


def headline(finding: Finding) -> str:
    """The verdict in one line."""
    known = titles(finding)
    named = [title_of(name, known) for name in finding.named]
    if finding.verdict == "adequate":
        return "The model is adequate: these recordings show no missing physics"
    if finding.verdict == "named":
        return f"Missing physics: {' + '.join(named)}" if named else "Missing physics: a known effect"
    if finding.verdict == "ambiguous":
        return (
            f"Missing physics: {listed(named, 'or')}; these recordings cannot distinguish them"
            if named
            else "Several hypotheses fit equally well"
        )
    if finding.verdict == "unnamed":
        return "Missing physics that no effect of the library explains"
    return f"Measurement fault: {' + '.join(named)}" if named else "Measurement fault"


def _parts(finding: Finding) -> list[object]:
    return [
        *_verdict(finding),
        _section(
            _VALIDATION if finding.put_in else "How well the model fits",
            misfits.proof(finding),
            misfits.recordings(finding),
        ),
        _section(
            "Location on the wing and in the beat",
            location.place(finding),
            wing_map.wing_map(finding),
            beat_maps.misfit_maps(finding),
        ),
        _section(f"The missing {beat_maps.missing_kind(finding)}", beat_maps.missing_loads(finding)),
        _section("Hypotheses considered", ranking.ranking(finding)),
        tables.law(finding.law),
        _section("Recorded and simulated", misfits.overlays(finding)),
        tables.genes(finding),
        tables.advice(finding),
        _section("Lower limit of the misfit", _floors(finding)),
        tables.sources(finding),
        tables.remarks(finding),
        _made(finding),
    ]


def _section(heading: str, *parts: Markup | None) -> Markup | None:
    shown = [part for part in parts if part is not None]
    return section(heading, *shown) if shown else None


def _verdict(finding: Finding) -> list[object]:
    rows = []
    for name in (*VERDICTS, *(k for k in finding.probabilities if k not in VERDICTS)):
        part = finding.probabilities.get(name, 0.0)
        chosen = " chosen" if name == finding.verdict else ""
        shown = bar(part, "strong" if chosen else "pale")
        rows += [tag("span", name, class_=f"name{chosen}"), shown, tag("span", percent(part), class_=f"value{chosen}")]
    return [
        tag("p", f"Diagnosis of {finding.dataset} · verdict: {finding.verdict}", class_="over"),
        tag("h1", headline(finding)),
        tag("p", finding.summary),
        tag("div", *rows, class_="bars verdicts", role="group", aria_label="Probability of every verdict"),
        _tiles(finding),
    ]


def _tiles(finding: Finding) -> Markup:
    scale = channel_scale(finding)
    tiles = [
        ("Strength d", number(finding.strength), "residual of the refitted nominal model / noise"),
        ("Noise", scale.text(finding.floors.noise), f"lag-1 autocorrelation {number(finding.floors.memory, 2)}"),
        ("Floor", scale.text(finding.floors.total), "expected misfit of a correct model"),
    ]
    if finding.proof is not None and "after" in stages(finding):
        change = f"{number(finding.proof.before.value)} → {number(finding.proof.after.value)}"
        tiles.append(("Held-out misfit / floor", change, f"nominal model → with {added_effects(finding)}"))
    best = best_of(finding)
    if best is not None and finding.verdict != "adequate":
        by = best.title if finding.put_in else f"{best.title}, the closest"
        tiles.append(("Explained", percent(best.explained), f"of the misfit beyond the noise, by {by}"))
    shown = [tag("div", tag("dt", name), tag("dd", value, tag("small", about))) for name, value, about in tiles]
    return tag("dl", *shown, class_="tiles")


def _floors(finding: Finding) -> Markup:
    scale = channel_scale(finding)
    floors = finding.floors
    rows = [
        ("noise, from the scatter between beats", floors.noise, "pale"),
        ("tolerance of the simulation", floors.simulation, "pale"),
        ("floor: root sum of squares of these", floors.total, "strong"),
        ("nominal model, refitted", finding.strength * floors.noise, "plain"),
    ]
    if floors.division is not None:
        rows.insert(1, ("discretisation error, from a finer model", floors.division, "pale"))
    most = max(value for _, value, _ in rows) * scale.factor or 1.0
    along = Axis(0, 1.1 * most, 12, 348)
    bottom = 8 + 34.0 * len(rows)
    parts: list[Markup] = [x_axis(along, 6, bottom, f"root mean square of one channel, {scale.unit}")]
    for k, (name, value, class_) in enumerate(rows):
        y = 34.0 * k + 8
        wide = along.at(value * scale.factor) - along.at(0)
        parts.append(text(12, y + 12, f"{name}: {number(value * scale.factor)}", class_="value"))
        parts.append(tag("rect", x=12.0, y=y + 17, width=max(wide, 0.5), height=9.0, class_=class_))
    note = f"The finer model: {floors.finer}." if floors.division is not None else None
    return figure(
        _floors_caption(finding, floors, scale), panels(drawing(360, bottom + 30, "Floors", *parts)), note=note
    )


def _floors_caption(finding: Finding, floors: Floors, scale: Scale) -> str:
    residual = scale.text(finding.strength * floors.noise)
    return (
        f"The expected misfit of a correct model is {scale.text(floors.total)}; the residual of the nominal model, "
        f"refitted, is {residual} (strength d = {number(finding.strength)})"
    )


def _made(finding: Finding) -> Markup:
    versions = ", ".join(f"{name} {version}" for name, version in finding.versions.items())
    minutes = (
        f"{number(finding.seconds / 60, 2)} minutes"
        if finding.seconds >= 60
        else f"{number(finding.seconds, 2)} seconds"
    )
    spent = f"{minutes}, {finding.evaluations} evaluations" if finding.evaluations else minutes
    lines = [f"Model: {finding.model}", f"Computed in {spent}" if finding.seconds else None, versions or None]
    return tag("footer", *(tag("p", words, class_="quiet") for words in lines if words))
