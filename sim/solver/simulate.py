"""Compute the periodic motion of a batch of wings to a requested accuracy; only this module runs their kernels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import State, Trace
from wingfit.sim.solver.numerics import LADDER, Numerics, estimated_error
from wingfit.sim.solver.scene import new_trace
from wingfit.sim.solver.sensitivity import neighbourhood
from wingfit.sim.solver.settle import Course, Subject, measure_growth, settle, warm_start
from wingfit.sim.wing.structure import Structure

FLUTTER = 1.02  # growth of a disturbance in a beat above which a periodic motion counts as unstable
RETRY_FACTOR = 1.5  # on the steps of individuals that fail from a warm start and from rest
NO_DERIVATIVE = "the derivative of its motion was not found"
_MAX_FAILURES = 4  # numbers of steps that may fail before an individual counts as failed


@dataclass(frozen=True)
class Beat:
    """One periodic beat of an individual, at n equal steps from drive phase 0; arrays are NaN if it failed.

    Attributes:
        tracks: [n, M, 3] positions of M markers in the world, m.
        rods: [n, 2, 6] moment and force (N m, N) of the wing on the front and rear driving rod, rod frame at the hinge.
        air: [n, 3] force of the air on the wing in the world, N; without the inertia of added mass.
        energy: [n, 3] kinetic, elastic, gravitational, J.
        power: [n, 4] into the wing through dampers, front motor, rear motor and air, W.
        beats: total number of simulated beats.
        error: estimated largest error of a marker, m, from the steps and from the distance to the periodic motion; NaN
            if the steps were given.
        growth: estimated growth of a disturbance of the periodic motion in a beat; below 1 it decays.
        reason: why the individual failed, or None.
        motion: pose and twist of the N bodies and the two rods [n, N+2, .], if requested, else None.
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
    """Simulate ``genomes`` [B, G] (B individuals, G genes) until each is periodic and accurate, in groups of LANES.

    The results of an individual do not depend on the others: each has its own steps and number of beats. With ``near``,
    the solution for a similar individual, the individuals start at its motion, with as many steps, and its error is
    taken as theirs. ``with_motion``: also return the motion of all bodies.
    """
    if near is not None and near.trace is not None:
        courses = _courses_near(subject, genomes, numerics, near, with_motion=with_motion)
        return tuple(_beat(subject.structure, course, with_motion) for course in courses)
    courses = [Course(genome) for genome in genomes]
    return _settled(subject, courses, numerics, with_motion)


def neighbouring_beats(
    subject: Subject, genomes: Array, sizes: Array, numerics: Numerics, near: Course, *, same: bool
) -> tuple[Beat, ...]:
    """Simulate ``genomes[0]``, and its neighbours to first order in their distance (:mod:`.sensitivity`).

    ``genomes`` [1 + K, G]; ``sizes`` [K]: distances of the neighbours, in any unit. ``near``: a periodic motion close
    to that of the first, or, if ``same``, the motion of the first. Of the beats, only the tracks are known. A neighbour
    whose derivative does not converge has a reason; if the first fails, all have its reason.
    """
    if not same:
        (near,) = _courses_near(subject, genomes[:1], numerics, near, with_motion=False)
        if near.reason is not None:
            return (_beat(subject.structure, near, with_motion=False),) * len(genomes)
    found = neighbourhood(subject, near, genomes, sizes, numerics)
    tracks = np.concatenate([found.tracks[None], found.tracks + sizes[:, None, None, None] * found.slopes])
    first = None if np.isfinite(found.distance) else "no periodic motion was found from that of a neighbour"
    later = (None if np.isfinite(error) else NO_DERIVATIVE for error in found.errors)
    n = len(found.tracks)
    rods, air, energy, power = (np.full(shape, np.nan) for shape in ((n, 2, 6), (n, 3), (n, 3), (n, 4)))
    error = near.error + found.distance
    return tuple(
        Beat(one, rods, air, energy, power, found.beats, error, near.growth, reason)
        for one, reason in zip(tracks, (first, *later), strict=True)
    )


def settled_course(subject: Subject, genome: Array, numerics: Numerics) -> Course | None:
    """Return the solution for one individual, ``genome`` [G], as a warm start for others; None if it fails.

    The solution at the previous, smaller number of steps is returned if its error turns out to be small enough.
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


def _courses_near(
    subject: Subject, genomes: Array, numerics: Numerics, near: Course, *, with_motion: bool
) -> list[Course]:
    """Solve for individuals from the motion of ``near`` with as many steps; those that fail restart from rest."""
    if near.trace is None:
        raise ValueError("a warm start needs an individual with a periodic motion")
    steps = len(near.trace.tracks)
    states = len(subject.scene(genomes[:1]).frozen().laws.size)
    courses = [warm_start(near, genome, states) for genome in genomes]
    settle(subject, courses, numerics, steps, with_motion)
    failed = [k for k, course in enumerate(courses) if course.reason is not None or course.growth > FLUTTER]
    for k, course in zip(failed, _from_rest(subject, genomes[failed], numerics, steps, with_motion), strict=True):
        courses[k] = course
    for course in courses:
        course.error = near.error + course.distance
    return courses


def _from_rest(subject: Subject, genomes: Array, numerics: Numerics, steps: int, with_motion: bool) -> list[Course]:
    """Solve from rest with ``steps`` per beat, and once more with RETRY_FACTOR times as many where that fails."""
    courses = [Course(genome) for genome in genomes]
    for tried in (steps, round(RETRY_FACTOR * steps)):
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
        settle(subject, under_way, numerics, steps, with_motion)
        for course in under_way:
            _judge(course, numerics, steps, last=rung == len(ladder) - 1)
        suspect = [c for c in under_way if c.done and c.reason is None and c.growth > FLUTTER]
        for start in range(0, len(suspect), LANES):
            measure_growth(subject, suspect[start : start + LANES], steps)
        for course in suspect:
            if course.growth > FLUTTER:  # an extrapolation may find an unstable motion
                growth = f"a disturbance of its periodic motion grows {course.growth:.3g}-fold from beat to beat"
                course.reason = f"flutters: {growth}"
    return tuple(_beat(subject.structure, course, with_motion) for course in courses)


def _judge(course: Course, numerics: Numerics, steps: int, *, last: bool) -> None:
    """Set in ``course`` whether its individual is accurate, needs more steps, or has failed, after ``steps`` per beat.

    ``last``: whether no larger number of steps remains to be tried.
    """
    if course.reason is not None:
        course.failures += 1
        course.tracks, course.changes, course.error = None, [], np.nan  # one that diverged starts again from rest
        course.done = last or course.failures >= _MAX_FAILURES
        return
    if numerics.steps is not None:
        course.done = True
        return
    if course.trace is None:
        raise AssertionError("a periodic individual has a trace")
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
        error, wanted = course.error * 1e3, f"requested {numerics.accuracy * 1e3:g} mm"
        estimate = f"estimated error {error:.3g} mm" if course.changes else "no coarser motion for comparison"
        course.reason = f"not accurate enough with {steps} steps a beat: {estimate}, {wanted}"


def _beat(structure: Structure, course: Course, with_motion: bool) -> Beat:
    trace = course.trace
    if trace is None or course.reason is not None:
        blank = new_trace(structure, LADDER[0], with_motion=with_motion)
        trace = Trace(*(np.full(array.shape[:-1], np.nan) for array in blank))
    motion = State(trace.R, trace.p, trace.V, trace.z) if with_motion else None
    arrays = (trace.tracks, trace.rods, trace.air, trace.energy, trace.power)
    return Beat(*arrays, course.beats, course.error, course.growth, course.reason, motion)
