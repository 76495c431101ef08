"""The nominal model at its best: fitted, at a division that does not limit it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.calibration.estimates.linearised import free_genes, unit_at
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.fit import Fit, thoroughly
from wingfit.diagnosis.evidence.refit import Refit, again, ended, judged
from wingfit.diagnosis.evidence.screen import Nuisance
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.subject import Subject

Array = npt.NDArray[np.float64]

STEPS = 20
ROUNDS = 3  # of refinement


@dataclass(frozen=True)
class Nominal:
    """The nominal model fitted.

    Attributes:
        subject: with the division that was settled on.
        refit: its fit.
        division: misfit (m or N) that its division leaves, by the next finer one; None where there is none.
        finer: in words.
        innocent: finer division, in words, that was fitted and hardly did better, so that it is not the division that
            limits; "" where there is none.
        remarks: for the reader.
    """

    subject: Subject
    refit: Refit
    division: float | None
    finer: str
    remarks: tuple[str, ...]
    innocent: str = ""


def first_fit(
    subject: Subject,
    stack: Stack,
    evaluator: Evaluator,
    free: tuple[str, ...],
    values: Mapping[str, float],
    fixed: Mapping[str, float],
) -> Iterator[Fit]:
    """Fit the ``free`` genes from ``values``, step by step; ValueError where the model cannot be simulated there."""
    base = base_genome(subject.model, {**values, **fixed})
    problem = Problem(subject.model, stack.recordings, free, base, stack.axes)
    genes = free_genes(problem)
    start = unit_at(genes, np.array([base[gene.name] for gene in genes]))
    return thoroughly(subject, stack, problem, evaluator, start, STEPS)


def settled(subject: Subject, stack: Stack, evaluator: Evaluator, fit: Fit, *, refine: bool) -> Nominal:
    """Go to finer divisions while these fit much better, and say what the last one's division leaves."""
    now, remarks = judged(stack, fit), list[str]()
    for _ in range(ROUNDS):
        left, finest, better, tried = 0.0, "", None, ""
        for finer in subject.finer():
            changes, takes = leaves(finer, stack, evaluator, now)
            if changes <= left:
                continue
            left, finest, tried = changes, finer.told, ""
            if refine and promises(stack, changes, takes, now):
                found = again(finer, stack, evaluator, now)
                better = ended(finer, stack, evaluator, found) if found and improves(stack, found, now) else None
                tried = finer.told if found is not None else ""
            if better is not None:
                break
        if better is None:
            return Nominal(subject, now, left if finest else None, finest, tuple(remarks), tried)
        remarks.append(
            f"the division limits the model: {finest} leaves {_percent(better.excess, now.excess)} of the excess "
            f"misfit that {subject.told} leaves, and was taken instead"
        )
        subject, now = finer, better
    return Nominal(subject, now, None, "", tuple(remarks))


def promises(stack: Stack, changes: float, takes: float, now: Refit) -> bool:
    """Whether a division that ``changes`` as much (m or N) and ``takes`` such a part of a misfit is worth a fit.

    Of one that changes more than the whole misfit the linearised model knows nothing.
    """
    policy = stack.policy
    matters = changes >= policy.finer_matters * stack.noise and now.excess >= (policy.finer_limit * stack.noise) ** 2
    return matters and (takes > policy.finer_promise or changes**2 >= now.excess)


def leaves(finer: Subject, stack: Stack, evaluator: Evaluator, refit: Refit) -> tuple[float, float]:
    """What the finer model says differently and the genes cannot make up for: root mean square (m or N).

    And which part of the misfit that would take away, as far as the linearised model knows; zeros if it fails.
    """
    fit = refit.fit
    problem = Problem(finer.extended(refit.names), stack.recordings, fit.problem.free, fit.problem.base, stack.axes)
    found, reasons, _ = stack.evaluate(problem, evaluator, np.array([list(fit.values.values())]))
    if reasons[0] is not None:
        return 0.0, 0.0
    nuisance = Nuisance(stack, fit)
    rest, left = nuisance.rest(found[0] - fit.coefficients), nuisance.left
    power = float(rest @ rest)
    amount = float(np.clip(-(rest @ left) / max(power, 1e-300), 0.0, stack.policy.division_factor))
    excess = max(float(left @ left) - len(left), 1e-300)
    taken = (float(left @ left) - float(np.sum((left + amount * rest) ** 2))) / excess
    return float(np.sqrt(stack.weight @ (rest[: len(stack.scale)] * stack.scale) ** 2)), taken


def improves(stack: Stack, finer: Refit, coarse: Refit) -> bool:
    """Whether a finer division takes away so much of the excess that it is worth its cost."""
    return finer.excess < (1.0 - stack.policy.finer_gain) * coarse.excess and coarse.excess > 0.0


def _percent(part: float, whole: float) -> str:
    return f"{100 * max(part, 0.0) / whole:.0f} %"
