"""Models of ``wing:`` in ``dataset.yaml`` and of the recordings of its markers."""

from __future__ import annotations

from decimal import Decimal
from typing import Annotated, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from wingfit.records.description import fields
from wingfit.records.description.fields import Strict
from wingfit.records.description.quantity import fault, limits
from wingfit.records.limits import MAX_MARKERS, MAX_RODS, MAX_STATIONS

Place = Annotated[
    Decimal, limits("[-10, 10] m", "coordinate in the wing frame (x aft, y outboard, z up)", fields.METRES)
]
Length = Annotated[Decimal, limits("(0, 10] m", "length", fields.METRES)]
Deviation = Annotated[Decimal, limits("(0, 0.1] m", "standard deviation of the noise", "give metres: 0.0005, not 0.5")]


class StationFile(Strict):
    """Section of the planform at one span position: leading edge, chord and thickness."""

    y_m: Place
    leading_edge_m: Place
    chord_m: fields.Chord
    thickness_m: fields.Thickness


class MaterialsFile(Strict):
    """Densities of the wing's body (foam, or what it is made of) and skin, which no calibration changes."""

    foam_density_kg_m3: Annotated[
        Decimal, limits("[0, 2000] kg/m^3", "density of the foam, or of what fills the thickness; 0 only without rods")
    ]
    skin_areal_density_kg_m2: Annotated[
        Decimal, limits("[0, 10] kg/m^2", "skin with its glue, both faces together", "give kg/m^2, not g/m^2")
    ]


class RodFile(Strict):
    """Carbon rod that slides in a straw glued into the foam, straight from its root to its tip."""

    name: fields.Name
    x_root_m: Place
    y_root_m: Place
    x_tip_m: Place
    y_tip_m: Place
    diameter_m: Annotated[Decimal, limits("(0, 0.05] m", "diameter", "give metres: 0.002, not 2")]
    density_kg_m3: Annotated[Decimal, limits("(0, 25000] kg/m^3", "density", "give kg/m^3: 1600, not 1.6")]
    glue_linear_density_kg_m: Annotated[
        Decimal, limits("[0, 1] kg/m", "straw with its glue", "give kg/m: 0.002, not 2 g/m")
    ]


class MarkerFile(Strict):
    """Tracked marker: its position when the wing is at rest, and its mass."""

    name: fields.Name
    x_m: Place
    y_m: Place
    z_m: Place
    mass_kg: Annotated[Decimal, limits("[0, 0.1] kg", "mass", "give kilograms: 0.0001, not 0.1 g")]


class HingeFile(Strict):
    """Axis about which the wing flaps, parallel to x through the point (y_m, z_m)."""

    y_m: Place
    z_m: Place


class FourBarFile(Strict):
    """Crank-rocker four-bar linkage that drives the rods: lengths of its links."""

    kind: Literal["four_bar"]
    ground_m: Length
    crank_m: Length
    coupler_m: Length
    rocker_m: Length
    offset_deg: Annotated[Decimal, limits("[-360, 360] deg", "added to the rocker angle", "give degrees")]

    @model_validator(mode="after")
    def _crank_turns(self) -> FourBarFile:
        others = sorted((self.ground_m, self.coupler_m, self.rocker_m))
        if self.crank_m >= others[0]:
            rule = f"it must be below the shortest of the other links, {others[0]} m, for the crank to turn fully"
            raise fault(f"crank_m is {self.crank_m} m; {rule} (Grashof): shorten it or check the links")
        longest, rest = self.crank_m + others[2], others[0] + others[1]
        if longest >= rest:
            rule = f"it must be below the sum of the other two, {rest} m, for the crank to turn fully"
            raise fault(f"shortest + longest link is {longest} m; {rule} (Grashof): check the lengths")
        return self


class WingFile(Strict):
    """The wing: planform, materials, rods, markers, hinge and drive.

    Without ``structure`` it is of foam with at least two rods. A ``sheet`` has no rods and is elastic, a ``rigid`` wing
    turns as a whole.
    """

    name: fields.Title
    structure: Literal["sheet", "rigid"] | None = Field(
        None, description="a wing without rods: an elastic sheet, or rigid; leave it out for a wing of foam and rods"
    )
    stations: list[StationFile] = Field(min_length=2, max_length=MAX_STATIONS)
    materials: MaterialsFile
    rods: list[RodFile] = Field(
        default_factory=list, max_length=MAX_RODS, description="at least 2; none with structure"
    )
    driven_rods: list[fields.Name] = Field(
        default_factory=list, max_length=2, description="front rod, rear rod; none with structure"
    )
    markers: list[MarkerFile] = Field(min_length=1, max_length=MAX_MARKERS)
    reference_markers: list[fields.Name] = Field(min_length=1, max_length=MAX_MARKERS)
    hinge: HingeFile
    drive: Annotated[fields.FourierFile | FourBarFile, Field(discriminator="kind")]
    estimates: fields.Estimates


Noise = Annotated[
    Annotated[Deviation, Tag("one")]
    | Annotated[dict[fields.Name, Annotated[list[Deviation], Field(min_length=3, max_length=3)]], Tag("each")],
    Discriminator(fields.one_or_each),
]


Correlation = Annotated[Decimal, limits("[-0.9999, 0.9999]", "correlation of the noise of two coordinates")]
LEAST_EIGENVALUE = 1e-6  # of a matrix of correlations: of less, the inverse is not accurate


_Lag = Annotated[Decimal, limits("[-180, 180] deg", "lag of the rear rod", "give degrees of drive phase")]
_Speed = Annotated[Decimal, limits("[0, 100] m/s", "speed of the airstream, aft")]
_Incidence = Annotated[Decimal, limits("[-90, 90] deg", "of the rig", "give degrees")]


class WingLimitsFile(fields.Strict):
    """Least and largest value to which the rig can be set, for recordings that are proposed; leave out what is free."""

    flap_frequency_hz: Annotated[list[fields.Frequency], fields.TWO] | None = None
    phase_lag_deg: Annotated[list[_Lag], fields.TWO] | None = None
    pressure_mbar: Annotated[list[fields.Pressure], fields.TWO] | None = None
    airspeed_m_s: Annotated[list[_Speed], fields.TWO] | None = None
    angle_of_attack_deg: Annotated[list[_Incidence], fields.TWO] | None = None


class WingRecordingFile(fields.WindowFile):
    """One recording of a wing; its tracks (positions of markers over time) are in ``recordings/<name>.csv``."""

    name: fields.Name
    rig: Literal["vacuum_chamber", "wind_tunnel"]
    flap_frequency_hz: fields.Frequency
    phase_lag_deg: _Lag
    pressure_mbar: fields.Pressure
    temperature_c: fields.Temperature
    airspeed_m_s: _Speed = Decimal(0)
    angle_of_attack_deg: _Incidence = Decimal(0)
    gravity_m_s2: Annotated[Decimal, limits("[0, 30] m/s^2", "along -z", "give a positive number")] = Decimal("9.80665")
    standard_deviation_m: Noise | None = Field(
        None, description="known noise: one number, or [x, y, z] for every marker recorded; leave out if unknown"
    )
    noise_correlation: dict[fields.Name, Annotated[list[Correlation], Field(min_length=3, max_length=3)]] | None = (
        Field(
            None,
            description="of the noise of every marker: [x with y, x with z, y with z]; needs standard_deviation_m",
        )
    )

    @model_validator(mode="after")
    def _correlations_belong_to_noise(self) -> WingRecordingFile:
        if self.noise_correlation is None:
            return self
        if self.standard_deviation_m is None:
            raise fault("noise_correlation needs standard_deviation_m: add it, or remove the correlations")
        for name, (xy, xz, yz) in self.noise_correlation.items():
            least = float(np.linalg.eigvalsh(np.array([[1, xy, xz], [xy, 1, yz], [xz, yz, 1]], float)).min())
            if least < LEAST_EIGENVALUE:
                what = f"noise_correlation of marker {name!r} is [{xy}, {xz}, {yz}], which no noise can have"
                rule = f"its least eigenvalue is {least:.2g}, and must be {LEAST_EIGENVALUE:g} or more"
                raise fault(f"{what}: {rule}; give the correlations of one covariance matrix, with more digits")
        return self


_Turn = Annotated[Decimal, limits("[0, 20] deg", "standard error of a small rotation", "give degrees: 0.2")]
_Shift = Annotated[Decimal, limits("[0, 0.1] m", "standard error of the origin", fields.METRES)]


class FrameErrorFile(fields.Strict):
    """Standard errors of the frame that all recordings of a wing share, along its x, y and z."""

    rotation_deg: Annotated[list[_Turn], Field(min_length=3, max_length=3)]
    origin_m: Annotated[list[_Shift], Field(min_length=3, max_length=3)]
