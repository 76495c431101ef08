"""Make the rows of the tables of the report: genes, free-form law, sources, what to record next."""

from __future__ import annotations

from wingfit.diagnosis.advice.advised import Advice, AdvisedCondition, AdvisedPlace
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


def recording(advice: Advice) -> str:
    """Return the recording that ``advice`` proposes as text: a condition, or one that exists, and what is changed."""
    if advice.recording is None:
        return _condition(advice.condition) if advice.condition else advice.words
    changes = [advice.change or ""]
    if advice.kind == "repeat" and advice.cost and advice.cost.beats is not None:
        changes.append(f"{number(advice.cost.beats)} beats")
    if advice.places:
        changes.append("further markers at " + ", ".join(map(_place, advice.places)))
    if advice.channels:
        changes.append("with " + ", ".join(advice.channels))
    return f"{advice.recording} again, " + ", ".join(one for one in changes if one)


def cost(advice: Advice) -> str:
    """Return how long the recording that ``advice`` proposes takes; "" where that is not known."""
    return "" if advice.cost is None else f"{number(advice.cost.seconds, 2)} s"


def _condition(condition: AdvisedCondition) -> str:
    found = [f"{number(condition.flap_frequency_hz)} Hz", f"{number(condition.phase_lag_deg)}° of lag"]
    found.append(f"{number(condition.pressure_mbar, 4)} mbar")
    if condition.airspeed > 0.0:
        found.append(f"{number(condition.airspeed)} m/s at {number(condition.angle_of_attack_deg)}°")
    return ", ".join(found)


def _place(place: AdvisedPlace) -> str:
    return place.marker or f"{number(100 * place.span, 2)} % of the span, {number(100 * place.chord, 2)} % of the chord"


def _holds(interval: Interval, value: float) -> bool:
    above = interval.low is None or interval.low <= value
    return above and (interval.high is None or value <= interval.high)
