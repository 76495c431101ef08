"""What the nominal model lacks, as a load or a motion of its drive: where it acts, and a free-form law for a load."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.finding import FreeLaw, Interval, MissingLoad, table
from wingfit.diagnosis.location.free_form_law import free_law
from wingfit.diagnosis.location.missing_load import (
    PHASES,
    Case,
    Inferred,
    LoadPlace,
    decorrelated,
    infer,
    missing_loads,
    place,
)
from wingfit.diagnosis.subject import Subject
from wingfit.sim.effects.probe import Probe
from wingfit.sim.wing.probing import Probed, StationMotion

Array = npt.NDArray[np.float64]

PROBE = Probe(tuple(np.linspace(0.0, 1.0, 7).tolist()), 8, turning=True, driving=True)
LARGEST = 10.0  # times the wing's inertia: no load of the air or of a neighbour is as large
MOST = 3  # recordings that are probed: those with the largest misfit


@dataclass(frozen=True)
class Unexplained:
    """What is lacking: per recording, its place, and a law; nothing where the rig cannot be probed.

    ``driven``: it is no load, but rods that move otherwise. ``pulse``: when a force acts, where forces were recorded.
    """

    loads: tuple[MissingLoad, ...] = ()
    place: LoadPlace | None = None
    law: FreeLaw | None = None
    driven: bool = False
    pulse: Interval | None = None

    @property
    def span(self) -> Interval | None:
        """Where along the span it acts."""
        return None if self.place is None else self.place.span

    @property
    def chord(self) -> Interval | None:
        """Where along the chord."""
        return None if self.place is None else self.place.chord

    @property
    def phase(self) -> Interval | None:
        """When in the beat it acts."""
        return self.pulse if self.place is None else self.place.phase


@dataclass(frozen=True)
class Guess:
    """What is ``inferred`` to be lacking from ``cases``: recordings, with one model's responses and ``motions``."""

    cases: tuple[Case, ...]
    motions: tuple[StationMotion, ...]
    inferred: Inferred


def largest(stack: Stack, nominal: Refit) -> list[int]:
    """Numbers of the recordings that are probed."""
    return [int(r) for r in np.argsort(-stack.excess_of(nominal.fit.coefficients))[:MOST]]


def guesses(
    models: Sequence[tuple[Subject, Refit]], stack: Stack, which: Sequence[int]
) -> Iterator[tuple[str, Guess | None]]:
    """What is lacking by each of ``models``, which are fitted; before each recording ``which`` is probed, its name."""
    for subject, nominal in models:
        fit = nominal.fit
        genome, found = fit.problem.genomes(np.array(list(fit.values.values())))[0], []
        for r in which:
            yield stack.recordings[r].name, None
            found.append((r, subject.probed(genome, stack.recordings[r], PROBE)))
        known = [(r, one) for r, one in found if one is not None]
        if known:
            cases = tuple(_case(stack, nominal, r, one) for r, one in known)
            motions = tuple(one.motion for _, one in known)
            yield stack.recordings[which[-1]].name, Guess(cases, motions, infer(cases, PROBE, motions[0].chord))


def unexplained(found: Sequence[Guess], *, law: bool) -> Unexplained:
    """What is lacking by the model that leaves least, of those that could be probed most; ``law`` asks for one."""
    if not found:
        return Unexplained()
    whole = max(len(guess.cases) for guess in found)
    best = min((guess for guess in found if len(guess.cases) == whole), key=lambda guess: guess.inferred.left)
    loads, driven = missing_loads(best.inferred), best.inferred.driven
    if not driven and not _plausible(loads, best.motions):
        return Unexplained()
    told = free_law(best.cases, PROBE, best.motions) if law and not driven else None
    return Unexplained(loads, place(best.inferred), told, driven)


def _plausible(loads: Sequence[MissingLoad], motions: Sequence[StationMotion]) -> bool:
    """Whether the loads are no larger than some times the wing's own inertia: what is lacking may be no load at all."""
    size = np.sqrt(np.mean([np.mean(np.square(load.values)) for load in loads]))
    own = np.sqrt(np.mean([np.mean((motion.mass[:, None] * motion.acceleration) ** 2) for motion in motions]))
    return bool(size <= LARGEST * own)


def _case(stack: Stack, nominal: Refit, r: int, probed: Probed) -> Case:
    view, part, fit = stack.views[r], stack.parts[r], nominal.fit
    responses = view.of(np.moveaxis(np.nan_to_num(probed.responses), -1, 0))[:, view.used]
    scale = stack.scale[part]
    return Case(
        stack.recordings[r].name,
        -fit.coefficients[part] / scale,
        responses.reshape(len(responses), -1).T / scale[:, None],
        fit.jacobian[part] / scale[:, None],
        probed.crossing,
    )


def missing_forces(subject: Subject, stack: Stack, nominal: Refit) -> tuple[MissingLoad, ...]:
    """Of recordings of forces, the missing force along the axis in which most is missing."""
    found = []
    for recording, view, residuals in zip(stack.recordings, stack.views, nominal.fit.residuals, strict=True):
        power = np.where(view.used, np.nansum(np.nan_to_num(residuals) ** 2, axis=0), 0.0)
        column = int(np.argmax(power))
        phase = recording.condition.flap_frequency * recording.times - subject.origin(recording) / (2 * np.pi)
        noise = max(float(view.noise[column]), stack.tolerance)
        memory = float(np.clip(view.lag1, 0.0, 0.99))
        found.append(missing_force(recording.name, residuals[:, column], phase, noise, memory))
    return tuple(found)


def missing_force(
    name: str, residuals: Array, phase: Array, noise: float, memory: float, harmonics: int = 8
) -> MissingLoad:
    """Of a recording of forces, the missing force itself: what the mean beat of one axis lacks, N.

    ``residuals`` [T] simulated minus recorded (N, NaN where missing) at ``phase`` [T] (beats from the start of the
    beat); ``noise`` its standard deviation (N) with correlation ``memory`` from sample to sample.
    """
    seen = np.isfinite(residuals)
    series = Probe((0.0, 1.0), harmonics).terms
    rows = np.concatenate([-residuals[seen, None], series(phase[seen])], axis=1)
    white = decorrelated(rows, np.flatnonzero(seen), memory) / noise
    spread = np.linalg.pinv(white[:, 1:].T @ white[:, 1:])
    at = np.arange(PHASES) / PHASES
    values = series(at) @ spread @ white[:, 1:].T @ white[:, 0]
    errors = np.sqrt(np.einsum("np,pq,nq->n", series(at), spread, series(at)))
    return MissingLoad(name, (0.0,), tuple(at.tolist()), table(values[None]), table(errors[None]), "N")
