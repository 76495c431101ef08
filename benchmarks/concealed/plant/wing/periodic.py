"""Finds a periodic motion by Anderson acceleration of the map from the state at a beat's start to that at its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.concealed.plant.wing.integrator import C, State, beat
from benchmarks.concealed.plant.wing.rig import Rig

Array = npt.NDArray[np.float64]

FINER = 4
_LENGTH = 0.1  # m: converts rotations to displacements when they are compared
_WINDOW = 10  # beats that are combined in an extrapolation
_ROUGH = 2e-4  # m: distance from periodicity below which the steps are refined
_FAR = 0.3  # m: extrapolations that go farther are rejected
_STAGE = 1e-3  # tolerance of a stage, relative to the tolerance of periodicity
_FIRST = 1e-5  # m: tolerance of the stages of the first beat
_WORSE = 5.0  # ratio to the smallest change so far above which an extrapolation is undone


@dataclass(frozen=True)
class Accuracy:
    """Settings of the search for a periodic motion: ``rough`` integration steps a beat at first, ``steps`` at the end.

    A motion counts as periodic if it repeats to within ``periodic`` m; ``beats`` limits each of the two searches. With
    the default values the time discretisation error is below 0.02 mm for van der Grinten's wings at up to 4 Hz.
    """

    rough: int = 48
    steps: int = 96
    periodic: float = 4e-6
    beats: int = 60


def settle(rig: Rig, rods: Callable[[int], Array], start: State, accuracy: Accuracy) -> tuple[Array, Array, float, int]:
    """Find a periodic motion, starting from the state ``start``.

    Returns rotations [n, N, 3, 3] and centres [n, N, 3] of the bodies over one beat, the distance from periodicity (m),
    and the number of beats that were integrated. ``rods``: :func:`.build.rod_table` as a function of the number of
    steps. ArithmeticError if no periodic motion is found, even with FINER times as many steps.
    """
    try:
        return _settled(rig, rods, start, accuracy)
    except ArithmeticError:
        finer = replace(accuracy, rough=FINER * accuracy.rough, steps=FINER * accuracy.steps)
        return _settled(rig, rods, start, finer)


def _settled(
    rig: Rig, rods: Callable[[int], Array], start: State, accuracy: Accuracy
) -> tuple[Array, Array, float, int]:
    state, spent = _let_in(rig, rods(accuracy.rough), start), 1
    for steps, near in ((accuracy.rough, _ROUGH), (accuracy.steps, accuracy.periodic)):
        search = _Search(rig, rods(steps), near)
        state, took = search.run(state, accuracy.beats)
        spent += took
    return search.R, search.p, search.error, spent


def _let_in(rig: Rig, table: Array, start: State) -> State:
    """State after one beat that begins at ``start``, over which the drive's amplitude grows from zero.

    ``table``: of :func:`.build.rod_table`.
    """
    n = len(table) - 1
    x = np.minimum((np.arange(n + 1)[:, None] + C) / n, 1.0)[..., None]
    share, growth = x**3 * (10 + x * (6 * x - 15)), 30 * (x * (1 - x)) ** 2 / rig.period
    grown = np.stack([share * table[..., 0], share * table[..., 1] + growth * table[..., 0]], axis=-1)
    end = beat(
        rig, np.ascontiguousarray(grown), start, _FIRST,
        np.empty((n, len(rig.mass), 3, 3)), np.empty((n, len(rig.mass), 3)), np.empty((n, len(start.z))),
    )  # fmt: skip
    if not np.isfinite(end.p).all():
        raise ArithmeticError("the integration fails while the drive starts from rest; check genome and condition")
    return end


class _Search:
    """Search for a periodic motion with a fixed number of steps a beat, to within ``near`` m.

    ``R``, ``p``: rotations and centres over the last beat; ``error``: its distance from periodicity, m.
    """

    def __init__(self, rig: Rig, table: Array, near: float) -> None:
        self.rig, self.table, self.near = rig, table, near
        shape = (len(table) - 1, len(rig.mass))
        self.R, self.p = np.empty((*shape, 3, 3)), np.empty((*shape, 3))
        self.error = np.inf

    def run(self, state: State, most: int) -> tuple[State, int]:
        """Search from ``state``, for at most ``most`` beats; returns the periodic state and the number of beats.

        ArithmeticError without convergence.
        """
        omega = 2 * np.pi / self.rig.period
        memories = np.empty((len(self.table) - 1, len(state.z)))
        xs: list[Array] = []
        fs: list[Array] = []
        x, best = _packed(state, omega), np.inf
        for count in range(1, most + 1):
            end = beat(self.rig, self.table, _unpacked(x, state, omega), _STAGE * self.near, self.R, self.p, memories)
            f = _packed(end, omega) - x if np.isfinite(end.p).all() else None
            size = _largest(f, len(self.rig.mass)) if f is not None else np.inf
            if f is None or (size > _WORSE * best and len(xs) > 1):
                if not xs:
                    raise ArithmeticError("the first beat cannot be integrated; check genome and condition")
                k = int(np.argmin([_largest(g, len(self.rig.mass)) for g in fs]))
                x, xs, fs, best = xs[k] + fs[k], [], [], np.inf  # restart from the best state, without extrapolation
                continue
            best = min(best, size)
            xs, fs = [*xs[-_WINDOW:], x], [*fs[-_WINDOW:], f]
            ahead = leap(xs, fs)
            way = _largest(ahead - x, len(self.rig.mass))
            self.error = max(size, min(way, 10 * size)) if len(xs) > 1 else 10 * size
            if self.error < self.near:
                return end, count
            x = ahead if way < _FAR else x + f
        raise ArithmeticError(
            f"no periodic motion within {most} beats: {1e3 * self.error:.3g} mm remain; check genome and strength"
        )


def leap(xs: list[Array], fs: list[Array]) -> Array:
    """The next state, extrapolated (Anderson 1965) from earlier states ``xs`` and their changes over a beat ``fs``."""
    if len(xs) == 1:
        return xs[0] + fs[0]
    dx, df = np.diff(np.array(xs), axis=0).T, np.diff(np.array(fs), axis=0).T
    part = np.linalg.lstsq(df, fs[-1], rcond=1e-10)[0]
    return np.asarray(xs[-1] + fs[-1] - (dx + df) @ part)


def _largest(f: Array, bodies: int) -> float:
    """Largest change of a body's position or attitude in the packed change ``f`` (see :func:`_packed`), m."""
    return float(np.abs(f[: 6 * bodies]).max())


def _packed(state: State, omega: float) -> Array:
    """The state as one vector in metres, so that all entries are comparable.

    Rotations are multiplied by about a chord, rates also by 1 / ``omega``, internal states by 0.02.
    """
    turn = _LENGTH * Rotation.from_matrix(state.R).as_rotvec()
    parts = (state.p, turn, state.v / omega, _LENGTH / omega * state.w, 0.02 * state.z)
    return np.concatenate([part.ravel() for part in parts])


def _unpacked(x: Array, like: State, omega: float) -> State:
    n = len(like.p)
    p, turn, v, w = x[: 12 * n].reshape(4, n, 3)
    R = np.ascontiguousarray(Rotation.from_rotvec(turn / _LENGTH).as_matrix())
    return State(R, p.copy(), v * omega, w * omega / _LENGTH, x[12 * n :] / 0.02)
