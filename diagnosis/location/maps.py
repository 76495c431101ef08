"""Compute maps of the misfit: by marker, over span and beat, by harmonic, and the channels to plot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import MarkerMisfit, Overlay, PhaseMap, table
from wingfit.diagnosis.subject import BeatSubject, ChannelLocation
from wingfit.inference.noise.harmonic import HarmonicFit
from wingfit.records.array_types import Array, Float

PHASES = 72  # instants of a beat in maps
BANDS = 6  # along the span


@dataclass(frozen=True)
class RecordingResidual:
    """Residual of one recording, simulated minus recorded, in its C used channels.

    ``coefficients`` and their noise ``variance`` [C, P] (P Fourier coefficients, as in ``beat_fit``), ``locations`` of
    the channels, and ``beat`` [PHASES, C], the periodic residual (m or N) from the start of the beat.
    """

    beat_fit: HarmonicFit
    locations: tuple[ChannelLocation, ...]
    coefficients: Float[Array, "C P"]
    variance: Float[Array, "C P"]
    beat: Float[Array, "N C"]

    @property
    def excess(self) -> Array:
        """Mean square [C] of each channel minus that of the noise, at least 0."""
        return np.maximum((self.coefficients**2 - self.variance) @ self.beat_fit.weight, 0.0)


def recording_residuals(
    subject: BeatSubject, data: WhitenedData, coefficients: Float[Array, " D"]
) -> list[RecordingResidual]:
    """Split ``coefficients`` [D] of the residuals by recording."""
    found = []
    for recording, beat_fit, part in zip(data.beat_recordings, data.beat_fits, data.recording_slices, strict=True):
        own = coefficients[part].reshape(-1, len(beat_fit.order))
        places = [p for p, used in zip(subject.channel_locations(recording), beat_fit.used, strict=True) if used]
        beat = beat_series(beat_fit, subject.beat_start_phase(recording)) @ own.T
        found.append(RecordingResidual(beat_fit, tuple(places), own, beat_fit.variance[beat_fit.used], beat))
    return found


def beat_series(beat_fit: HarmonicFit, origin: float, count: int = PHASES) -> Float[Array, "count P"]:
    """Return the basis function of each of P coefficients at ``count`` equal steps of the beat, [count, P].

    ``origin``: phase (rad) at which the beat starts. Slow trends are zero.
    """
    return beat_fit.waves(origin + 2 * np.pi * np.arange(count) / count)


def markers(before: Sequence[RecordingResidual], after: Sequence[RecordingResidual]) -> tuple[MarkerMisfit, ...]:
    """Return the misfit of each marker or force axis over all recordings, before and after effects are added."""
    places: dict[str, ChannelLocation] = {}
    for residual in before:
        for place in residual.locations:
            places.setdefault(place.name, place)
    return tuple(_marker(place, before, after) for place in places.values())


def _marker(
    place: ChannelLocation, before: Sequence[RecordingResidual], after: Sequence[RecordingResidual]
) -> MarkerMisfit:
    first, then = (_root_mean_square(place.name, residuals) for residuals in (before, after))
    total, beats = np.zeros(PHASES), {axis: np.zeros(PHASES) for axis in "xyz"}
    for residual, c in _channels_of(place.name, before):
        total += residual.beat[:, c] ** 2
        beats[residual.locations[c].axis] += residual.beat[:, c]
    worst = int(np.argmax(total))
    direction = np.array([beats[axis][worst] for axis in "xyz"])
    length = float(np.linalg.norm(direction))
    x, y, z = (direction / length if length > 0 else direction).tolist()
    return MarkerMisfit(place.name, place.span, place.chord, place.x, place.y, first, then, worst / PHASES, (x, y, z))


def _channels_of(name: str, residuals: Sequence[RecordingResidual]) -> Iterator[tuple[RecordingResidual, int]]:
    """Yield (residual of a recording, column there) of each channel of the marker or force axis ``name``."""
    for residual in residuals:
        yield from ((residual, c) for c, place in enumerate(residual.locations) if place.name == name)


def _root_mean_square(name: str, residuals: Sequence[RecordingResidual]) -> float:
    """Return the root mean square (m or N) beyond the noise of the marker or force axis ``name``."""
    squares = [
        float(residual.beat_fit.weight @ (residual.coefficients[c] ** 2 - residual.variance[c]))
        for residual, c in _channels_of(name, residuals)
    ]
    return float(np.sqrt(max(sum(squares) / len(squares), 0.0)))


def phase_map(before: Sequence[RecordingResidual], after: Sequence[RecordingResidual]) -> PhaseMap:
    """Return the periodic misfit (root mean square) in BANDS of the span at PHASES of the beat, before and after."""
    known = np.array([p.span for residual in before for p in residual.locations if p.span is not None], float)
    edges = np.linspace(known.min(), known.max() + 1e-9, BANDS + 1) if len(known) else np.zeros(2)
    first, then = (np.sqrt(_squares(recording_residuals, edges)) for recording_residuals in (before, after))
    periodic = [
        (residual.variance * residual.beat_fit.weight)[:, ~residual.beat_fit.trend].sum(axis=1) for residual in before
    ]
    noise = float(np.mean(np.concatenate(periodic)))
    return PhaseMap(
        tuple((0.5 * (edges[:-1] + edges[1:])).tolist()),
        tuple((np.arange(PHASES) / PHASES).tolist()),
        table(first),
        table(then),
        float(np.sqrt(noise)),
    )


def _squares(recording_residuals: Sequence[RecordingResidual], edges: Array) -> Array:
    total, count = np.zeros((len(edges) - 1, PHASES)), np.zeros((len(edges) - 1, 1))
    for residual in recording_residuals:
        for column, place in enumerate(residual.locations):
            at = 0.0 if place.span is None else place.span
            band = int(np.clip(np.searchsorted(edges, at, side="right") - 1, 0, len(edges) - 2))
            total[band] += residual.beat[:, column] ** 2
            count[band] += 1
    return np.asarray(total / np.maximum(count, 1))


def harmonics(data: WhitenedData, coefficients: Float[Array, " D"]) -> tuple[float, ...]:
    """Return the fraction of the excess in each harmonic of the beat, from 0 (the mean); trends are ignored."""
    order = np.concatenate([np.tile(v.order, int(v.used.sum())) for v in data.beat_fits])
    trend = np.concatenate([np.tile(v.trend, int(v.used.sum())) for v in data.beat_fits])
    every = np.where(trend, 0.0, data.weight * (coefficients**2 - data.variance))
    found = np.maximum(np.bincount(order, weights=every), 0.0)
    return tuple((found / max(found.sum(), 1e-300)).tolist())


def overlays(
    subject: BeatSubject,
    data: WhitenedData,
    before: Sequence[Array],
    after: Sequence[Array],
    held_out: bool,
    most: int = 2,
) -> Iterator[Overlay]:
    """Yield the channel that the added effects change most, of each of the ``most`` recordings that they change most.

    Where they change nothing, the channel with the largest misfit of the nominal model. ``before`` and ``after``:
    residuals [T, C] of each recording, simulated minus recorded, without and with the effects.
    """
    change = [np.nanmean((b - a) ** 2) for b, a in zip(before, after, strict=True)]
    for r in np.argsort(change)[::-1][:most]:
        recording = data.beat_recordings[r]
        apart = before[r] - after[r] if change[r] > 0.0 else before[r]
        square = np.where(data.beat_fits[r].used, np.nan_to_num(apart**2).sum(axis=0), 0.0)
        channel = int(np.argmax(square))
        seen = np.isfinite(before[r][:, channel])
        psi = 2 * np.pi * recording.condition.flap_frequency * recording.times[seen]
        phase = ((psi - subject.beat_start_phase(recording)) / (2 * np.pi)) % 1.0
        turn = np.argsort(phase)
        recorded = recording.values[seen, channel]
        yield Overlay(
            recording.name,
            recording.channels[channel],
            held_out,
            tuple(phase[turn].tolist()),
            tuple(recorded[turn].tolist()),
            tuple((recorded + before[r][seen, channel])[turn].tolist()),
            tuple((recorded + after[r][seen, channel])[turn].tolist()),
        )
