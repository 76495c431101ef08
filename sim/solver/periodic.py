"""Finding the periodic motion sooner than by waiting for transients to die.

The beat maps the state x at its start to the state F(x) at its end; the periodic motion is its fixed point. Near it the
map is linear, and a lightly damped wing has only a few modes that survive a beat. From the beats so far, Anderson's
method (J. ACM 12, 1965; Walker and Ni, SIAM J. Numer. Anal. 49, 2011) takes the combination whose change over a beat is
smallest: with as many beats as surviving modes, the fixed point itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.kernels.arrays import State
from wingfit.sim.kernels.chart import coordinates, displaced

# A leap after which a beat changes this many times as much as before is taken back. Not less: a mode n times as fast as
# the beat changes by up to n times as much where it is caught moving as where it is caught bent.
WORSE = 10.0
LONGEST = 20.0  # admits leaps along modes that keep up to 0.95 of their amplitude over a beat
_RANK = 1e-8  # of the largest singular value: less is the integrator's noise

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
        found = np.empty(12 * (len(state.V) - 2) + len(self.sizes))
        coordinates(self.about, state, self.angular_rate, self.sizes, found)
        return found

    def _state(self, x: Array, rods: State) -> State:
        """The state at the coordinates ``x``, the driving rods as in ``rods``."""
        found = State(*(array.copy() for array in rods))
        displaced(self.about, x, self.angular_rate, self.sizes, found)
        return found
