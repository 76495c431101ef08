"""What is known of the frames of a fit: weights for means over the beat, slow motion and errors of the body."""

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

    def covariance(self, turn: Array, hinge: Array) -> Array:
        """Return the covariance [5, 5] of rotations about y and z of the wing (rad) and shifts of its hinge, m.

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
        return np.asarray(self.memory * covariance)


STEADY = PoseError(np.zeros((3, 3)), 0.0, np.zeros(3))
"""Of a body that rests."""


@dataclass(frozen=True, eq=False)
class Frames:
    """What is known of the T frames of a fit.

    Attributes:
        mean: [T] weights whose sum with a state is its mean over the beat.
        slow: [T, D] polynomials over time, without a constant, of which the body's motion that is left is made.
        shaking: errors of the body's pose, in every frame anew.
    """

    mean: Array
    slow: Array
    shaking: PoseError


def polynomials(times: Array, order: int) -> Array:
    """Return the Legendre polynomials of order 1 to ``order`` [T, order] over ``times`` [T], s."""
    s = 2 * (times - times[0]) / (times[-1] - times[0]) - 1
    return np.asarray(np.polynomial.legendre.legvander(s, order)[:, 1:])
