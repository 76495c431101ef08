"""Infer the load that the nominal model is missing, or its drive's error, and fit a free-form law to a load."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import FreeLaw, MissingLoad, table
from wingfit.diagnosis.location.free_form_law import free_law
from wingfit.diagnosis.location.missing_load import (
    PHASES,
    Case,
    InferredLoads,
    LoadPlace,
    infer,
    locate_load,
    missing_loads,
    whitened,
)
from wingfit.diagnosis.subject import Subject, beat_subject
from wingfit.records.array_types import Array, Float
from wingfit.sim.effects.probe import Probe
from wingfit.sim.wing.probing import Probed, StationMotion

PROBE = Probe(tuple(np.linspace(0.0, 1.0, 7).tolist()), 8, turning=True, driving=True)
MAX_INERTIA_RATIO = 10.0  # times the wing's inertia: no load of the air or of a neighbour is as large
MAX_RECORDINGS = 3  # that are probed: those with the largest misfit


@dataclass(frozen=True)
class MissingPhysics:
    """The missing loads by recording, where they act (``place``), and a ``law``; empty where the rig cannot be probed.

    ``drive_error``: the drive rods are in error, and no load acts.
    """

    loads: tuple[MissingLoad, ...] = ()
    place: LoadPlace = field(default_factory=LoadPlace)
    law: FreeLaw | None = None
    drive_error: bool = False


@dataclass(frozen=True)
class LoadEstimate:
    """The load ``inferred`` from ``cases`` (recordings with one model's responses), and the model's ``motions``."""

    cases: tuple[Case, ...]
    motions: tuple[StationMotion, ...]
    inferred: InferredLoads


def largest_residuals(data: WhitenedData, nominal: Refit) -> list[int]:
    """Return the indices of the MAX_RECORDINGS recordings with the largest misfit, which are probed."""
    return [int(r) for r in np.argsort(-data.excess_by_recording(nominal.fit.coefficients))[:MAX_RECORDINGS]]


def load_estimates(
    models: Sequence[tuple[Subject, Refit]], data: WhitenedData, which: Sequence[int]
) -> Iterator[tuple[str, LoadEstimate | None]]:
    """Infer the load that each of the fitted ``models`` is missing, from the recordings ``which``.

    Yields the name of each recording and None before it is probed, then the last name and the estimate, if there is
    one.
    """
    for subject, nominal in models:
        found = []
        for r in which:
            yield data.recordings[r].name, None
            found.append((r, beat_subject(subject).probe_responses(nominal.fit.genome, data.beat_recordings[r], PROBE)))
        known = [(r, one) for r, one in found if one is not None]
        if known:
            cases = tuple(_case(data, nominal, r, one) for r, one in known)
            motions = tuple(one.motion for _, one in known)
            yield data.recordings[which[-1]].name, LoadEstimate(cases, motions, infer(cases, PROBE, motions[0].chord))


def missing_physics(found: Sequence[LoadEstimate], *, law: bool) -> MissingPhysics:
    """Return the result for the best-fitting model among those probed on the most recordings.

    ``found``: an estimate for each model; ``law``: also fit a free-form law. Empty where the load is implausibly large.
    """
    if not found:
        return MissingPhysics()
    whole = max(len(guess.cases) for guess in found)
    complete = [guess for guess in found if len(guess.cases) == whole]
    best = min(complete, key=lambda guess: guess.inferred.noise_inflation)
    loads, drive_error = missing_loads(best.inferred), best.inferred.drive_error
    if not drive_error and not _plausible(loads, best.motions):
        return MissingPhysics()
    free_form = free_law(best.cases, PROBE, best.motions) if law and not drive_error else None
    return MissingPhysics(loads, locate_load(best.inferred) or LoadPlace(), free_form, drive_error)


def _plausible(loads: Sequence[MissingLoad], motions: Sequence[StationMotion]) -> bool:
    """Return whether the loads are at most MAX_INERTIA_RATIO times the wing's inertia; larger ones are no loads."""
    size = np.sqrt(np.mean([np.mean(np.square(load.values)) for load in loads]))
    own = np.sqrt(np.mean([np.mean((motion.mass[:, None] * motion.acceleration) ** 2) for motion in motions]))
    return bool(size <= MAX_INERTIA_RATIO * own)


def _case(data: WhitenedData, nominal: Refit, r: int, probed: Probed) -> Case:
    beat_fit, part, fit = data.beat_fits[r], data.recording_slices[r], nominal.fit
    responses = beat_fit.of(np.moveaxis(np.nan_to_num(probed.responses), -1, 0))[:, beat_fit.used]
    residual, slopes = data.whiten(fit.coefficients), data.whiten(fit.jacobian.T)
    whitened = data.whitening.of_part(part).whiten(responses.reshape(len(responses), -1))
    rows = (residual[part], whitened, slopes[:, part])
    if data.errors is not None:  # another recording has another load, so each is considered alone
        alone = data.errors.of_part(part)
        rows = (
            alone.whiten(data.errors.restore(residual)[part]),
            alone.whiten(rows[1]),
            alone.whiten(data.errors.restore(slopes)[:, part]),
        )
    return Case(
        data.recordings[r].name,
        -rows[0],
        rows[1].T,
        rows[2].T,
        probed.crossing,
    )


def missing_forces(context: FitContext, nominal: Refit) -> tuple[MissingLoad, ...]:
    """Return the missing force along the axis with the largest residual, for each recording of forces."""
    data, found = context.data, []
    for recording, beat_fit, residuals in zip(data.beat_recordings, data.beat_fits, nominal.fit.residuals, strict=True):
        power = np.where(beat_fit.used, np.nansum(np.nan_to_num(residuals) ** 2, axis=0), 0.0)
        column = int(np.argmax(power))
        origin = beat_subject(context.subject).beat_start_phase(recording) / (2 * np.pi)
        phase = recording.condition.flap_frequency * recording.times - origin
        noise = max(float(beat_fit.noise[column]), data.tolerance)
        lag1 = float(np.clip(beat_fit.lag1, 0.0, 0.99))
        found.append(missing_force(recording.name, residuals[:, column], phase, noise, lag1))
    return tuple(found)


def missing_force(
    name: str, residuals: Float[Array, " T"], phase: Float[Array, " T"], noise: float, lag1: float, harmonics: int = 8
) -> MissingLoad:
    """Return the missing force in a recording of forces: the mean beat of one axis' residual, N.

    ``residuals`` [T] simulated minus recorded (N, NaN where missing) at ``phase`` [T] (beats from the start of the
    beat); ``noise`` its standard deviation (N) with lag-1 autocorrelation ``lag1``. At most ``harmonics`` of the beat.
    """
    seen = np.isfinite(residuals)
    series = Probe((0.0, 1.0), harmonics).terms
    rows = np.concatenate([-residuals[seen, None], series(phase[seen])], axis=1)
    white = whitened(rows, np.flatnonzero(seen), lag1) / noise
    spread = np.linalg.pinv(white[:, 1:].T @ white[:, 1:])
    at = np.arange(PHASES) / PHASES
    values = series(at) @ spread @ white[:, 1:].T @ white[:, 0]
    errors = np.sqrt(np.einsum("np,pq,nq->n", series(at), spread, series(at)))
    return MissingLoad(name, (0.0,), tuple(at.tolist()), table(values[None]), table(errors[None]), "N")
