"""Make the rows of the tables of the report: genes, free-form law, sources."""

from __future__ import annotations

from wingfit.diagnosis.finding import Finding, GeneValue, Interval, Term
from wingfit.report.number_format import bounds, number, scale_for, titles_of, with_unit


def genes(finding: Finding) -> tuple[list[GeneValue], list[GeneValue]]:
    """Return the genes of the effects, and those of the nominal model."""
    effects = [g for g in finding.genes if g.off is not None or "." in g.name]
    return effects, [g for g in finding.genes if g not in effects]


def gene(given: GeneValue) -> tuple[str, str, str]:
    """Return value and 90 % interval of a gene as text, and the value that means no effect ("" if there is none)."""
    value = given.value
    scale = scale_for((value.value, value.low, value.high), given.unit)
    off = "" if given.off is None else with_unit(number(given.off * scale.factor), scale.unit)
    inside = given.off is not None and _holds(value, given.off)
    return (
        with_unit(number(value.value * scale.factor), scale.unit),
        with_unit(bounds(value, scale), scale.unit if value.low is not None or value.high is not None else ""),
        f"{off} (in the interval)" if inside else off,
    )


def interval_of(term: Term) -> str:
    """Return the 90 % interval of the coefficient of ``term``, in SI units."""
    return bounds(term.coefficient, scale_for((), "1" if term.unit == "rad" else term.unit))


def sources(finding: Finding) -> list[tuple[str, str]]:
    """Return (title, source of its law) of each named effect."""
    found: dict[str, str] = {}
    for h in sorted(finding.hypotheses, key=lambda h: len(h.effects) > 1):  # its own source rather than a common one
        if h.source and set(h.effects) <= set(finding.named):
            for name in h.effects:
                found.setdefault(name, h.source)
    return list(zip(titles_of(found, finding), found.values(), strict=True))


def _holds(interval: Interval, value: float) -> bool:
    above = interval.low is None or interval.low <= value
    return above and (interval.high is None or value <= interval.high)
