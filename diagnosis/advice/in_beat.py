"""Proposals for a rig that flaps: conditions, repetitions of what was recorded, further markers, a further axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wingfit.diagnosis.advice.advised import AdvisedCost
from wingfit.diagnosis.advice.places import best_places, places_on, with_markers
from wingfit.diagnosis.advice.predictions import Simulated, first_prediction, fixed_separation, simulated
from wingfit.diagnosis.advice.proposal import (
    MAX_ADVICE,
    SETTLES,
    Proposal,
    advised_condition,
    condition_in_words,
    nearest,
)
from wingfit.diagnosis.advice.rivals import Prediction, Rivals
from wingfit.diagnosis.advice.settling import Settling, share_of
from wingfit.diagnosis.candidate_conditions import settings_beyond
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.subject import beat_subject
from wingfit.inference.campaign.noise_level import NoiseLevel, seen_noise
from wingfit.inference.campaign.sampling import seen_sampling
from wingfit.records import Recording, RigLimits
from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.sim.wing.flexible_wing import FlexibleWing

NEARLY_CERTAIN = 0.9  # probability from which fewer conditions are compared
MAX_CONDITIONS_IF_CERTAIN = 8  # conditions
MOST_ADAPTED = 12  # conditions in which genes may adapt
LONGER = 4.0  # times as many beats
OVERLOAD = 4.0  # times the largest recorded force (root mean square): a balance is chosen for what it is to measure

Step = tuple[float, list[Proposal]]


def overloads(predicted: Recording, recorded: Sequence[Recording]) -> bool:
    """Return whether a force of ``predicted`` is OVERLOAD times the largest of those ``recorded``, or more.

    More wind at once with another angle of attack may multiply the force by ten. Never of tracks.
    """

    def largest(one: Recording) -> float:
        return float(np.sqrt(np.nanmean(one.values**2, axis=0)).max())

    return bool(predicted.forces) and largest(predicted) >= OVERLOAD * max(map(largest, recorded))


@dataclass(frozen=True, eq=False)
class InBeat:
    """Looks for recordings that settle which of the ``rivals`` is right, as ``settling`` predicts."""

    context: FitContext
    rivals: Rivals
    settling: Settling

    def proposals(self) -> Iterator[Step]:
        """Yield the fraction done, and proposals as they are found; none without two rivals."""
        if len(self.rivals.numbers) < 2:
            return
        repetitions = self._repetitions()
        yield 0.05, [one for _, one in repetitions]
        for part, found in self._conditions():
            yield 0.05 + 0.8 * part, found
        best = repetitions[0][0]
        yield 0.9, self._markers(best)
        yield 1.0, self._axes(best)

    @property
    def _recordings(self) -> tuple[Recording, ...]:
        return self.context.data.beat_recordings

    @cached_property
    def _level(self) -> NoiseLevel:
        """The noise of a new recording: of an axis that was not recorded, the mean of the others."""
        found = seen_noise(self._recordings, tracks=self.context.data.kind == "tracks")
        known = np.isfinite(found.deviation)
        mean = float(np.sqrt(np.mean(found.deviation[known] ** 2)))
        return replace(found, deviation=np.where(known, found.deviation, mean))

    @cached_property
    def _tracked(self) -> tuple[str, ...]:
        """Names of the channels that were recorded and are used in any recording."""
        found = dict[str, None]()
        for one, fit in zip(self._recordings, self.context.data.beat_fits, strict=True):
            found |= dict.fromkeys(np.array(one.channels)[fit.used].tolist())
        return tuple(found)

    @cached_property
    def _channels(self) -> Float[Array, " R"]:
        return np.array([float(fit.used.sum()) for fit in self.context.data.beat_fits])

    # -- conditions -------------------------------------------------------------------------------------------

    def _conditions(self) -> Iterator[Step]:
        """Yield proposals of other conditions: first all with fixed genes, then the best with genes that adapt."""
        conditions = beat_subject(self.context.subject).candidate_conditions()
        if self.rivals.weights.probabilities.max() >= NEARLY_CERTAIN:
            conditions = conditions[:MAX_CONDITIONS_IF_CERTAIN]
        screened = list[tuple[float, Recording]]()
        for k, condition in enumerate(conditions):
            recording = first_prediction(self.context, self.rivals, condition)
            if recording is not None and not overloads(recording, self._recordings):
                most = fixed_separation(self.context, self.rivals, recording)
                screened += [] if most is None else [(most, recording)]
            yield 0.5 * (k + 1) / len(conditions), []
        found = list[float]()
        for k, (most, recording) in enumerate(sorted(screened, key=lambda pair: -pair[0])[:MOST_ADAPTED]):
            if sum(one >= most for one in found) >= MAX_ADVICE:
                return
            proposal = self._condition(recording)
            found += [] if proposal is None else [proposal.separation]
            yield 0.5 + 0.5 * (k + 1) / min(len(screened), MOST_ADAPTED), [] if proposal is None else [proposal]

    def _condition(self, recording: Recording) -> Proposal | None:
        seen = simulated(self.context, self.rivals, recording)
        if seen is None:
            return None
        kept = self._kept(seen)
        share = share_of(self._channels, float(kept.sum()))
        apart, distance = self.rivals.apart(seen.of(self._level, self.context.data.noise, kept), share)
        resolves = self.settling.probability(self.settling.elsewhere(apart, distance), share, self._samples)
        condition = recording.condition
        known = getattr(self.context.subject, "dataset", None)  # with the recordings that are held out
        recorded: Sequence[Recording] = self._recordings if known is None else known.recordings
        beyond = settings_beyond(condition, [one.condition for one in recorded])
        what = f"record {condition_in_words(condition)}"
        if beyond:
            allowed = "as" if self._allows(beyond) else "if"
            what += f", {' and '.join(beyond)} beyond what was recorded, {allowed} the rig allows"
        details = {"condition": advised_condition(condition), "beyond": beyond}
        return Proposal("condition", what, nearest(apart), resolves, cost_of(recording), details)

    def _allows(self, settings: Sequence[str]) -> bool:
        """Return whether limits of all these ``settings`` are stated."""
        limits: RigLimits | None = getattr(self.context.subject, "rig_limits", None)
        return limits is not None and all(getattr(limits, one.replace(" ", "_")) is not None for one in settings)

    @property
    def _samples(self) -> float:
        return self.context.data.policy.effective_samples

    def _share(self, channels: Bool[Mask, " C"]) -> float:
        """Return the part of all channels that further ``channels`` of a new recording are."""
        return share_of(self._channels, float(channels.sum()))

    def _kept(self, seen: Simulated) -> Bool[Mask, " C"]:
        return np.array([name in self._tracked for name in seen.channels])

    # -- repetitions ------------------------------------------------------------------------------------------

    def _repetitions(self) -> list[tuple[int, Proposal]]:
        """Return proposals to record again what was recorded, with the number of the recording, the best first."""
        found = [(r, self._repetition(r)) for r in range(len(self._recordings))]
        return sorted(found, key=lambda pair: (-(pair[1].resolves or 0.0), -pair[1].separation))

    def _repetition(self, number: int) -> Proposal:
        once, longer = (self._again(number, times) for times in (1.0, LONGER))
        return longer if (longer.resolves or 0.0) > (once.resolves or 0.0) + SETTLES else once

    def _again(self, number: int, times: float) -> Proposal:
        recording = self._recordings[number]
        share = share_of(self._channels, self._channels[number])
        apart, distance = self.rivals.apart(self._recorded(number).longer(times), share)
        expected = self.settling.again(number, apart, distance)
        resolves = self.settling.probability(expected, share, self._samples, times)
        many = f", {times:g} times as many beats" if times > 1.0 else ""
        details = {"condition": advised_condition(recording.condition), "recording": recording.name}
        what = f"record {recording.name} again{many}"
        return Proposal("repeat", what, nearest(apart), resolves, cost_of(recording, times), details)

    def _recorded(self, number: int) -> Prediction:
        """Return what the rivals predict of a recording that exists, from their fits."""
        data = self.context.data
        part = data.recording_slices[number]
        fits = [one.fit for one in self.rivals.refits]
        values = [one.coefficients for one in fits]
        changes = self.rivals.stacked([one.jacobian[part] for one in fits], [one[part] for one in values])
        white = self.rivals.stacked(
            [data.whitened_slopes(one.jacobian)[part] for one in fits], [data.whiten(one)[part] for one in values]
        )
        weight = data.weight[part] / data.recording_weights[number] / data.noise**2
        return Prediction((changes * weight[:, None]).T @ changes, white.T @ white)

    # -- markers and axes -------------------------------------------------------------------------------------

    def _markers(self, number: int) -> list[Proposal]:
        """Return the proposal to record again, with further markers where the hypotheses differ most."""
        model = self.context.subject.model
        if not isinstance(model, FlexibleWing):
            return []
        recording = self._recordings[number]
        like = first_prediction(self.context, self.rivals, recording.condition)
        tracked = tuple(dict.fromkeys(name.rpartition("_")[0] for name in self._tracked))
        places = places_on(model.wing, tracked)
        models = [one.fit.problem.model for one in self.rivals.refits]
        wings = [with_markers(one, places) for one in models if isinstance(one, FlexibleWing)]
        if like is None or not places or len(wings) < len(models):
            return []
        every = (*tracked, *(one.marker.name for one in places))
        seen = simulated(self.context, self.rivals, like, wings, every)
        if seen is None:
            return []
        masks = [np.array([name.rpartition("_")[0] == one.marker.name for name in seen.channels]) for one in places]
        noise = self.context.data.noise
        alone = [self.rivals.apart(seen.of(self._level, noise, one), self._share(one))[0] for one in masks]
        squares = np.array([one[0, 1:].min() for one in alone])
        best = best_places(places, squares, model.wing.span)
        new = np.any([masks[k] for k in best], axis=0)
        pair = self.rivals.apart(seen.of(self._level, noise, new), self._share(new))
        advised = tuple(places[k].advised(float(np.sqrt(squares[k]))) for k in best)
        at = ", ".join(
            one.marker or f"{100 * one.span:.0f} % of the span and {100 * one.chord:.0f} % of the chord"
            for one in advised
        )
        what = f"record {recording.name} again with further markers at {at}"
        details = {"condition": advised_condition(recording.condition), "recording": recording.name, "places": advised}
        return [self._with_more("markers", what, number, pair, float(new.sum()), details)]

    def _axes(self, number: int) -> list[Proposal]:
        """Return the proposal to record again with the axis of the force that was not used."""
        recording = self._recordings[number]
        if recording.kind != "forces":
            return []
        like = first_prediction(self.context, self.rivals, recording.condition)
        seen = None if like is None else simulated(self.context, self.rivals, like)
        if seen is None or (new := ~self._kept(seen)).sum() == 0:
            return []
        pair = self.rivals.apart(seen.of(self._level, self.context.data.noise, new), self._share(new))
        channels = tuple(np.array(seen.channels)[new].tolist())
        what = f"record {recording.name} again with {' and '.join(channels)}, if its noise is that of the other axis"
        details = {
            "condition": advised_condition(recording.condition), "recording": recording.name, "channels": channels
        }  # fmt: skip
        return [self._with_more("sensor", what, number, pair, float(new.sum()), details)]

    def _with_more(
        self,
        kind: str,
        what: str,
        number: int,
        new: tuple[Array, Array],
        channels: float,
        details: dict[str, object],
    ) -> Proposal:
        """Return the proposal of a repetition with ``channels`` more, in which the rivals are apart by ``new``."""
        own = share_of(self._channels, self._channels[number])
        apart, distance = self.rivals.apart(self._recorded(number), own)
        expected = self.settling.again(number, apart, distance)
        part = channels / (channels + self._channels[number])
        expected = expected.with_part(self.settling.elsewhere(*new), part)
        share = share_of(self._channels, self._channels[number] + channels)
        resolves = self.settling.probability(expected, share, self._samples)
        size = float(np.sqrt((1.0 - part) * nearest(apart) ** 2 + part * nearest(new[0]) ** 2))
        return Proposal(kind, what, size, resolves, cost_of(self._recordings[number]), details)  # type: ignore[arg-type]


def cost_of(recording: Recording, times: float = 1.0) -> AdvisedCost:
    """Return the cost of a recording like ``recording``, with ``times`` as many beats."""
    sampling, count = seen_sampling(recording), len(recording.times)
    seconds = float(np.ptp(recording.times)) * count / max(count - 1, 1)
    return AdvisedCost(1, round(times * count), times * seconds, times * sampling.beats)
