"""Checks a description against its models and turns what pydantic says into errors a user can act on."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from records import description as files
from records.consistency import inconsistencies
from records.description import DatasetFile
from records.errors import Faults, nearest
from records.quantity import FAULT, kind
from records.yaml_text import Document, Path

_MODELS: dict[str | None, type[BaseModel]] = {
    None: DatasetFile,
    "wing": files.WingFile,
    "stations": files.StationFile,
    "materials": files.MaterialsFile,
    "rods": files.RodFile,
    "markers": files.MarkerFile,
    "hinge": files.HingeFile,
    "fourier": files.FourierFile,
    "four_bar": files.FourBarFile,
    "recordings": files.RecordingFile,
}
_SUFFIX = re.compile(
    r"_(?:hz|khz|rpm|rad_s|rad|deg_s|deg|degrees|m|mm|cm|um|metres|meters|in|ft|m_s|km_h|kmh|kn|m_s2|pa|hpa|kpa|bar|mbar"
    r"|atm|torr|k|c|f|kelvin|celsius|kg|g|mg|kg_m3|g_cm3|g_m3|kg_m2|g_m2|kg_m|g_m|s|ms|us)$"
)
_KINDS = {
    "list_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
    "string_type": "text",
    "bool_type": "true or false",
}


def check_description(document: Document) -> DatasetFile:
    """Validate the description; DatasetError lists everything that is wrong with it."""
    faults = Faults()
    try:
        checked = DatasetFile.model_validate(document.data)
    except ValidationError as error:
        _explain(document, error.errors(include_url=False), faults)
        faults.raise_any()
        raise
    for path, value, message in inconsistencies(checked):
        faults.add(document.where(path), value, message)
    faults.raise_any()
    return checked


def _explain(document: Document, errors: list[ErrorDetails], faults: Faults) -> None:
    mistaken = {_renamed(error) for error in errors if error["type"] == "extra_forbidden"}
    for error in errors:
        path = _path(error, document.data)
        # A key with the wrong unit is one mistake, not an unknown key and a missing one.
        if error["type"] == "missing" and error["loc"] in mistaken:
            continue
        value = error["input"] if error["type"] != "missing" else None
        faults.add(document.where(path), path[-1] if error["type"] == "extra_forbidden" else value, _message(error))


def _message(error: ErrorDetails) -> str:
    what, context, value = error["type"], error.get("ctx", {}), error["input"]
    if what == FAULT:
        return error["msg"]
    if what == "missing":
        return "this key is missing; add it (docs/formats.md)"
    if what == "extra_forbidden":
        return _unknown_key(error)
    if what == "union_tag_not_found":
        return "the key 'kind' is missing; it must be fourier or four_bar"
    if what == "union_tag_invalid":
        return f"kind is {context.get('tag')!r}; it must be {context.get('expected_tags')}"
    if what == "literal_error":
        version = "; a newer wingfit may read it" if error["loc"][-1] == "format_version" else ""
        return f"is {kind(value)}; it must be {context.get('expected')}{version}"
    if what == "too_short":
        found, needed = context.get("actual_length"), context.get("min_length")
        return f"has {found} entries, at least {needed} are needed: add some"
    if what == "too_long":
        return f"has more than {context.get('max_length')} entries, the most that are read; remove some"
    if what in _KINDS:
        return f"is {kind(value)}; it must be {_KINDS[what]}"
    return error["msg"]


def _unknown_key(error: ErrorDetails) -> str:
    key = str(error["loc"][-1])
    renamed = _renamed(error)
    if renamed is not None:
        return f"unknown key {key!r}; write {renamed[-1]!r} and give the value in that unit"
    return f"unknown key {key!r}; {nearest(key, _model(error['loc'][:-1]).model_fields)}"


def _renamed(error: ErrorDetails) -> tuple[int | str, ...] | None:
    """Where an unknown key should have stood, when it is a known one with another unit or none."""
    parent, key = error["loc"][:-1], str(error["loc"][-1])
    for known in _model(parent).model_fields:
        if _SUFFIX.search(known) and _stem(known) == _stem(key):
            return (*parent, known)
    return None


def _stem(key: str) -> str:
    return _SUFFIX.sub("", key.lower())


def _model(location: tuple[int | str, ...]) -> type[BaseModel]:
    return _MODELS[next((str(part) for part in reversed(location) if part in _MODELS), None)]


def _path(error: ErrorDetails, data: Any) -> Path:
    """Pydantic's location as a path in the data: without the tags of unions, which stand in no file."""
    location, path = error["loc"], list[str | int]()
    for number, part in enumerate(location):
        inside = isinstance(data, Mapping) and part in data
        indexed = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if inside or indexed:
            data = data[part]
        elif error["type"] != "missing" or number < len(location) - 1:
            continue
        path.append(part)
    return tuple(path)
