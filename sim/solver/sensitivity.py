"""Exact derivatives of a computed periodic motion with respect to genes, by differences of single beats.

With a given number of steps, a beat maps the state x at its start and the genes g to the state F(x, g) at its end, and
the periodic motion is x = F(x, g). Its derivative by a gene is the fixed point of a linear map, dx = M dx + b with M =
dF/dx and b = dF/dg. Each lane simulates one beat that starts at x + h d with the gene changed by h; its end, less that
of the undisturbed beat and divided by h, is M d + b to within h. As no difference of two converged motions is taken, h
can be a millionth of the range of a gene. All genes share M: the fixed points are extrapolated (Anderson, J. ACM 12,
1965) from the secants of all genes together, which after a few beats span all that survives a beat.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import State
from wingfit.sim.kernels.chart import coordinates, displaced
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.settle import Course, Group, Subject, put

TOLERANCE = 1e-4  # of a derivative, relative to its size
ROUND_OFF = 1e-13  # m, of the state at the end of a beat: derivatives smaller than this over h are not resolved
LARGEST_GROWTH = 0.98  # of a disturbance in a beat, that errors are multiplied for
SETTLED = 2e-7  # m, of the undisturbed motion from its periodic one: a millionth of what moves in a beat
ACCEPTED = 1e-5  # m, the same after MAX_BEATS
LEAST_MOVE = 1e-9  # m, of the undisturbed motion between beats: a shorter one shows round-off
MAX_BEATS = 12
_RANK = 1e-6  # relative to the largest singular value of the secants; smaller ones are round-off


@dataclass(frozen=True)
class Neighbourhood:
    """A periodic beat and its derivatives.

    Attributes:
        tracks: [n, M, 3] positions of M markers at n equal steps, m.
        slopes: [K, n, M, 3] their derivatives, m per unit of each of K changes.
        errors: [K] estimated relative error of the derivatives, besides round-off; inf for those that did not converge.
        distance: of the beat from the periodic motion, m.
        beats: number of beats simulated of each individual.
    """

    tracks: Array
    slopes: Array
    errors: Array
    distance: float
    beats: int


def neighbourhood(subject: Subject, near: Course, genomes: Array, sizes: Array, numerics: Numerics) -> Neighbourhood:
    """Differentiate the periodic motion of ``genomes[0]`` in the directions of the other genomes.

    ``genomes`` [1 + K, G]: the undisturbed genome, then K genomes that differ from it by small changes of ``sizes``
    [K], which divide the differences. ``near``: the motion of the undisturbed one; ValueError if it is not periodic.
    """
    beats, secants = _Beats(subject, near, genomes, numerics), _Secants()
    x, d = beats.start, np.zeros((len(sizes), len(beats.start)))
    for beat in range(1, MAX_BEATS + 1):
        ends, tracks = beats.run(np.vstack([x, x + sizes[:, None] * d]))
        reached, seen = (ends[1:] - ends[0]) / sizes[:, None], (tracks[1:] - tracks[0]) / sizes[:, None, None, None]
        secants.add(np.vstack([x, d]), np.vstack([ends[:1], reached]), np.concatenate([tracks[:1], seen]))
        whole, moved = np.isfinite(reached).all(axis=1), ends[0] - x
        weights, left = secants.combined(np.vstack([np.where(whole[:, None], reached - d, 0.0), moved]))
        resolved = np.linalg.norm(reached, axis=1) + ROUND_OFF / (TOLERANCE * sizes)
        remaining = np.linalg.norm(left[:-1], axis=1) / (1.0 - min(near.growth, LARGEST_GROWTH))
        errors, distance = np.where(whole, remaining / resolved, np.inf), float(np.abs(moved).max())
        exact = distance <= SETTLED and bool((errors[whole] <= TOLERANCE).all())
        if exact or not np.isfinite(distance) or beat == MAX_BEATS:
            break
        step = secants.moved(weights)
        d, x = np.where(whole[:, None], reached + step[:-1], 0.0), ends[0] + step[-1]
    settled = distance <= ACCEPTED
    good = (errors <= TOLERANCE) & settled
    slopes = np.where(good[:, None, None, None], seen + secants.seen(weights)[:-1], np.nan)
    return Neighbourhood(tracks[0], slopes, np.where(good, errors, np.inf), distance if settled else np.inf, beat)


class _Secants:
    """Differences between successive beats, which show how the linear map of a beat moves S directions of the state.

    They are those of the undisturbed motion, scaled to length 1, and of the derivatives by K genes.
    """

    def __init__(self) -> None:
        self.last: tuple[Array, Array, Array] | None = None
        self.starts: list[Array] = []
        self.ends: list[Array] = []
        self.tracks: list[Array] = []

    def add(self, start: Array, end: Array, tracks: Array) -> None:
        """Add a beat: ``start`` and ``end`` [1 + K, D] and ``tracks`` [1 + K, n, M, 3].

        The first row is the undisturbed motion, the others are the derivatives.
        """
        if self.last is not None:
            changes = [now - before for now, before in zip((start, end, tracks), self.last, strict=True)]
            own = float(np.linalg.norm(changes[0][0]))
            kept = np.flatnonzero(np.isfinite(changes[1]).all(axis=1))[0 if own > LEAST_MOVE else 1 :]
            for known, change in zip((self.starts, self.ends, self.tracks), changes, strict=True):
                change[0] /= max(own, LEAST_MOVE)
                known += list(change[kept])
        self.last = start, end, tracks

    def combined(self, changes: Array) -> tuple[Array, Array]:
        """Combine the secants so that the ``changes`` [J, D] over a beat vanish as far as they can.

        Returns the weights [S, J] of the secants, and the changes [J, D] that remain.
        """
        if not self.starts or not np.all(np.isfinite(changes)):
            return np.zeros((len(self.starts), len(changes))), changes
        changed = (np.array(self.ends) - np.array(self.starts)).T
        weights, *_ = np.linalg.lstsq(changed, -changes.T, rcond=_RANK)
        return np.asarray(weights, float), changes + (changed @ weights).T

    def moved(self, weights: Array) -> Array:
        """Move [J, D] of the ends for the ``weights`` [S, J] of the secants."""
        return np.asarray(weights.T @ np.array(self.ends)) if self.ends else np.zeros((weights.shape[1], 1))

    def seen(self, weights: Array) -> Array:
        """Change [J, n, M, 3] of the tracks for the ``weights`` [S, J] of the secants."""
        if not self.tracks:
            return np.zeros((weights.shape[1], 1, 1, 1))
        return np.asarray(np.tensordot(weights.T, np.array(self.tracks), 1))


class _Beats:
    """Simulates single beats of a genome and its neighbours, in groups of LANES, from given coordinates [D]."""

    def __init__(self, subject: Subject, near: Course, genomes: Array, numerics: Numerics) -> None:
        if near.trace is None or near.state is None:
            raise ValueError("derivatives need an individual with a periodic motion")
        steps = len(near.trace.tracks)
        parts = [genomes[k : k + LANES] for k in range(0, len(genomes), LANES)]
        self.about = near.state
        self.groups = [Group(subject, [Course(genome, self.about) for genome in part], steps) for part in parts]
        self.tables = [group.table(numerics, steps, [numerics.ramp_beats]) for group in self.groups]
        self.start = self._coordinates(self.about)

    def run(self, starts: Array) -> tuple[Array, Array]:
        """Return the coordinates at the end of a beat [1 + K, D] and the tracks [1 + K, n, M, 3]; NaN if diverged.

        ``starts`` [1 + K, D]: coordinates at its start.
        """
        ends, tracks = [], []
        for k, (group, table) in enumerate(zip(self.groups, self.tables, strict=True)):
            for lane in range(len(group.courses)):
                put(group.state, lane, self._state(group, starts[k * LANES + lane]))
            group.beat(table)
            for lane in range(len(group.courses)):
                end = State(*(array[..., lane].copy() for array in group.state))
                ends.append(self._coordinates(end) if group.alive[lane] else np.full_like(self.start, np.nan))
                tracks.append(group.trace.tracks[..., lane].copy())
        return np.array(ends), np.array(tracks)

    def _state(self, group: Group, x: Array) -> State:
        found = State(*(array.copy() for array in self.about))
        displaced(self.about, x, group.angular_rate, group.sizes, found)
        return found

    def _coordinates(self, state: State) -> Array:
        found = np.empty(12 * (len(state.V) - 2) + len(state.z))
        coordinates(self.about, state, self.groups[0].angular_rate, self.groups[0].sizes, found)
        return found
