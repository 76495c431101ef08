"""Generates the JSON Schema of ``dataset.yaml`` from its models; running the module prints it."""

from __future__ import annotations

import json
import sys
from typing import Any

from pydantic import TypeAdapter

from wingfit.records.description.dataset_file import DatasetFile
from wingfit.records.limits import FORMAT_VERSION


def dataset_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of ``dataset.yaml``, version ``FORMAT_VERSION`` of the format."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:wingfit:schema:dataset:{FORMAT_VERSION}",
        **untitled(TypeAdapter[object](DatasetFile).json_schema()),
        "title": f"wingfit dataset.yaml, format {FORMAT_VERSION}",
    }


def schema_text() -> str:
    """Return the text of the published schema, docs/schemas/dataset.schema.json."""
    return as_text(dataset_schema())


def as_text(schema: dict[str, Any]) -> str:
    """Return ``schema`` as indented JSON text."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def untitled(schema: Any) -> Any:
    """Return ``schema`` without the titles that pydantic derives from names, at any depth."""
    if isinstance(schema, list):
        return [untitled(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {key: untitled(item) for key, item in schema.items() if not (key == "title" and isinstance(item, str))}


if __name__ == "__main__":
    sys.stdout.write(schema_text())
