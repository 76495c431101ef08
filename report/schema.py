"""Generate the JSON Schema of a finding from its types; ``python -m wingfit.report.schema`` prints it."""

from __future__ import annotations

import sys
from typing import Any

from wingfit.records.description.schema import as_text, untitled
from wingfit.report.finding_file import ADAPTER, FORMAT_VERSION


def finding_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of the output of :func:`finding_json`."""
    schema = untitled(ADAPTER.json_schema(mode="serialization"))
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
    """Return the text of the published schema, docs/schemas/finding.schema.json."""
    return as_text(finding_schema())


if __name__ == "__main__":
    sys.stdout.write(schema_text())
