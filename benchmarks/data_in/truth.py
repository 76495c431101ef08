"""Tracks that are known: a flapping wing's markers in mm, rounded as capture programs print them, with gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """Names [M], frames per second, positions [T, M, 3] in mm, NaN in gaps."""

    names: tuple[str, ...]
    rate: float
    mm: Array

    @property
    def frames(self) -> int:
        """Return the count of frames."""
        return len(self.mm)


def flapping(seed: int = 0, frames: int = 60, rate: float = 240.0, step_mm: float = 0.001, gaps: bool = True) -> Truth:
    """Return four markers on a wing that flaps; positions are multiples of ``step_mm``."""
    random = np.random.default_rng(seed)
    names = ("root", "mid_1", "tip-2", "trailing.edge")
    rest = np.array([[5.0, 40.0, 3.0], [12.0, 160.0, 5.0], [18.0, 290.0, 8.0], [85.0, 150.0, 2.0]])
    angle = 0.6 * np.sin(2 * np.pi * 12.5 * np.arange(frames) / rate)[:, None]
    y, z = rest[:, 1], rest[:, 2]
    turned = np.stack(
        [rest[:, 0] + 0 * angle, y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)], axis=-1
    )
    mm = np.round((turned + random.normal(0, 0.05, turned.shape)) / step_mm) * step_mm
    if gaps:
        mm[random.random(mm.shape[:2]) < 0.1] = np.nan
        mm[0] = np.where(np.isnan(mm[0]), 1.0, mm[0])
    return Truth(names, rate, mm)
