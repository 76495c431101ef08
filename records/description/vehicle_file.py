"""Models of ``vehicle:`` in ``dataset.yaml`` and of the recordings of its forces."""

from __future__ import annotations

from decimal import Decimal
from typing import Annotated, Literal

from pydantic import BeforeValidator, Discriminator, Field, StrictBool, Tag

from wingfit.records.description import fields
from wingfit.records.description.fields import Strict
from wingfit.records.description.quantity import limits
from wingfit.records.limits import MAX_STATIONS

_DEGREES = "give degrees"
RightAngle = Annotated[Decimal, limits("[-90, 90] deg", "angle", _DEGREES)]
Beats = Annotated[Decimal, limits("(0, 0.5] beats", "part of a beat", "give beats: 0.17, not 17 %")]
Mass = Annotated[Decimal, limits("(0, 100] kg", "mass", "give kilograms: 0.0174, not 17.4")]
Deviation = Annotated[Decimal, limits("(0, 100] N", "standard deviation of the noise", "give newtons: 0.005, not 5")]


class ChordFile(Strict):
    """Chord of the wing at one distance from the flapping axis."""

    r_m: Annotated[Decimal, limits("[0, 10] m", "distance from the flapping axis", fields.METRES)]
    chord_m: fields.Chord


class SplitCycleFile(Strict):
    """Flap angle of wings that open and close at different speeds (Armanini et al. 2016, Eqs. 20-21).

    The wing opens during the fraction pi / (2 pi - split_rad_per_beat) of the beat, which may be 17 % to 83 %.
    """

    kind: Literal["split_cycle"]
    amplitude_deg: Annotated[Decimal, limits("[0, 90] deg", "half the range of the flap angle", _DEGREES)]
    bias_deg: RightAngle
    split_rad_per_beat: Annotated[
        Decimal,
        limits(
            "[-12, 2.5] rad/beat",
            "delta of Eq. 20, of omega = 2 pi rad/beat",
            "opening takes pi / (2 pi - delta) of the beat, from 17 % to 83 %",
        ),
    ]
    smoothing_beats: Annotated[
        Decimal, limits("[0, 0.1] beats", "standard deviation of the rounding", "give beats: 0.01, not 1 %")
    ] = Decimal("0.01")


class PassivePitchFile(Strict):
    """Wing pitch computed from the flap angle and its rate (Armanini et al. 2016, Eq. 17 and Table 5)."""

    kind: Literal["passive"]
    constant_rad: Annotated[Decimal, limits("[-10, 10] rad", "C_theta,0", "give radians")]
    flap: Annotated[Decimal, limits("[-100, 100]", "C_theta,zeta, rad per rad")]
    flap_rate_s: Annotated[Decimal, limits("[-10, 10] s", "C_theta,zeta', rad per rad/s")]
    flap_rate_squared_s2: Annotated[Decimal, limits("[-10, 10] s^2", "C_theta,zeta'^2, rad per (rad/s)^2")]


class MotionFile(Strict):
    """Prescribed motion of the wings over a beat, which starts where the wings are closest and begin to open."""

    flap: Annotated[SplitCycleFile | fields.FourierFile, Field(discriminator="kind")]
    pitch: Annotated[PassivePitchFile | fields.FourierFile, Field(discriminator="kind")]
    pitch_station: Annotated[
        Decimal, limits("(0, 1] spans", "where the pitch holds", "give a fraction of the span")
    ] = Decimal("0.7")
    # No default: the source says "zero at the root", although its pitch is pi/2 where the chord lies along the body.
    root_pitch_deg: Annotated[
        Decimal, limits("[-180, 180] deg", "wing pitch at the flapping axis; 90: chord along the body", _DEGREES)
    ]
    peel_end_beats: Beats = Decimal("0.17")


class VehicleFile(Strict):
    """The vehicle: wings, masses and motion."""

    name: fields.Title
    layout: Literal["x4", "pair", "single"]
    claps: StrictBool = Field(description="whether the wings meet at the start of the beat")
    stations: list[ChordFile] = Field(min_length=2, max_length=MAX_STATIONS)
    wing_mass_kg: Mass
    thickness_m: fields.Thickness
    pitch_axis: Annotated[
        Decimal, limits("[0, 1] chords", "axis of wing pitch behind the leading edge", "give a fraction of the chord")
    ]
    dihedral_deg: RightAngle
    mass_kg: Mass
    motion: MotionFile
    velocities: Literal["mirrored", "printed"] = "mirrored"
    estimates: fields.Estimates


class LowPassFile(Strict):
    """The zero-phase Butterworth low-pass that was applied to the forces before they were stored in the file."""

    cutoff_hz: Annotated[Decimal, limits("(0, 1000000] Hz", "half-power frequency of one pass")]
    order: Annotated[Literal[1, 2, 3, 4, 5, 6, 7, 8], BeforeValidator(fields.whole)] = 4


class AxesFile(Strict):
    """Standard deviation of the noise: one number for each force axis recorded."""

    x: Deviation | None = None
    z: Deviation | None = None


Noise = Annotated[
    Annotated[Deviation, Tag("one")] | Annotated[AxesFile, Tag("each")], Discriminator(fields.one_or_each)
]


_Pitch = Annotated[Decimal, limits("[-90, 90] deg", "nose up from level", _DEGREES)]
_Speed = Annotated[Decimal, limits("[0, 100] m/s", "level speed through the air")]


class VehicleLimitsFile(fields.Strict):
    """Least and largest value to which the rig can be set, for recordings that are proposed; leave out what is free."""

    flap_frequency_hz: Annotated[list[fields.Frequency], fields.TWO] | None = None
    body_pitch_deg: Annotated[list[_Pitch], fields.TWO] | None = None
    pressure_mbar: Annotated[list[fields.Pressure], fields.TWO] | None = None
    airspeed_m_s: Annotated[list[_Speed], fields.TWO] | None = None


class VehicleRecordingFile(fields.WindowFile):
    """One recording of a vehicle; its forces are in ``recordings/<name>.csv``."""

    name: fields.Name
    rig: Literal["wind_tunnel", "free_flight", "vacuum_chamber"]
    flap_frequency_hz: fields.Frequency
    body_pitch_deg: _Pitch
    pressure_mbar: fields.Pressure
    temperature_c: fields.Temperature
    airspeed_m_s: _Speed = Decimal(0)
    gravity_m_s2: Annotated[Decimal, limits("[0, 30] m/s^2", "downwards", "give a positive number")] = Decimal(
        "9.80665"
    )
    low_pass: LowPassFile | None = Field(None, description="the filter the values have been through; leave out if raw")
    motion: MotionFile | None = Field(None, description="the wings' motion as measured in this recording")
    mass_kg: Mass | None = Field(None, description="the vehicle's mass in this recording, where it differs")
    standard_deviation_n: Noise | None = Field(
        None, description="known noise: one number, or {x: ..., z: ...} for the axes recorded; leave out if unknown"
    )
