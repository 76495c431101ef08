"""Light of a scene: a strobe, a continuous light, or both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array


@dataclass(frozen=True)
class Strobe:
    """Periodic flashes that no camera controls.

    Attributes:
        frequency: flashes per second.
        first: true time at which flash 0 starts, s.
        duration: of a flash, s.
        brightness: grey levels that one whole flash gives a reflecting point at 1 m that faces the camera.
        flashes: number of flashes; None: without end.
    """

    frequency: float
    first: float = 0.0
    duration: float = 5e-4
    brightness: float = 200.0
    flashes: int | None = None

    def starts(self, first: float, last: float) -> Array:
        """Times at which the flashes start that shine at any time from ``first`` to ``last``, s."""
        low = max(0, int(np.floor((first - self.duration - self.first) * self.frequency)) + 1)
        high = int(np.ceil((last - self.first) * self.frequency))
        high = high if self.flashes is None else min(high, self.flashes)
        return np.asarray(self.first + np.arange(low, max(low, high)) / self.frequency)


@dataclass(frozen=True)
class Light:
    """The light of a scene.

    Attributes:
        strobe: flashes, or None.
        continuous: grey levels that a reflecting point at 1 m that faces the camera gains per second of exposure.
    """

    strobe: Strobe | None = None
    continuous: float = 0.0

    def intervals(self, first: float, last: float) -> list[tuple[float, float, float]]:
        """Start, end (s) and strength (grey levels per second) of the light between ``first`` and ``last``."""
        found = [(first, last, self.continuous)] if self.continuous > 0 else []
        if self.strobe:
            rate = self.strobe.brightness / self.strobe.duration
            starts = self.strobe.starts(first, last).tolist()
            found.extend((max(first, start), min(last, start + self.strobe.duration), rate) for start in starts)
        return found
