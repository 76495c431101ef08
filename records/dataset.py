"""Conditions, recordings and datasets. SI units, radians; a missing sample is NaN with ``valid`` False."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from records.wing import Wing

Rig = Literal["vacuum_chamber", "wind_tunnel"]
STANDARD_GRAVITY = 9.80665


@dataclass(frozen=True)
class Condition:
    """Setting of the rig during one recording.

    Attributes:
        flap_frequency: beats per second, Hz.
        phase_lag: lag of the rear driving rod behind the front one, rad of drive phase.
        pressure: static air pressure, Pa.
        temperature: air temperature, K.
        airspeed: speed of the airstream along +x (aft) at zero angle of attack, m/s.
        angle_of_attack: of the rig in the airstream, rad; positive turns the stream upwards.
        gravity: m/s^2, along -z.
    """

    flap_frequency: float
    phase_lag: float
    pressure: float
    temperature: float
    airspeed: float = 0.0
    angle_of_attack: float = 0.0
    gravity: float = STANDARD_GRAVITY


@dataclass(frozen=True, eq=False)
class Recording:
    """Tracks of markers under one condition.

    ``values`` has shape [T, C]: at each of the ``times`` (T, in s, increasing) the channels, three per marker in the
    order x, y, z (m, wing frame). ``standard_deviation`` [C] is the noise where the user knows it, else None.
    """

    name: str
    rig: Rig
    condition: Condition
    times: npt.NDArray[np.float64]
    markers: tuple[str, ...]
    values: npt.NDArray[np.float64]
    standard_deviation: npt.NDArray[np.float64] | None = None

    @cached_property
    def valid(self) -> npt.NDArray[np.bool_]:
        """True where a channel was recorded, [T, C]."""
        return np.isfinite(self.values)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channel names in the order of the columns of ``values``: ``<marker>_x``, ``<marker>_y``, ``<marker>_z``."""
        return tuple(f"{marker}_{axis}" for marker in self.markers for axis in "xyz")

    @property
    def positions(self) -> npt.NDArray[np.float64]:
        """``values`` as [T, M, 3]."""
        return self.values.reshape(len(self.times), len(self.markers), 3)


@dataclass(frozen=True)
class Dataset:
    """A wing with its recordings; those named in ``held_out`` are never fitted, only predicted."""

    name: str
    wing: Wing
    recordings: tuple[Recording, ...]
    held_out: tuple[str, ...] = ()
    description: str = ""

    def recording(self, name: str) -> Recording:
        """The recording called ``name``."""
        for recording in self.recordings:
            if recording.name == name:
                return recording
        raise ValueError(
            f"no recording {name!r} in dataset {self.name!r}; it has {', '.join(r.name for r in self.recordings)}"
        )

    def select(self, names: Iterable[str]) -> tuple[Recording, ...]:
        """The recordings called ``names``, in that order."""
        return tuple(self.recording(name) for name in names)

    @property
    def fitted(self) -> tuple[Recording, ...]:
        """The recordings that a calibration may fit."""
        return tuple(r for r in self.recordings if r.name not in self.held_out)
