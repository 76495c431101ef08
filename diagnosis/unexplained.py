"""The load that the nominal model lacks, where it acts, and a free-form law for it, by the model's own response."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.finding import FreeLaw, Interval, MissingLoad
from diagnosis.law import free_law
from diagnosis.missing import Case, LoadPlace, infer, missing_force, missing_loads, place
from diagnosis.refit import Refit
from diagnosis.stack import Stack
from diagnosis.subject import Subject
from sim.effects.probe import Probe
from sim.probing import Probed

PROBE = Probe(tuple(np.linspace(0.0, 1.0, 7).tolist()), 6, turning=True)
LARGEST = 10.0  # times the wing's inertia: no load of the air or of a neighbour is as large
MOST = 4  # recordings that are probed: those with the largest misfit


@dataclass(frozen=True)
class Unexplained:
    """What is lacking as a load: per recording, its place, and a law; nothing where the rig cannot be probed."""

    loads: tuple[MissingLoad, ...] = ()
    place: LoadPlace | None = None
    law: FreeLaw | None = None

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
        return None if self.place is None else self.place.phase


def probed_recordings(subject: Subject, stack: Stack, nominal: Refit) -> Iterator[tuple[int, Probed | None]]:
    """Responses about the nominal fit of the recordings with the largest misfit, one after the other."""
    fit = nominal.fit
    genome = fit.problem.genomes(np.array(list(fit.values.values())))[0]
    for r in np.argsort(-stack.excess_of(fit.coefficients))[:MOST]:
        yield int(r), subject.probed(genome, stack.recordings[r], PROBE)


def unexplained(stack: Stack, nominal: Refit, found: list[tuple[int, Probed]], *, law: bool) -> Unexplained:
    """What is lacking, from the ``found`` responses of recordings; ``law`` asks for a law as well."""
    if not found:
        return Unexplained()
    cases = [_case(stack, nominal, r, one) for r, one in found]
    inferred = infer(cases, PROBE, found[0][1].motion.chord)
    loads = missing_loads(inferred)
    if not _plausible(loads, [one for _, one in found]):
        return Unexplained()
    told = free_law(cases, PROBE, [one.motion for _, one in found]) if law else None
    return Unexplained(loads, place(inferred), told)


def _plausible(loads: Sequence[MissingLoad], found: Sequence[Probed]) -> bool:
    """Whether the loads are no larger than some times the wing's own inertia: what is lacking may be no load at all."""
    size = np.sqrt(np.mean([np.mean(np.square(load.values)) for load in loads]))
    own = np.sqrt(np.mean([np.mean((one.motion.mass[:, None] * one.motion.acceleration) ** 2) for one in found]))
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
        memory = float(np.clip(view.memory, 0.0, 0.99))
        found.append(missing_force(recording.name, residuals[:, column], phase, noise, memory))
    return tuple(found)
