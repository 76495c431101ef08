"""Compute misfits to recordings, fitted and held out, before and after effects are added, with intervals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.estimates.linearised import free_genes, unit_at
from wingfit.calibration.problem import Problem
from wingfit.calibration.series.beginnings import from_beginnings
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import FIT_ERRORS, Fit, gauss_newton_fit
from wingfit.diagnosis.evidence.intervals import CONFIDENCE
from wingfit.diagnosis.evidence.position_errors import PositionErrors
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import Interval, Proof, RecordingMisfit, amount
from wingfit.diagnosis.subject import beat_subject
from wingfit.inference.noise.series_fit import SeriesFit
from wingfit.records import AnyRecording, Condition, Recording
from wingfit.records.array_types import Array, Float
from wingfit.records.series import belongs_to

BOOTSTRAP_DRAWS = 400  # of markers, with replacement (Efron 1979)
MIN_MARKERS = 4  # for a bootstrap over markers
OWN_STEPS = 20  # of the fit of the genes that belong to a held-out recording alone


@dataclass(frozen=True)
class ResidualPair:
    """Residuals [T, C] of each recording of ``data``, without (``before``) and with (``after``) the added effects.

    ``incomplete``: the model with the effects could not be simulated for every recording; those are not in ``data``.
    """

    data: WhitenedData
    before: tuple[Array, ...]
    after: tuple[Array, ...]
    incomplete: bool = False

    @property
    def squares(self) -> Iterator[Array]:
        """Squares [2, T, C] of the residuals before and after, NaN where a channel is not used, by recording.

        Residuals of a series are divided by the scale of their channel.
        """
        for fit, *residuals in zip(self.data.reduced, self.before, self.after, strict=True):
            scale = fit.scale if isinstance(fit, SeriesFit) else 1.0
            yield np.stack([np.where(fit.used, one / scale, np.nan) ** 2 for one in residuals])


def fitted_residuals(context: FitContext, errors: PositionErrors | None, before: Fit, after: Fit) -> ResidualPair:
    """Return the residuals of the fitted recordings at two fits; arguments as of :func:`predict_held_out`."""
    first, then = (_corrected(context.data, context, errors, fit, fit.residuals) for fit in (before, after))
    return ResidualPair(context.data, first, then)


def predict_held_out(
    recordings: Sequence[AnyRecording], context: FitContext, errors: PositionErrors | None, before: Fit, after: Fit
) -> tuple[ResidualPair | None, tuple[str, ...]]:
    """Return residuals of recordings that neither model was fitted to, and remarks on those that cannot be simulated.

    ``before``: fit of the nominal model; ``after``: fit with effects added; ``context``: of both, whose force axes and
    thresholds are used here too. ``errors`` of the markers' rest positions, as each fit estimates them, are subtracted.
    Genes that belong to a held-out recording alone (an initial state) are fitted to it; all others keep their values.
    None where no recording can be simulated with both models.
    """
    fitted = context.data
    kept, pairs, failed, incomplete = list[AnyRecording](), list[tuple[Array, Array]](), list[str](), False
    for recording in recordings:
        one, found, reasons = fitted.like([recording]), [], []
        for fit in (before, after):
            residuals, reason = predicted_residuals(one, context, errors, fit)
            found.append(residuals)
            reasons.append(reason)
        incomplete = incomplete or reasons[1] is not None
        if any(reasons):
            which = "the nominal model" if reasons[0] else "the model with the added effects"
            failed.append(f"{recording.name} was not predicted: {which} fails: {reasons[0] or reasons[1]}")
        else:
            kept.append(recording)
            pairs.append((found[0], found[1]))
    if not kept:
        return None, tuple(failed)
    before_all, after_all = zip(*pairs, strict=True)
    data = fitted.like(kept)
    return ResidualPair(data, before_all, after_all, incomplete), tuple(failed)


def predicted_residuals(
    one: WhitenedData, context: FitContext, errors: PositionErrors | None, fit: Fit
) -> tuple[Array, str | None]:
    """Return the residuals [T, C] of the only recording of ``one`` with the genes of ``fit``, and why it failed.

    Arguments as of :func:`predict_held_out`.
    """
    try:
        problem, values = with_own_genes(one, context, fit)
    except FIT_ERRORS as error:
        return np.empty(0), str(error)
    _, (reason,), (residuals,) = one.evaluate(problem, context.evaluator, values)
    if reason is not None:
        return np.empty(0), reason
    return _corrected(one, context, errors, fit, (residuals[0],))[0], None


def _corrected(
    data: WhitenedData, context: FitContext, errors: PositionErrors | None, fit: Fit, residuals: tuple[Array, ...]
) -> tuple[Array, ...]:
    """Return ``residuals`` without what ``errors``, estimated at ``fit``, contribute to the recordings of ``data``."""
    if errors is None:
        return residuals
    return errors.corrected(beat_subject(context.subject), data, residuals, errors.estimates(context.data, fit))


def with_own_genes(one: WhitenedData, context: FitContext, fit: Fit) -> tuple[Problem, Float[Array, "1 K"]]:
    """Return the problem of the only recording of ``one`` with the genes of ``fit``, and values of its free genes.

    Free are the K genes that belong to this recording alone, which are fitted to it; without any, those of ``fit``. One
    of FIT_ERRORS where it cannot be simulated.
    """
    (recording,) = one.recordings
    problem = replace(fit.problem, recordings=one.recordings)
    own = tuple(gene.name for gene in fit.problem.model.genes if belongs_to(gene.name, recording.name))
    values = fit.individual
    if own:
        base = problem.base.replace(fit.values)
        problem = replace(problem, free=own, base=base)
        first = base.replace(from_beginnings(problem, context.evaluator, {}).values)
        start = unit_at(free_genes(problem), np.array([first[name] for name in own]))
        *_, last = gauss_newton_fit(replace(context, data=one), problem, start, OWN_STEPS)
        values = last.individual
    return problem, values


def recording_misfits(predicted: ResidualPair, *, held_out: bool, floor: float) -> tuple[RecordingMisfit, ...]:
    """Return the misfit to each recording; ``floor`` (m or N) is the discretisation error."""
    rows = []
    for r, recording in enumerate(predicted.data.recordings):
        fit = predicted.data.reduced[r]
        alone = replace(predicted.data, recordings=(recording,), reduced=(fit,), errors=None)
        before, after, _ = _misfits(ResidualPair(alone, (predicted.before[r],), (predicted.after[r],)))
        noise = float(np.sqrt(np.mean(fit.noise[fit.used] ** 2)))
        expected = before, after, _least(noise, floor, alone)
        if isinstance(recording, Recording):
            rows.append(RecordingMisfit(recording.name, held_out, *_setting(recording.condition), *expected))
        else:
            blank, settings = (None, None, None, None), dict(recording.settings)
            rows.append(RecordingMisfit(recording.name, held_out, *blank, *expected, settings))
    return tuple(rows)


def _setting(condition: Condition) -> tuple[float, float, float, float]:
    lag = float(np.degrees(condition.phase_lag))
    return condition.flap_frequency, lag, condition.pressure / 100.0, condition.airspeed


def proof(predicted: ResidualPair, floor: float, unit: str, *, effects_added: bool) -> Proof:
    """Return the misfit of both models over all held-out recordings, relative to the misfit to be expected.

    ``floor`` (m or N): discretisation error; ``effects_added``: whether effects were added, so that the models differ.
    """
    data = predicted.data
    before, after, better = _misfits(predicted)
    least = _least(data.noise, floor, data)
    change = amount(before.value, unit)
    if effects_added:
        change += f" before, {amount(after.value, unit)} after"
    better = better and not predicted.incomplete
    several = "s" if len(data.recordings) > 1 else ""
    words = f"{len(data.recordings)} held-out recording{several}: {change}, {after.value / least:.2f} times the floor"
    if effects_added and not better:
        words += "; the improvement is not significant"
    return Proof(_relative_to_floor(before, least), _relative_to_floor(after, least), least, better, words)


def misfit_to_floor(one: WhitenedData, residuals: Array, floor: float) -> tuple[float, float]:
    """Return the misfit of the only recording of ``one`` over the one to be expected, and itself (RMS, m or N).

    ``residuals`` [T, C]; ``floor`` (m or N): discretisation error.
    """
    misfit = _misfits(ResidualPair(one, (residuals,), (residuals,)))[0].value
    return misfit / _least(one.noise, floor, one), misfit


def _least(noise: float, floor: float, data: WhitenedData) -> float:
    """Return the misfit to be expected of a right model: noise, discretisation error and the error that is accepted."""
    return float(np.sqrt(noise**2 + floor**2 + data.accepted_of_samples**2))


def _relative_to_floor(interval: Interval, floor: float) -> Interval:
    low, high = interval.low, interval.high
    return Interval(interval.value / floor, low and low / floor, high and high / floor)


def _misfits(predicted: ResidualPair) -> tuple[Interval, Interval, bool]:
    """Return root mean squares (m or N) before and after with intervals, and if the decrease is significant."""
    kind, groups = predicted.data.kind, list[Array]()
    for squares in predicted.squares:
        count = np.isfinite(squares[0]).sum(axis=0)
        total = np.nansum(squares, axis=1)
        width = 3 if kind == "tracks" else 1
        rows = np.concatenate([total, count[None].astype(float)]).reshape(3, -1, width).sum(axis=2)
        groups.append(rows[:, rows[2] > 0])
    every = np.concatenate(groups, axis=1)
    if kind != "tracks" or every.shape[1] < MIN_MARKERS:  # blocks of time instead of markers
        every = _time_blocks(predicted)
    drawn = np.random.default_rng(0).integers(0, every.shape[1], (BOOTSTRAP_DRAWS, every.shape[1]))
    sums = every[:, drawn].sum(axis=2)
    rms = np.sqrt(sums[:2] / sums[2])
    whole = np.sqrt(every[:2].sum(axis=1) / every[2].sum())
    ends = np.quantile(rms, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2], axis=1)
    found = [Interval(float(w), float(a), float(b)) for w, a, b in zip(whole, *ends, strict=True)]
    return found[0], found[1], bool(np.mean(rms[1] < rms[0]) >= 0.5 + CONFIDENCE / 2)


def _time_blocks(predicted: ResidualPair, count: int = 12) -> Array:
    """Return sums of squares before and after, and numbers of samples, [3, N] over ``count`` blocks per recording."""
    rows = []
    for squares in predicted.squares:
        for before, after in zip(*(np.array_split(one, count) for one in squares), strict=True):
            rows.append([np.nansum(before), np.nansum(after), np.isfinite(before).sum()])
    found = np.array(rows, float).T
    return np.asarray(found[:, found[2] > 0])
