"""Responses of a flexible wing to known loads, and its motion where they act, to estimate missing loads from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wingfit.records import Recording
from wingfit.records.array_types import Array, ArrayLike, Index
from wingfit.sim.atmosphere import density
from wingfit.sim.effects.probe import Probe, strip_middles
from wingfit.sim.kernels.arrays import State
from wingfit.sim.model import Observation, genome_batch
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.loads import crossing
from wingfit.sim.wing.structure import Structure

MOVES = 2e-3  # intended largest displacement of a marker by a load, in spans
TOLERANCE = 4.0  # factor by which a displacement may be larger or smaller than intended
CLOSE = 2e-3  # accepted distance to the periodic motion, relative to the intended displacement
_MOST_BEATS = 60
_INITIAL_LOAD = 0.5  # initial force of a load, in weights of the wing
_GRAVITY = 9.81


@dataclass(frozen=True)
class StationMotion:
    """Motion of the wing at J stations along the span and N instants of a beat, from the start of the beat.

    Attributes:
        stations: [J] fractions of the span.
        phase: [N] beats from the start of the beat, as in recordings.
        velocity: [J, N] of the wing through the air along its normal (positive upward), m/s.
        forward: [J, N] of the wing through the air along its chord, from trailing to leading edge, m/s.
        acceleration: [J, N] along the normal, m/s^2.
        deflection: [J, N] along the normal, relative to a rigid wing on the rods, m.
        pitch_rate: [J, N] positive nose up, rad/s.
        chord: [J] m.
        mass: [J] mass of the wing per metre of span, kg/m.
        density: of the air, kg/m^3.
        airspeed: m/s.
        flap_frequency: Hz.
    """

    stations: Array
    phase: Array
    velocity: Array
    forward: Array
    acceleration: Array
    deflection: Array
    pitch_rate: Array
    chord: Array
    mass: Array
    density: float
    airspeed: float
    flap_frequency: float


@dataclass(frozen=True)
class Probed:
    """Responses of a recording to the loads of a probe, and the motion of the wing without them.

    ``responses`` [T, C, P]: change of the C channels (m) per unit of each of P loads, which is N/m, N or deg (see
    :class:`wingfit.sim.effects.probe.Probe`); NaN where a simulation failed. ``crossing``: drive phase (beats) at which
    the recorded beat starts. ``motion``: at the stations of the probe.
    """

    responses: Array
    crossing: float
    motion: StationMotion


def probed(model: FlexibleWing, genome: ArrayLike, recording: Recording, probe: Probe, instants: int = 72) -> Probed:
    """Simulate the responses to each load of ``probe``, one at a time, and the motion of the wing without them.

    ``genome`` [G]: the wing; ``instants``: number of instants of the motion. The responses are one-sided differences;
    wings with and without load are simulated with the same steps, so that the integrator's errors cancel. A load that
    moves the wing far more or less than MOVES is scaled and simulated again. ValueError with the reason if the wing
    without loads cannot be simulated.
    """
    base = genome_batch(model.genes, genome)
    near = model.beside(base[0])
    beat = near.beat(base[0], recording, with_motion=True)
    if beat.reason is not None or beat.motion is None:
        raise ValueError(f"the wing cannot be simulated under {recording.name!r}: {beat.reason}")
    aim = MOVES * model.wing.span
    numerics = replace(model.numerics, steps=len(beat.tracks), periodic=CLOSE * aim, max_beats=_MOST_BEATS)
    probing = replace(near, numerics=numerics, probe=probe)
    sizes = np.repeat(_sizes(model, probe), 1 + 2 * probe.harmonics)
    found = np.full((probe.size, *recording.values.shape), np.nan)
    tried = np.arange(probe.size)
    for _ in range(2):
        change, reasons = _changes(probing, base[0], recording, tried, sizes[tried])
        good = np.array([reason is None for reason in reasons])
        found[tried[good]] = change[good] / sizes[tried[good], None, None]
        moved = np.where(good, np.abs(change).max(axis=(1, 2)), TOLERANCE**2 * aim)
        off = (moved > TOLERANCE * aim) | (moved < aim / TOLERANCE)
        sizes[tried] *= aim / np.maximum(moved, aim / TOLERANCE**4)
        tried = tried[off]
        if not len(tried):
            break
    start = crossing(model, recording, beat.tracks)
    motion = station_motion(model, recording, beat.motion, start, np.array(probe.stations), instants)
    return Probed(np.moveaxis(found, 0, -1), start, motion)


def _sizes(model: FlexibleWing, probe: Probe) -> Array:
    """Initial sizes of loads: a force (N/m) and a moment (N) for each station, an angle (deg) for each rod.

    Forces come first, then moments and angles if the probe has them. Forces are larger near the root, where their lever
    arm is small; moments are the smallest force times the mean chord.
    """
    weight = sum(body.mass for body in model.structure.bodies) * _GRAVITY
    forces = _INITIAL_LOAD * weight / model.wing.span / np.maximum(np.array(probe.stations), 0.1)
    edges = model.structure.planform.strips(model.structure.division)
    chord = float(np.mean(model.structure.planform.chord(edges)))
    turning = np.full(len(forces), forces.min() * chord)
    turns = np.full(2, np.degrees(MOVES))
    return np.concatenate([forces, turning][: 1 + probe.turning] + [turns] * probe.driving)


def _changes(
    model: FlexibleWing, genome: Array, recording: Recording, which: Index, sizes: Array
) -> tuple[Array, tuple[str | None, ...]]:
    """Changes [B, T, C] of the recorded channels by B loads, and why each simulation failed (None: it did not).

    ``which`` [B]: index of the load among the genes of the probe; ``sizes`` [B]: its size.
    """
    batch = np.zeros((len(which) + 1, len(model.genes)))
    batch[:, : len(genome)] = genome
    batch[np.arange(1, len(batch)), len(genome) + which] = sizes
    seen: Observation = model.observe(batch, recording)
    if seen.reasons[0] is not None:
        raise ValueError(f"the wing cannot be simulated under {recording.name!r}: {seen.reasons[0]}")
    return np.asarray(seen.channels[1:] - seen.channels[0]), seen.reasons[1:]


def station_motion(
    model: FlexibleWing, recording: Recording, motion: State, start: float, stations: Array, instants: int
) -> StationMotion:
    """Motion of the wing at ``stations`` [J] (fractions of the span) over a beat of the given ``motion`` of all bodies.

    It is computed at ``instants`` equal steps from drive phase ``start`` (beats). The motion is interpolated linearly
    between the middles of the strips, and extrapolated beyond the first and the last.
    """
    structure, condition = model.structure, recording.condition
    a, frequency = condition.angle_of_attack, condition.flap_frequency
    wind = condition.airspeed * np.array([np.cos(a), 0.0, np.sin(a)])
    place, normal, chordwise, turning, rigid = _strips(structure, motion)
    rate = _derivative(place, frequency)
    through = rate - wind
    across, ahead = (through * normal).sum(axis=-1), -(through * chordwise).sum(axis=-1)
    gaining = (_derivative(rate, frequency) * normal).sum(axis=-1)
    bent = ((place - rigid) * normal).sum(axis=-1)
    series = np.stack([across, ahead, gaining, bent, turning])  # [5, n, S]
    at_stations = np.einsum("qns,js->qjn", series, _between(strip_middles(structure), stations))
    velocity, forward, acceleration, deflection, pitch_rate = _resampled(at_stations, start, instants)
    edges, phase = structure.planform.strips(structure.division), np.arange(instants) / instants
    per_metre = np.add.reduceat(structure.wiring.mass, structure.wiring.strip_start[:-1]) / np.diff(edges)
    mass = np.interp(stations, strip_middles(structure), per_metre)
    chord = structure.planform.chord(edges[0] + stations * (edges[-1] - edges[0]))
    air, airspeed = density(condition.pressure, condition.temperature), condition.airspeed
    return StationMotion(
        stations, phase, velocity, forward, acceleration, deflection, pitch_rate, chord, mass, air, airspeed, frequency
    )


def _strips(structure: Structure, motion: State) -> tuple[Array, Array, Array, Array, Array]:
    """Means over each of S strips at n instants of a beat.

    Returns position, unit normal and unit chord vector (aft), [n, S, 3] each, pitch rate [n, S] (rad/s), and the
    position [n, S, 3] that the strip would have on a rigid wing on the rods.
    """
    w, count = structure.wiring, len(structure.bodies)
    starts = w.strip_start[:-1]
    R = motion.R.reshape(*motion.R.shape[:2], 3, 3)
    local = np.concatenate([w.centroid, np.zeros((count, 1))], axis=1)
    place = motion.p[:, :count] + np.einsum("tnij,nj->tni", R[:, :count], local)

    def mean(values: Array) -> Array:
        return np.asarray(np.add.reduceat(w.weight[:, None] * values, starts, axis=-2))

    chordwise = mean(R[:, :count, :, 0])
    chordwise /= np.linalg.norm(chordwise, axis=-1, keepdims=True)
    normal = mean(R[:, :count, :, 2])
    normal -= (normal * chordwise).sum(axis=-1, keepdims=True) * chordwise
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    hinge = np.array([0.0, structure.wing.hinge.y, structure.wing.hinge.z])
    rest = mean(np.array([body.centre for body in structure.bodies]) + local) - hinge
    rigid = motion.p[:, count, None] + np.einsum("trij,sj->trsi", R[:, count:], rest).mean(axis=1)
    turning = mean(motion.V[:, :count, 1:2])[..., 0]
    return mean(place), normal, chordwise, turning, rigid


def _between(middles: Array, stations: Array) -> Array:
    """Weights [J, S] to interpolate from ``middles`` [S] of strips to ``stations`` [J], fractions of span."""
    inner = np.clip(np.searchsorted(middles, stations) - 1, 0, len(middles) - 2)
    part = (stations - middles[inner]) / (middles[inner + 1] - middles[inner])
    weights = np.zeros((len(stations), len(middles)))
    weights[np.arange(len(stations)), inner] = 1.0 - part
    weights[np.arange(len(stations)), inner + 1] = part
    return weights


def _derivative(series: Array, frequency: float) -> Array:
    """Time derivative of periodic values [n, ...] at n equal steps of a beat; ``frequency`` of the beat in Hz."""
    n = len(series)
    order = 2j * np.pi * frequency * np.arange(n // 2 + 1)
    order[n // 2 :] *= n % 2  # the highest harmonic of an even number of samples has no derivative
    spectrum = np.fft.rfft(series, axis=0) * order.reshape(-1, *[1] * (series.ndim - 1))
    return np.asarray(np.fft.irfft(spectrum, n, axis=0))


def _resampled(values: Array, start: float, instants: int) -> Array:
    """Resample periodic ``values`` [..., n] at ``instants`` equal steps over a beat from phase ``start`` (beats)."""
    n = values.shape[-1]
    kept = min(n, instants) // 2
    series = np.fft.rfft(values)[..., :kept] / n
    series[..., 1:] *= 2
    turn = np.exp(2j * np.pi * (start + np.arange(instants) / instants)[:, None] * np.arange(kept))
    return np.asarray(np.einsum("...k,tk->...t", series, turn).real)
