"""Simulate a group of individuals at the same time, beat after beat, until the motion of each is periodic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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

REFILLED = 2  # lanes that are free before others take them: to set up a group costs a tenth of a beat
GROWTH_BEATS = 16  # after which the fastest growing mode dominates the transient
ROUND_OFF = 1e-12  # m: size of transients that consist of round-off
DIVERGED = "a body turned more than 1 rad within one step"


@dataclass
class Course:
    """Progress of the solution for one individual, over increasing numbers of steps per beat.

    Attributes:
        genome: [G] values of the genes.
        state: motion at the start of the next beat; None at rest.
        secants: past beats, from which the periodic motion is extrapolated; None before the first.
        tracks: [n, M, 3] positions of the markers in the periodic beat with the previous number of steps, m.
        changes: largest change of a marker from each number of steps to the next, m.
        beats: total number of simulated beats.
        failures: how many numbers of steps failed.
        trace: results of the periodic beat with the present number of steps; None before it is reached.
        reason: why the present number of steps failed, or None.
        distance: estimated distance to the periodic motion, m.
        growth: factor by which a disturbance of the periodic motion grows in a beat.
        error: estimated error of the markers, m.
        done: whether the motion is accurate, or has failed finally.
        before: this object at the previous number of steps.
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
        """Return a copy, whose arrays are shared with this object, since they are never modified."""
        known = self.secants and replace(self.secants, columns=list(self.secants.columns), target=None)
        return replace(self, secants=known, changes=list(self.changes), before=None)


class Subject(NamedTuple):
    """What is simulated: a structure, a condition, and a function from up to LANES genomes to the kernels' inputs."""

    structure: Structure
    condition: Condition
    scene: Callable[[Array], WingScene]


class Group:
    """Up to LANES individuals simulated together under a condition, each from rest or from the state of its course."""

    def __init__(self, subject: Subject, courses: list[Course], steps: int, with_motion: bool = False) -> None:
        structure, self.courses = subject.structure, courses
        self.angular_rate = 2 * np.pi * subject.condition.flap_frequency
        self.scene = subject.scene(np.array([c.genome for c in courses]))
        self.wiring, self.lanes, self.here = structure.wiring, self.scene.frozen(), self.scene.setting(steps)
        self.sizes = self.lanes.laws.size
        states = len(self.sizes)
        self.work = new_work(self.wiring, self.here, self.lanes)
        self.trace = new_trace(structure, steps, with_motion=with_motion, states=states)
        self.state = at_rest(structure, states)
        for lane in range(LANES):  # lanes without an individual repeat the last
            course = courses[min(lane, len(courses) - 1)]
            if course.state is not None:
                put(self.state, lane, course.state)
        self.alive = np.ones(LANES, bool)

    def table(self, numerics: Numerics, steps: int, beats: Sequence[int]) -> Array:
        """Return the rods' motion in beat number ``beats[lane]`` of each individual, the last for lanes without one.

        See :func:`wingfit.sim.solver.scene.drive_table`.
        """
        frequency, compliant = self.angular_rate / (2 * np.pi), len(self.lanes.laws.motor) > 0
        tables = {
            beat: drive_table(self.scene.rods, frequency, numerics, steps, beat, compliant=compliant)
            for beat in {min(beat, numerics.ramp_beats) for beat in beats}
        }
        if len(tables) == 1:
            return next(iter(tables.values()))
        found = aligned(tables[min(beats[-1], numerics.ramp_beats)].copy())
        for lane, beat in enumerate(beats):
            found[..., lane] = tables[min(beat, numerics.ramp_beats)][..., lane]
        return found

    def beat(self, table: Array) -> State:
        """Simulate one beat with the drive ``table``; return a copy of the state at its start."""
        start = State(*(array.copy() for array in self.state))
        advance(self.wiring, self.here, self.lanes, table, self.work, self.state, self.trace, self.alive)
        return start

    def evaluate(self, lane: int, start: State, beat: int, numerics: Numerics) -> None:
        """Decide on the individual ``lane`` after a beat: failed, periodic, or to continue from an extrapolated start.

        ``start``: state of the group at the start of the individual's beat number ``beat``. The decision is stored in
        the individual's course, and the start of its next beat there and in the group's state.
        """
        course = self.courses[lane]
        course.beats += 1
        course.state = _lane(self.state, lane)
        if not self.alive[lane]:
            self.alive[lane] = _recover(course, lane, self.state)
            if self.alive[lane]:
                course.state = _lane(self.state, lane)
            else:
                course.reason, course.state, course.secants = f"diverged in beat {beat + 1}: {DIVERGED}", None, None
        elif beat >= numerics.ramp_beats:
            before, after = _lane(start, lane), _lane(self.state, lane)
            if course.secants is None:
                course.secants = Secants(before, self.angular_rate, numerics.window, self.sizes)
            course.state, course.distance = course.secants.add(before, after)
            put(self.state, lane, course.state)
            if course.distance <= numerics.settled:
                course.growth = course.secants.growth
                course.trace = Trace(*(array[..., lane].copy() for array in self.trace))


def warm_start(near: Course, genome: Array, states: int) -> Course:
    """Return a course for ``genome`` that starts at the periodic motion of ``near``, with the secants of ``near``.

    If the number of effects' ``states`` differs, these states start at zero and the secants are not used. ValueError if
    ``near`` has no periodic motion.
    """
    if near.state is None or near.secants is None:
        raise ValueError("a warm start needs an individual with a periodic motion")
    state = State(*(array.copy() for array in near.state))
    if len(state.z) != states:
        return Course(genome, state._replace(z=np.zeros(states)))
    known = replace(near.secants, columns=list(near.secants.columns), target=None)
    known.restart()
    return Course(genome, state, known)


def settle(subject: Subject, courses: list[Course], numerics: Numerics, steps: int, with_motion: bool) -> None:
    """Simulate individuals with ``steps`` per beat until the motion of each is periodic or has failed.

    LANES of them are simulated at a time; when REFILLED lanes are done, the next individuals take these. Results are
    stored in ``courses``; ``with_motion``: whether the motion of all bodies is stored too.
    """
    for course in courses:
        course.reason, course.trace = None, None
        if course.secants is not None:
            course.secants.restart()
    waiting = [_Running(course, 0 if course.state is None else numerics.ramp_beats) for course in courses]
    lanes, group = list[_Running](), None
    while waiting or any(one.unfinished for one in lanes):
        running = [one for one in lanes if one.unfinished]
        if group is None or (waiting and len(running) <= LANES - REFILLED):
            free = LANES - len(running)
            lanes, waiting = running + waiting[:free], waiting[free:]
            group = Group(subject, [one.course for one in lanes], steps, with_motion)
        start = group.beat(group.table(numerics, steps, [one.beat for one in lanes]))
        for lane, one in enumerate(lanes):
            if one.unfinished:
                group.evaluate(lane, start, one.beat, numerics)
                one.end_beat(numerics)


@dataclass
class _Running:
    """An individual that is being simulated: its course, and the number of its next beat."""

    course: Course
    beat: int

    @property
    def unfinished(self) -> bool:
        """Whether the individual is neither periodic nor failed."""
        return self.course.reason is None and self.course.trace is None

    def end_beat(self, numerics: Numerics) -> None:
        """Go on to the next beat, or give the individual up after ``numerics.max_beats``."""
        self.beat += 1
        if self.unfinished and self.beat >= numerics.max_beats:
            self.course.reason = (
                f"not periodic after {self.course.beats} beats: still more than {numerics.settled * 1e3:g} mm from a "
                "periodic motion; it may flutter"
            )


def measure_growth(subject: Subject, courses: list[Course], steps: int) -> None:
    """Measure how fast disturbances of up to LANES periodic motions grow, over GROWTH_BEATS more beats.

    The growth of each course is set; infinite if the motion diverges. The estimate from the secants is less reliable,
    because it includes beats on which the motion was far from periodic.
    """
    group, numerics = Group(subject, courses, steps), Numerics(steps=steps)
    table = group.table(numerics, steps, [numerics.ramp_beats])
    monitors = [Secants(_lane(group.state, k), group.angular_rate, 0, group.sizes) for k in range(len(courses))]
    distances = np.zeros((GROWTH_BEATS, len(courses)))
    for beat in range(GROWTH_BEATS):
        start = group.beat(table)
        distances[beat] = [w.add(_lane(start, k), _lane(group.state, k))[1] for k, w in enumerate(monitors)]
    for k, course in enumerate(courses):
        course.growth = _mean_growth(distances[:, k]) if group.alive[k] else np.inf


def _recover(course: Course, lane: int, state: State) -> bool:
    """Revert the extrapolation that made individual ``lane`` of ``state`` diverge; return False if there was none."""
    if course.secants is None or not course.secants.extrapolated:
        return False
    put(state, lane, course.secants.step_back())
    return True


def _lane(state: State, lane: int) -> State:
    return State(*(array[..., lane].copy() for array in state))


def put(into: State, lane: int, state: State) -> None:
    """Set the individual ``lane`` of the group's state ``into`` to ``state``."""
    for array, value in zip(into, state, strict=True):
        array[..., lane] = value


def _mean_growth(distances: Array) -> float:
    """Fit an exponential to the latter half of ``distances`` [beats] (m); return its growth factor per beat."""
    tail = np.log(np.maximum(distances[len(distances) // 2 :], ROUND_OFF))
    return float(np.exp(np.polyfit(np.arange(len(tail)), tail, 1)[0]))
