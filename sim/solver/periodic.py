"""Anderson acceleration of the convergence to the periodic motion.

The beat maps the state x at its start to the state F(x) at its end; the periodic motion is its fixed point. Near it the
map is linear, and a lightly damped wing has only a few modes that survive a beat. Anderson's method (J. ACM 12, 1965;
Walker and Ni, SIAM J. Numer. Anal. 49, 2011) extrapolates to the combination of the past beats with the smallest change
over a beat: with as many beats as such modes, this is the fixed point.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.kernels.arrays import State
from wingfit.sim.kernels.chart import coordinates, displaced

# An extrapolation is reverted if the change over a beat becomes this many times larger. A lower factor would revert
# good ones: a mode n times as fast as the beat changes up to n times as much, depending on its phase.
WORSE = 10.0
MAX_EXTRAPOLATION = 20.0  # times the change of a beat: for modes that decay to 0.95 of their amplitude in a beat
_RANK = 1e-8  # relative to the largest singular value; smaller ones are the integrator's noise
_SIGNIFICANT = 1e-2  # relative to the largest singular value, for the estimation of multipliers


@dataclass
class Secants:
    """The latest beats of one individual, and the secants (differences of successive beats) between them.

    At most ``window`` secants are stored. The coordinates of a state are relative to the pose of the state ``about``
    and in metres (:func:`wingfit.sim.kernels.chart.coordinates`); velocities are divided by ``angular_rate`` (rad/s), 2
    pi times the flap frequency. ``starts`` and ``ends`` hold the coordinates of the latest beat, ``columns`` the
    secants: changes from one beat to the next of the end and of the change over the beat.
    """

    about: State
    angular_rate: float
    window: int
    sizes: Array  # [Z]: states of effects times these are comparable with metres
    starts: list[Array] = field(default_factory=list)
    ends: list[Array] = field(default_factory=list)
    columns: list[tuple[Array, Array]] = field(default_factory=list)
    best: tuple[float, State] | None = None  # smallest change over a beat so far, and the state at its end
    extrapolated: bool = False  # whether the latest start was extrapolated
    target: Array | None = None  # coordinates of the latest start returned by :meth:`add`

    def add(self, start: State, end: State) -> tuple[State, float]:
        """Add one beat; return the start of the next beat, and the distance (m) of ``start`` to the periodic motion.

        ``start`` and ``end``: states at the start and end of the beat. The distance is estimated by the extrapolation;
        before a second beat, or with a window of 0, it is the change over the beat; inf after an extrapolation that is
        reverted.
        """
        x = self._coordinates(start) if self.target is None else self.target
        arrived = self._coordinates(end)
        change = arrived - x
        size = float(np.linalg.norm(change))
        if self.extrapolated and self.best is not None and not size <= WORSE * self.best[0]:
            return self.step_back(), np.inf
        if self.best is None or size <= self.best[0]:
            self.best = (size, end)
        if self.starts:
            moved, changed = arrived - self.ends[-1], change - (self.ends[-1] - self.starts[-1])
            self.columns = [*self.columns, (moved, changed)][-self.window :] if self.window else []
        self.starts, self.ends = [x], [arrived]
        correction = self._correction(change)
        # a longer one means that the linear map is not useful yet: it counts as distance but is not applied
        self.extrapolated = bool(0.0 < np.linalg.norm(correction) <= MAX_EXTRAPOLATION * size)
        distance = float(np.abs(arrived + correction - x).max())
        self.target = arrived + correction if self.extrapolated else arrived
        return (self._state(self.target, end) if self.extrapolated else end), distance

    def step_back(self) -> State:
        """Revert an extrapolation that made the change over a beat larger: return the end of the best beat so far.

        All secants are removed. ValueError if the latest start was not extrapolated.
        """
        if self.best is None or not self.extrapolated:
            raise ValueError("there is no extrapolation to revert")
        _, state = self.best
        self.columns, self.starts, self.ends, self.best, self.extrapolated, self.target = [], [], [], None, False, None
        return State(*(array.copy() for array in state))

    @property
    def growth(self) -> float:
        """Factor by which a disturbance grows in a beat: magnitude of the largest Floquet multiplier.

        It is estimated from the map of a beat restricted to the span of the significant secants; 0 without any.
        """
        if not self.columns:
            return 0.0
        moved, changed = (np.array(part).T for part in zip(*self.columns, strict=True))
        before = moved - changed
        size = np.linalg.norm(before, axis=0)
        if not (np.all(np.isfinite(moved)) and np.all(size > 0)):
            return 0.0
        basis, spread, mixed = np.linalg.svd(before / size, full_matrices=False)
        used = spread > _SIGNIFICANT * spread[0]
        reduced = basis[:, used].T @ (moved / size) @ mixed[used].T / spread[used]
        return float(np.abs(np.linalg.eigvals(reduced)).max())

    def restart(self) -> None:
        """Prepare for another step size: keep the secants, but do not compare its beats with earlier ones."""
        self.starts, self.ends, self.best, self.extrapolated = [], [], None, False

    def _correction(self, change: Array) -> Array:
        """Estimate the step [12 N + Z] from the end of a beat with this ``change`` [12 N + Z] to the fixed point.

        N bodies, Z states of effects; zeros without secants.
        """
        if not self.columns or not np.all(np.isfinite(change)):
            return np.zeros_like(change)
        moved, changed = (np.array(part).T for part in zip(*self.columns, strict=True))
        size = np.linalg.norm(changed, axis=0)
        size[size == 0.0] = 1.0
        weights, *_ = np.linalg.lstsq(changed / size, -change, rcond=_RANK)
        return np.asarray((moved / size) @ weights)

    def _coordinates(self, state: State) -> Array:
        found = np.empty(12 * (len(state.V) - 2) + len(self.sizes))
        coordinates(self.about, state, self.angular_rate, self.sizes, found)
        return found

    def _state(self, x: Array, rods: State) -> State:
        """Return the state at the coordinates ``x`` [12 N + Z], with the driving rods of the state ``rods``."""
        found = State(*(array.copy() for array in rods))
        displaced(self.about, x, self.angular_rate, self.sizes, found)
        return found
