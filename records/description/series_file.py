"""Models of a dataset of any other rig: its channels, inputs and settings, and its recordings."""

from __future__ import annotations

from decimal import Decimal
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, WithJsonSchema

from wingfit.records.description import fields
from wingfit.records.description.fields import Strict
from wingfit.records.description.quantity import fault, limits, text
from wingfit.records.limits import MAX_ESTIMATES, MAX_QUANTITIES

_NO_UNIT = "a unit is a few printable characters, without spaces at the ends; write 1 for a quantity without unit"


def _unit(value: Any) -> Any:
    """Return the number 1, the unit of a quantity without unit, as text; refuse an empty unit."""
    if value is None or value == "":
        raise fault("is empty; write the unit, or 1 for a quantity without unit")
    return "1" if isinstance(value, (int, Decimal)) and not isinstance(value, bool) and value == 1 else value


Unit = Annotated[
    str,
    text(r"[!-~\xa1-\ud7ff](?:[ -~\xa1-\ud7ff]*[!-~\xa1-\ud7ff])?", 50, "unit", _NO_UNIT, portable=False),
    BeforeValidator(_unit),
    WithJsonSchema(
        {
            "anyOf": [{"type": "string", "minLength": 1, "maxLength": 50}, {"const": 1}],
            "description": "unit as you write it; 1 if it has none",
        }
    ),
]
Line = Annotated[
    str,
    text(rf"[^{fields.UNPRINTABLE}]*", 200, "a line of text", "it must be one line of printable text", portable=False),
]
Value = Annotated[Decimal, limits("[-1e300, 1e300]", "value of a setting, in its unit")]
Estimate = Annotated[Decimal, limits("[-1e300, 1e300]", "estimate of a gene of this recording, in its unit")]


class QuantityFile(Strict):
    """An input or a setting."""

    name: fields.Name
    unit: Unit
    description: fields.Prose = ""


class ChannelFile(Strict):
    """A measured quantity; its samples are in the column of this name."""

    name: fields.Name
    unit: Unit
    standard_deviation: (
        Annotated[
            Decimal,
            limits(
                "[1e-50, 1e50]",
                "standard deviation of the noise of one sample, in the unit of the channel",
                "give it in the unit of the channel, or leave it out if it is not known",
            ),
        ]
        | None
    ) = Field(None, description="known noise; leave out if unknown")
    accepted_error: (
        Annotated[
            Decimal,
            limits(
                "[1e-50, 1e50]",
                "error that the simulation may have, in the unit of the channel",
                "give it in the unit of the channel, or leave it out",
            ),
        ]
        | None
    ) = Field(None, description="error of the simulation that counts as none; leave out for no more than the noise")
    place: Line = Field("", description="where it is measured, for reports")
    description: fields.Prose = ""


class SeriesRecordingFile(Strict):
    """One recording of a rig; its samples are in ``recordings/<name>.csv``."""

    name: fields.Name
    settings: dict[fields.Name, Value] = Field(
        default_factory=dict, max_length=MAX_QUANTITIES, description="value of every setting of the rig"
    )
    estimates: dict[fields.GeneName, Estimate] = Field(
        default_factory=dict, max_length=MAX_ESTIMATES, description="estimates of genes of this recording alone"
    )
    repeats: fields.Name | None = Field(None, description="name shared by recordings of the same experiment")
    period_s: (
        Annotated[
            Decimal,
            limits("[1e-9, 1e9] s", "period of the motion", "give seconds, or leave it out if it is not periodic"),
        ]
        | None
    ) = None
