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

from sim.kernels.integrate import State

Array = npt.NDArray[np.float64]

_LENGTH = 0.1  # m, a chord: makes rotations comparable with displacements
WORSE = 2.0  # a leap after which a beat changes this many times as much as before is taken back
LONGEST = 20.0  # admits modes that keep up to 0.95 of their amplitude over a beat
_RANK = 1e-8  # of the largest singular value: less is the integrator's noise


@dataclass
class Secants:
    """What successive beats of one individual have told about its map.

    Coordinates are taken about the pose ``about``; twists are made displacements by ``angular_rate``, that of the beat,
    so that all are in metres.
    """

    about: State
    angular_rate: float
    kept: int
    starts: list[Array] = field(default_factory=list)
    ends: list[Array] = field(default_factory=list)
    columns: list[tuple[Array, Array]] = field(default_factory=list)
    best: tuple[float, State] | None = None  # smallest change of a beat so far, and the state at its end
    leapt: bool = False

    def add(self, start: State, end: State) -> tuple[State, float]:
        """Learn from one beat; the state from which to start the next, and how far (m) that is from this start.

        That distance is what is left between this beat and the periodic one, as far as the beats can tell.
        """
        x, arrived = self._coordinates(start), self._coordinates(end)
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
        self.leapt = bool(correction.any())
        target = arrived + correction
        return (self._state(target, end) if self.leapt else end), float(np.abs(target - x).max())

    def step_back(self) -> State:
        """Where to go on after a leap that made things worse: from the end of the best beat, having learnt nothing."""
        if self.best is None or not self.leapt:
            raise ValueError("there was no leap to take back")
        _, state = self.best
        self.columns, self.starts, self.ends, self.best, self.leapt = [], [], [], None, False
        return State(*(array.copy() for array in state))

    def restart(self) -> None:
        """The map has changed a little (another step): keep what is known of its slope, compare no beat across."""
        self.starts, self.ends, self.best, self.leapt = [], [], None, False

    def _correction(self, change: Array) -> Array:
        if not self.columns or not np.all(np.isfinite(change)):
            return np.zeros_like(change)
        moved, left = (np.array(part).T for part in zip(*self.columns, strict=True))
        size = np.linalg.norm(left, axis=0)
        size[size == 0.0] = 1.0
        weights, *_ = np.linalg.lstsq(left / size, -change, rcond=_RANK)
        correction = (moved / size) @ weights
        # a longer one means that there is no useful linear map yet
        return correction if np.linalg.norm(correction) <= LONGEST * np.linalg.norm(change) else np.zeros_like(change)

    def _coordinates(self, state: State) -> Array:
        n = len(state.V) - 2
        R0, R = self.about.R[:n].reshape(n, 3, 3), state.R[:n].reshape(n, 3, 3)
        if not np.all(np.isfinite(R)):
            return np.full(12 * n, np.nan)
        turn = Rotation.from_matrix(np.swapaxes(R0, 1, 2) @ R).as_rotvec() * _LENGTH
        twist = state.V[:n] / self.angular_rate
        parts = [turn, state.p[:n] - self.about.p[:n], twist[:, :3] * _LENGTH, twist[:, 3:]]
        return np.concatenate(parts, axis=1).ravel()

    def _state(self, coordinates: Array, rods: State) -> State:
        """The state at ``coordinates``, the driving rods as in ``rods``."""
        n = len(rods.V) - 2
        x = coordinates.reshape(n, 12)
        found = State(*(array.copy() for array in rods))
        R0 = self.about.R[:n].reshape(n, 3, 3)
        found.R[:n] = (R0 @ Rotation.from_rotvec(x[:, :3] / _LENGTH).as_matrix()).reshape(n, 9)
        found.p[:n] = self.about.p[:n] + x[:, 3:6]
        found.V[:n, :3] = x[:, 6:9] / _LENGTH * self.angular_rate
        found.V[:n, 3:] = x[:, 9:12] * self.angular_rate
        return found
