"""What schemathesis loads (``SCHEMATHESIS_HOOKS``): fills those parts of a request that are meant to be valid."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import schemathesis
from schemathesis import GenerationMode

from benchmarks.abuse.valid_values import Filling

GIVEN = "WINGFIT_FUZZ_GOOD"
FORM = "multipart/form-data"


def _filling() -> Filling:
    folder = Path(os.environ[GIVEN])
    given = json.loads((folder / "good.json").read_text(encoding="utf-8"))
    archives = [path.read_bytes() for path in sorted(folder.glob("*.zip"))]
    return Filling(given["good"], archives, given["seed"])


FILLING = _filling()


def before_call(context: Any, case: Any, kwargs: dict[str, Any]) -> None:  # noqa: ARG001  as they call it
    """Fill what is valid; what was made invalid on purpose stays."""
    dice = FILLING.dice(case.method, case.path, case.path_parameters, case.query, str(case.body))
    kind = FILLING.kind(case.path, dice)
    valid = _valid(case)
    if case.method == "DELETE":
        case.path_parameters = FILLING.spared(case.path_parameters)
    elif "path" in valid:
        case.path_parameters = FILLING.parameters(case.path_parameters, kind, dice)
    if "query" in valid:
        case.query = FILLING.parameters(case.query, kind, dice)
    if "header" in valid:
        case.headers = FILLING.headers(case.headers, dice)
    if "body" in valid and case.media_type == FORM:
        kwargs.update(FILLING.upload(case.body, dice))
    elif "body" in valid:
        case.body = FILLING.body(case.body, kind, dice)


def _valid(case: Any) -> set[str]:
    """The parts that are valid."""
    made = case.meta.components.items() if case.meta else ()
    return {where.value for where, part in made if part.mode is GenerationMode.POSITIVE}


schemathesis.hook(before_call)
