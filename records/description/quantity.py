"""Pydantic metadata for numbers and texts in files: checks their limits and writes them into the JSON Schema."""

from __future__ import annotations

import re
from collections.abc import Callable
from decimal import Decimal
from typing import Any

from pydantic import GetPydanticSchema
from pydantic_core import PydanticCustomError, core_schema

from wingfit.records.errors import shown
from wingfit.records.units import number_text

FAULT = "wingfit"  # type of the pydantic errors whose message is final


def fault(message: str) -> PydanticCustomError:
    """Return a pydantic error whose ``message`` is shown to the user as it is."""
    return PydanticCustomError(FAULT, "{message}", {"message": message})


def limits(interval: str, description: str, remedy: str = "") -> GetPydanticSchema:
    """Return metadata of a finite number in an ``interval`` such as "(0, 0.5] m"; "(" excludes the lower limit.

    The number is read as a decimal, so that its conversion to SI rounds once. Errors name value, limits and unit, and
    ``remedy``: advice for the usual mistake. ``description`` is for the JSON Schema.
    """
    match = re.fullmatch(r"([(\[])(.+), (.+)\] ?(.*)", interval)
    if match is None:
        raise ValueError(f"the interval is {interval!r}; write it as '[0, 1] m' or '(0, 1] m'")
    bracket, low, high, unit = match.groups()
    least, most, above = Decimal(low), Decimal(high), bracket == "("

    def check(value: Any) -> Decimal:
        number = _decimal(value)
        if number < least or (above and number == least) or number > most:
            of_unit, advice = f" {unit}" if unit else "", f"; {remedy}" if remedy else ""
            inside = f"{bracket}{float(least):g}, {float(most):g}]{of_unit}"
            raise fault(f"is {shown(number_text(number))}{of_unit}; it must lie in {inside}{advice}")
        return number

    lower = {"exclusiveMinimum" if above else "minimum": float(least)}
    described = f"{description}, {unit}" if unit else description
    return _checked(check, {"type": "number", "description": described, **lower, "maximum": float(most)})


def text(pattern: str, length: int, description: str, rule: str, *, portable: bool = True) -> GetPydanticSchema:
    """Return metadata of text of at most ``length`` characters that matches ``pattern``.

    ``rule`` describes the pattern in errors, ``description`` the text in the JSON Schema. A pattern that is not
    ``portable`` between dialects of regular expressions is omitted from the JSON Schema.
    """

    def check(value: Any) -> str:
        if not isinstance(value, str):
            quoted = f'; put it in quotes: "{value}"' if isinstance(value, (bool, int, Decimal)) else ""
            raise fault(f"is {kind(value)}; it must be text{quoted}")
        if len(value) > length:
            raise fault(f"has {len(value)} characters; at most {length} are allowed: shorten it")
        if not re.fullmatch(pattern, value):
            raise fault(f"is {shown(value)!r}; {rule}")
        return value

    schema = {"type": "string", "description": description, "maxLength": length}
    return _checked(check, schema | ({"pattern": f"^{pattern}$"} if portable else {}))


def _checked(check: Callable[[Any], object], schema: dict[str, Any]) -> GetPydanticSchema:
    """Return metadata of a field: ``check`` converts its value or raises an error, ``schema`` is its JSON Schema."""
    validator = core_schema.no_info_plain_validator_function(check)
    return GetPydanticSchema(lambda *_: validator, lambda *_: dict(schema))


def kind(value: object) -> str:
    """Describe ``value`` in the terms of YAML for a message: "empty", "the number 3", "a list of 2"."""
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
