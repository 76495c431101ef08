"""Misfits to recordings, fitted and held out, before and after, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Problem
from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.intervals import CONFIDENCE
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.finding import Interval, Proof, RecordingMisfit
from wingfit.records import Recording

Array = npt.NDArray[np.float64]

DRAWS = 400  # of markers, with replacement (bootstrap; Efron 1979)
FEWEST = 4  # markers to draw from


@dataclass(frozen=True)
class Predicted:
    """Residuals [T, C] of each recording of a stack, with the nominal model and with what was found.

    ``broken``: what was found could not be simulated under every recording; those are not among the stack's.
    """

    stack: Stack
    before: tuple[Array, ...]
    after: tuple[Array, ...]
    broken: bool = False


def predicted(
    recordings: Sequence[Recording], axes: tuple[str, ...], evaluator: Evaluator, before: Fit, after: Fit
) -> tuple[Predicted | None, tuple[str, ...]]:
    """Predict recordings that neither model was fitted to, and say which cannot be; None where none can by both."""
    kept, pairs, failed, broken = list[Recording](), list[tuple[Array, Array]](), list[str](), False
    for recording in recordings:
        one, found, reasons = Stack.of([recording], axes), [], []
        for fit in (before, after):
            problem = Problem(fit.problem.model, one.recordings, fit.problem.free, fit.problem.base, axes)
            _, (reason,), (residuals,) = one.evaluate(problem, evaluator, np.array([list(fit.values.values())]))
            found.append(residuals[0])
            reasons.append(reason)
        broken = broken or reasons[1] is not None
        if any(reasons):
            which = "the nominal model" if reasons[0] else "what was found"
            failed.append(f"{recording.name} was not predicted: {which} fails there: {reasons[0] or reasons[1]}")
        else:
            kept.append(recording)
            pairs.append((found[0], found[1]))
    if not kept:
        return None, tuple(failed)
    before_all, after_all = zip(*pairs, strict=True)
    return Predicted(Stack.of(kept, axes), before_all, after_all, broken), tuple(failed)


def recording_misfits(predicted: Predicted, *, held_out: bool, floor: float) -> tuple[RecordingMisfit, ...]:
    """Misfit to each recording; ``floor`` (m or N) is what the model's division leaves beside the noise."""
    rows = []
    for r, recording in enumerate(predicted.stack.recordings):
        view, condition = predicted.stack.views[r], recording.condition
        own = Predicted(predicted.stack, (predicted.before[r],), (predicted.after[r],))
        before, after, _ = _misfits(own, [view.used], [recording.kind])
        noise = float(np.sqrt(np.mean(view.noise[view.used] ** 2)))
        rows.append(
            RecordingMisfit(
                recording.name,
                held_out,
                condition.flap_frequency,
                float(np.degrees(condition.phase_lag)),
                condition.pressure / 100.0,
                condition.airspeed,
                before,
                after,
                float(np.hypot(noise, floor)),
            )
        )
    return tuple(rows)


def proof(predicted: Predicted, floor: float, unit: str, *, put_in: bool) -> Proof:
    """What the held-out recordings say of both models together; ``floor`` as in :func:`recording_misfits`.

    ``put_in``: whether the models differ.
    """
    stack = predicted.stack
    used, kinds = [view.used for view in stack.views], [one.kind for one in stack.recordings]
    before, after, better = _misfits(predicted, used, kinds)
    least = float(np.hypot(stack.noise, floor))
    told = {"m": (1e3, "mm"), "N": (1e3, "mN")}[unit]
    change = f"{told[0] * before.value:.3g} {told[1]}"
    if put_in:
        change += f" before, {told[0] * after.value:.3g} {told[1]} after"
    better = better and not predicted.broken
    several = "s" if len(stack.recordings) > 1 else ""
    words = f"{len(stack.recordings)} held-out recording{several}: {change}, {after.value / least:.2f} times the floor"
    if put_in and not better:
        words += "; that it is better is not sure"
    return Proof(_over(before, least), _over(after, least), least, better, words)


def _over(interval: Interval, floor: float) -> Interval:
    low, high = interval.low, interval.high
    return Interval(interval.value / floor, low and low / floor, high and high / floor)


def _misfits(
    predicted: Predicted, used: Sequence[npt.NDArray[np.bool_]], kinds: Sequence[str]
) -> tuple[Interval, Interval, bool]:
    """Root mean squares before and after with intervals, and whether after is surely less."""
    groups: list[Array] = []
    for before, after, own, kind in zip(predicted.before, predicted.after, used, kinds, strict=True):
        width = 3 if kind == "tracks" else 1
        squares = np.stack([np.where(own, one, np.nan) ** 2 for one in (before, after)])
        count = np.isfinite(squares[0]).sum(axis=0)
        total = np.nansum(squares, axis=1)
        rows = np.concatenate([total, count[None].astype(float)]).reshape(3, -1, width).sum(axis=2)
        groups.append(rows[:, rows[2] > 0])
    every = np.concatenate(groups, axis=1)
    if "forces" in kinds or every.shape[1] < FEWEST:  # stretches of time instead of markers
        every = _stretches(predicted, used)
    drawn = np.random.default_rng(0).integers(0, every.shape[1], (DRAWS, every.shape[1]))
    sums = every[:, drawn].sum(axis=2)
    rms = np.sqrt(sums[:2] / sums[2])
    whole = np.sqrt(every[:2].sum(axis=1) / every[2].sum())
    ends = np.quantile(rms, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2], axis=1)
    found = [Interval(float(w), float(a), float(b)) for w, a, b in zip(whole, *ends, strict=True)]
    return found[0], found[1], bool(np.mean(rms[1] < rms[0]) >= 0.5 + CONFIDENCE / 2)


def _stretches(predicted: Predicted, used: Sequence[npt.NDArray[np.bool_]], count: int = 12) -> Array:
    rows = []
    for before, after, own in zip(predicted.before, predicted.after, used, strict=True):
        for part in np.array_split(np.arange(len(before)), count):
            squares = [np.where(own, one[part], np.nan) ** 2 for one in (before, after)]
            rows.append([np.nansum(squares[0]), np.nansum(squares[1]), np.isfinite(squares[0]).sum()])
    found = np.array(rows, float).T
    return np.asarray(found[:, found[2] > 0])
