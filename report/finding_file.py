"""Convert a finding to JSON, and back, without loss.

Numbers have the SI units of :mod:`wingfit.diagnosis.finding`; only the report converts them for reading.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any, Literal

import pydantic
from pydantic.dataclasses import dataclass

from wingfit.diagnosis.finding import Finding

FORMAT_VERSION = 1


@dataclass(frozen=True, config=pydantic.ConfigDict(extra="forbid", allow_inf_nan=False, strict=True))
class _FindingFile(Finding):
    format_version: Literal[1] = 1


ADAPTER = pydantic.TypeAdapter(_FindingFile)


def finding_json(finding: Finding) -> dict[str, Any]:
    """Return all fields of ``finding`` by name, tuples as lists, with ``format_version`` in front.

    Raises:
        ValueError: if a value is not finite, or of a type that JSON does not have; the message names the value.
    """
    return {"format_version": FORMAT_VERSION, **_plain(finding, "finding")}


def finding_from_json(data: Mapping[str, Any]) -> Finding:
    """Return the finding that :func:`finding_json` converted to ``data``.

    Raises:
        ValueError: if ``data`` does not meet the schema; the message names the first field that does not.
    """
    version = data.get("format_version")
    if version != FORMAT_VERSION:
        raise ValueError(f"format_version is {version!r}; this program reads {FORMAT_VERSION}: diagnose again")
    try:
        read = ADAPTER.validate_json(json.dumps(data, allow_nan=False))
    except pydantic.ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ValueError(
            f"not a finding: {place}: {first['msg']} ({error.error_count()} in all); see finding.schema.json"
        ) from error
    return Finding(**{field.name: getattr(read, field.name) for field in dataclasses.fields(Finding)})


def _plain(value: Any, place: str) -> Any:
    if dataclasses.is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name), f"{place}.{f.name}") for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(item, f"{place}.{key}") for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item, f"{place}[{k}]") for k, item in enumerate(value)]
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(
                f"{place} is {value}; it must be finite: use None where a field admits it, or leave it out"
            )
        return float(value)  # of numpy's too, which JSON would not know again
    if value is None or isinstance(value, bool | int | str):
        return value
    raise ValueError(f"{place} is a {type(value).__name__}; it must be a plain number, text, bool or None: convert it")
