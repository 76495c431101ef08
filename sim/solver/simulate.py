"""Motion of a batch of wings to its periodic state, as accurately as asked: the one door to the kernels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import State, Trace
from wingfit.sim.solver.numerics import LADDER, Numerics, estimated_error
from wingfit.sim.solver.scene import new_trace
from wingfit.sim.solver.settle import Course, Subject, beside, measure_growth, settle
from wingfit.sim.wing.structure import Structure

FLUTTER = 1.02  # growth of a disturbance in a beat beyond which a periodic motion is none that a wing keeps
MORE = 1.5  # times as many steps, for individuals that fail beside another and from rest
_TRIES = 4  # rungs on which an individual may fail before it is given up


@dataclass(frozen=True)
class Beat:
    """One periodic beat of an individual, at n equal steps from drive phase 0; NaN where it failed.

    Attributes:
        tracks: [n, M, 3] marker positions in the world, m.
        rods: [n, 2, 6] wrench (moment, force) of the wing on the front and rear driving rod, rod frame at the hinge.
        air: [n, 3] force of the air on the wing in the world, N; without the inertia of air it moves along.
        energy: [n, 3] kinetic, elastic, gravitational, J.
        power: [n, 4] into the wing through dampers, front motor, rear motor and air, W.
        beats: simulated in all.
        error: estimated largest error of a marker, of the steps and of the distance to the periodic motion, m; NaN when
            the steps were given.
        growth: of a disturbance of the periodic motion in a beat, as far as the beats told; below 1 it dies out.
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
    growth: float
    reason: str | None
    motion: State | None = None


def periodic_beats(
    subject: Subject, genomes: Array, numerics: Numerics, *, with_motion: bool = False, near: Course | None = None
) -> tuple[Beat, ...]:
    """Simulate ``genomes`` [B, G] until each is periodic and accurate; groups of LANES at a time.

    An individual's numbers do not depend on its neighbours: each has its own steps, beats and end. Those that begin
    ``near`` a settled individual take as many steps as that, and its error is taken for theirs.
    """
    if near is not None and near.trace is not None:
        return _beats_beside(subject, genomes, numerics, near, len(near.trace.tracks), with_motion)
    courses = [Course(genome) for genome in genomes]
    return _settled(subject, courses, numerics, with_motion)


def settled_course(subject: Subject, genome: Array, numerics: Numerics) -> Course | None:
    """One individual settled, for others to begin beside; None where it fails.

    Not with the steps that it took to know its error, but with those before, where it turns out that these would do.
    """
    course = Course(genome)
    _settled(subject, [course], numerics, with_motion=False)
    if course.trace is None or course.reason is not None:
        return None
    before = course.before
    if before is not None and course.changes:
        before.error = course.changes[-1] + course.error
        if before.error <= numerics.accuracy:
            return before
    return course


def _beats_beside(
    subject: Subject, genomes: Array, numerics: Numerics, near: Course, steps: int, with_motion: bool
) -> tuple[Beat, ...]:
    """Beats of individuals that begin beside another; those that fail so begin again from rest."""
    states = len(subject.scene(genomes[:1]).frozen().laws.size)
    courses = [beside(near, genome, states) for genome in genomes]
    for group in _groups(courses):
        settle(subject, group, numerics, steps, with_motion)
    failed = [k for k, course in enumerate(courses) if course.reason is not None or course.growth > FLUTTER]
    for k, course in zip(failed, _from_rest(subject, genomes[failed], numerics, steps, with_motion), strict=True):
        courses[k] = course
    for course in courses:
        course.error = near.error + course.distance
    return tuple(_beat(subject.structure, course, with_motion) for course in courses)


def _from_rest(subject: Subject, genomes: Array, numerics: Numerics, steps: int, with_motion: bool) -> list[Course]:
    """Individuals that begin at rest with ``steps`` a beat; those that fail so once more with more steps."""
    courses = [Course(genome) for genome in genomes]
    for tried in (steps, round(MORE * steps)):
        again = [k for k, course in enumerate(courses) if not course.done or course.reason is not None]
        fresh = [Course(genomes[k]) for k in again]
        _settled(subject, fresh, replace(numerics, steps=tried), with_motion)
        for k, course in zip(again, fresh, strict=True):
            courses[k] = course
    return courses


def _settled(subject: Subject, courses: list[Course], numerics: Numerics, with_motion: bool) -> tuple[Beat, ...]:
    ladder = numerics.ladder(subject.condition)
    for rung, steps in enumerate(ladder):
        under_way = [course for course in courses if not course.done]
        for group in _groups(under_way):
            settle(subject, group, numerics, steps, with_motion)
            for course in group:
                _judge(course, numerics, steps, last=rung == len(ladder) - 1)
        suspect = [c for c in under_way if c.done and c.reason is None and c.growth > FLUTTER]
        for group in _groups(suspect):
            measure_growth(subject, group, steps)
            _refuse_flutter(group)
    return tuple(_beat(subject.structure, course, with_motion) for course in courses)


def _groups(courses: list[Course]) -> list[list[Course]]:
    """Those that start from rest apart from those that go on, LANES at a time."""
    parts = [[c for c in courses if (c.state is None) == resting] for resting in (True, False)]
    return [part[k : k + LANES] for part in parts for k in range(0, len(part), LANES)]


def _judge(course: Course, numerics: Numerics, steps: int, *, last: bool) -> None:
    """Decide whether an individual is accurate, goes up a rung, or is given up."""
    if course.reason is not None:
        course.failures += 1
        course.tracks, course.changes, course.error = None, [], np.nan  # one that diverged starts again from rest
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
        course.error = estimated_error(course.changes) + course.distance
        course.done = course.error <= numerics.accuracy
    if not course.done:
        course.before = course.copy()
    if last and not course.done:
        course.done = True
        estimate = (
            f"estimated error {course.error * 1e3:.3g} mm" if course.changes else "no coarser motion to compare with"
        )
        course.reason = (
            f"not accurate enough with {steps} steps a beat: {estimate}, asked for {numerics.accuracy * 1e3:g} mm"
        )


def _refuse_flutter(group: list[Course]) -> None:
    """A leap may find a periodic motion that no wing keeps."""
    for course in group:
        if course.growth > FLUTTER:
            course.reason = (
                f"flutters: a disturbance of its periodic motion grows {course.growth:.3g}-fold from beat to beat"
            )


def _beat(structure: Structure, course: Course, with_motion: bool) -> Beat:
    trace = course.trace
    if trace is None or course.reason is not None:
        trace = Trace(
            *(np.full(a.shape[:-1], np.nan) for a in new_trace(structure, LADDER[0], with_motion=with_motion))
        )
    motion = State(trace.R, trace.p, trace.V, trace.z) if with_motion else None
    return Beat(
        trace.tracks,
        trace.rods,
        trace.air,
        trace.energy,
        trace.power,
        course.beats,
        course.error,
        course.growth,
        course.reason,
        motion,
    )
