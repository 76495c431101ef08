"""Ranking of the hypotheses: explained and predicted misfit, evidence, probability."""

from __future__ import annotations

from collections.abc import Callable

from wingfit.diagnosis.finding import Finding, Hypothesis
from wingfit.report.layout import figure, folded, table_of
from wingfit.report.markup import Markup, joined, tag
from wingfit.report.number_format import best_of, channel_scale, listed, number, percent, title_of, titles
from wingfit.report.svg import bar

MOST_SHOWN = 8
_NOTE = (
    "Explained: fraction of the nominal model's mean-square misfit beyond the noise removed by a refit. Predicted: the "
    "same for recordings left out of the refit one by one. Evidence: natural logarithm of the Bayes factor over the "
    "nominal model; 5 is strong, and each further 2.3 is a factor of ten."
)


def ranking(finding: Finding) -> Markup | None:
    """The strongest hypotheses as bars, all others as a table."""
    if not finding.hypotheses:
        return None
    # the nominal model is always shown: all others are compared with it
    shown = [h for k, h in enumerate(finding.hypotheses) if k < MOST_SHOWN or not h.effects]
    others = [h for h in finding.hypotheses if h not in shown]
    top = max((h.evidence for h in finding.hypotheses), default=0.0)
    rows = [_row(h, finding, top) for h in shown]
    rest = folded(f"{len(others)} weaker hypotheses", _table(others, finding)) if others else None
    return joined(figure(caption(finding), tag("ol", *rows, class_="ranking"), note=_NOTE), rest, _alike(finding))


def caption(finding: Finding) -> str:
    """The main result of the ranking in one sentence."""
    best = best_of(finding)
    if best is None:
        return "Only the nominal model was considered"
    parts = [f"{best.title} explains {percent(best.explained)} of the misfit beyond the noise"]
    if best.predicted is not None:
        parts.append(f"and predicts {percent(best.predicted)} of it in recordings left out of the fit")
    overlapping = set(best.effects)
    rivals = [h for h in finding.hypotheses if h.effects and not overlapping & set(h.effects)]
    rival = max(rivals, key=lambda h: h.explained, default=None)
    if rival is not None:
        parts.append(f"; without it, at most {percent(rival.explained)} ({rival.title})")
    return " ".join(parts).replace(" ;", ";")


def _row(hypothesis: Hypothesis, finding: Finding, top: float) -> Markup:
    selected = finding.alike if finding.verdict == "ambiguous" else [finding.named]
    named = bool(hypothesis.effects) and any(set(hypothesis.effects) == set(names) for names in selected)
    scale = channel_scale(finding)
    evidence = hypothesis.evidence / top if top > 0 else 0.0
    sure = hypothesis.refitted or not hypothesis.effects
    estimate = "" if sure else " (linear estimate, not refitted)"
    bars = [
        _bar("probability", hypothesis.probability, percent(hypothesis.probability), "strong"),
        _bar("explained", hypothesis.explained, percent(hypothesis.explained), "plain" if sure else "guess"),
    ]
    if hypothesis.predicted is not None:
        bars.append(_bar("predicted", hypothesis.predicted, percent(hypothesis.predicted), "plain"))
    bars.append(_bar("evidence", evidence, _signed(hypothesis.evidence), "pale"))
    about = [
        tag("h3", hypothesis.title, _family(hypothesis)),
        tag("p", hypothesis.signature) if hypothesis.signature else None,
        tag("p", f"Residual {scale.text(hypothesis.misfit)}{estimate}.", class_="quiet"),
        tag("p", hypothesis.source, class_="quiet") if hypothesis.source else None,
    ]
    return tag("li", tag("div", *about), tag("div", *bars, class_="bars"), class_="named" if named else None)


def _family(hypothesis: Hypothesis) -> Markup | None:
    if not hypothesis.effects:
        return tag("span", "nominal model", class_="badge")
    kind = "measurement" if hypothesis.family == "measurement" else "physics"
    words = kind if hypothesis.family in ("measurement", "") else f"{kind}: {hypothesis.family}"
    return tag("span", words, class_=f"badge {kind}")


def _bar(name: str, part: float, value: str, class_: str) -> Markup:
    return joined(
        tag("span", name, class_="name"),
        bar(part, class_),
        tag("span", value, class_="value negative" if part < 0 else "value"),
    )


def _table(hypotheses: list[Hypothesis], finding: Finding) -> Markup:
    scale = channel_scale(finding)
    columns: dict[str, Callable[[Hypothesis], str]] = {
        "hypothesis": lambda h: h.title,
        "family": lambda h: h.family,
        "probability": lambda h: percent(h.probability),
        "score (genes)": lambda h: f"{number(h.score)} ({h.freedom})",
        "explained": lambda h: percent(h.explained),
        "predicted": lambda h: "" if h.predicted is None else percent(h.predicted),
        "evidence": lambda h: _signed(h.evidence),
        "residual": lambda h: scale.text(h.misfit),
    }
    return table_of(hypotheses, columns, numbers=6)


def _alike(finding: Finding) -> Markup | None:
    if not finding.alike:
        return None
    known = titles(finding)
    sets = [tag("li", listed((title_of(name, known) for name in names), "and")) for names in finding.alike]
    return joined(tag("h3", "Not distinguishable by these recordings"), tag("ul", *sets, class_="plain"))


def _signed(value: float) -> str:
    return f"+{number(value)}" if value > 0 else number(value)
