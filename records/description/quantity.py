"""Numbers and names in files: pydantic metadata that checks limits and writes them into the JSON Schema."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from wingfit.records.errors import shown
from wingfit.records.units import number_text

FAULT = "wingfit"  # type of the pydantic errors whose message is final


def fault(message: str) -> PydanticCustomError:
    """Make a pydantic error with this final message."""
    return PydanticCustomError(FAULT, "{message}", {"message": message})


@dataclass(frozen=True)
class Limits:
    """A finite number in [low, high] ``unit``; read as a decimal, so that its conversion to SI rounds once.

    ``above`` excludes ``low`` itself; ``remedy`` is advice for the usual mistake.
    """

    low: Decimal
    high: Decimal
    unit: str
    text: str
    remedy: str = ""
    above: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """Check by :meth:`check`."""
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe a number with its limits."""
        unit = f", {self.unit}" if self.unit else ""
        return {
            "type": "number",
            "description": self.text + unit,
            "exclusiveMinimum" if self.above else "minimum": float(self.low),
            "maximum": float(self.high),
        }

    def check(self, value: Any) -> Decimal:
        """``value`` as a decimal; a pydantic error names value, limits, unit and remedy."""
        number = _decimal(value)
        too_low = number <= self.low if self.above else number < self.low
        if too_low or number > self.high:
            interval = f"{'(' if self.above else '['}{_bound(self.low)}, {_bound(self.high)}]"
            unit = f" {self.unit}" if self.unit else ""
            remedy = f"; {self.remedy}" if self.remedy else ""
            raise fault(f"is {shown(number_text(number))}{unit}; it must lie in {interval}{unit}{remedy}")
        return number


def limits(interval: str, text: str, remedy: str = "") -> Limits:
    """:class:`Limits` from text such as ``"(0, 0.5] m"``; a round bracket excludes the lower limit itself."""
    match = re.fullmatch(r"([(\[])(.+), (.+)\] ?(.*)", interval)
    if match is None:
        raise ValueError(f"the interval is {interval!r}; write it as '[0, 1] m' or '(0, 1] m'")
    bracket, low, high, unit = match.groups()
    return Limits(Decimal(low), Decimal(high), unit, text, remedy, above=bracket == "(")


@dataclass(frozen=True)
class Text:
    """Text of limited length that matches ``pattern``; ``rule`` describes the pattern in messages.

    A pattern that is not ``portable`` between dialects of regular expressions is omitted from the JSON Schema.
    """

    pattern: str
    length: int
    text: str
    rule: str
    portable: bool = True

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """Check by :meth:`check`."""
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Describe a string with its pattern."""
        pattern = {"pattern": f"^{self.pattern}$"} if self.portable else {}
        return {"type": "string", "description": self.text, "maxLength": self.length} | pattern

    def check(self, value: Any) -> str:
        """``value``, if it is admissible text; else a pydantic error."""
        if not isinstance(value, str):
            quoted = f'; put it in quotes: "{value}"' if isinstance(value, (bool, int, Decimal)) else ""
            raise fault(f"is {kind(value)}; it must be text{quoted}")
        if len(value) > self.length:
            raise fault(f"has {len(value)} characters; at most {self.length} are allowed: shorten it")
        if not re.fullmatch(self.pattern, value):
            raise fault(f"is {shown(value)!r}; {self.rule}")
        return value


def kind(value: object) -> str:
    """Description of ``value`` in the terms of YAML, for messages."""
    if value is None:
        return "empty"
    if isinstance(value, bool):
        return f"{str(value).lower()} (true or false)"
    if isinstance(value, (int, float, Decimal)):
        return f"the number {shown(value)}"
    if isinstance(value, str):
        return f"the text {shown(value)!r}"
    return f"a {shown(value)}"


def _decimal(value: Any) -> Decimal:
    if isinstance(value, bool) or not isinstance(value, (int, float, Decimal)):
        if isinstance(value, str) and re.fullmatch(r"[-+]?[0-9]+,[0-9]+", value):
            raise fault(f"is the text {value!r}; it must be a number: write a decimal point, not a comma")
        raise fault(f"is {kind(value)}; it must be a finite number, without quotes or unit")
    number = value if isinstance(value, Decimal) else Decimal(repr(value))
    if not number.is_finite():
        raise fault(f"is {value}; it must be a finite number")
    return number


def _bound(value: Decimal) -> str:
    return f"{float(value):g}"
