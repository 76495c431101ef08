"""Values in the YAML files of cameras and films, which errors name by line and key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wingfit.records.description.yaml_text import Document
from wingfit.records.errors import fail, nearest, shown


def value_at(document: Document, path: tuple[str | int, ...]) -> Any:
    """Return the value at ``path``; None where a key of a mapping is missing."""
    data = document.data
    for key in path:
        data = data[key] if isinstance(key, int) else data.get(key) if isinstance(data, dict) else None
    return data


def mapping_at(
    document: Document, path: tuple[str | int, ...], keys: tuple[str, ...], optional: tuple[str, ...] = ()
) -> Mapping[str, Any]:
    """Return the mapping at ``path``; DatasetError unless it has all ``keys``, and none but these and ``optional``."""
    data = value_at(document, path)
    every = (*keys, *optional)
    if not isinstance(data, dict):
        raise fail(document.where(path), data, f"{shown(data)} is no mapping with the keys {', '.join(every)}")
    for key in keys:
        if key not in data:
            raise fail(document.where((*path, key)), None, f"the key {key!r} is missing; add it")
    for key in data:
        if key not in every:
            raise fail(document.where((*path, key)), key, f"unknown key {key!r}; {nearest(str(key), every)}")
    return data
