"""Stated errors of the frame of the tracks, as changes of the coefficients of every residual.

The tracks of a wing are stated in a frame that was itself measured. A frame that is turned by a small angle e about an
axis a and shifted by s changes a position X by e a x X + s, at every instant alike: linear in the six errors, whose
standard deviations are stated with the dataset. The changes are computed from the recorded positions.
"""

from __future__ import annotations

import numpy as np

from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.inference.noise.harmonic import HarmonicFit
from wingfit.records import FrameError
from wingfit.records.array_types import Array, Float

_ERRORS = 6  # three rotations, three shifts


def deviations(frame: FrameError) -> Float[Array, " 6"]:
    """Return the standard errors [6] of ``frame``: rotations about x, y, z (rad), shifts along them (m)."""
    return np.array([*frame.rotation, *frame.origin])


def changes_by_frame(data: WhitenedData) -> Float[Array, "D 6"]:
    """Return the changes of the coefficients [D] by rotations of 1 rad about x, y, z, and shifts of 1 m along them."""
    return np.concatenate([_changes(one)[one.used].reshape(-1, _ERRORS) for one in data.beat_fits])


def moved_by_frame(fit: HarmonicFit, psi: Float[Array, " T"], errors: Float[Array, " 6"]) -> Float[Array, "T C"]:
    """Return the displacements [T, C] (m) at phases ``psi`` [T] (rad) by ``errors`` [6] of the frame (rad, m)."""
    return np.asarray(fit.waves(psi) @ (_changes(fit) @ errors).T)


def _changes(fit: HarmonicFit) -> Float[Array, "C P 6"]:
    """Return the changes of the coefficients of one recording; zero for channels that are not used."""
    motion = np.where(fit.used[:, None], fit.coefficients, 0.0).reshape(-1, 3, len(fit.order))
    found = np.zeros((len(motion), 3, len(fit.order), _ERRORS))
    for k, axis in enumerate(np.eye(3)):
        found[..., k] = np.cross(axis, motion, axisb=1, axisc=1)
        found[:, k, (fit.order == 0) & ~fit.trend, 3 + k] = 1.0
    flat = found.reshape(len(fit.coefficients), len(fit.order), _ERRORS)
    return np.asarray(np.where(fit.used[:, None, None], flat, 0.0))
