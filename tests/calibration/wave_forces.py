"""Recordings of forces that are known waves."""

from __future__ import annotations

import numpy as np

from wingfit.records import Condition, Recording

Array = np.typing.NDArray[np.float64]

F, RATE, PITCH = 12.5, 1000.0, 0.9
CONDITION = Condition(F, 0.0, 101_325.0, 293.15, airspeed=0.5, angle_of_attack=PITCH)


def recording(values: Array, start: float = 0.0) -> Recording:
    times = start + np.arange(len(values)) / RATE
    axes = ("x", "z")[: values.shape[1]]
    return Recording("r", "wind_tunnel", CONDITION, times, (), values, forces=axes)  # type: ignore[arg-type]


def waves(beats: int = 10, noise: float = 0.0, start: float = 0.0) -> Recording:
    """X = 0.2 + 0.1 cos, Z = -0.05 + 0.03 sin of twice the phase."""
    t = start + np.arange(round(beats * RATE / F)) / RATE
    psi = 2 * np.pi * F * t
    values = np.stack([0.2 + 0.1 * np.cos(psi), -0.05 + 0.03 * np.sin(2 * psi)], axis=1)
    return recording(values + noise * np.random.default_rng(0).standard_normal(values.shape), start)
