"""Measures the convergence of the simulation of one nominal wing.

Computes its converged periodic motion, the integration steps that a beat needs, and the beats until it is periodic.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from wingfit.records import Condition
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import State, Trace, new_work
from wingfit.sim.kernels.integrate import advance
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.periodic import Secants
from wingfit.sim.solver.scene import at_rest, drive_table, new_trace, setting
from wingfit.sim.solver.simulate import Beat, periodic_beats
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.genes import lanes
from wingfit.sim.wing.structure import Structure

Array = npt.NDArray[np.float64]

CONVERGED = 1024  # steps of the reference, which is compared with half as many
SETTLED = 1e-7  # m from the periodic motion at which a beat counts as periodic: negligible compared with 0.1 mm
MOST_BEATS = 400
_AGREEMENT = 0.02  # largest change from half as many steps to the reference, relative to the tolerance


@dataclass(frozen=True)
class Subject:
    """The Robird's wing with nominal genes, in one discretisation under one condition.

    ``division``: discretisation, such as "6x4" (6 strips of 4 bodies); ``damping``: factor of the nominal damping
    genes. The simulator computes LANES individuals at once, in "lanes"; here all of them are equal.
    """

    division: str
    condition: Condition
    damping: float = 1.0

    @cached_property
    def model(self) -> FlexibleWing:
        """The model of the wing with default settings."""
        return FlexibleWing(robird_wing(), self.division)

    @property
    def structure(self) -> Structure:
        """The rigid bodies and connectors of the model."""
        return self.model.structure

    @cached_property
    def genome(self) -> Array:
        """Values of all G genes, [1, G]."""
        factors = {"D_E": self.damping, "D_G": self.damping}
        return np.array([[gene.nominal * factors.get(gene.name, 1.0) for gene in self.model.genes]])

    @cached_property
    def scene(self) -> WingScene:
        """Input of the simulator for LANES individuals, all with the same genome."""
        return WingScene.of(self.structure, self.condition, lanes(self.structure, self.model.genes, self.genome))

    def drive(self, numerics: Numerics, steps: int, beat: int) -> Array:
        """Return angles and rates of the driving rods over beat number ``beat``, in ``steps`` steps.

        See :func:`wingfit.sim.solver.scene.drive_table`.
        """
        return drive_table(self.scene.rods, self.condition.flap_frequency, numerics, steps, beat)


@dataclass(frozen=True)
class Passed:
    """One integrated beat of the first lane: ``trace``, its motion and energy; ``start``, the state at its start.

    ``distance``: estimated distance (m) of that state from the periodic motion; infinite if it is not known.
    """

    trace: Trace
    start: State
    distance: float


def beats(subject: Subject, steps: int, *, window: int, start: State | None = None) -> Iterator[Passed]:
    """Integrate from rest, or from the state ``start``, and yield one beat of ``steps`` steps after another, endlessly.

    The search for a periodic motion is that of :func:`wingfit.sim.solver.settle.settle`, which returns only the last
    beat. ``window``: past beats that Anderson acceleration uses, 0 for none. ArithmeticError if a lane diverges.
    """
    structure, numerics = subject.structure, Numerics(steps=steps, window=window)
    group, here = subject.scene.frozen(), subject.scene.setting(steps)
    work = new_work(structure.wiring, here, group)
    state, trace, alive = at_rest(structure), new_trace(structure, steps), np.ones(LANES, bool)
    if start is not None:
        _put(state, start)
    secants: Secants | None = None
    beat = 0 if start is None else numerics.ramp_beats
    while True:
        before = _first_lane(state)
        table = subject.drive(numerics, steps, min(beat, numerics.ramp_beats))
        advance(structure.wiring, here, group, table, work, state, trace, alive)
        if not alive.all():
            raise ArithmeticError(f"{subject.division} bodies diverge with {steps} steps a beat")
        distance = np.inf
        if beat >= numerics.ramp_beats:
            secants = secants or Secants(before, subject.scene.angular_rate, window, group.laws.size)
            following, distance = secants.add(before, _first_lane(state))
            _put(state, following)
        yield Passed(Trace(*(array[..., 0].copy() for array in trace)), before, distance)
        beat += 1


def _first_lane(state: State) -> State:
    return State(*(array[..., 0].copy() for array in state))


def _put(into: State, state: State) -> None:
    for array, value in zip(into, state, strict=True):
        array[:] = value[..., None]


def periodic(subject: Subject, steps: int, start: State | None = None) -> Passed:
    """Return the first beat of ``steps`` steps that is periodic to within SETTLED m; ArithmeticError after MOST_BEATS.

    ``start``: initial state; at rest if None.
    """
    window = Numerics().window
    for passed in islice(beats(subject, steps, window=window, start=start), MOST_BEATS):
        if passed.distance <= SETTLED:
            return passed
    raise ArithmeticError(f"{subject.division} bodies are not periodic to {SETTLED:g} m after {MOST_BEATS} beats")


@dataclass(frozen=True)
class Reference:
    """The converged periodic motion, with CONVERGED steps a beat.

    ``tracks`` [CONVERGED, M, 3]: positions of the M markers, m; ``change``: their largest distance (m) from those with
    half as many steps; ``start``: state at the start of the beat.
    """

    tracks: Array
    change: float
    start: State


def reference(subject: Subject, tolerance: float) -> Reference:
    """Compute the converged periodic motion of ``subject``.

    ArithmeticError if the motion with half as many steps differs by more than ``tolerance`` (m) times _AGREEMENT.
    """
    half = periodic(subject, CONVERGED // 2)
    whole = periodic(subject, CONVERGED, half.start)
    change = largest_distance(half.trace.tracks, whole.trace.tracks)
    if not change <= _AGREEMENT * tolerance:
        raise ArithmeticError(
            f"{CONVERGED} and {CONVERGED // 2} steps differ by {change * 1e3:.3g} mm, more than "
            f"{_AGREEMENT * tolerance * 1e3:.3g} mm; raise CONVERGED"
        )
    return Reference(whole.trace.tracks, change, whole.start)


def largest_distance(tracks: Array, converged: Array) -> float:
    """Return the largest distance (m) of a marker between two periodic motions, over the beat.

    It is taken at the n instants of ``tracks`` [n, M, 3], to which ``converged`` [m, M, 3] is interpolated.
    """
    return float(np.sqrt(((tracks - at_steps(converged, len(tracks))) ** 2).sum(axis=-1)).max())


def at_steps(tracks: Array, count: int) -> Array:
    """Resample the periodic ``tracks`` [m, M, 3] at ``count`` equal steps of the beat, by their full Fourier series."""
    if len(tracks) % count == 0:
        return tracks[:: len(tracks) // count]
    series = np.fft.rfft(tracks, axis=0) / len(tracks)
    series[1 : (len(tracks) + 1) // 2] *= 2
    turn = np.exp(2j * np.pi * np.outer(np.arange(count) / count, np.arange(len(series))))
    return np.asarray(np.tensordot(turn, series, axes=1).real)


def fewest_steps(subject: Subject, converged: Reference, tolerance: float, least: int = 16) -> tuple[int, float]:
    """Return the smallest even number of steps a beat that keeps markers within ``tolerance`` (m), and its error (m).

    The next even number must suffice too, so that an error that is small by chance does not count. ``least``: first
    number tried.
    """
    found: tuple[int, float] | None = None
    for steps in range(least, CONVERGED // 2, 2):
        error = _error(subject, converged, steps)
        if error > tolerance:
            found = None
        elif found is not None:
            return found
        else:
            found = steps, error
    raise ArithmeticError(f"{subject.division} bodies: {CONVERGED // 2} steps are not enough for {tolerance:g} m")


def _error(subject: Subject, converged: Reference, steps: int) -> float:
    """Return the largest error (m) of a marker with ``steps`` steps a beat; infinite without a periodic motion."""
    try:
        return largest_distance(periodic(subject, steps, converged.start).trace.tracks, converged.tracks)
    except ArithmeticError:
        return np.inf


def beats_to_periodic(subject: Subject, steps: int, window: int, tolerance: float) -> int | None:
    """Return the number of beats from rest until all markers stay within ``tolerance`` (m) of the periodic motion.

    The count includes the beats of the start-up ramp; the periodic motion is computed with as many ``steps`` a beat.
    ``window``: past beats that Anderson acceleration uses. None if it takes more than MOST_BEATS.
    """
    final = periodic(subject, steps).trace.tracks
    errors = []
    for passed in islice(beats(subject, steps, window=window), MOST_BEATS):
        errors.append(largest_distance(passed.trace.tracks, final))
        if passed.distance <= SETTLED and errors[-1] <= tolerance:
            return 1 + int(np.max(1 + np.flatnonzero(np.array(errors) > tolerance), initial=0))
    return None


def ms_per_beat(subject: Subject, steps: int, start: State, seconds: float = 0.6) -> float:
    """Return the median processor time (ms) of a beat of ``steps`` steps from the state ``start``, without compilation.

    The time is for one individual: that of all lanes divided by LANES. ``seconds``: least total duration of the
    measurement.
    """
    structure, numerics = subject.structure, Numerics(steps=steps)
    group, here = subject.scene.frozen(), subject.scene.setting(steps)
    work = new_work(structure.wiring, here, group)
    table = subject.drive(numerics, steps, numerics.ramp_beats)
    state, trace, alive = at_rest(structure), new_trace(structure, steps), np.ones(LANES, bool)
    _put(state, start)
    times: list[float] = []
    while len(times) < 6 or sum(times) < seconds:
        began = time.thread_time()
        advance(structure.wiring, here, group, table, work, state, trace, alive)
        times.append(time.thread_time() - began)
    if not alive.all():
        raise ArithmeticError(f"{subject.division} bodies diverge with {steps} steps a beat")
    return 1e3 * statistics.median(times[1:]) / LANES


@dataclass(frozen=True)
class ByDefault:
    """Result of a simulation with default settings.

    ``beat``: periodic beat of the first individual; ``ms``: processor time (ms) until the motion is periodic, for one
    individual: that of all lanes divided by LANES.
    """

    beat: Beat
    ms: float


def by_default(subject: Subject) -> ByDefault:
    """Simulate LANES individuals by default settings until they are periodic; the time is the least of three runs."""
    genomes = np.repeat(subject.genome, LANES, axis=0)
    arguments = (subject.model.subject((), subject.condition), genomes, subject.model.numerics)
    times, found = [], periodic_beats(*arguments)
    for _ in range(3):
        began = time.thread_time()
        found = periodic_beats(*arguments)
        times.append(time.thread_time() - began)
    if found[0].reason is not None:
        raise ArithmeticError(f"{subject.division} bodies, nominal genes: {found[0].reason}")
    return ByDefault(found[0], 1e3 * min(times) / LANES)


def energy_error(subject: Subject, steps: int, count: int = 20) -> float:
    """Return the largest energy error over ``count`` beats from rest, as a fraction.

    The error is the change of stored energy (kinetic, elastic, gravitational) minus the works of dampers, first motor,
    second motor and air since the start; it is divided by the largest of these four works.
    """
    passed = [one.trace for one in islice(beats(subject, steps, window=0), count)]
    stored = np.concatenate([trace.energy for trace in passed]).sum(axis=1)
    power = np.concatenate([trace.power for trace in passed])
    times = np.arange(len(power)) * setting(subject.condition, steps).step
    work = CubicSpline(times, power).antiderivative()(times)
    return float(np.abs(stored - stored[0] - work.sum(axis=1)).max() / np.abs(work).max())
