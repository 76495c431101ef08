"""Types of values in ``dataset.yaml`` that wings and vehicles share, with their physical limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from decimal import Decimal
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

from wingfit.records.description.quantity import fault, limits, text
from wingfit.records.limits import MAX_ESTIMATES, MAX_HARMONICS

METRES = "give metres: 0.22, not 220 or 22"

NAME_PATTERN = "[A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9_-])?"
Name = Annotated[
    str,
    text(
        NAME_PATTERN,
        100,
        "name",
        "a name has letters, digits, '.', '_', '-'; it starts with a letter or digit, ends without '.'",
    ),
]
GeneName = Annotated[
    str,
    text("[A-Za-z][A-Za-z0-9_]*", 100, "gene name", "a gene name starts with a letter: letters, digits and '_'"),
]
UNPRINTABLE = r"\x00-\x1f\x7f-\x9f\ud800-\udfff\ufeff\ufffe\uffff"
Title = Annotated[
    str,
    text(rf"[^{UNPRINTABLE}]+", 200, "title", "a title is one line of printable text, not empty", portable=False),
]
Prose = Annotated[
    str,
    text(
        rf"(?:[^{UNPRINTABLE}]|[\t\n])*",
        20_000,
        "free text",
        "it must be printable text without control characters",
        portable=False,
    ),
]
Angle = Annotated[Decimal, limits("[-180, 180] deg", "angle", "give degrees")]
Chord = Annotated[Decimal, limits("[0.0001, 5] m", "chord", METRES)]
Thickness = Annotated[Decimal, limits("(0, 0.5] m", "thickness", "give metres: 0.012, not 12")]
Frequency = Annotated[Decimal, limits("[0.01, 1000] Hz", "beats per second")]
Pressure = Annotated[
    Decimal, limits("[0, 20000] mbar", "static pressure", "give mbar (1 mbar = 100 Pa): 1013.25, not 101325")
]
Temperature = Annotated[Decimal, limits("[-100, 100] °C", "air temperature", "give degrees Celsius: 20, not 293.15")]
Estimates = Annotated[
    dict[GeneName, Annotated[Decimal, limits("[-1e300, 1e300]", "estimate of a gene, SI units")]],
    Field(default_factory=dict, max_length=MAX_ESTIMATES),
]

TWO = Field(min_length=2, max_length=2)


class Strict(BaseModel):
    """Base class of all models of ``dataset.yaml``: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


_Instant = Annotated[Decimal, limits("[-1000000, 1000000] s", "start or end of the part that is used")]
_Beats = Annotated[Decimal, limits("[-1000000, 1000000] beats", "start or end of the part that is used, from time 0")]


class WindowFile(Strict):
    """The part of a recording that is used, in seconds or in beats; all of it without either key."""

    window_s: list[_Instant] | None = Field(None, min_length=2, max_length=2, description="start and end of the part")
    window_beats: list[_Beats] | None = Field(
        None, min_length=2, max_length=2, description="start and end of the part, in beats from time 0"
    )

    @model_validator(mode="after")
    def _one_window(self) -> WindowFile:
        if self.window_s and self.window_beats:
            raise fault("window_s and window_beats are both given; keep one of them")
        return self


class FourierFile(Strict):
    """An angle as a Fourier series over the beat; the k-th entry of each list belongs to the k-th harmonic."""

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


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the pydantic models within the type ``annotation``, such as ``list[Model] | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from models_in(argument)


def tag_of(model: type[BaseModel]) -> str | None:
    """Return the value of the key ``kind`` that selects ``model`` among alternatives; None if it has no such key."""
    field = model.model_fields.get("kind")
    return str(get_args(field.annotation)[0]) if field else None


def one_or_each(value: Any) -> str:
    """Return the form of a standard deviation, for pydantic: "each" for a mapping by channel, else "one"."""
    return "each" if isinstance(value, Mapping) else "one"


def whole(value: Any) -> Any:
    """Convert ``value`` to an int if it is a whole decimal number, else return it; for fields that admit only ints."""
    if isinstance(value, Decimal) and abs(value) < 10**6 and value == value.to_integral_value():
        return int(value)
    return value
