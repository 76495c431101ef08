"""Simulate a group of individuals at the same time, beat after beat, until the motion of each is periodic."""

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
    """Up to LANES individuals simulated together under a condition, all starting from rest or all from given states."""

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
        """Return the rods' motion in beat number ``beat``, see :func:`wingfit.sim.solver.scene.drive_table`."""
        frequency, compliant = self.angular_rate / (2 * np.pi), len(self.lanes.laws.motor) > 0
        return drive_table(self.scene.rods, frequency, numerics, steps, beat, compliant=compliant)

    def beat(self, table: Array) -> State:
        """Simulate one beat with the drive ``table``; return a copy of the state at its start."""
        start = State(*(array.copy() for array in self.state))
        advance(self.wiring, self.here, self.lanes, table, self.work, self.state, self.trace, self.alive)
        return start

    def evaluate(self, lane: int, start: State, beat: int, numerics: Numerics) -> None:
        """Decide on the individual ``lane`` after a beat: failed, periodic, or to continue from an extrapolated start.

        ``start``: state of the group at the start of beat number ``beat``. The decision is stored in the individual's
        course, and the start of its next beat in the group's state.
        """
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
    """Simulate up to LANES individuals with ``steps`` per beat until the motion of each is periodic or has failed.

    Results are stored in ``courses``; ``with_motion``: whether the motion of all bodies is stored too. Either all
    courses or none of them start from rest.
    """
    group = Group(subject, courses, steps, with_motion)
    first = 0 if courses[0].state is None else numerics.ramp_beats
    tables = {beat: group.table(numerics, steps, beat) for beat in range(first, numerics.ramp_beats + 1)}
    for course in courses:
        course.reason, course.trace = None, None
        if course.secants is not None:
            course.secants.restart()
    running = list(range(len(courses)))
    for beat in range(first, numerics.max_beats):
        start = group.beat(tables[min(beat, numerics.ramp_beats)])
        for lane in running:
            group.evaluate(lane, start, beat, numerics)
        running = [lane for lane in running if courses[lane].reason is None and courses[lane].trace is None]
        if not running:
            return
    for lane in running:
        courses[lane].reason = (
            f"not periodic after {courses[lane].beats} beats: still more than {numerics.settled * 1e3:g} mm from a "
            "periodic motion; it may flutter"
        )


def measure_growth(subject: Subject, courses: list[Course], steps: int) -> None:
    """Measure how fast disturbances of up to LANES periodic motions grow, over GROWTH_BEATS more beats.

    The growth of each course is set; infinite if the motion diverges. The estimate from the secants is less reliable,
    because it includes beats on which the motion was far from periodic.
    """
    group, numerics = Group(subject, courses, steps), Numerics(steps=steps)
    table = group.table(numerics, steps, numerics.ramp_beats)
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


def _stacked(states: list[State]) -> State:
    """Return states of single individuals as the state of a group; if they are too few, the last is repeated."""
    filled = [states[min(k, len(states) - 1)] for k in range(LANES)]
    return State(*(aligned(np.stack(parts, axis=-1)) for parts in zip(*filled, strict=True)))
