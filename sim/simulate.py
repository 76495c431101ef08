"""Motion of a batch of wings to its periodic state: the one door to the kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from records import Condition, Gene
from sim.atmosphere import density
from sim.drive import flap_angle
from sim.kernels import LANES
from sim.kernels.integrate import NODES, PORTS, Setting, State, Trace, advance, new_work
from sim.periodic import extrapolate
from sim.structure import Structure
from sim.wing_genes import lanes

Array = npt.NDArray[np.float64]


STEPS_PER_HZ = 120.0
STEPS_LIMITS = (120, 1200)


@dataclass(frozen=True)
class Numerics:
    """How finely to integrate.

    Attributes:
        steps: per beat; None takes STEPS_PER_HZ for each Hz of flapping. The faster a wing flaps, the nearer its
            harmonics come to its resonances, and the shorter a step must be even as a part of the beat.
        ramp_beats: the drive's amplitude grows from rest over these first beats.
        max_beats: after which a wing that is still not periodic is reported.
        periodic: largest marker displacement between successive beats (m) that counts as periodic.
        window: beats between extrapolations to the periodic motion; 0 waits for transients to die.
    """

    steps: int | None = None
    ramp_beats: int = 1
    max_beats: int = 24
    periodic: float = 5e-5
    window: int = 4

    def per_beat(self, condition: Condition) -> int:
        """Steps in one beat under a condition."""
        if self.steps is not None:
            return self.steps
        return int(np.clip(8 * round(STEPS_PER_HZ * condition.flap_frequency / 8), *STEPS_LIMITS))

    def __post_init__(self) -> None:
        if (self.steps is not None and self.steps < 8) or self.ramp_beats < 1 or self.max_beats <= self.ramp_beats:
            raise ValueError(
                f"{self} is not usable: at least 8 steps a beat, at least one beat of ramp and more beats than that"
            )


@dataclass(frozen=True)
class Beat:
    """One periodic beat of B individuals, at n equal steps from drive phase 0.

    Attributes:
        tracks: [B, n, M, 3] marker positions in the world, m; NaN rows for failed individuals.
        rods: [B, n, 2, 6] wrench (moment, force) of the wing on the front and rear driving rod, rod frame at the hinge.
        air: [B, n, 3] force of the air on the wing in the world, N.
        energy: [B, n, 3] kinetic, elastic, gravitational, J.
        power: [B, n, 4] into the wing through dampers, front motor, rear motor and air, W.
        beats: [B] beats simulated until periodic.
        reasons: why an individual failed, else None.
        motion: pose and twist of all bodies and the two rods, when asked for.
    """

    tracks: Array
    rods: Array
    air: Array
    energy: Array
    power: Array
    beats: npt.NDArray[np.int64]
    reasons: tuple[str | None, ...]
    motion: State | None = None


def periodic_beat(
    structure: Structure,
    genes: tuple[Gene, ...],
    genomes: Array,
    condition: Condition,
    numerics: Numerics,
    *,
    with_motion: bool = False,
) -> Beat:
    """Simulate ``genomes`` [B, G] under ``condition`` until each is periodic; groups of LANES at a time.

    ``with_motion`` keeps the motion of every body: rotation [B, n, N+2, 9], position [B, n, N+2, 3] and twist
    [B, n, N+2, 6].
    """
    groups = [
        _run_group(structure, genes, genomes[k : k + LANES], condition, numerics, with_motion)
        for k in range(0, len(genomes), LANES)
    ]
    motion = None
    if with_motion:
        motion = State(*(np.concatenate(parts) for parts in zip(*(g.motion for g in groups if g.motion), strict=True)))
    return Beat(
        tracks=np.concatenate([g.tracks for g in groups]),
        rods=np.concatenate([g.rods for g in groups]),
        air=np.concatenate([g.air for g in groups]),
        energy=np.concatenate([g.energy for g in groups]),
        power=np.concatenate([g.power for g in groups]),
        beats=np.concatenate([g.beats for g in groups]),
        reasons=tuple(reason for g in groups for reason in g.reasons),
        motion=motion,
    )


def drive_table(structure: Structure, condition: Condition, numerics: Numerics, beat: int) -> Array:
    """[n, 4, 2, 3]: angle, rate and acceleration (rad, s) of both rods at the stages of beat number ``beat``."""
    n, omega = numerics.per_beat(condition), 2 * np.pi * condition.flap_frequency
    phase = 2 * np.pi * (np.arange(n)[:, None, None] + NODES[None, :, None]) / n - np.array([0.0, condition.phase_lag])
    angle = flap_angle(structure.wing.drive, phase) * np.array([1.0, omega, omega**2])
    if beat >= numerics.ramp_beats:
        return np.asarray(angle)
    # smooth start from rest: 0 at the start, 1 at the end of the ramp, rate and acceleration zero at both
    x = (beat + (np.arange(n)[:, None, None] + NODES[None, :, None]) / n) / numerics.ramp_beats
    rate = condition.flap_frequency / numerics.ramp_beats
    x = np.minimum(x, 1.0)
    e = x**3 * (10 - 15 * x + 6 * x**2)
    e1 = rate * 30 * x**2 * (1 - x) ** 2
    e2 = rate**2 * 60 * x * (1 - x) * (1 - 2 * x)
    a, a1, a2 = angle[..., 0], angle[..., 1], angle[..., 2]
    return np.stack([e * a, e * a1 + e1 * a, e * a2 + 2 * e1 * a1 + e2 * a], axis=-1)


def at_rest(structure: Structure) -> State:
    """All bodies at their rest pose, not moving, the rods horizontal."""
    n = len(structure.bodies)
    state = State(np.zeros((n + 2, 9, LANES)), np.zeros((n + 2, 3, LANES)), np.zeros((n + 2, 6, LANES)))
    state.R[:, [0, 4, 8]] = 1.0
    hinge = structure.wing.hinge
    state.p[:n] = np.array([body.centre for body in structure.bodies])[:, :, None]
    state.p[n:] = np.array([0.0, hinge.y, hinge.z])[:, None]
    return state


def setting(condition: Condition, numerics: Numerics) -> Setting:
    """The kernel's view of a condition."""
    a = condition.angle_of_attack
    wind = condition.airspeed * np.array([np.cos(a), 0.0, np.sin(a)])
    step = 1.0 / (condition.flap_frequency * numerics.per_beat(condition))
    return Setting(density(condition.pressure, condition.temperature), wind, condition.gravity, step)


def new_trace(structure: Structure, steps: int, *, with_motion: bool = False) -> Trace:
    """Empty arrays for one beat; those of the motion have no room unless asked for."""
    kept, bodies = steps if with_motion else 0, len(structure.bodies) + 2
    return Trace(
        tracks=np.zeros((steps, len(structure.wing.markers), 3, LANES)),
        rods=np.zeros((steps, 2, 6, LANES)),
        air=np.zeros((steps, 3, LANES)),
        power=np.zeros((steps, PORTS, LANES)),
        energy=np.zeros((steps, 3, LANES)),
        R=np.zeros((kept, bodies, 9, LANES)),
        p=np.zeros((kept, bodies, 3, LANES)),
        V=np.zeros((kept, bodies, 6, LANES)),
    )


def _run_group(
    structure: Structure,
    genes: tuple[Gene, ...],
    genomes: Array,
    condition: Condition,
    numerics: Numerics,
    with_motion: bool,
) -> Beat:
    """Up to LANES individuals. Each keeps the first beat that repeats the one before, whatever its neighbours do."""
    count, n = len(genomes), numerics.per_beat(condition)
    group, here, state = lanes(structure, genes, genomes), setting(condition, numerics), at_rest(structure)
    work = new_work(structure.wiring, group, here.step)
    trace, kept = (new_trace(structure, n, with_motion=with_motion) for _ in range(2))
    alive, done = np.ones(LANES, bool), np.arange(LANES) >= count
    beats, change = np.zeros(LANES, np.int64), np.full(LANES, np.inf)
    tables = [drive_table(structure, condition, numerics, beat) for beat in range(numerics.ramp_beats + 1)]
    before = np.full_like(trace.tracks, np.inf)
    history: list[State] = []
    for beat in range(numerics.max_beats):
        advance(structure.wiring, here, group, tables[min(beat, numerics.ramp_beats)], work, state, trace, alive)
        with np.errstate(invalid="ignore"):
            change = np.abs(trace.tracks - before).max(axis=(0, 1, 2))
        before = trace.tracks.copy()
        beats[~done] = beat + 1
        arrived = ~done & ((change < numerics.periodic) | ~alive)
        if beat < numerics.ramp_beats:
            arrived &= ~alive
        for whole, part in zip(kept, trace, strict=True):
            whole[..., arrived] = part[..., arrived]
        done |= arrived
        if done.all():
            break
        if beat >= numerics.ramp_beats - 1 and numerics.window:
            history.append(State(*(array.copy() for array in state)))
        if len(history) > numerics.window:
            extrapolate(history, ~done & alive, 2 * np.pi * condition.flap_frequency, state)
            history, before = [], np.full_like(before, np.inf)
    reasons = tuple(
        _reason(bool(alive[k]), bool(done[k]), int(beats[k]), float(change[k]), numerics) for k in range(count)
    )
    for k, reason in enumerate(reasons):
        if reason is not None:
            for array in kept:
                array[..., k] = np.nan
    found = Trace(*(np.moveaxis(array, -1, 0)[:count].copy() for array in kept))
    motion = State(found.R, found.p, found.V) if with_motion else None
    return Beat(found.tracks, found.rods, found.air, found.energy, found.power, beats[:count], reasons, motion)


def _reason(alive: bool, done: bool, beats: int, change: float, numerics: Numerics) -> str | None:
    if not alive:
        return f"diverged in beat {beats}: a body turned more than 1 rad within one step"
    if not done:
        return (
            f"not periodic after {beats} beats: markers still move by {change * 1e3:.3g} mm from beat to beat, "
            f"more than {numerics.periodic * 1e3:g} mm"
        )
    return None
