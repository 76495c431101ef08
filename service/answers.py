"""Answers (`wingfit.client`) from the objects and rows of the service; conversions follow from the names of fields.

A field called ``before_mm`` is the attribute ``before``, in metres, of the object that is described.
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
    """Describe ``source`` in the ``shape`` of an answer; fields that ``source`` does not have are ``computed``.

    Sequences become lists, objects within become answers as the shape says, numbers that are not finite become null.
    AttributeError for a field that is neither computed nor an attribute.
    """
    found: Any = {}
    for name, hint in _fields(shape).items():
        found[name] = computed[name] if name in computed else _plain(*_attribute(source, name), hint)
    return found  # type: ignore[no-any-return]


def checked(shape: type[T], values: Mapping[str, Any]) -> T:
    """The fields of ``shape`` out of ``values``, which were stored; ValueError where they do not fit it."""
    return _adapter(shape).validate_python(values)  # type: ignore[no-any-return]


def in_si(values: Mapping[str, Any]) -> dict[str, Any]:
    """``values`` of fields by the names of attributes; those of fields that end in a unit are converted to SI."""
    found = dict(values)
    for name in values:
        if ending := _ending(name):
            value = found.pop(name)
            found[name.removesuffix(ending)] = None if value is None else UNITS[ending][1](value)
    return found


def _attribute(source: object, name: str) -> tuple[Any, Convert | None]:
    """The attribute that a field stands for, and the conversion of its numbers."""
    if hasattr(source, name):
        return getattr(source, name), None
    if ending := _ending(name):
        return getattr(source, name.removesuffix(ending)), UNITS[ending][0]
    raise AttributeError(f"{type(source).__name__} has no attribute for the field {name!r}, which is not computed")


def _ending(name: str) -> str:
    return next((ending for ending in UNITS if name.endswith(ending)), "")


def _plain(value: Any, convert: Convert | None, hint: Any) -> Any:
    """``value`` as JSON of the type ``hint``."""
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
