"""Score one finding against the answer of its trial. The rules are explained in docs/concealed.md."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from benchmarks.concealed.answer import Answer, Group, Side
from benchmarks.concealed.plant.measurement.balance import CHOICES
from benchmarks.concealed.trials import LATTICE
from wingfit.diagnosis.finding import NAMING, Finding, GeneValue, Hypothesis, Interval
from wingfit.sim.effects.registry import EFFECTS

BINS = {2: (1.6, 2.45), 3: (2.45, 3.87), 5: (3.87, math.inf)}
"""Range of the measured strength d (misfit / noise) by intended d. Trials below the first are too weak to count."""
WEAK = BINS[2][0]
WORSE = 1.01  # ratio of held-out misfits above which the second counts as worse


@dataclass(frozen=True)
class Mark:
    """Score of one trial. Entries that do not apply to a trial are None.

    Attributes:
        trial, group, rig: as in :class:`.answer.Answer`.
        truth: names of the hidden effects.
        target, strength: misfit / noise intended for each hidden effect, and measured for all together by a refit.
        verdict, named: as in the finding; "failed" if the diagnosis gave none.
        top: effects of the most probable hypothesis other than the nominal model.
        alarm: the verdict is not "adequate".
        first: ``top`` are the hidden effects and no others; exact: the verdict names these and no others.
        found: number of hidden effects among those that the verdict names, or among ``top`` if it names none.
        among: the hidden effects are one of the hypotheses that an ambiguous verdict leaves open.
        wrong: the verdict names an effect that was not hidden.
        side: physics or measurement, according to the verdict; None if the verdict does not decide.
        right_side: whether all hidden effects are of this side.
        held_out: misfit / noise on held-out recordings; worse: whether the misfit is more than 1 % larger than with the
            refitted nominal model.
        span, chord, phase: distance of the reported from the true place, in spans, chords and degrees of the beat.
        covered, intervals: number of 90 % intervals that contain the true value, and number of intervals.
        finer, division, plant, body: as in the answer.
        probability: of the verdict, according to the finding.
        seconds: duration of the diagnosis.
        remark: why there is no finding, or other notes for the list of failures.
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
    among: bool | None = None
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
    body: str = ""
    probability: float = 0.0
    seconds: float = 0.0
    remark: str = ""


def blank(answer: Answer, verdict: str, remark: str = "") -> Mark:
    """A score with the entries of ``answer``; all that a diagnosis should have detected counts as missed."""
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
        body=answer.body,
        remark=remark,
    )


def failed(answer: Answer, remark: str) -> Mark:
    """The score of a diagnosis that gave no finding: the worst value of every entry."""
    span, chord, phase = (_apart(_true(answer, along), None) for along in ("span", "chord", "phase"))
    intervals = sum(len(secret.values) for secret in answer.secrets) if answer.secrets else len(_nominal(answer))
    worst = replace(blank(answer, "failed", remark), alarm=True, wrong=True, intervals=intervals)
    if not answer.secrets:
        return worst
    return replace(worst, held_out=math.inf, worse=True, span=span, chord=chord, phase=phase)


def mark(finding: Finding, answer: Answer) -> Mark:
    """Score a finding of the diagnosis against the answer of its trial."""
    top = tuple(leading.effects) if (leading := _leading(finding)) else ()
    named = finding.named if finding.verdict in NAMING else ()
    credited = set(named or top)
    plain = replace(blank(answer, finding.verdict), named=finding.named, top=top, alarm=finding.verdict != "adequate")
    plain = replace(plain, seconds=finding.seconds, probability=finding.probabilities.get(finding.verdict, 0.0))
    plain = replace(plain, wrong=not set(named) <= answer.names)
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
        among=any(set(one) == answer.names for one in finding.indistinguishable),
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
    """The side ("physics" or "measurement") of all effects that the verdict names; None if it names none or both."""
    if finding.verdict not in (*NAMING, "ambiguous") or not finding.named:
        return None
    sides = {side_of(name) for name in finding.named}
    return sides.pop() if len(sides) == 1 else None


def side_of(effect: str) -> Side:
    """Whether an effect of the library is physics or a fault of the measurement."""
    known = EFFECTS.get(effect)
    return "measurement" if known is not None and known.family == "measurement" else "physics"


def _proof(finding: Finding, answer: Answer) -> tuple[float | None, bool | None]:
    """Held-out misfit / noise, and whether the misfit exceeds WORSE times that of the refitted nominal model.

    (None, None) without held-out recordings.

    Noise is the RMS noise added to these recordings, without the error of the first discretisation, because a
    diagnosis may choose a finer one.
    """
    held_out = [one for one in finding.recordings if one.held_out]
    if not held_out:
        return None, None
    before = math.hypot(*(one.before.value for one in held_out)) / math.sqrt(len(held_out))
    after = math.hypot(*(one.after.value for one in held_out)) / math.sqrt(len(held_out))
    return after / answer.noise_held_out, after > WORSE * before


def _covered(finding: Finding, answer: Answer) -> tuple[int, int]:
    """Number of bounded intervals that contain the true value of their gene, and number of those with a true value.

    True values exist for genes (parameters) of hidden effects that were named and, in null trials with equal
    discretisation, for the nominal genes. With a finer plant or with missing physics the nominal genes have none.
    """
    true = _nominal(answer)
    if finding.verdict in NAMING:
        for secret in answer.secrets:
            if secret.name in finding.named and secret.name not in (*CHOICES, "body_pitch_convention"):
                true.update(secret.values)
    inside = [_holds(gene, true[gene.name]) for gene in finding.genes if gene.name in true]
    known = [one for one in inside if one is not None]
    return sum(known), len(known)


def _nominal(answer: Answer) -> dict[str, float]:
    """True values of the nominal genes by name, in a null trial of a vehicle; empty otherwise.

    Of a wing, the description has wrong densities, which fitted moduli make up for; a vortex lattice has no genes.
    """
    if answer.secrets or answer.rig == "wing" or answer.plant == LATTICE:
        return {}
    return dict(answer.genome)


def _true(answer: Answer, along: str) -> float | None:
    """True place of a single hidden effect along the span, the chord or the beat; None if there is no single place."""
    value: float | None = getattr(answer.secrets[0], along) if len(answer.secrets) == 1 else None
    return value


def _holds(gene: GeneValue, true: float) -> bool | None:
    low, high = gene.value.low, gene.value.high
    return None if low is None or high is None else low <= true <= high


def _distances(finding: Finding, answer: Answer) -> tuple[float | None, float | None, float | None]:
    """Distances along span, chord (fractions) and beat (degrees) between reported and true place of the hidden effect.

    Each is infinite if no place is reported, and None if there is no true place.
    """
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
    """Estimate of the gene ``parameter`` ("station", "chord") of the hidden effect; None if that is not named."""
    secret = answer.secrets[0]
    if finding.verdict not in NAMING or secret.name not in finding.named:
        return None
    wanted = f"{secret.name}.{parameter}"
    return next((gene.value for gene in finding.genes if gene.name == wanted), None)


def _apart(
    true: float | None, reported: Interval | None, distance: Callable[[float, float], float] = lambda a, b: abs(a - b)
) -> float | None:
    if true is None:
        return None
    return math.inf if reported is None else distance(reported.value, true)


def beats_apart(a: float, b: float) -> float:
    """Distance of two phases ``a``, ``b`` (beats) on the cycle, at most 0.5 beats."""
    return abs((a - b + 0.5) % 1.0 - 0.5)
