"""Select and describe the hypotheses for their ranking in the report."""

from __future__ import annotations

from wingfit.diagnosis.finding import Finding, Hypothesis
from wingfit.report.number_format import best_of, percent

MOST_SHOWN = 8
LEAST_LISTED = 1e-3  # probability of a hypothesis of several effects; each effect alone is always listed


def parts(finding: Finding) -> tuple[list[Hypothesis], list[Hypothesis], int]:
    """Return the hypotheses shown in full (MOST_SHOWN and the nominal model), those listed, and how many more."""
    # the nominal model is always shown: all others are compared with it
    shown = [h for k, h in enumerate(finding.hypotheses) if k < MOST_SHOWN or not h.effects]
    others = [h for h in finding.hypotheses if h not in shown]
    listed = [h for h in others if len(h.effects) == 1 or h.probability >= LEAST_LISTED]
    return shown, listed, len(others) - len(listed)


def is_selected(hypothesis: Hypothesis, finding: Finding) -> bool:
    """Return whether the verdict names this hypothesis."""
    selected = finding.indistinguishable if finding.verdict == "ambiguous" else [finding.named]
    return bool(hypothesis.effects) and any(set(hypothesis.effects) == set(names) for names in selected)


def caption(finding: Finding) -> str:
    """Return the main result of the ranking in one sentence."""
    best = best_of(finding)
    if best is None:
        return "Only the nominal model was considered"
    parts = [f"{best.title} explains {percent(best.explained)} of the misfit beyond the noise"]
    if best.predicted is not None:
        parts.append(f"and predicts {percent(best.predicted)} of it in recordings left out of the fit")
    rivals = [h for h in finding.hypotheses if h.effects and not set(best.effects) & set(h.effects)]
    rival = max(rivals, key=lambda h: h.explained, default=None)
    if rival is not None:
        parts.append(f"; without it, at most {percent(rival.explained)} ({rival.title})")
    return " ".join(parts).replace(" ;", ";")
