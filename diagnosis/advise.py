"""What to record next: the condition under which the explanations that are still alive differ most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from calibration.evaluator import Evaluator
from calibration.linearised import free_genes, values_at
from calibration.problem import Problem
from diagnosis.decide import SURE, Weighed, tolerated
from diagnosis.finding import Advice
from diagnosis.fit import PRIOR, STEP, Fit
from diagnosis.refit import Refit
from diagnosis.stack import Stack
from diagnosis.subject import Subject
from records import Condition, Recording

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
    """How far explanations would lie apart under each condition that might be recorded, with the part that is done.

    Nothing where no two explanations are left or no other condition can be run; None for one that cannot be simulated.
    """
    alive, able = rivals(weighed), subject.conditions()
    if len(alive) < 2:
        return
    if weighed.probabilities.max() >= DECIDED:
        able = able[:FEW]
    for k, condition in enumerate(able):
        apart = _apart(subject, stack, alive, condition, evaluator)
        yield (k + 1) / len(able), None if apart is None else (apart, condition)


def advised(stack: Stack, weighed: Weighed, apart: Sequence[tuple[float, Condition]]) -> tuple[Advice, ...]:
    """Conditions to record next, best first, from :func:`separations`."""
    best, alive = sorted(apart, key=lambda pair: -pair[0])[:TOLD], rivals(weighed)
    return tuple(_advice(stack, weighed, alive, size, condition) for size, condition in best)


def _apart(
    subject: Subject, stack: Stack, alive: Sequence[Refit], condition: Condition, evaluator: Evaluator
) -> float | None:
    """Least root mean square (in noises) of what another explanation could not make up for under ``condition``."""
    first = alive[0].fit
    genome = first.problem.genomes(np.array(list(first.values.values())))[0]
    shell = subject.shown(subject.beside(subject.extended(alive[0].names), genome), genome, condition)
    if shell is None:
        return None
    differences = [unlike(subject, stack, genome, shell, other.fit, evaluator) for other in alive[1:]]
    known = [one for one in differences if one is not None]
    return min(known) if known else None


def unlike(
    subject: Subject, stack: Stack, genome: Array, shell: Recording, rival: Fit, evaluator: Evaluator
) -> float | None:
    """Root mean square difference (in noises) of a rival from what the first explanation foretells, its genes adapting.

    They adapt as far as the recordings that there are allow. What makes two explanations alike is that their genes
    differ: where these alone set them apart, a new recording is met by other genes (Atkinson and Fedorov 1975:
    T-optimality; here with what is known of the genes already).
    """
    problem = Problem(
        subject.beside(rival.problem.model, genome),
        (shell,),
        rival.problem.free,
        rival.problem.base,
        rival.problem.axes,
    )
    moves = np.where(rival.unit > 1.0 - STEP, -STEP, STEP)
    units = np.vstack([rival.unit, rival.unit + np.diag(moves)])
    evaluation = evaluator.evaluate(problem, values_at(free_genes(problem), units), residuals=True)
    residuals = evaluation.per_recording[0].residuals
    if residuals is None or any(reason is not None for reason in evaluation.reasons):
        return None
    seen = np.isfinite(residuals).all(axis=0)
    white = residuals[:, seen] / stack.noise
    memory = float(np.clip(np.mean([view.memory for view in stack.views]), 0.0, 0.99))
    counts = (1.0 - memory) / (1.0 + memory)  # of a sample: noise that lasts tells less
    slopes, known = (white[1:] - white[0]) / moves[:, None], rival.jacobian / stack.scale[:, None]
    trust = stack.trust(rival.coefficients)
    told = trust * known.T @ known + np.eye(len(moves)) / PRIOR**2
    score = trust * counts * slopes @ white[0]
    gained = score @ np.linalg.solve(told + trust * counts * slopes @ slopes.T, score)
    whole = float(white[0] @ white[0]) - float(gained) / (trust * counts)
    return float(np.sqrt(max(whole, 0.0) / white.shape[1]))


def _advice(stack: Stack, weighed: Weighed, alive: Sequence[Refit], apart: float, condition: Condition) -> Advice:
    share = 1.0 / (len(stack.recordings) + 1.0)
    unit = stack.noise**2
    tau = tolerated(stack, weighed.left[0] * unit, 0.0) / unit + float(weighed.left.min())
    gain = 0.5 * stack.pieces / (1.0 - share) * np.log1p(share * apart**2 / tau)
    odds = np.log(SURE / (1.0 - SURE))
    resolves = float(1.0 / (1.0 + np.exp(-(gain - odds))))
    lag, incidence = float(np.degrees(condition.phase_lag)), float(np.degrees(condition.angle_of_attack))
    where = f"{condition.flap_frequency:.3g} Hz, {lag:.3g} deg of lag, {condition.pressure / 100.0:.4g} mbar"
    if condition.airspeed > 0:
        where += f", {condition.airspeed:.3g} m/s at {incidence:.3g} deg"
    names = tuple(" and ".join(one.names) or "nothing lacking" for one in alive)
    told = [" and ".join(trial.suspect.title.lower() for trial in one.trials) or "nothing lacking" for one in alive]
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
