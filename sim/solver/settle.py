"""Running a group of individuals side by side, beat after beat, until each is periodic."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from wingfit.records import Condition
from wingfit.records.array_types import Array
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import State, Trace, new_work
from wingfit.sim.kernels.integrate import advance
from wingfit.sim.kernels.lanes.memory import aligned
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.periodic import Secants
from wingfit.sim.solver.scene import at_rest, drive_table, new_trace
from wingfit.sim.wing.structure import Structure

GROWING = 16  # beats after which the fastest growing part of what is left stands out
ROUND_OFF = 1e-12  # m: what is left of a transient that has died, and neither grows nor falls
DIVERGED = "a body turned more than 1 rad within one step"


@dataclass
class Course:
    """One individual on its way: up the ladder of steps, beat after beat.

    Attributes:
        genome: its genes.
        state: from where its next beat starts; None at rest.
        secants: what its beats have told about its map.
        tracks: of the rung before, [n, M, 3].
        changes: of the tracks from rung to rung, m.
        beats: simulated in all.
        failures: rungs on which it failed.
        trace: of its periodic beat on the present rung.
        reason: why it failed on the present rung.
        distance: to the periodic motion, m.
        growth: of a disturbance of the periodic motion in a beat.
        error: estimated, m.
        done: accurate, or given up.
        before: as it was on the rung before.
    """

    genome: Array
    state: State | None = None
    secants: Secants | None = None
    tracks: Array | None = None
    changes: list[float] = field(default_factory=list)
    beats: int = 0
    failures: int = 0
    trace: Trace | None = None
    reason: str | None = None
    distance: float = np.nan
    growth: float = 0.0
    error: float = np.nan
    done: bool = False
    before: Course | None = None

    def copy(self) -> Course:
        """As it is now, whatever becomes of it; arrays are never written into, and are shared."""
        known = self.secants and replace(self.secants, columns=list(self.secants.columns), target=None)
        return replace(self, secants=known, changes=list(self.changes), before=None)


class Subject(NamedTuple):
    """What is simulated: a structure under a condition, and how up to LANES genomes make a scene of it."""

    structure: Structure
    condition: Condition
    scene: Callable[[Array], WingScene]


class _Group:
    """Up to LANES individuals side by side under a condition, all at rest or all under way."""

    def __init__(self, subject: Subject, courses: list[Course], steps: int, with_motion: bool = False) -> None:
        structure, self.courses = subject.structure, courses
        self.angular_rate = 2 * np.pi * subject.condition.flap_frequency
        self.scene = subject.scene(np.array([c.genome for c in courses]))
        self.wiring, self.lanes, self.here = structure.wiring, self.scene.frozen(), self.scene.setting(steps)
        self.sizes = self.lanes.laws.size
        states = len(self.sizes)
        self.work = new_work(self.wiring, self.here, self.lanes)
        self.trace = new_trace(structure, steps, with_motion=with_motion, states=states)
        moving = [course.state for course in courses if course.state is not None]
        self.state = _stacked(moving) if moving else at_rest(structure, states)
        self.alive = np.ones(LANES, bool)

    def table(self, numerics: Numerics, steps: int, beat: int) -> Array:
        """The drive of a beat."""
        frequency, giving_way = self.angular_rate / (2 * np.pi), len(self.lanes.laws.motor) > 0
        return drive_table(self.scene.rods, frequency, numerics, steps, beat, giving_way=giving_way)

    def beat(self, table: Array) -> State:
        """One beat under a drive; the state from which it started."""
        start = State(*(array.copy() for array in self.state))
        advance(self.wiring, self.here, self.lanes, table, self.work, self.state, self.trace, self.alive)
        return start

    def learn(self, lane: int, start: State, beat: int, numerics: Numerics) -> None:
        """What a beat means for an individual: it diverged, it is periodic, or it goes on from a better start."""
        course = self.courses[lane]
        course.beats += 1
        if not self.alive[lane]:
            self.alive[lane] = _recover(course, lane, self.state)
            if not self.alive[lane]:
                course.reason, course.state, course.secants = f"diverged in beat {beat + 1}: {DIVERGED}", None, None
        elif beat >= numerics.ramp_beats:
            before, after = _lane(start, lane), _lane(self.state, lane)
            if course.secants is None:
                course.secants = Secants(before, self.angular_rate, numerics.window, self.sizes)
            course.state, course.distance = course.secants.add(before, after)
            _put(self.state, lane, course.state)
            if course.distance <= numerics.settled:
                course.growth = course.secants.growth
                course.trace = Trace(*(array[..., lane].copy() for array in self.trace))


def beside(near: Course, genome: Array, states: int) -> Course:
    """A course for ``genome`` that begins at the periodic motion of ``near`` and with what that knows of its map.

    ``states`` of effects begin at rest where ``near`` has others; what it knows of the map is then of no use.
    """
    if near.state is None or near.secants is None:
        raise ValueError("only a settled individual can be begun beside")
    state = State(*(array.copy() for array in near.state))
    if len(state.z) != states:
        return Course(genome, state._replace(z=np.zeros(states)))
    known = replace(near.secants, columns=list(near.secants.columns), target=None)
    known.restart()
    return Course(genome, state, known)


def settle(subject: Subject, courses: list[Course], numerics: Numerics, steps: int, with_motion: bool) -> None:
    """Run up to LANES individuals with ``steps`` a beat until each is periodic, whatever its neighbours do."""
    group = _Group(subject, courses, steps, with_motion)
    first = 0 if courses[0].state is None else numerics.ramp_beats
    tables = {beat: group.table(numerics, steps, beat) for beat in range(first, numerics.ramp_beats + 1)}
    for course in courses:
        course.reason, course.trace = None, None
        if course.secants is not None:
            course.secants.restart()
    open_ = list(range(len(courses)))
    for beat in range(first, numerics.max_beats):
        start = group.beat(tables[min(beat, numerics.ramp_beats)])
        for lane in open_:
            group.learn(lane, start, beat, numerics)
        open_ = [lane for lane in open_ if courses[lane].reason is None and courses[lane].trace is None]
        if not open_:
            return
    for lane in open_:
        courses[lane].reason = (
            f"not periodic after {courses[lane].beats} beats: still more than {numerics.settled * 1e3:g} mm from a "
            "periodic motion; it may flutter"
        )


def measure_growth(subject: Subject, courses: list[Course], steps: int) -> None:
    """Let up to LANES settled individuals go on for GROWING beats, and see whether what is left of transients grows.

    What the secants tell of it is mixed with the beats on which the motion was still far from periodic.
    """
    group, numerics = _Group(subject, courses, steps), Numerics(steps=steps)
    table = group.table(numerics, steps, numerics.ramp_beats)
    watched = [Secants(_lane(group.state, k), group.angular_rate, 0, group.sizes) for k in range(len(courses))]
    left = np.zeros((GROWING, len(courses)))
    for beat in range(GROWING):
        start = group.beat(table)
        left[beat] = [w.add(_lane(start, k), _lane(group.state, k))[1] for k, w in enumerate(watched)]
    for k, course in enumerate(courses):
        course.growth = _mean_growth(left[:, k]) if group.alive[k] else np.inf


def _recover(course: Course, lane: int, state: State) -> bool:
    """Go back to before the leap that made an individual diverge; False when there was none."""
    if course.secants is None or not course.secants.leapt:
        return False
    _put(state, lane, course.secants.step_back())
    return True


def _lane(state: State, lane: int) -> State:
    return State(*(array[..., lane].copy() for array in state))


def _put(into: State, lane: int, state: State) -> None:
    for array, value in zip(into, state, strict=True):
        array[..., lane] = value


def _mean_growth(left: Array) -> float:
    """Factor per beat of the latter half of a series, by least squares in its logarithm: two modes may beat."""
    tail = np.log(np.maximum(left[len(left) // 2 :], ROUND_OFF))
    return float(np.exp(np.polyfit(np.arange(len(tail)), tail, 1)[0]))


def _stacked(states: list[State]) -> State:
    """States of single individuals side by side in lanes; spare lanes repeat the last."""
    filled = [states[min(k, len(states) - 1)] for k in range(LANES)]
    return State(*(aligned(np.stack(parts, axis=-1)) for parts in zip(*filled, strict=True)))
