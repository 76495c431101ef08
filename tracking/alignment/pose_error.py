"""Errors of the body's pose in each frame, and the motion of the wing's hinge that they seem to be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array

_STEADY = 1e-7  # standard deviation of jitter (rad, m) where there is none


@dataclass(frozen=True, eq=False)
class PoseError:
    """Errors of the pose of a body, as of noisy markers on it.

    Attributes:
        rotation: [3, 3] covariance of the rotation about ``middle``, in the axes of the tracks, rad^2.
        position: standard deviation of each coordinate of ``middle``, m.
        middle: [3] mean of the body's markers, m.
        memory: number of consecutive frames whose errors count as one.
    """

    rotation: Array
    position: float
    middle: Array
    memory: float = 1.0

    def precision(self, turn: Array, hinge: Array) -> Array:
        """Return the inverse covariance [5, 5] of rotations about y and z of the wing (rad) and shifts of its hinge, m.

        ``turn`` [3, 3]: to the wing's axes; ``hinge`` [3]: its position, m. A rotation about x is a flap angle.
        """
        x, y, z = hinge - self.middle
        by_rotation = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # w cross (hinge - middle)
        to_pose = np.zeros((5, 6))
        to_pose[:2, :3] = np.linalg.det(turn) * turn[1:]  # axial: a mirror reverses it
        to_pose[2:, :3], to_pose[2:, 3:] = turn @ by_rotation, turn
        errors = np.zeros((6, 6))
        errors[:3, :3], errors[3:, 3:] = self.rotation, self.position**2 * np.eye(3)
        covariance = to_pose @ errors @ to_pose.T + _STEADY**2 * np.eye(5)
        return np.asarray(np.linalg.inv(covariance) / self.memory)


STEADY = PoseError(np.zeros((3, 3)), 0.0, np.zeros(3))
"""Of a body that rests."""
