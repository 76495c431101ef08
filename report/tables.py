"""Tables of the report: genes, free-form law, next recordings, sources."""

from __future__ import annotations

from collections.abc import Callable

from wingfit.diagnosis.finding import Advice, Finding, FreeLaw, GeneValue, Interval
from wingfit.report.layout import folded, section, table
from wingfit.report.markup import Markup, joined, tag
from wingfit.report.number_format import (
    added_effects,
    bounds,
    capital,
    number,
    percent,
    scale_for,
    title_of,
    titles,
    with_unit,
)

MOST_GENES = 12
_ADVICE: dict[str, Callable[[Advice], str]] = {
    "flapping, Hz": lambda a: number(a.flap_frequency_hz),
    "lag, °": lambda a: number(a.phase_lag_deg),
    "pressure, mbar": lambda a: number(a.pressure_mbar, 4),
    "airspeed, m/s": lambda a: number(a.airspeed),
    "angle of attack, °": lambda a: number(a.angle_of_attack_deg),
    "separation, sigma": lambda a: number(a.separation, 2),
    "probability of a decision": lambda a: percent(a.resolves),
}


def genes(finding: Finding) -> Markup | None:
    """Genes of the effects, then those of the nominal model, folded where there are many."""
    if not finding.genes:
        return None
    effects = [g for g in finding.genes if g.off is not None or "." in g.name]
    nominal = [g for g in finding.genes if g not in effects]
    shown = nominal if len(nominal) <= MOST_GENES else []
    many = folded(f"{len(nominal)} genes of the nominal model", _genes(nominal)) if not shown and nominal else None
    return section(
        "Values of the genes, with 90 % intervals",
        joined(tag("h3", capital(added_effects(finding))), _genes(effects)) if effects else None,
        joined(tag("h3", "Nominal model"), _genes(shown)) if shown else None,
        many,
    )


def law(given: FreeLaw | None) -> Markup | None:
    """The free-form law of a residual that no effect of the library explains."""
    if given is None:
        return None
    rows = [(t.feature, number(t.coefficient.value), _bounds(t.coefficient, t.unit), t.unit) for t in given.terms]
    return section(
        "Free-form law of the residual",
        tag("p", given.words),
        table(("term", "coefficient", "90 % interval", "unit"), rows) if rows else None,
        tag("p", f"It explains {percent(given.explained)} of the misfit beyond the noise (cross-validated)."),
    )


def advice(finding: Finding) -> Markup | None:
    """Recordings that would distinguish the hypotheses."""
    if not finding.advice:
        return None
    known = titles(finding)
    best = finding.advice[0]
    between = ", ".join(title_of(name, known) for name in best.between)
    rows = [[rank, *(cell(a) for cell in _ADVICE.values())] for rank, a in enumerate(finding.advice, 1)]
    return section(
        "Next recording",
        tag("p", tag("strong", best.words)),
        tag("p", f"It distinguishes: {between}.", class_="quiet") if between else None,
        table(["rank", *_ADVICE], rows, numbers=7),
    )


def sources(finding: Finding) -> Markup | None:
    """Sources of the laws of the named effects."""
    known = titles(finding)
    found = {
        h.effects[0]: h.source
        for h in finding.hypotheses
        if len(h.effects) == 1 and h.effects[0] in finding.named and h.source
    }
    for h in finding.hypotheses:
        if h.source and set(h.effects) <= set(finding.named) and not set(h.effects) <= set(found):
            found.update({name: h.source for name in h.effects if name not in found})
    if not found:
        return None
    items = [tag("li", tag("strong", title_of(name, known)), ": ", source) for name, source in found.items()]
    return section("Sources of the named effects", tag("ul", *items, class_="plain"))


def remarks(finding: Finding) -> Markup | None:
    """Remarks on the data and on the diagnosis."""
    if not finding.remarks:
        return None
    return section("Remarks", tag("ul", *(tag("li", words) for words in finding.remarks), class_="plain"))


def _genes(given: list[GeneValue]) -> Markup:
    rows = [("gene", "value", "90 % interval", "no effect at", "description"), *(_gene(g) for g in given)]
    if all(g.off is None for g in given):
        rows = [(*row[:3], row[4]) for row in rows]
    return table([str(name) for name in rows[0]], rows[1:])


def _gene(gene: GeneValue) -> tuple[object, ...]:
    value = gene.value
    scale = scale_for((value.value, value.low, value.high), gene.unit)
    off = "" if gene.off is None else with_unit(number(gene.off * scale.factor), scale.unit)
    inside = gene.off is not None and _holds(value, gene.off)
    return (
        tag("code", gene.name),
        tag("strong", with_unit(number(value.value * scale.factor), scale.unit)),
        with_unit(bounds(value, scale), scale.unit if value.low is not None or value.high is not None else ""),
        f"{off} (in the interval)" if inside else off,
        gene.description,
    )


def _holds(interval: Interval, value: float) -> bool:
    above = interval.low is None or interval.low <= value
    return above and (interval.high is None or value <= interval.high)


def _bounds(interval: Interval, unit: str) -> str:
    return bounds(interval, scale_for((), "1" if unit == "rad" else unit))
