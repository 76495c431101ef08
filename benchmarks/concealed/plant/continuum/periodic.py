"""Finds a periodic motion of the rod by Anderson acceleration (J. ACM 12, 547 (1965)) of the map over one beat."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.concealed.plant.continuum.beam import Beam, states_of
from benchmarks.concealed.plant.continuum.build import rod_table
from benchmarks.concealed.plant.continuum.integrate import C, State, beat

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_FINER = 4
_LENGTH = 0.1  # m: converts rotations to displacements
_WINDOW = 8  # beats that are combined in an extrapolation
_FAR = 0.3  # m: extrapolations that go farther are rejected
_WORSE = 5.0  # ratio to the smallest change so far above which the extrapolation starts again
_STAGE = 1e-3  # tolerance of a stage, relative to that of periodicity


@dataclass(frozen=True)
class Settings:
    """Settings of the search: ``rough`` steps a beat until it repeats within ``near`` m, then ``steps`` steps a beat.

    The motion counts as periodic if it repeats within ``periodic`` m; ``beats`` limits either search.
    """

    rough: int = 64
    steps: int = 256
    near: float = 2e-4
    periodic: float = 4e-6
    beats: int = 60


@dataclass(frozen=True, eq=False)
class Cycle:
    """One beat of a periodic motion: rotations ``R`` [n, nodes, 3, 3] and places ``p`` [n, nodes, 3] (m) of the nodes.

    ``error``: estimated distance from the periodic motion, m; ``beats``: number of beats that were integrated.
    """

    R: Array
    p: Array
    error: float
    beats: int


def settle(beam: Beam, series: Complex, settings: Settings) -> Cycle:
    """Find the periodic motion of ``beam``, starting from rest.

    ``series`` [K, 2]: Fourier series of the angles of the driving rods, rad. ArithmeticError if there is none, even
    with four times as many steps.
    """
    try:
        return _settled(beam, series, settings)
    except ArithmeticError:
        finer = replace(settings, rough=_FINER * settings.rough, steps=_FINER * settings.steps)
        return _settled(beam, series, finer)


def at_rest(beam: Beam) -> State:
    """State of the undeformed wing at rest."""
    n = len(beam.rest)
    return State(
        np.tile(np.eye(3), (n, 1, 1)), beam.rest.copy(), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(states_of(beam))
    )


def _settled(beam: Beam, series: Complex, settings: Settings) -> Cycle:
    state = _started(beam, rod_table(series, 1 / beam.period, settings.rough), settings.near)
    state, rough = _search(beam, rod_table(series, 1 / beam.period, settings.rough), state, settings.near, settings)
    table = rod_table(series, 1 / beam.period, settings.steps)
    _, found = _search(beam, table, state, settings.periodic, settings)
    return replace(found, beats=1 + rough.beats + found.beats)


def _started(beam: Beam, table: Array, near: float) -> State:
    """State after one beat from rest, over which the amplitude of the drive's ``table`` grows from zero."""
    n = len(table) - 1
    x = np.minimum((np.arange(n + 1)[:, None] + C) / n, 1.0)[..., None]
    share, growth = x**3 * (10 + x * (6 * x - 15)), 30 * (x * (1 - x)) ** 2 / beam.period
    grown = np.stack([share * table[..., 0], share * table[..., 1] + growth * table[..., 0]], axis=-1)
    end = beat(beam, np.ascontiguousarray(grown), at_rest(beam), _STAGE * near, *_room(beam, n))
    if not np.isfinite(end.p).all():
        raise ArithmeticError("the integration fails while the drive starts from rest; check genome and condition")
    return end


def _room(beam: Beam, steps: int) -> tuple[Array, Array]:
    n = len(beam.rest)
    return np.empty((steps, n, 3, 3)), np.empty((steps, n, 3))


def _search(beam: Beam, table: Array, state: State, near: float, settings: Settings) -> tuple[State, Cycle]:
    """The periodic state to within ``near`` m, and its last beat, starting from ``state``.

    ArithmeticError without convergence.
    """
    omega, n = 2 * np.pi / beam.period, len(beam.rest)
    R, p = _room(beam, len(table) - 1)
    x, xs, fs, error = _packed(state, omega), list[Array](), list[Array](), np.inf
    for count in range(1, settings.beats + 1):
        end = beat(beam, table, _unpacked(x, state, omega), _STAGE * near, R, p)
        f = _packed(end, omega) - x
        sizes = [_largest(g, n) for g in fs]
        if not np.isfinite(f).all() or (len(fs) > 1 and _largest(f, n) > _WORSE * min(sizes)):
            if not fs:
                raise ArithmeticError("the first beat cannot be integrated; check genome and condition")
            best = int(np.argmin(sizes))
            x, xs, fs = xs[best] + fs[best], [], []
            continue
        xs, fs = [*xs[-_WINDOW:], x], [*fs[-_WINDOW:], f]
        leap = _leap(xs, fs)
        size, way = _largest(f, n), _largest(leap - x, n)
        error = max(size, min(way, 10 * size)) if len(xs) > 1 else 10 * size
        if error < near:
            return end, Cycle(R, p, error, count)
        x = leap if way < _FAR else x + f
    raise ArithmeticError(
        f"no periodic motion within {settings.beats} beats: {1e3 * error:.3g} mm remain; check genome and strength"
    )


def _leap(xs: list[Array], fs: list[Array]) -> Array:
    """The next state from the states ``xs`` at the starts of beats, and their changes ``fs`` over a beat."""
    if len(xs) == 1:
        return xs[0] + fs[0]
    dx, df = np.diff(np.array(xs), axis=0).T, np.diff(np.array(fs), axis=0).T
    part = np.linalg.lstsq(df, fs[-1], rcond=1e-10)[0]
    return np.asarray(xs[-1] + fs[-1] - (dx + df) @ part)


def _largest(f: Array, nodes: int) -> float:
    """Largest change of place or attitude (as a displacement, m) in the packed change ``f`` of a state."""
    return float(np.abs(f[: 6 * nodes]).max())


def _packed(state: State, omega: float) -> Array:
    """The state as a vector of displacements (m): velocities are divided by ``omega``, internal states scaled."""
    turn = _LENGTH * Rotation.from_matrix(state.R).as_rotvec() if np.isfinite(state.R).all() else np.nan * state.p
    parts = (state.p, turn, state.v / omega, _LENGTH / omega * state.w, 0.02 * state.z)
    return np.concatenate([part.ravel() for part in parts])


def _unpacked(x: Array, like: State, omega: float) -> State:
    n = len(like.p)
    p, turn, v, w = x[: 12 * n].reshape(4, n, 3)
    R = np.ascontiguousarray(Rotation.from_rotvec(turn / _LENGTH).as_matrix())
    return State(R, p.copy(), v * omega, w * omega / _LENGTH, x[12 * n :] / 0.02)
