"""Wing motions with known derivatives, noise with known correlation, and markers on moving wings."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def split_cycle(phase: Array, frequency: float, amplitude: float = 0.34, split: float = 0.35) -> list[Array]:
    """Flap angle of Armanini et al. (2016), Eqs. 20-21, its rate and its acceleration."""
    omega = 2 * np.pi
    opening = phase % 1.0 < np.pi / (omega - split)
    rate = np.where(opening, omega - split, omega + split * omega / (omega - 2 * split))
    angle = rate * (phase % 1.0) - np.where(opening, 0.0, omega * split / (omega - 2 * split) * 2 * np.pi / omega)
    value = amplitude * (1 - np.cos(angle))
    return [
        value,
        amplitude * rate * frequency * np.sin(angle),
        amplitude * (rate * frequency) ** 2 * np.cos(angle),
    ]


def noise(rng: np.random.Generator, shape: tuple[int, ...], white: float, coloured: float, decay: float) -> Array:
    """White noise plus noise whose correlation falls by ``decay`` per sample, along the first axis."""
    drawn = rng.standard_normal(shape)
    for i in range(1, shape[0]):
        drawn[i] = decay * drawn[i - 1] + np.sqrt(1 - decay**2) * drawn[i]
    return np.asarray(white * rng.standard_normal(shape) + coloured * drawn)


def passive_pitch(zeta: Array, rate: Array) -> Array:
    """Eq. 17 with Table 5."""
    return np.pi / 2 + 0.3139 - 1.1382 * zeta - 0.0179 * rate - 0.0002 * rate**2


def wing_markers(zeta: Array, pitch: Array, upper: bool, right: bool, dihedral: float) -> tuple[Array, Array]:
    """Three markers on the leading edge [T, 3, 3] and two along the chord [T, 2, 3], in body axes, m.

    Computed from rotations of a wing that lies flat, not from the formulas under test.
    """
    turn = dihedral + zeta if upper else dihedral - zeta  # up from the horizontal
    side, opening = (1.0 if right else -1.0), (1.0 if upper else -1.0)
    edge, chord = np.zeros((len(zeta), 3, 3)), np.zeros((len(zeta), 2, 3))
    for t, (up, theta) in enumerate(zip(turn, pitch, strict=True)):
        roll = np.array([[1, 0, 0], [0, np.cos(up), side * np.sin(up)], [0, -side * np.sin(up), np.cos(up)]])
        # Flat wing: the span along +-y, opening towards -z for an upper wing; leading edge forward at theta = 90 deg.
        forward = np.array([np.sin(theta), 0.0, -opening * np.cos(theta)])
        hinge, span = np.array([0.02, side * 0.01, 0.005]), np.array([0.0, side, 0.0])
        station = 0.7 * 0.137 * span
        edge[t] = [hinge + roll @ (r * span) for r in (0.05, 0.09, 0.13)]
        chord[t] = [hinge + roll @ (station - back * forward) for back in (0.0, 0.07)]
    return edge, chord
