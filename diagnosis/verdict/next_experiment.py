"""What to record next: the condition under which the explanations that are still alive differ most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.calibration.estimates.linearised import free_genes, residuals_of, values_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem
from wingfit.diagnosis.evidence.fit import PRIOR, Fit
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.finding import Advice
from wingfit.diagnosis.subject import Subject
from wingfit.diagnosis.verdict.weigh_hypotheses import Weighed, tolerated
from wingfit.inference.differences import Outputs, differences
from wingfit.records import Condition, Recording

Array = npt.NDArray[np.float64]

ALIVE = 0.02  # probability from which an explanation is alive
RIVALS = 3
TOLD = 5  # conditions
DECIDED = 0.9  # probability from which few conditions are compared: there is little to separate
FEW = 8


def rivals(weighed: Weighed) -> list[Refit]:
    """The explanations that are still alive, most probable first; a single one with the next. None where none is."""
    order = np.argsort(-weighed.probabilities, kind="stable")
    alive = [k for k in order if weighed.probabilities[k] >= ALIVE]
    return [weighed.refits[k] for k in (order[:2] if len(alive) == 1 else alive)[:RIVALS]]


def separations(
    subject: Subject, stack: Stack, weighed: Weighed, evaluator: Evaluator
) -> Iterator[tuple[float, tuple[float, Condition] | None]]:
    """How far explanations would lie apart under conditions that might be recorded, with the part that is done.

    First as they were fitted, then, where that is far, by what a rival cannot make up for, which is never more: until
    no other condition can be among the best TOLD. Nothing where no two explanations are left or no other condition can
    be run.
    """
    alive, able = rivals(weighed), subject.conditions()
    if len(alive) < 2:
        return
    if weighed.probabilities.max() >= DECIDED:
        able = able[:FEW]
    scenes = list[tuple[float, _Scene]]()
    for k, condition in enumerate(able):
        scene = _scene(subject, alive[0], condition)
        least = None if scene is None else _least(subject, stack, scene, alive[1:], evaluator, adapts=False)
        scenes += [] if scene is None or least is None else [(least, scene)]
        yield 0.5 * (k + 1) / len(able), None
    found = list[float]()
    for k, (most, scene) in enumerate(sorted(scenes, key=lambda pair: -pair[0])):
        if sum(one >= most for one in found) >= TOLD:
            return
        least = _least(subject, stack, scene, alive[1:], evaluator, adapts=True)
        found += [] if least is None else [least]
        yield 0.5 + 0.5 * (k + 1) / len(scenes), None if least is None else (least, scene.shell.condition)


def advised(stack: Stack, weighed: Weighed, apart: Sequence[tuple[float, Condition]]) -> tuple[Advice, ...]:
    """Conditions to record next, best first, from :func:`separations`."""
    best, alive = sorted(apart, key=lambda pair: -pair[0])[:TOLD], rivals(weighed)
    return tuple(_advice(stack, weighed, alive, size, condition) for size, condition in best)


@dataclass(frozen=True)
class _Scene:
    """A condition with what the first explanation, of ``genome`` [G], shows under it."""

    genome: Array
    shell: Recording


def _scene(subject: Subject, first: Refit, condition: Condition) -> _Scene | None:
    genome = first.fit.problem.genomes(np.array(list(first.fit.values.values())))[0]
    shell = subject.shown(subject.beside(subject.extended(first.names), genome), genome, condition)
    return None if shell is None else _Scene(genome, shell)


def _least(
    subject: Subject, stack: Stack, scene: _Scene, others: Sequence[Refit], evaluator: Evaluator, *, adapts: bool
) -> float | None:
    """Of several rivals; None where one of them cannot be simulated."""
    every = [unlike(subject, stack, scene.genome, scene.shell, one.fit, evaluator, adapts=adapts) for one in others]
    known = [one for one in every if one is not None]
    return min(known) if len(known) == len(others) else None


def unlike(
    subject: Subject, stack: Stack, genome: Array, shell: Recording, rival: Fit, evaluator: Evaluator, *, adapts: bool
) -> float | None:
    """Root mean square difference (in noises) of a rival from what the first explanation foretells.

    Where it ``adapts``, with its genes moved as far as the recordings that there are allow. What makes two explanations
    alike is that their genes differ: where these alone set them apart, a new recording is met by other genes (Atkinson
    and Fedorov 1975: T-optimality; here with what is known of the genes already).
    """
    problem = Problem(
        subject.beside(rival.problem.model, genome),
        (shell,),
        rival.problem.free,
        rival.problem.base,
        rival.problem.axes,
    )

    def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        evaluation = evaluator.evaluate(problem, values_at(free_genes(problem), units), residuals=True)
        return residuals_of(evaluation), evaluation.reasons

    columns = np.arange(len(rival.unit)) if adapts else np.empty(0, np.int64)
    try:
        found = differences(simulate, rival.unit, columns, sides=1)
    except ValueError:
        return None
    seen = np.isfinite(found.outputs[0])
    white, slopes = found.outputs[0][seen] / stack.noise, found.slopes[0][seen].T / stack.noise
    whole = float(white @ white)
    if adapts:
        whole -= _made_up_for(stack, rival, white, slopes)
    return float(np.sqrt(max(whole, 0.0) / len(white)))


def _made_up_for(stack: Stack, rival: Fit, difference: Array, slopes: Array) -> float:
    """Of the square of a ``difference`` [n] (in noises): what genes with ``slopes`` [F, n] take, and cost elsewhere."""
    memory = float(np.clip(np.mean([view.lag1 for view in stack.views]), 0.0, 0.99))
    trust = stack.trust(rival.coefficients)
    counts = trust * (1.0 - memory) / (1.0 + memory)  # of a sample: noise that lasts tells less
    known = rival.jacobian / stack.scale[:, None]
    told = trust * known.T @ known + np.eye(len(rival.unit)) / PRIOR**2
    score = slopes @ difference
    return float(counts * score @ np.linalg.solve(told + counts * slopes @ slopes.T, score))


def _advice(stack: Stack, weighed: Weighed, alive: Sequence[Refit], apart: float, condition: Condition) -> Advice:
    share = 1.0 / (len(stack.recordings) + 1.0)
    unit = stack.noise**2
    tau = tolerated(stack, weighed.left[0] * unit, 0.0) / unit + float(weighed.left.min())
    gain = 0.5 * stack.pieces / (1.0 - share) * np.log1p(share * apart**2 / tau)
    odds = np.log(stack.policy.single / (1.0 - stack.policy.single))
    resolves = float(1.0 / (1.0 + np.exp(-(gain - odds))))
    lag, incidence = float(np.degrees(condition.phase_lag)), float(np.degrees(condition.angle_of_attack))
    where = f"{condition.flap_frequency:.3g} Hz, {lag:.3g} deg of lag, {condition.pressure / 100.0:.4g} mbar"
    if condition.airspeed > 0:
        where += f", {condition.airspeed:.3g} m/s at {incidence:.3g} deg"
    names = tuple(" and ".join(one.names) or "nothing lacking" for one in alive)
    told = [" with ".join(trial.suspect.title.lower() for trial in one.trials) or "nothing lacking" for one in alive]
    return Advice(
        f"record at {where}: {' or '.join(told)} would differ by {apart:.2g} times the noise",
        condition.flap_frequency,
        lag,
        condition.pressure / 100.0,
        condition.airspeed,
        incidence,
        apart,
        resolves,
        names,
    )
