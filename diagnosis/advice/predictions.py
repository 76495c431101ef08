"""Simulates what each of the rivals predicts of a recording that has not been made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, residuals_of, values_at
from wingfit.diagnosis.advice.rivals import Prediction, Rivals
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.subject import beat_subject
from wingfit.inference.campaign.noise_level import NoiseLevel
from wingfit.inference.campaign.responses import Response
from wingfit.inference.campaign.sampling import Sampling, blank_on_grid, seen_sampling
from wingfit.inference.differences import Outputs, differences
from wingfit.records import Condition, Recording
from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.sim.model import Model


@dataclass(frozen=True, eq=False)
class Simulated:
    """What the rivals predict under a condition: the changes are those of a :class:`Prediction`.

    ``sampling``: of the recorded one under the most similar condition; ``channels``: names of all that are simulated.
    """

    response: Response
    sampling: Sampling
    channels: tuple[str, ...]

    def of(self, level: NoiseLevel, noise: float, kept: Bool[Mask, " C"]) -> Prediction:
        """Return the prediction of the channels ``kept`` [C]; ``noise``: of a sample in an excess, m or N."""
        changes = self.response.changes[:, kept]
        flat = changes.reshape(-1, changes.shape[-1]) / noise
        true = self.response.information(level, self.sampling, kept).true
        return Prediction(flat.T @ flat / len(flat), true)


def first_prediction(context: FitContext, rivals: Rivals, condition: Condition) -> Recording | None:
    """Return what the most probable hypothesis predicts under ``condition``; None if that cannot be simulated."""
    first, subject = rivals.refits[0], beat_subject(context.subject)
    model = subject.with_initial_motion(subject.extended(first.names), first.fit.genome)
    return subject.simulated_recording(model, first.fit.genome, condition)


def first_on_grid(
    like: Recording, model: Model, first: Fit, markers: tuple[str, ...]
) -> tuple[Recording, Sampling] | None:
    """Return what ``model`` with the genes of ``first`` predicts on a grid of equal steps, else sampled as ``like``.

    None if that cannot be simulated.
    """
    sampling = seen_sampling(like)
    blank = blank_on_grid(like, like.condition, like.name, sampling, markers)
    seen = model.observe(first.genome[None], blank)
    return None if seen.reasons[0] is not None else (replace(blank, values=seen.channels[0]), sampling)


def fixed_separation(context: FitContext, rivals: Rivals, recording: Recording) -> float | None:
    """Return the least root mean square difference of the others from ``recording``, which the first predicts.

    In standard deviations of the noise, with genes as they are: an upper bound, since they may adapt. None
    where one cannot be simulated.
    """
    found = list[float]()
    for one in rivals.refits[1:]:
        seen = _differentiated(context, one.fit, one.fit.problem.model, rivals.refits[0].fit, recording, adapt=False)
        if seen is None:
            return None
        difference = seen[0][np.isfinite(seen[0])] / context.data.noise
        found.append(float(np.sqrt(np.mean(difference**2))))
    return min(found)


def simulated(
    context: FitContext,
    rivals: Rivals,
    like: Recording,
    models: Sequence[Model] = (),
    markers: tuple[str, ...] = (),
) -> Simulated | None:
    """Return what the rivals predict under the condition of ``like``, of its channels; None where one fails.

    ``models``: of the rivals, if not those of their fits; ``markers``: if not those of ``like``.
    """
    own = models or [one.fit.problem.model for one in rivals.refits]
    first = rivals.refits[0].fit
    base = context.subject.with_initial_motion(own[0], first.genome)
    shown = first_on_grid(like, base, first, markers or like.markers)
    if shown is None:
        return None
    recording, sampling = shown
    slopes, values = list[Array](), list[Array]()
    for one, model in zip(rivals.refits, own, strict=True):
        seen = _differentiated(context, one.fit, model, first, recording, adapt=True)
        if seen is None:
            return None
        values.append(np.nan_to_num(seen[0]))
        slopes.append(np.nan_to_num(seen[1]))
    size = recording.values.size
    changes = rivals.stacked([one.reshape(size, -1) for one in slopes], [one.ravel() for one in values])
    response = Response.of(recording, changes.reshape(*recording.values.shape, -1), None)
    return Simulated(response, sampling, recording.channels)


def _differentiated(
    context: FitContext, rival: Fit, model: Model, first: Fit, recording: Recording, *, adapt: bool
) -> tuple[Float[Array, "T C"], Float[Array, "T C F"]] | None:
    """Return the difference of the prediction of ``rival`` from ``recording``, and its derivatives if it may ``adapt``.

    None where it cannot be simulated.
    """
    near = context.subject.with_initial_motion(model, first.genome)
    problem = replace(rival.problem, model=near, recordings=(recording,), axes=tuple(recording.forces))

    def simulate(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        evaluation = context.evaluator.evaluate(problem, values_at(free_genes(problem), units), residuals=True)
        return residuals_of(evaluation), evaluation.reasons

    columns = np.arange(len(rival.unit)) if adapt else np.empty(0, np.int64)
    try:
        found = differences(simulate, rival.unit, columns, sides=1)
    except ValueError:
        return None
    return found.outputs[0], found.slopes[0]
