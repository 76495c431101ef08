"""Hooks of the fuzzer schemathesis, which loads this module (environment variable ``SCHEMATHESIS_HOOKS``).

They put valid values into those parts of a generated request that are meant to be valid.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import schemathesis
from schemathesis import GenerationMode

from benchmarks.abuse.valid_values import ValidValues

GIVEN = "WINGFIT_FUZZ_GOOD"
FORM = "multipart/form-data"


def _valid_values() -> ValidValues:
    folder = Path(os.environ[GIVEN])
    given = json.loads((folder / "good.json").read_text(encoding="utf-8"))
    archives = [path.read_bytes() for path in sorted(folder.glob("*.zip"))]
    return ValidValues(given["good"], archives, given["seed"])


VALUES = _valid_values()


def before_call(context: Any, case: Any, kwargs: dict[str, Any]) -> None:  # noqa: ARG001  as they call it
    """Called before ``case`` is sent: put valid values into the parts that are meant to be valid.

    Parts that schemathesis made invalid on purpose are not changed, except that ids in a deletion may be made invalid.
    ``kwargs``: arguments of the HTTP client, changed for uploads.
    """
    dice = VALUES.dice(case.method, case.path, case.path_parameters, case.query, str(case.body))
    kind = VALUES.kind(case.path, dice)
    valid = _valid(case)
    if case.method == "DELETE":
        case.path_parameters = VALUES.spared(case.path_parameters)
    elif "path" in valid:
        case.path_parameters = VALUES.parameters(case.path_parameters, kind, dice)
    if "query" in valid:
        case.query = VALUES.parameters(case.query, kind, dice)
    if "header" in valid:
        case.headers = VALUES.headers(case.headers, dice)
    if "body" in valid and case.media_type == FORM:
        kwargs.update(VALUES.upload(case.body, dice))
    elif "body" in valid:
        case.body = VALUES.body(case.body, kind, dice)


def _valid(case: Any) -> set[str]:
    """Return the names of those parts of ``case`` (path, query, header, body) that are meant to be valid."""
    made = case.meta.components.items() if case.meta else ()
    return {where.value for where, part in made if part.mode is GenerationMode.POSITIVE}


schemathesis.hook(before_call)
