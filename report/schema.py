"""The JSON Schema of a finding, generated from its types; ``python -m wingfit.report.schema`` prints it."""

from __future__ import annotations

import json
import sys
from typing import Any

from wingfit.report.finding_file import ADAPTER, FORMAT_VERSION


def finding_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of what :func:`finding_json` makes."""
    schema = _untitled(ADAPTER.json_schema(mode="serialization"))
    required = [*schema["required"], "format_version"]  # fields with a default are always written
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:wingfit:schema:finding:{FORMAT_VERSION}",
        **schema,
        "required": required,
        "title": f"wingfit finding, format {FORMAT_VERSION}",
        "description": "What a diagnosis found.",
    }


def schema_text() -> str:
    """Write the schema as it is published in docs/schemas/finding.schema.json."""
    return json.dumps(finding_schema(), indent=2, ensure_ascii=False) + "\n"


def _untitled(schema: Any) -> Any:
    """Drop the titles that pydantic derives from field names; they repeat the names."""
    if isinstance(schema, list):
        return [_untitled(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {key: _untitled(item) for key, item in schema.items() if not (key == "title" and isinstance(item, str))}


if __name__ == "__main__":
    sys.stdout.write(schema_text())
