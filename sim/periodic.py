"""Finding the periodic motion sooner than by waiting for transients to die.

The beat maps the state at its start to the state at its end; near the periodic motion that map is linear, and a lightly
damped wing has only a few modes that survive a beat. Reduced-rank extrapolation (Eddy 1979, Mesina 1977; Sidi, *Vector
Extrapolation Methods*, 2017, ch. 2) combines the states after successive beats, with weights that sum to one, so that
their combined change over a beat is smallest: with as many beats as surviving modes, the fixed point itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from sim.kernels.integrate import State

Array = npt.NDArray[np.float64]

# Scales that make rotations (rad) and rates comparable with displacements (m): a chord, and the beat's angular rate.
_LENGTH = 0.1
LONGEST = 10.0  # admits modes that keep up to about 0.9 of their amplitude over a beat


def extrapolate(states: Sequence[State], lanes: npt.ArrayLike, angular_rate: float, into: State) -> None:
    """Replace the lanes of ``into`` by the extrapolated state; ``states`` are those after successive beats.

    At least three states are needed; all lanes are treated on their own. A lane whose extrapolation would move the wing
    LONGEST times as far as the first of the beats did has no useful linear map yet, and is left alone.
    """
    for lane in np.flatnonzero(np.asarray(lanes)):
        x = np.stack([_coordinates(s, into, int(lane), angular_rate) for s in states])
        change = np.diff(x, axis=0)
        if not np.all(np.isfinite(change)):
            continue
        c, *_ = np.linalg.lstsq(np.diff(change, axis=0).T, -change[-1], rcond=1e-10)
        correction = change[1:].T @ c
        if np.linalg.norm(correction) > LONGEST * np.linalg.norm(change[0]):
            continue
        _apply(correction, into, int(lane), angular_rate)


def _coordinates(state: State, about: State, lane: int, angular_rate: float) -> Array:
    """State of one lane as a vector, in local coordinates about the pose of another."""
    n = len(state.V) - 2
    R0 = about.R[:n, :, lane].reshape(n, 3, 3)
    R = state.R[:n, :, lane].reshape(n, 3, 3)
    turn = Rotation.from_matrix(np.swapaxes(R0, 1, 2) @ R).as_rotvec() * _LENGTH
    shift = np.einsum("nji,nj->ni", R0, state.p[:n, :, lane] - about.p[:n, :, lane])
    twist = state.V[:n, :, lane] / angular_rate
    twist = np.concatenate([twist[:, :3] * _LENGTH, twist[:, 3:]], axis=1)
    return np.concatenate([turn, shift, twist], axis=1).ravel()


def _apply(correction: Array, state: State, lane: int, angular_rate: float) -> None:
    n = len(state.V) - 2
    x = correction.reshape(n, 12)
    R0 = state.R[:n, :, lane].reshape(n, 3, 3)
    state.p[:n, :, lane] += np.einsum("nij,nj->ni", R0, x[:, 3:6])
    state.R[:n, :, lane] = (R0 @ Rotation.from_rotvec(x[:, :3] / _LENGTH).as_matrix()).reshape(n, 9)
    state.V[:n, :3, lane] += x[:, 6:9] / _LENGTH * angular_rate
    state.V[:n, 3:, lane] += x[:, 9:12] * angular_rate
