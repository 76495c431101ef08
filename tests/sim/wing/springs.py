"""One connector between two bodies, driven through the compiled kernels in lane 0."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.connectors import connect, relative_pose

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pair:
    """Poses (rotation vector, position) and twists of two bodies, arms of the connector, stiffness and damping.

    ``coupling`` [3, 3] couples rotation with translation.
    """

    turn: Array
    place: Array
    twist: Array
    a: Array
    b: Array
    K: Array
    D: Array
    coupling: Array | None = None

    def moved(self, body: int, axis: int, by: float) -> Pair:
        """The pair with one body displaced along one of its own six axes (rotation x, y, z, then translation)."""
        turn, place = self.turn.copy(), self.place.copy()
        rotation = Rotation.from_rotvec(turn[body])
        step = np.zeros(3)
        step[axis % 3] = by
        if axis < 3:
            turn[body] = (rotation * Rotation.from_rotvec(step)).as_rotvec()
        else:
            place[body] = place[body] + rotation.apply(step)
        return replace(self, turn=turn, place=place)


def lanes(x: Array) -> Array:
    return np.ascontiguousarray(np.repeat(np.asarray(x, float)[..., None], LANES, axis=-1))


def load(pair: Pair) -> tuple[Array, float, float]:
    """Wrenches [2, 6] on both bodies in their own frames, power lost in the damper, energy in the spring."""
    first, second = np.array([0]), np.array([1])
    R = lanes(np.array([Rotation.from_rotvec(t).as_matrix().ravel() for t in pair.turn]))
    p, V = lanes(pair.place), lanes(pair.twist)
    Q, d = np.zeros((1, 9, LANES)), np.zeros((1, 3, LANES))
    a, b = pair.a[None], pair.b[None]
    relative_pose(first, second, a, b, R, p, Q, d)
    wrench, lost, stored = np.zeros((2, 6, LANES)), np.zeros(LANES), np.zeros(LANES)
    coupling = np.zeros((0, 9, LANES)) if pair.coupling is None else lanes(pair.coupling.reshape(1, 9))
    K, D, more = lanes(pair.K[None]), lanes(pair.D[None]), np.zeros((0, 6, LANES))
    connect(first, second, a, b, K, D, coupling, more, Q, d, V, wrench, lost, stored)
    return wrench[..., 0], float(lost[0]), float(stored[0])
