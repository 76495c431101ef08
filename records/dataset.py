"""Conditions, recordings and datasets, in SI units and radians; a missing sample is NaN."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.records.camera_pose import CameraPose
from wingfit.records.mistake_kinds import MistakeKind
from wingfit.records.name_lists import refuse_text
from wingfit.records.recorded import Recorded
from wingfit.records.series import Series, SeriesDataset
from wingfit.records.vehicle import Vehicle, WingMotion
from wingfit.records.wing import Wing

Rig = Literal["vacuum_chamber", "wind_tunnel", "free_flight"]
ForceAxis = Literal["x", "z"]
Kind = Literal["tracks", "forces"]
AnyKind = Literal["tracks", "forces", "series"]
STANDARD_GRAVITY = 9.80665


@dataclass(frozen=True)
class Condition:
    """What was set for one recording of a rig (the measured wing or vehicle with its drive).

    Attributes:
        flap_frequency: beats per second, Hz.
        phase_lag: lag of the rear driving rod behind the front one, rad of drive phase.
        pressure: static air pressure, Pa.
        temperature: air temperature, K.
        airspeed: speed of the airstream along +x (aft) at zero angle of attack, m/s.
        angle_of_attack: of the rig in the airstream, rad; positive turns the stream upwards. Of a vehicle in level
            flight it is the body pitch theta_b (Armanini et al. 2016, Eq. 16).
        gravity: gravitational acceleration, m/s^2, downwards.
    """

    flap_frequency: float
    phase_lag: float
    pressure: float
    temperature: float
    airspeed: float = 0.0
    angle_of_attack: float = 0.0
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self) -> None:
        for one in fields(self):  # whole numbers would make arrays of whole numbers
            object.__setattr__(self, one.name, float(getattr(self, one.name)))


@dataclass(frozen=True)
class LowPass:
    """Zero-phase low-pass: a Butterworth filter run forwards and backwards.

    ``cutoff`` is the half-power frequency (Hz) of one pass, ``order`` the order of the filter of one pass.
    """

    cutoff: float
    order: int = 4


@dataclass(frozen=True, eq=False)
class Recording:
    """Measurements under one condition: tracks (positions over time) of markers, or forces of a vehicle.

    ``values`` [T, C] are C channels at the T increasing ``times`` (s): three per marker in the order x, y, z (m, wing
    frame), or one per axis in ``forces`` (N, body axes, force of the wings on the body). ``markers`` names the markers,
    none for forces. ``standard_deviation`` [C] is that of the noise, None if unknown; ``noise_correlation`` [M, 3] is
    that of each marker's noise along x and y, x and z, y and z, None if not stated. Times of forces count from the
    start of a beat. ``low_pass`` is the filter that was applied to the values; a model applies the same filter.
    ``motion`` of the wings and ``mass`` (kg), if given, replace those of the vehicle's description in this recording.
    """

    name: str
    rig: Rig
    condition: Condition
    times: Float[Array, " T"]
    markers: tuple[str, ...]
    values: Float[Array, "T C"]
    standard_deviation: Float[Array, " C"] | None = None
    forces: tuple[ForceAxis, ...] = ()
    low_pass: LowPass | None = None
    motion: WingMotion | None = None
    mass: float | None = None
    noise_correlation: Float[Array, "M 3"] | None = None

    @cached_property
    def valid(self) -> Bool[Mask, "T C"]:
        """True [T, C] where a value was recorded, False where it is missing (NaN)."""
        return np.isfinite(self.values)

    @property
    def kind(self) -> Kind:
        """Return "forces" or "tracks", which the recording holds."""
        return "forces" if self.forces else "tracks"

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the columns of ``values``: MARKER_x, MARKER_y, MARKER_z of each marker, or force_x, force_z."""
        tracks = tuple(f"{marker}_{axis}" for marker in self.markers for axis in "xyz")
        return tracks + tuple(f"force_{axis}" for axis in self.forces)

    @property
    def positions(self) -> Float[Array, "T M 3"]:
        """Return the ``values`` of a recording of tracks as positions [T, M, 3] in m: M markers, axes x, y, z."""
        return self.values.reshape(len(self.times), len(self.markers), 3)


@dataclass(frozen=True)
class FrameError:
    """Standard errors of the frame in which all recordings of a wing are stated, as an alignment gives them.

    Attributes:
        rotation: of small rotations about x, y and z of the wing, rad.
        origin: of the origin along x, y and z, m.
    """

    rotation: tuple[float, float, float]
    origin: tuple[float, float, float]


@dataclass(frozen=True)
class RigLimits:
    """What a rig allows: least and largest value of each setting of a condition, in its unit; None: not stated."""

    flap_frequency: tuple[float, float] | None = None
    phase_lag: tuple[float, float] | None = None
    pressure: tuple[float, float] | None = None
    airspeed: tuple[float, float] | None = None
    angle_of_attack: tuple[float, float] | None = None

    def allow(self, condition: Condition) -> bool:
        """Return whether the rig can be set to ``condition``, as far as its limits are stated."""
        for one in fields(self):
            stated, value = getattr(self, one.name), getattr(condition, one.name)
            room = 1e-9 * max(abs(value), 1.0)
            if stated is not None and not stated[0] - room <= value <= stated[1] + room:
                return False
        return True


@dataclass(frozen=True)
class Dataset(Recorded[Recording]):
    """A wing with recordings of tracks, or a vehicle with recordings of forces; ``rig`` describes the wing or vehicle.

    Recordings named in ``held_out`` are used for validation only, never for fitting. ``frame_error``: of the frame of
    the tracks, which all recordings share; None if unknown, and for a vehicle. ``cameras``: which filmed all recordings
    of a wing, in the frame of the tracks; empty if unknown. ``rig_limits``: conditions that can be recorded; None if
    they are not stated. ``verified``: kinds of likely mistakes that were verified to be none: no check warns of them.
    """

    name: str
    rig: Wing | Vehicle
    recordings: tuple[Recording, ...]
    held_out: tuple[str, ...] = ()
    description: str = ""
    frame_error: FrameError | None = None
    cameras: tuple[CameraPose, ...] = ()
    rig_limits: RigLimits | None = None
    verified: tuple[MistakeKind, ...] = ()

    def __post_init__(self) -> None:
        refuse_text(self, "held_out", "verified")
        known = get_args(MistakeKind)
        if unknown := [kind for kind in self.verified if kind not in known]:
            raise ValueError(
                f"verified has {unknown[0]!r}, which is no kind of mistake; the kinds are {', '.join(known)}"
            )

    @property
    def kind(self) -> Kind:
        """Return "tracks" or "forces", which all recordings hold."""
        return "tracks" if isinstance(self.rig, Wing) else "forces"

    @property
    def wing(self) -> Wing:
        """Return the wing that was recorded; ValueError if the dataset is one of a vehicle."""
        if not isinstance(self.rig, Wing):
            raise ValueError(f"dataset {self.name!r} describes a vehicle with forces; this needs a wing with tracks")
        return self.rig

    @property
    def vehicle(self) -> Vehicle:
        """Return the vehicle that was recorded; ValueError if the dataset is one of a wing."""
        if not isinstance(self.rig, Vehicle):
            raise ValueError(f"dataset {self.name!r} describes a wing with tracks; this needs a vehicle with forces")
        return self.rig


AnyRecording = Recording | Series
"""A recording of a wing, of a vehicle, or of any other rig."""

AnyDataset = Dataset | SeriesDataset
"""Recordings of a wing, of a vehicle, or of any other rig."""


def wing_or_vehicle(dataset: AnyDataset) -> Dataset:
    """Return ``dataset`` if it describes a wing or a vehicle; ValueError if it is a series of any other rig."""
    if isinstance(dataset, SeriesDataset):
        raise ValueError(f"dataset {dataset.name!r} is a series of rig {dataset.rig!r}; this needs a wing or a vehicle")
    return dataset
