"""Marks for one finding against the answer of its trial. The rules in words: docs/concealed.md."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from benchmarks.concealed.answer import Answer, Group, Side
from wingfit.diagnosis.finding import Finding, GeneValue, Hypothesis, Interval
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.wing.genes import wing_genes

WORSE = 1.01  # a held-out misfit that is larger by less is the same
NAMING = ("named", "measurement fault")
SHARES = frozenset(gene.name for gene in wing_genes({}) if gene.share_of)  # only their ratios mean anything


@dataclass(frozen=True)
class Mark:
    """How one trial went. What does not apply to a trial is None.

    Attributes:
        trial, group, rig: as in the answer.
        truth: names of what was hidden.
        target, strength: d that was aimed at, and found by the scorer's refit.
        verdict, named: as in the finding; "failed" where the diagnosis gave none.
        top: effects of the most probable hypothesis other than the nominal model.
        alarm: something is said to be lacking.
        first: what was hidden is the most probable hypothesis; exact: the verdict names it and nothing else.
        found: number of hidden effects among those credited (pairs).
        wrong: the verdict names an effect that is not there.
        side: physics or measurement, by the verdict; None where it takes no side.
        right_side: whether that is right.
        held_out: misfit over floor on held-out recordings; worse: larger than the refitted nominal model's.
        span, chord, phase: distances from the truth in parts of R and c, and in degrees.
        covered, intervals: 90 % intervals that hold the truth, and their number.
        finer, division, plant: as in the answer.
        remark: why there is no finding, or what else a reader of failures wants.
    """

    trial: str
    group: Group
    rig: str
    truth: tuple[str, ...]
    target: float
    strength: float
    verdict: str
    named: tuple[str, ...] = ()
    top: tuple[str, ...] = ()
    alarm: bool = False
    first: bool | None = None
    exact: bool | None = None
    found: int | None = None
    wrong: bool = False
    side: Side | None = None
    right_side: bool | None = None
    held_out: float | None = None
    worse: bool | None = None
    span: float | None = None
    chord: float | None = None
    phase: float | None = None
    covered: int = 0
    intervals: int = 0
    finer: bool = False
    division: str = ""
    plant: str = ""
    seconds: float = 0.0
    remark: str = ""


def blank(answer: Answer, verdict: str, remark: str = "") -> Mark:
    """A mark with nothing but the answer in it, everything missed."""
    missed = bool(answer.secrets)
    return Mark(
        trial=answer.trial,
        group=answer.group,
        rig=answer.rig,
        truth=tuple(sorted(answer.names)),
        target=answer.target,
        strength=answer.strength,
        verdict=verdict,
        first=False if missed else None,
        exact=False if missed else None,
        found=0 if missed else None,
        right_side=False if missed else None,
        finer=answer.finer,
        division=answer.division,
        plant=answer.plant,
        remark=remark,
    )


def failed(answer: Answer, remark: str) -> Mark:
    """The mark of a diagnosis that gave no finding: the worst in all that the trial counts in."""
    span, chord, phase = (_apart(_true(answer, along), None) for along in ("span", "chord", "phase"))
    intervals = sum(len(secret.values) for secret in answer.secrets) if answer.secrets else len(_nominal(answer))
    worst = replace(blank(answer, "failed", remark), alarm=True, wrong=True, intervals=intervals)
    if not answer.secrets:
        return worst
    return replace(worst, held_out=math.inf, worse=True, span=span, chord=chord, phase=phase)


def mark(finding: Finding, answer: Answer) -> Mark:
    """Marks of a diagnosis."""
    top = tuple(leading.effects) if (leading := _leading(finding)) else ()
    named = finding.named if finding.verdict in NAMING else ()
    credited = set(named or top)
    plain = replace(blank(answer, finding.verdict), named=finding.named, top=top, alarm=finding.verdict != "adequate")
    plain = replace(plain, seconds=finding.seconds, wrong=not set(named) <= answer.names)
    held_out, worse = _proof(finding, answer)
    covered, intervals = _covered(finding, answer)
    plain = replace(plain, held_out=held_out, worse=worse, covered=covered, intervals=intervals)
    if not answer.secrets:
        return plain
    side = _side(finding)
    span, chord, phase = _distances(finding, answer)
    return replace(
        plain,
        first=set(top) == answer.names,
        exact=bool(named) and set(named) == answer.names,
        found=len(credited & answer.names),
        side=side,
        right_side=all(side == secret.side for secret in answer.secrets),
        span=span,
        chord=chord,
        phase=phase,
    )


def _leading(finding: Finding) -> Hypothesis | None:
    others = [hypothesis for hypothesis in finding.hypotheses if hypothesis.effects]
    return max(others, key=lambda hypothesis: hypothesis.probability) if others else None


def _side(finding: Finding) -> Side | None:
    """The side that a verdict takes; one that leaves a set open takes it where the whole set is on one side."""
    if finding.verdict not in (*NAMING, "ambiguous") or not finding.named:
        return None
    sides = {side_of(name) for name in finding.named}
    return sides.pop() if len(sides) == 1 else None


def side_of(effect: str) -> Side:
    """Whether an effect of the library is physics or a fault of the measurement."""
    known = EFFECTS.get(effect)
    return "measurement" if known is not None and known.family == "measurement" else "physics"


def _proof(finding: Finding, answer: Answer) -> tuple[float | None, bool | None]:
    """Held-out misfit over floor, and whether it is worse than the refitted nominal model's.

    The floor is the noise that was put into those very recordings, and nothing else: a diagnosis may go to a finer
    division, so what the first one leaves is no excuse.
    """
    held_out = [one for one in finding.recordings if one.held_out]
    if not held_out:
        return None, None
    before = math.hypot(*(one.before.value for one in held_out)) / math.sqrt(len(held_out))
    after = math.hypot(*(one.after.value for one in held_out)) / math.sqrt(len(held_out))
    return after / answer.noise_held_out, after > WORSE * before


def _covered(finding: Finding, answer: Answer) -> tuple[int, int]:
    """How many intervals hold the truth, of those that can: effects that were found, and nominal genes of a null.

    A plant of finer division has no true value of the coarser model's genes, nor has one with physics that the model
    lacks: only a null trial at equal division has.
    """
    true = _nominal(answer)
    if finding.verdict in NAMING:
        for secret in answer.secrets:
            if secret.name in finding.named:
                true.update(secret.values)
    inside = [_holds(gene, true[gene.name]) for gene in finding.genes if gene.name in true]
    told = [one for one in inside if one is not None]
    return sum(told), len(told)


def _nominal(answer: Answer) -> dict[str, float]:
    """True values of the nominal genes, where a model can have them."""
    if answer.secrets or answer.finer:
        return {}
    return {name: value for name, value in answer.genome.items() if name not in SHARES}


def _true(answer: Answer, along: str) -> float | None:
    """Where the only thing that is hidden acts along the span, the chord or the beat; None if there is no one place."""
    value: float | None = getattr(answer.secrets[0], along) if len(answer.secrets) == 1 else None
    return value


def _holds(gene: GeneValue, true: float) -> bool | None:
    low, high = gene.value.low, gene.value.high
    return None if low is None or high is None else low <= true <= high


def _distances(finding: Finding, answer: Answer) -> tuple[float | None, float | None, float | None]:
    """How far the place that is told lies from the true one; infinitely, where none is told."""
    where = finding.where
    span = _place(finding, answer, "station") or (where.span if where else None)
    chord = _place(finding, answer, "chord") or (where.chord if where else None)
    phase = where.phase if where else None
    return (
        _apart(_true(answer, "span"), span),
        _apart(_true(answer, "chord"), chord),
        _apart(_true(answer, "phase"), phase, lambda a, b: 360 * beats_apart(a, b)),
    )


def _place(finding: Finding, answer: Answer, parameter: str) -> Interval | None:
    """The place by a gene of the effect that is named, where it has one."""
    secret = answer.secrets[0]
    if finding.verdict not in NAMING or secret.name not in finding.named:
        return None
    wanted = f"{secret.name}.{parameter}"
    return next((gene.value for gene in finding.genes if gene.name == wanted), None)


def _apart(
    true: float | None, told: Interval | None, distance: Callable[[float, float], float] = lambda a, b: abs(a - b)
) -> float | None:
    if true is None:
        return None
    return math.inf if told is None else distance(told.value, true)


def beats_apart(a: float, b: float) -> float:
    """Distance of two phases in beats, the shorter way round."""
    return abs((a - b + 0.5) % 1.0 - 0.5)
