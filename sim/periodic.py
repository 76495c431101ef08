"""Finding the periodic motion sooner than by waiting for transients to die.

The beat maps the state x at its start to the state F(x) at its end; the periodic motion is its fixed point. Near it the
map is linear, and a lightly damped wing has only a few modes that survive a beat. From the beats so far, Anderson's
method (J. ACM 12, 1965; Walker and Ni, SIAM J. Numer. Anal. 49, 2011) takes the combination whose change over a beat is
smallest: with as many beats as surviving modes, the fixed point itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from sim.kernels.arrays import State

Array = npt.NDArray[np.float64]

_LENGTH = 0.1  # m, a chord: makes rotations comparable with displacements
# A leap after which a beat changes this many times as much as before is taken back. Not less: a mode n times as fast as
# the beat changes by up to n times as much where it is caught moving as where it is caught bent.
WORSE = 10.0
LONGEST = 20.0  # admits leaps along modes that keep up to 0.95 of their amplitude over a beat
_RANK = 1e-8  # of the largest singular value: less is the integrator's noise

_FAR = 2.0  # rad
_TOLD = 1e-2  # of the largest direction: less is too much mixed to tell a multiplier


@dataclass
class Secants:
    """What successive beats of one individual have told about its map.

    Coordinates are taken about the pose ``about``; twists are made displacements by ``angular_rate``, that of the beat,
    so that all are in metres.
    """

    about: State
    angular_rate: float
    kept: int
    sizes: Array  # [Z]: states of effects times these are comparable with metres
    starts: list[Array] = field(default_factory=list)
    ends: list[Array] = field(default_factory=list)
    columns: list[tuple[Array, Array]] = field(default_factory=list)
    best: tuple[float, State] | None = None  # smallest change of a beat so far, and the state at its end
    leapt: bool = False
    target: Array | None = None  # coordinates of the start that was given last

    def add(self, start: State, end: State) -> tuple[State, float]:
        """Learn from one beat; the state from which to start the next, and how far (m) that is from this start.

        That distance is what is left between this beat and the periodic one, as far as the beats can tell: until two of
        them can be compared, and for ever where none is kept, what the beat changes.
        """
        x = self._coordinates(start) if self.target is None else self.target
        arrived = self._coordinates(end)
        change = arrived - x
        size = float(np.linalg.norm(change))
        if self.leapt and self.best is not None and not size <= WORSE * self.best[0]:
            return self.step_back(), np.inf
        if self.best is None or size <= self.best[0]:
            self.best = (size, end)
        if self.starts:
            moved, left = arrived - self.ends[-1], change - (self.ends[-1] - self.starts[-1])
            self.columns = [*self.columns, (moved, left)][-self.kept :] if self.kept else []
        self.starts, self.ends = [x], [arrived]
        correction = self._correction(change)
        # a longer one means that there is no useful linear map yet: told as a distance, but not gone
        self.leapt = bool(0.0 < np.linalg.norm(correction) <= LONGEST * size)
        distance = float(np.abs(arrived + correction - x).max())
        self.target = arrived + correction if self.leapt else arrived
        return (self._state(self.target, end) if self.leapt else end), distance

    def step_back(self) -> State:
        """Where to go on after a leap that made things worse: from the end of the best beat, having learnt nothing."""
        if self.best is None or not self.leapt:
            raise ValueError("there was no leap to take back")
        _, state = self.best
        self.columns, self.starts, self.ends, self.best, self.leapt, self.target = [], [], [], None, False, None
        return State(*(array.copy() for array in state))

    @property
    def growth(self) -> float:
        """Factor by which a disturbance grows in a beat: the largest multiplier of the map, as far as beats can tell.

        From the map restricted to the changes seen, in an orthonormal basis of those that stand out; 0 before any.
        """
        if not self.columns:
            return 0.0
        moved, left = (np.array(part).T for part in zip(*self.columns, strict=True))
        before = moved - left
        size = np.linalg.norm(before, axis=0)
        if not (np.all(np.isfinite(moved)) and np.all(size > 0)):
            return 0.0
        basis, spread, mixed = np.linalg.svd(before / size, full_matrices=False)
        told = spread > _TOLD * spread[0]
        reduced = basis[:, told].T @ (moved / size) @ mixed[told].T / spread[told]
        return float(np.abs(np.linalg.eigvals(reduced)).max())

    def restart(self) -> None:
        """The map has changed a little (another step): keep what is known of its slope, compare no beat across."""
        self.starts, self.ends, self.best, self.leapt = [], [], None, False

    def _correction(self, change: Array) -> Array:
        """From the end of the beat to the fixed point, zero where nothing is known."""
        if not self.columns or not np.all(np.isfinite(change)):
            return np.zeros_like(change)
        moved, left = (np.array(part).T for part in zip(*self.columns, strict=True))
        size = np.linalg.norm(left, axis=0)
        size[size == 0.0] = 1.0
        weights, *_ = np.linalg.lstsq(left / size, -change, rcond=_RANK)
        return np.asarray((moved / size) @ weights)

    def _coordinates(self, state: State) -> Array:
        n = len(state.V) - 2
        R0, R = self.about.R[:n].reshape(n, 3, 3), state.R[:n].reshape(n, 3, 3)
        if not np.all(np.isfinite(R)):
            return np.full(12 * n + len(self.sizes), np.nan)
        turn = _vectors(np.swapaxes(R0, 1, 2) @ R) * _LENGTH
        twist = state.V[:n] / self.angular_rate
        parts = [turn, state.p[:n] - self.about.p[:n], twist[:, :3] * _LENGTH, twist[:, 3:]]
        return np.concatenate([np.concatenate(parts, axis=1).ravel(), state.z * self.sizes])

    def _state(self, coordinates: Array, rods: State) -> State:
        """The state at ``coordinates``, the driving rods as in ``rods``."""
        n = len(rods.V) - 2
        x = coordinates[: 12 * n].reshape(n, 12)
        found = State(*(array.copy() for array in rods))
        R0 = self.about.R[:n].reshape(n, 3, 3)
        found.R[:n] = (R0 @ _matrices(x[:, :3] / _LENGTH)).reshape(n, 9)
        found.p[:n] = self.about.p[:n] + x[:, 3:6]
        found.V[:n, :3] = x[:, 6:9] / _LENGTH * self.angular_rate
        found.V[:n, 3:] = x[:, 9:12] * self.angular_rate
        found.z[:] = coordinates[12 * n :] / self.sizes
        return found


def _vectors(R: Array) -> Array:
    """Rotation vectors [N, 3] of matrices [N, 3, 3]: axis times angle, from the antisymmetric part and the trace.

    Of turns beyond _FAR the antisymmetric part tells the axis badly; they take the slow way.
    """
    axis = 0.5 * (R[:, [2, 0, 1], [1, 2, 0]] - R[:, [1, 2, 0], [2, 0, 1]])
    sine, cosine = np.sqrt((axis * axis).sum(axis=1)), 0.5 * (R[:, 0, 0] + R[:, 1, 1] + R[:, 2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    if angle.max(initial=0.0) > _FAR:
        return np.asarray(Rotation.from_matrix(R).as_rotvec())
    return np.asarray(axis / np.sinc(angle / np.pi)[:, None])


def _matrices(turn: Array) -> Array:
    """Inverse of :func:`_vectors` (Rodrigues 1840)."""
    half = 0.5 * np.sqrt((turn * turn).sum(axis=1))
    cross = np.zeros((len(turn), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]], cross[:, [1, 2, 0], [2, 0, 1]] = turn, -turn
    once, twice = np.sinc(2.0 * half / np.pi), 0.5 * np.sinc(half / np.pi) ** 2
    return np.asarray(np.eye(3) + once[:, None, None] * cross + twice[:, None, None] * (cross @ cross))
