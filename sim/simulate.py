"""Motion of a batch of wings to its periodic state, as accurately as asked: the one door to the kernels."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from records import Condition, Gene
from sim.atmosphere import density
from sim.drive import flap_angle
from sim.kernels import LANES
from sim.kernels.integrate import NODES, PORTS, SLOPES, Setting, State, Trace, advance, new_work
from sim.periodic import Secants
from sim.structure import Structure
from sim.wing_genes import lanes

Array = npt.NDArray[np.float64]

ACCURACY = 1e-4
# Steps of a beat to try, one after the other: each half as many again, so that successive motions share instants.
LADDER = (64, 96, 144, 216, 324, 486, 729)
STEPS_PER_HZ = 21.0  # no beat starts below: the faster a wing flaps, the nearer its harmonics come to its resonances
KINKS = 2e-5  # m
_ORDER = 4
_GROWTH = 1.5
DIVERGED = "a body turned more than 1 rad within one step"
_TRIES = 3  # rungs on which an individual may fail before it is given up


@dataclass(frozen=True)
class Numerics:
    """How well to solve.

    Attributes:
        accuracy: largest distance (m) of any marker at any instant from where the exact periodic motion of the model
            has it. The number of steps is raised, individual by individual, until the estimated error is below.
        steps: per beat; given, it is taken as it is and no error is estimated.
        ramp_beats: the drive's amplitude grows from rest over these first beats.
        max_beats: after which a wing that is still not periodic is reported.
        periodic: distance (m) to the periodic motion at which a beat counts as periodic; None takes a quarter of the
            accuracy.
        window: beats that the acceleration towards the periodic motion learns from; 0 waits for transients to die.
    """

    accuracy: float = ACCURACY
    steps: int | None = None
    ramp_beats: int = 1
    max_beats: int = 24
    periodic: float | None = None
    window: int = 8

    def __post_init__(self) -> None:
        if (self.steps is not None and self.steps < 8) or self.ramp_beats < 1 or self.max_beats <= self.ramp_beats:
            raise ValueError(
                f"{self} is not usable: at least 8 steps a beat, at least one beat of ramp and more beats than that"
            )
        if not (np.isfinite(self.accuracy) and self.accuracy > 0):
            raise ValueError(f"accuracy is {self.accuracy!r} m; it must be a positive number such as 1e-4 (0.1 mm)")

    def ladder(self, condition: Condition) -> tuple[int, ...]:
        """Steps of a beat to try under a condition, coarsest first."""
        if self.steps is not None:
            return (self.steps,)
        least = STEPS_PER_HZ * condition.flap_frequency
        return tuple(n for n in LADDER if n >= least) or (LADDER[-1],)

    @property
    def settled(self) -> float:
        """Distance (m) to the periodic motion that counts as periodic."""
        return 0.25 * self.accuracy if self.periodic is None else self.periodic


@dataclass(frozen=True)
class Beat:
    """One periodic beat of an individual, at n equal steps from drive phase 0; NaN where it failed.

    Attributes:
        tracks: [n, M, 3] marker positions in the world, m.
        rods: [n, 2, 6] wrench (moment, force) of the wing on the front and rear driving rod, rod frame at the hinge.
        air: [n, 3] force of the air on the wing in the world, N.
        energy: [n, 3] kinetic, elastic, gravitational, J.
        power: [n, 4] into the wing through dampers, front motor, rear motor and air, W.
        beats: simulated in all.
        error: estimated largest error of a marker, of the steps and of the distance to the periodic motion, m; NaN when
            the steps were given.
        reason: why the individual failed, else None.
        motion: pose and twist of all bodies and the two rods [n, N+2, .], when asked for.
    """

    tracks: Array
    rods: Array
    air: Array
    energy: Array
    power: Array
    beats: int
    error: float
    reason: str | None
    motion: State | None = None


@dataclass
class _Course:
    """One individual on its way: up the ladder of steps, beat after beat."""

    genome: Array
    state: State | None = None  # None: at rest
    secants: Secants | None = None
    tracks: Array | None = None
    changes: list[float] = field(default_factory=list)
    beats: int = 0
    failures: int = 0
    trace: Trace | None = None
    reason: str | None = None
    distance: float = np.nan
    error: float = np.nan
    done: bool = False


def periodic_beats(
    structure: Structure,
    genes: tuple[Gene, ...],
    genomes: Array,
    condition: Condition,
    numerics: Numerics,
    *,
    with_motion: bool = False,
) -> tuple[Beat, ...]:
    """Simulate ``genomes`` [B, G] under ``condition`` until each is periodic and accurate; groups of LANES at a time.

    An individual's numbers do not depend on its neighbours: each has its own steps, beats and end.
    """
    courses = [_Course(genome) for genome in genomes]
    ladder = numerics.ladder(condition)
    for rung, steps in enumerate(ladder):
        for group in _groups([course for course in courses if not course.done]):
            _settle(structure, genes, group, condition, numerics, steps, with_motion)
            for course in group:
                _judge(course, numerics, steps, last=rung == len(ladder) - 1)
    return tuple(_beat(structure, course, with_motion) for course in courses)


def _groups(courses: list[_Course]) -> list[list[_Course]]:
    """Those that start from rest apart from those that go on, LANES at a time."""
    parts = [[c for c in courses if (c.state is None) == resting] for resting in (True, False)]
    return [part[k : k + LANES] for part in parts for k in range(0, len(part), LANES)]


def _judge(course: _Course, numerics: Numerics, steps: int, *, last: bool) -> None:
    """Decide whether an individual is accurate, goes up a rung, or is given up."""
    if course.reason is not None:
        course.failures += 1
        course.state, course.secants, course.tracks, course.changes = None, None, None, []
        course.done = last or course.failures >= _TRIES
        return
    if numerics.steps is not None:
        course.done = True
        return
    if course.trace is None:
        raise AssertionError("a settled individual has a trace")
    finer, coarser = course.trace.tracks, course.tracks
    course.tracks = finer
    if coarser is not None:
        shared = np.gcd(steps, len(coarser))
        apart = finer[:: steps // shared] - coarser[:: len(coarser) // shared]
        course.changes.append(float(np.sqrt((apart**2).sum(axis=-1)).max()))
        course.error = _estimate(course.changes) + course.distance
        course.done = course.error <= numerics.accuracy
    if last and not course.done:
        course.done = True
        course.reason = (
            f"not accurate enough with {steps} steps a beat: estimated error {course.error * 1e3:.3g} mm, "
            f"asked for {numerics.accuracy * 1e3:g} mm"
        )


def _estimate(changes: list[float]) -> float:
    """Error of the latest motion from what each refinement changed, as a geometric series.

    Its ratio is that of the method's order until it can be seen; then it is what is seen, within two orders of that.
    Below KINKS a change may come from the corners in the law of the air, which fall with the second order only.
    """
    ratio = _GROWTH**_ORDER
    if len(changes) > 1:
        seen = changes[-2] / max(changes[-1], np.finfo(float).tiny)
        ratio = float(np.clip(seen, _GROWTH ** (_ORDER - 2), _GROWTH ** (_ORDER + 1)))
    return max(changes[-1] / (ratio - 1.0), min(changes[-1], KINKS) / (_GROWTH**2 - 1.0))


def drive_table(structure: Structure, condition: Condition, numerics: Numerics, n: int, beat: int) -> Array:
    """[n, STAGES, 2, 3]: angle, rate, acceleration (rad, s) of both rods at the stages of n steps of beat ``beat``.

    The acceleration carries the stage's share of its rate of change, as the method asks where time enters by itself.
    """
    omega = 2 * np.pi * condition.flap_frequency
    beats = beat + (np.arange(n)[:, None, None] + NODES[None, :, None]) / n
    phase = 2 * np.pi * (beats - beat) - np.array([0.0, condition.phase_lag])
    angle = flap_angle(structure.wing.drive, phase) * np.array([1.0, omega, omega**2, omega**3])
    if beat < numerics.ramp_beats:
        angle = _ramped(angle, beats / numerics.ramp_beats, condition.flap_frequency / numerics.ramp_beats)
    slope = SLOPES[:, None] / (n * condition.flap_frequency)
    return np.stack([angle[..., 0], angle[..., 1], angle[..., 2] + slope * angle[..., 3]], axis=-1)


def _ramped(angle: Array, x: Array, rate: float) -> Array:
    """Start from rest: 0 at x = 0, 1 from x = 1 on, without rate and acceleration at both; x grows at ``rate``."""
    x = np.minimum(x, 1.0)
    e = x**3 * (10 - 15 * x + 6 * x**2)
    e1 = rate * 30 * x**2 * (1 - x) ** 2
    e2 = rate**2 * 60 * x * (1 - x) * (1 - 2 * x)
    e3 = rate**3 * 60 * (1 - 6 * x + 6 * x**2) * (x < 1)
    a, a1, a2, a3 = np.moveaxis(angle, -1, 0)
    return np.stack(
        [e * a, e * a1 + e1 * a, e * a2 + 2 * e1 * a1 + e2 * a, e * a3 + 3 * (e1 * a2 + e2 * a1) + e3 * a], axis=-1
    )


def at_rest(structure: Structure) -> State:
    """All bodies at their rest pose, not moving, the rods horizontal."""
    n = len(structure.bodies)
    state = State(np.zeros((n + 2, 9, LANES)), np.zeros((n + 2, 3, LANES)), np.zeros((n + 2, 6, LANES)))
    state.R[:, [0, 4, 8]] = 1.0
    hinge = structure.wing.hinge
    state.p[:n] = np.array([body.centre for body in structure.bodies])[:, :, None]
    state.p[n:] = np.array([0.0, hinge.y, hinge.z])[:, None]
    return state


def setting(condition: Condition, steps: int) -> Setting:
    """The kernel's view of a condition, with ``steps`` a beat."""
    a = condition.angle_of_attack
    wind = condition.airspeed * np.array([np.cos(a), 0.0, np.sin(a)])
    step = 1.0 / (condition.flap_frequency * steps)
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


def _stacked(states: list[State]) -> State:
    """States of single individuals side by side in lanes; spare lanes repeat the last."""
    filled = [states[min(k, len(states) - 1)] for k in range(LANES)]
    return State(*(np.ascontiguousarray(np.stack(parts, axis=-1)) for parts in zip(*filled, strict=True)))


def _settle(
    structure: Structure,
    genes: tuple[Gene, ...],
    group: list[_Course],
    condition: Condition,
    numerics: Numerics,
    steps: int,
    with_motion: bool,
) -> None:
    """Run up to LANES individuals with ``steps`` a beat until each is periodic, whatever its neighbours do."""
    lanes_, here = lanes(structure, genes, np.array([c.genome for c in group])), setting(condition, steps)
    work, trace = new_work(structure.wiring, lanes_), new_trace(structure, steps, with_motion=with_motion)
    first = 0 if group[0].state is None else numerics.ramp_beats
    state = at_rest(structure) if first == 0 else _stacked([c.state for c in group if c.state is not None])
    tables = [drive_table(structure, condition, numerics, steps, beat) for beat in range(numerics.ramp_beats + 1)]
    alive, open_ = np.ones(LANES, bool), list(range(len(group)))
    for course in group:
        course.reason, course.trace = None, None
        if course.secants is not None:
            course.secants.restart()
    for beat in range(first, numerics.max_beats):
        start = State(*(array.copy() for array in state))
        table = tables[min(beat, numerics.ramp_beats)]
        advance(structure.wiring, here, lanes_, table, work, state, trace, alive)
        for lane in open_:
            course = group[lane]
            course.beats += 1
            if not alive[lane]:
                alive[lane] = _recover(course, lane, state)
                course.reason = None if alive[lane] else f"diverged in beat {beat + 1}: {DIVERGED}"
            elif beat >= numerics.ramp_beats:
                course.distance = _follow(course, lane, start, state, condition, numerics)
                if course.distance <= numerics.settled:
                    course.trace = Trace(*(array[..., lane].copy() for array in trace))
        open_ = [lane for lane in open_ if group[lane].reason is None and group[lane].trace is None]
        if not open_:
            return
    for lane in open_:
        group[lane].reason = (
            f"not periodic after {numerics.max_beats} beats: still more than {numerics.settled * 1e3:g} mm from a "
            "periodic motion; it may flutter"
        )


def _follow(course: _Course, lane: int, start: State, end: State, condition: Condition, numerics: Numerics) -> float:
    """Learn from a beat and put the lane of ``end`` where the next one starts; distance (m) to the periodic motion."""
    before, after = (State(*(array[..., lane].copy() for array in s)) for s in (start, end))
    if course.secants is None:
        course.secants = Secants(before, 2 * np.pi * condition.flap_frequency, numerics.window)
    course.state, distance = course.secants.add(before, after)
    _put(end, lane, course.state)
    return distance


def _recover(course: _Course, lane: int, state: State) -> bool:
    """Go back to before the leap that made an individual diverge; False when there was none."""
    if course.secants is None or not course.secants.leapt:
        return False
    _put(state, lane, course.secants.step_back())
    return True


def _put(into: State, lane: int, state: State) -> None:
    for array, value in zip(into, state, strict=True):
        array[..., lane] = value


def _beat(structure: Structure, course: _Course, with_motion: bool) -> Beat:
    trace = course.trace
    if trace is None or course.reason is not None:
        trace = Trace(
            *(np.full(a.shape[:-1], np.nan) for a in new_trace(structure, LADDER[0], with_motion=with_motion))
        )
    motion = State(trace.R, trace.p, trace.V) if with_motion else None
    return Beat(
        trace.tracks,
        trace.rods,
        trace.air,
        trace.energy,
        trace.power,
        course.beats,
        course.error,
        course.reason,
        motion,
    )
