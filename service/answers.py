"""Builds the JSON answers (typed dicts of `wingfit.client`) from Python objects and database rows.

The ending of a field's name says how to convert: field ``before_mm`` of the answer is attribute ``before`` (in m) of
the object, converted to mm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter
from typing_extensions import is_typeddict

from wingfit.service.units import MM, MN, PASCAL_PER_MBAR, ZERO_CELSIUS

T = TypeVar("T")
Convert = Callable[[float], float]

# Ending of a field: conversion from SI, and to SI.
UNITS: Mapping[str, tuple[Convert, Convert]] = {
    "_mm": (lambda metres: metres * MM, lambda mm: mm / MM),
    "_mn": (lambda newtons: newtons * MN, lambda mn: mn / MN),
    "_deg": (math.degrees, math.radians),
    "_mbar": (lambda pascals: pascals / PASCAL_PER_MBAR, lambda mbar: mbar * PASCAL_PER_MBAR),
    "_c": (lambda kelvins: kelvins - ZERO_CELSIUS, lambda celsius: celsius + ZERO_CELSIUS),
    "_percent": (lambda fraction: 100 * fraction, lambda percent: percent / 100),
    **dict.fromkeys(("_beats", "_hz", "_m_s", "_n"), (float, float)),
}


def answer(shape: type[T], source: object, /, **computed: object) -> T:
    """Build the typed dict ``shape``: each field is taken from ``computed``, or else from an attribute of ``source``.

    Units are converted from SI as the field's name says. Sequences become lists, nested objects the typed dicts that
    ``shape`` names, infinity and NaN None. AttributeError for a field that is neither computed nor an attribute.
    """
    found: Any = {}
    for name, hint in _fields(shape).items():
        found[name] = computed[name] if name in computed else _plain(*_attribute(source, name), hint)
    return found  # type: ignore[no-any-return]


def checked(shape: type[T], values: Mapping[str, Any]) -> T:
    """Return ``values``, stored JSON, as typed dict ``shape``; ValueError if fields are missing or of a wrong type."""
    return _adapter(shape).validate_python(values)  # type: ignore[no-any-return]


def in_si(values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert ``values`` from the API's names and units to those in SI, e.g. ``before_mm`` to ``before`` (m)."""
    found = dict(values)
    for name in values:
        if ending := _ending(name):
            value = found.pop(name)
            found[name.removesuffix(ending)] = None if value is None else UNITS[ending][1](value)
    return found


def _attribute(source: object, name: str) -> tuple[Any, Convert | None]:
    """Return the attribute of ``source`` for API field ``name``, and its conversion from SI (None: not needed)."""
    if hasattr(source, name):
        return getattr(source, name), None
    if ending := _ending(name):
        return getattr(source, name.removesuffix(ending)), UNITS[ending][0]
    raise AttributeError(f"{type(source).__name__} has no attribute for the field {name!r}, which is not computed")


def _ending(name: str) -> str:
    return next((ending for ending in UNITS if name.endswith(ending)), "")


def _plain(value: Any, convert: Convert | None, hint: Any) -> Any:
    """Convert ``value`` to JSON data of the type ``hint``, its numbers by ``convert`` (None: not converted)."""
    if get_origin(hint) in (Union, UnionType):
        if value is None:
            return None
        (hint,) = (one for one in get_args(hint) if one is not NoneType)
    if is_typeddict(hint):
        return answer(hint, value)
    if isinstance(value, list | tuple):
        (item,) = get_args(hint)
        return [_plain(one, convert, item) for one in value]
    if hint is float:
        number = convert(value) if convert else float(value)
        return number if math.isfinite(number) else None
    return value


_fields: Callable[[type], dict[str, Any]] = cache(get_type_hints)
_adapter: Callable[[type], TypeAdapter[Any]] = cache(TypeAdapter)
