"""The layout of ``dataset.yaml``: pydantic models, in the units that people write, with physical limits.

Only shape and single values are checked here; what needs several values (references between names, markers on
the planform) is in ``records.consistency``. The published JSON Schema is generated from these models.
"""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from records.limits import (
    MAX_ESTIMATES,
    MAX_HARMONICS,
    MAX_MARKERS,
    MAX_RECORDINGS,
    MAX_RODS,
    MAX_STATIONS,
)
from records.quantity import Text, fault, limits

_METRES = "give metres: 0.22, not 220 or 22"
_PLACE = limits("-10", "10", "m", "coordinate in the wing frame (x aft, y outboard, z up)", _METRES)
_ANGLE = limits("-180", "180", "deg", "angle", "give degrees")
_LENGTH = limits("0", "10", "m", "length", _METRES, above=True)

Name = Annotated[
    str,
    Text(
        "[A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9_-])?",
        100,
        "name",
        "a name has letters, digits, '.', '_', '-'; it starts with a letter or digit, ends without '.'",
    ),
]
GeneName = Annotated[
    str,
    Text("[A-Za-z][A-Za-z0-9_]*", 100, "gene name", "a gene name starts with a letter: letters, digits and '_'"),
]
_UNPRINTABLE = r"\x00-\x1f\x7f-\x9f\ud800-\udfff\ufeff\ufffe\uffff"
Title = Annotated[
    str,
    Text(
        rf"[^{_UNPRINTABLE}]+",
        200,
        "title",
        "a title is one line of printable text, not empty",
        portable=False,
    ),
]
Prose = Annotated[
    str,
    Text(
        rf"(?:[^{_UNPRINTABLE}]|[\t\n])*",
        20_000,
        "free text",
        "it must be printable text without control characters",
        portable=False,
    ),
]
Place = Annotated[Decimal, _PLACE]
Angle = Annotated[Decimal, _ANGLE]
Length = Annotated[Decimal, _LENGTH]
Deviation = Annotated[
    Decimal,
    limits("0", "0.1", "m", "standard deviation of the noise", "give metres: 0.0005, not 0.5", above=True),
]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class StationFile(_Strict):
    """Section of the planform."""

    y_m: Place
    leading_edge_m: Place
    chord_m: Annotated[Decimal, limits("0.0001", "5", "m", "chord", _METRES)]
    thickness_m: Annotated[Decimal, limits("0", "0.5", "m", "thickness", "give metres: 0.012, not 12", above=True)]


class MaterialsFile(_Strict):
    """Masses that are no genes."""

    foam_density_kg_m3: Annotated[Decimal, limits("0", "2000", "kg/m^3", "density of the foam", above=True)]
    skin_areal_density_kg_m2: Annotated[
        Decimal,
        limits("0", "10", "kg/m^2", "skin with its glue, both faces together", "give kg/m^2, not g/m^2"),
    ]


class RodFile(_Strict):
    """Carbon rod in its straw."""

    name: Name
    x_root_m: Place
    y_root_m: Place
    x_tip_m: Place
    y_tip_m: Place
    diameter_m: Annotated[Decimal, limits("0", "0.05", "m", "diameter", "give metres: 0.002, not 2", above=True)]
    density_kg_m3: Annotated[
        Decimal, limits("0", "25000", "kg/m^3", "density", "give kg/m^3: 1600, not 1.6", above=True)
    ]
    glue_linear_density_kg_m: Annotated[
        Decimal, limits("0", "1", "kg/m", "straw with its glue", "give kg/m: 0.002, not 2 g/m")
    ]


class MarkerFile(_Strict):
    """Tracked marker at rest."""

    name: Name
    x_m: Place
    y_m: Place
    z_m: Place
    mass_kg: Annotated[Decimal, limits("0", "0.1", "kg", "mass", "give kilograms: 0.0001, not 0.1 g")]


class HingeFile(_Strict):
    """Axis of flapping, parallel to x."""

    y_m: Place
    z_m: Place


class FourierFile(_Strict):
    """Flap angle as a Fourier series of the drive phase; entry k belongs to the k-th harmonic."""

    kind: Literal["fourier"]
    mean_deg: Angle
    cosine_deg: list[Angle] = Field(min_length=1, max_length=MAX_HARMONICS)
    sine_deg: list[Angle] = Field(min_length=1, max_length=MAX_HARMONICS)

    @model_validator(mode="after")
    def _paired(self) -> FourierFile:
        cosines, sines = len(self.cosine_deg), len(self.sine_deg)
        if cosines != sines:
            raise fault(f"cosine_deg has {cosines} entries and sine_deg {sines}; give as many of each: fill up with 0")
        return self


class FourBarFile(_Strict):
    """Crank-rocker linkage that drives the rods."""

    kind: Literal["four_bar"]
    ground_m: Length
    crank_m: Length
    coupler_m: Length
    rocker_m: Length
    offset_deg: Annotated[Decimal, limits("-360", "360", "deg", "added to the rocker angle", "give degrees")]

    @model_validator(mode="after")
    def _crank_turns(self) -> FourBarFile:
        others = sorted((self.ground_m, self.coupler_m, self.rocker_m))
        if self.crank_m >= others[0]:
            raise fault(
                f"crank_m is {self.crank_m} m; it must be below the shortest of the other links, "
                f"{others[0]} m, for the crank to turn fully (Grashof): shorten it or check the links"
            )
        longest, rest = self.crank_m + others[2], others[0] + others[1]
        if longest >= rest:
            raise fault(
                f"shortest + longest link is {longest} m; it must be below the sum of the other two, "
                f"{rest} m, for the crank to turn fully (Grashof): check the lengths"
            )
        return self


class WingFile(_Strict):
    """The wing as built."""

    name: Title
    stations: list[StationFile] = Field(min_length=2, max_length=MAX_STATIONS)
    materials: MaterialsFile
    rods: list[RodFile] = Field(min_length=2, max_length=MAX_RODS)
    driven_rods: list[Name] = Field(min_length=2, max_length=2, description="front rod, rear rod")
    markers: list[MarkerFile] = Field(min_length=1, max_length=MAX_MARKERS)
    reference_markers: list[Name] = Field(min_length=1, max_length=MAX_MARKERS)
    hinge: HingeFile
    drive: Annotated[FourierFile | FourBarFile, Field(discriminator="kind")]
    estimates: dict[GeneName, Annotated[Decimal, limits("-1e300", "1e300", "", "estimate of a gene, SI units")]] = (
        Field(default_factory=dict, max_length=MAX_ESTIMATES)
    )


def _noise_kind(value: Any) -> str:
    return "per_marker" if isinstance(value, Mapping) else "one"


Noise = Annotated[
    Annotated[Deviation, Tag("one")]
    | Annotated[dict[Name, Annotated[list[Deviation], Field(min_length=3, max_length=3)]], Tag("per_marker")],
    Discriminator(_noise_kind),
]


class RecordingFile(_Strict):
    """One recording; its tracks are in ``recordings/<name>.csv``."""

    name: Name
    rig: Literal["vacuum_chamber", "wind_tunnel"]
    flap_frequency_hz: Annotated[Decimal, limits("0.01", "1000", "Hz", "beats per second")]
    phase_lag_deg: Annotated[
        Decimal, limits("-180", "180", "deg", "lag of the rear rod", "give degrees of drive phase")
    ]
    pressure_mbar: Annotated[
        Decimal,
        limits("0", "20000", "mbar", "static pressure", "give mbar (1 mbar = 100 Pa): 1013.25, not 101325"),
    ]
    temperature_c: Annotated[
        Decimal, limits("-100", "100", "°C", "air temperature", "give degrees Celsius: 20, not 293.15")
    ]
    airspeed_m_s: Annotated[Decimal, limits("0", "100", "m/s", "speed of the airstream, aft")] = Decimal(0)
    angle_of_attack_deg: Annotated[Decimal, limits("-90", "90", "deg", "of the rig", "give degrees")] = Decimal(0)
    gravity_m_s2: Annotated[Decimal, limits("0", "30", "m/s^2", "along -z", "give a positive number")] = Decimal(
        "9.80665"
    )
    standard_deviation_m: Noise | None = Field(
        None,
        description="known noise: one number, or [x, y, z] for every marker recorded; leave out if unknown",
    )


def _whole(value: Any) -> Any:
    if isinstance(value, Decimal) and abs(value) < 10**6 and value == value.to_integral_value():
        return int(value)
    return value


class DatasetFile(_Strict):
    """A wing with its recordings."""

    format_version: Annotated[Literal[1], BeforeValidator(_whole)]
    name: Title
    description: Prose = ""
    wing: WingFile
    recordings: list[RecordingFile] = Field(min_length=1, max_length=MAX_RECORDINGS)
    held_out: list[Name] = Field(default_factory=list, max_length=MAX_RECORDINGS)
