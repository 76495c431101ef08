"""Tracks and forces of a recording over its beat, and samples over time, as the API's JSON answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wingfit.checks.tracked import Tracked, rms, turn
from wingfit.client.recorded import answers as a
from wingfit.records import Recording, Vehicle, Wing, WingMotion
from wingfit.records.array_types import Array, Index
from wingfit.service.datasets.gaps import missing
from wingfit.service.datasets.wing_views import points_mm
from wingfit.service.units import MM, mm
from wingfit.sim.vehicle.lift_drag import lift_drag
from wingfit.sim.vehicle.motion import angles_of, flap_series
from wingfit.sim.wing.alignment import recorded_crossing

MOST_PHASES, FEWEST_PHASES = 48, 8  # of a mean beat
FRAMES_PER_PHASE = 2
MOST_FRAMES = 120  # of a single beat
FORCE_PHASES = 100
MOST_SAMPLES = 4000  # over time, in one answer
DECIMALS, TIME_DECIMALS, PHASE_DECIMALS, FORCE_DECIMALS = 3, 6, 5, 6
Start = Literal["reference markers", "time 0"]


@dataclass(frozen=True)
class Beats:
    """Time in beats [T] from the start of the first beat of a recording, and what defines that start."""

    time: Array
    start: Start

    @property
    def phase(self) -> Array:
        """Phase [T] in the beat, 0 to 1."""
        return np.asarray(self.time % 1.0)

    @property
    def number(self) -> Index:
        """Number [T] of the beat, from 1."""
        return np.asarray(np.floor(self.time).astype(int) + 1)

    @property
    def count(self) -> int:
        """Number of beats of which there is a sample."""
        return len(np.unique(self.number))


def beats_of(recording: Recording, wing: Wing | None) -> Beats:
    """Return the beats of a recording: of forces they start at time 0, of tracks at the upstroke of the ``wing``."""
    start: Start = "time 0"
    late = 0.0
    if wing is not None:
        try:
            late, start = recorded_crossing(wing, recording) / (2 * np.pi), "reference markers"
        except ValueError:  # nothing shows where the beat starts
            late = 0.0
    time = recording.condition.flap_frequency * recording.times - late
    return Beats(time - np.floor(time[0] + 1e-9), start)


def tracks(recording: Recording, wing: Wing, beat: int | None) -> a.Tracks:
    """Return the markers over one beat; ``beat``: number of a single one, None for the mean. ValueError if unknown."""
    beats = beats_of(recording, wing)
    if beat is not None and beat not in beats.number:
        raise ValueError(
            f"recording {recording.name!r} has no frame of beat {beat}; it has those of beats "
            f"{beats.number.min()} to {beats.number.max()}"
        )
    rest, hinge = _rest(recording, wing)
    phase, positions = _mean_beat(recording, beats) if beat is None else _one_beat(recording, beats, beat)
    tracked = Tracked(recording, wing, recording.times, recording.positions, rest, hinge)
    away = tracked.deviation
    with np.errstate(all="ignore"):
        squares = np.where(np.isfinite(away), away, 0.0) ** 2
        seen = np.isfinite(away).all(axis=2)
        distance = np.sqrt(squares.sum(axis=(0, 2)) / np.where(seen.any(axis=0), seen.sum(axis=0), np.nan))
    misfit = rms(away) if seen.any() else None
    return {
        "recording": recording.name,
        "markers": list(recording.markers),
        "frames": len(recording.times),
        "beats": beats.count,
        "beat": beat,
        "start": beats.start,
        "phase": np.round(phase, PHASE_DECIMALS).tolist(),
        "angle_deg": numbers(np.degrees(turn(positions - hinge, rest - hinge)), DECIMALS),
        "positions_mm": points_mm(positions),
        "misfit_mm": mm(misfit),
        "misfit_percent": None if misfit is None else 100.0 * misfit / wing.span,
        "distance_mm": numbers(MM * distance, DECIMALS),
        "missing": (~np.isfinite(recording.positions).all(axis=2)).sum(axis=0).tolist(),
        "noise": _noise(recording),
    }


def _rest(recording: Recording, wing: Wing) -> tuple[Array, Array]:
    """Rest positions [M, 3] (m) of the recorded markers, NaN for one that the wing has not; a point of the hinge."""
    known = {marker.name: marker.position for marker in wing.markers}
    unknown = (np.nan, np.nan, np.nan)
    rest = np.array([known.get(name, unknown) for name in recording.markers], float).reshape(-1, 3)
    return rest, np.array([0.0, wing.hinge.y, wing.hinge.z])


def _mean_beat(recording: Recording, beats: Beats) -> tuple[Array, Array]:
    """Phases [B], and mean positions [B, M, 3] (m) of the frames near each; phases without frames are left out."""
    count = int(np.clip(len(recording.times) // FRAMES_PER_PHASE, FEWEST_PHASES, MOST_PHASES))
    return binned(beats.phase, recording.positions, count)


def binned(phase: Array, values: Array, count: int) -> tuple[Array, Array]:
    """Mean phases [B] and values [B, ...] of the samples ``values`` [T, ...] in ``count`` equal parts of the beat.

    A part without samples is left out, a value that none of its samples has is NaN.
    """
    part = np.minimum((phase * count).astype(int), count - 1)
    used, index = np.unique(part, return_inverse=True)
    seen = np.isfinite(values)
    total, number = (np.zeros((len(used), *values.shape[1:])) for _ in range(2))
    np.add.at(total, index, np.where(seen, values, 0.0))
    np.add.at(number, index, seen)
    with np.errstate(invalid="ignore"):
        means = total / np.where(number > 0, number, np.nan)
    return np.bincount(index, phase) / np.bincount(index), means


def _one_beat(recording: Recording, beats: Beats, beat: int) -> tuple[Array, Array]:
    rows = np.flatnonzero(beats.number == beat)
    rows = rows[:: -(-len(rows) // MOST_FRAMES)]
    return beats.phase[rows], recording.positions[rows]


def _noise(recording: Recording) -> a.MarkerNoise | None:
    if recording.standard_deviation is None:
        return None
    related = recording.noise_correlation
    return {
        "standard_deviation_mm": points_mm(recording.standard_deviation.reshape(-1, 3)),
        "correlation": None if related is None else [numbers(row, DECIMALS) for row in related],
    }


def samples(recording: Recording, wing: Wing | None, marker: str | None) -> a.Samples:
    """Return what was recorded over time: of ``marker``, or of the forces if it is None. ValueError if unknown."""
    names: list[str]
    if marker is None:
        names, values = [*recording.forces], recording.values
    else:
        if marker not in recording.markers:
            raise ValueError(
                f"recording {recording.name!r} has no marker {marker!r}; it has {', '.join(recording.markers)}"
            )
        names, values = list("xyz"), MM * recording.positions[:, recording.markers.index(marker)]
    stride = max(1, -(-len(recording.times) // MOST_SAMPLES))
    return {
        "recording": recording.name,
        "marker": marker,
        "unit": "N" if marker is None else "mm",
        "samples": len(recording.times),
        "stride": stride,
        "time_s": np.round(recording.times[::stride], TIME_DECIMALS).tolist(),
        "phase": np.round(beats_of(recording, wing).time[::stride], PHASE_DECIMALS).tolist(),
        "channels": [
            _channel(name, column, recording.times, stride) for name, column in zip(names, values.T, strict=True)
        ],
    }


def _channel(name: str, values: Array, times: Array, stride: int) -> a.ChannelSamples:
    return {"name": name, "values": numbers(values[::stride], FORCE_DECIMALS), "missing": missing(values, times)}


def forces(recording: Recording, vehicle: Vehicle) -> a.Forces:
    """Return the mean beat of the recorded forces, and the motion of the wings at its phases."""
    beats = beats_of(recording, None)
    count = int(np.clip(len(recording.times) // FRAMES_PER_PHASE, FEWEST_PHASES, FORCE_PHASES))
    columns, deviations = _force_columns(recording)
    phase, means = binned(beats.phase, np.stack(list(columns.values()), axis=1), count)
    motion = recording.motion or vehicle.motion
    flap, pitch = _motion(motion, recording.condition.flap_frequency, vehicle.claps, phase)
    mass = recording.mass or vehicle.mass
    return {
        "recording": recording.name,
        "beats": beats.count,
        "phase": np.round(phase, PHASE_DECIMALS).tolist(),
        "forces": [
            {"name": name, "mean_n": numbers(means[:, k], FORCE_DECIMALS), "noise_n": deviations.get(name)}
            for k, name in enumerate(columns)
        ],
        "flap_deg": numbers(np.degrees(flap), DECIMALS),
        "pitch_deg": numbers(np.degrees(pitch), DECIMALS),
        "pitch_station": motion.pitch_station,
        "own_motion": recording.motion is not None,
        "weight_n": mass * recording.condition.gravity,
        "low_pass_hz": recording.low_pass.cutoff if recording.low_pass else None,
    }


def _force_columns(recording: Recording) -> tuple[dict[a.ForceName, Array], dict[a.ForceName, float]]:
    """Forces [T] (N) by name: the recorded axes, and lift and drag if both were; stated noise (N) of the axes."""
    columns: dict[a.ForceName, Array] = {axis: recording.values[:, k] for k, axis in enumerate(recording.forces)}
    stated = recording.standard_deviation
    noise: dict[a.ForceName, float] = {}
    if stated is not None:
        noise.update((axis, float(stated[k])) for k, axis in enumerate(recording.forces))
    if {"x", "z"} <= set(columns):
        both = np.stack([columns["x"], columns["z"]], axis=-1)
        columns["lift"], columns["drag"] = lift_drag(both, recording.condition.angle_of_attack).T
    return columns, noise


def _motion(motion: WingMotion, frequency: float, claps: bool, phase: Array) -> tuple[Array, Array]:
    """Flap angle and wing pitch at the pitch station (rad) at each ``phase``."""
    series = flap_series(motion.flap, {}, 1, 2 * FORCE_PHASES)
    angles = angles_of(series, motion, {}, frequency, 2 * FORCE_PHASES, claps, 0.0)
    at = np.arange(2 * FORCE_PHASES) / (2 * FORCE_PHASES)
    flap, pitch = (np.interp(phase, at, row, period=1.0) for row in (angles.flap[0, 0], angles.pitch[0, 0]))
    return flap, pitch


def numbers(values: Array, decimals: int) -> list[Any]:
    """Return ``values`` [T], rounded to ``decimals``, as a list with None where they are not finite."""
    rounded = np.round(values, decimals) + 0.0
    return [value if np.isfinite(value) else None for value in rounded.tolist()]
