"""Checks ``dataset.yaml`` against its models, and converts pydantic's errors to messages with a remedy."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from wingfit.records.description.consistency import inconsistencies
from wingfit.records.description.dataset_file import (
    DatasetFile,
    SeriesDatasetFile,
    VehicleDatasetFile,
    WingDatasetFile,
    model_of,
)
from wingfit.records.description.fields import models_in, tag_of
from wingfit.records.description.placeholder import missing
from wingfit.records.description.quantity import FAULT, kind
from wingfit.records.description.yaml_text import Document, Path
from wingfit.records.errors import Faults, fail, nearest

Location = tuple[int | str, ...]
_SUFFIX = re.compile(
    r"_(?:hz|khz|rpm|rad_s|rad|deg_s|deg|degrees|m|mm|cm|um|metres|meters|in|ft|m_s|km_h|kmh|kn|m_s2|pa|hpa|kpa|bar|mbar"
    r"|atm|torr|k|c|f|kelvin|celsius|kg|g|mg|kg_m3|g_cm3|g_m3|kg_m2|g_m2|kg_m|g_m|s|s2|ms|us|n|mn|gf|beats"
    r"|rad_per_beat|deg_per_beat)$"
)
_KINDS = {
    "list_type": "a list",
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "a mapping of keys to values"),
    "string_type": "text",
    "bool_type": "true or false",
}
_RIGS = {
    "wing": "a wing with tracks of markers",
    "vehicle": "a vehicle with forces",
    "rig": "any other rig with channels",
}
_ROOTS: dict[str, type[DatasetFile]] = {
    "wing": WingDatasetFile,
    "vehicle": VehicleDatasetFile,
    "rig": SeriesDatasetFile,
}
_NAMES = {"wing": "a wing", "vehicle": "a vehicle", "rig": "a rig with channels"}


def check_description(document: Document) -> DatasetFile:
    """Validate the parsed ``dataset.yaml`` and return it as a model; DatasetError lists all errors."""
    faults, data = Faults(), document.data
    described = [key for key in _RIGS if isinstance(data, Mapping) and key in data]
    if len(described) > 1:
        both = " and ".join(map(repr, described[:2]))
        message = f"both {both} are described; a dataset is of {_either(_RIGS.values())}: split it"
        raise fail(document.where((described[1],)), None, message)
    root = model_of(data)
    try:
        checked = root.model_validate(data)
    except ValidationError as error:
        _Explainer(document, root).explain(error.errors(include_url=False), faults)
        faults.raise_any()
        raise
    for path, value, message in inconsistencies(checked):
        faults.add(document.where(path), value, message)
    faults.raise_any()
    return checked


class _Explainer:
    """Converts pydantic's errors on one ``document``, which was checked against the model ``root``, to faults."""

    def __init__(self, document: Document, root: type[DatasetFile]) -> None:
        self.document, self.root = document, root

    def explain(self, errors: list[ErrorDetails], faults: Faults) -> None:
        """Add a fault for each of pydantic's ``errors``; a key with a wrong unit gets one, not two."""
        mistaken = {self._renamed(error["loc"]) for error in errors if error["type"] == "extra_forbidden"}
        for error in errors:
            path, unknown = _path(error, self.document.data), error["type"] == "extra_forbidden"
            # Pydantic reports a key with a wrong unit twice: as an unknown key and as a missing one.
            if error["type"] == "missing" and error["loc"] in mistaken:
                continue
            value = error["input"] if error["type"] != "missing" else None
            faults.add(self.document.where(path), path[-1] if unknown else value, self._message(error))

    def _message(self, error: ErrorDetails) -> str:
        what, location = error["type"], error["loc"]
        if (wanted := missing(error["input"])) is not None:
            return f"is not filled in yet; replace the placeholder by the {wanted}"
        if what == "missing":
            if location in {("wing",), ("vehicle",)}:
                return f"there is neither {' nor '.join(map(repr, _RIGS))}; describe {_either(_RIGS.values())}"
            return "this key is missing; add it (docs/formats.md)"
        if what == "extra_forbidden":
            return self._unknown_key(location)
        if what == "union_tag_not_found":
            kinds = " or ".join(str(tag_of(model)) for model in _models(self.root, location))
            return f"the key 'kind' is missing; it must be {kinds}"
        return _plain_message(error)

    def _unknown_key(self, location: Location) -> str:
        key, renamed = str(location[-1]), self._renamed(location)
        if renamed is not None:
            return f"unknown key {key!r}; write {renamed[-1]!r} and give the value in that unit"
        fields = self._fields(location)
        this = next(name for name, root in _ROOTS.items() if root is self.root)
        others = [
            _NAMES[that]
            for that, root in _ROOTS.items()
            if that != this and any(key in model.model_fields for model in self._alike(root, location, this, that))
        ]
        if others:
            return f"key {key!r} is for {' or '.join(others)}, this is {_NAMES[this]}; {nearest(key, fields)}"
        return f"unknown key {key!r}; {nearest(key, fields)}"

    @staticmethod
    def _alike(root: type[BaseModel], location: Location, this: str, that: str) -> list[type[BaseModel]]:
        """Return the models at the place of ``location`` in a description of ``that`` instead of ``this``."""
        return _models(root, tuple(that if part == this else part for part in location[:-1]))

    def _renamed(self, location: Location) -> Location | None:
        """Return the location of the known key that differs from the key at ``location`` only in its unit, or None."""
        key = str(location[-1])
        for known in self._fields(location):
            if _SUFFIX.search(known) and _stem(known) == _stem(key):
                return (*location[:-1], known)
        return None

    def _fields(self, location: Location) -> list[str]:
        """Return the valid keys of the mapping that contains the key at ``location``."""
        return [name for model in _models(self.root, location[:-1])[:1] for name in model.model_fields]


def _plain_message(error: ErrorDetails) -> str:
    """Return the message for an error that can be explained without the rest of the file."""
    what, context, value = error["type"], error.get("ctx", {}), error["input"]
    if what == FAULT:
        return error["msg"]
    if what == "union_tag_invalid":
        return f"kind is {context.get('tag')!r}; it must be {context.get('expected_tags')}"
    if what == "literal_error":
        version = "; a newer wingfit may read it" if error["loc"][-1] == "format_version" else ""
        return f"is {kind(value)}; it must be {context.get('expected')}{version}"
    if what == "too_short":
        return f"has {context.get('actual_length')} entries, at least {context.get('min_length')} are needed: add some"
    if what == "too_long":
        return f"has more than {context.get('max_length')} entries, the most that are read; remove some"
    if what in _KINDS:
        return f"is {kind(value)}; it must be {_KINDS[what]}"
    return error["msg"]


def _either(texts: Iterable[str]) -> str:
    *first, last = texts
    return f"{', '.join(first)} or {last}"


def _stem(key: str) -> str:
    return _SUFFIX.sub("", key.lower())


def _models(root: type[BaseModel], location: Location) -> list[type[BaseModel]]:
    """Return the models below ``root`` for the data at ``location`` (keys, indices, values of ``kind``).

    There are several if ``location`` does not say which ``kind`` it is.
    """
    models = [root]
    for part in location:
        fields = [model.model_fields[str(part)] for model in models if str(part) in model.model_fields]
        if fields:
            models = [model for field in fields for model in models_in(field.annotation)]
        else:
            models = [model for model in models if tag_of(model) == part] or models
    return models


def _path(error: ErrorDetails, data: Any) -> Path:
    """Convert pydantic's location of ``error`` to a path in ``data``, without values of ``kind``, which are no keys."""
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
