"""Answers of the server, checked against the types that the server publishes and the client hands out."""

from __future__ import annotations

import json
from typing import Any

from pydantic import TypeAdapter


class Fields(dict[str, Any]):
    """A JSON object whose fields are attributes as well."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(name) from error


def valid(shape: Any, answer: Any) -> Any:
    """``answer`` with its fields as attributes; ValidationError where it does not have the ``shape``."""
    TypeAdapter(shape).validate_python(answer)
    return json.loads(json.dumps(answer), object_hook=Fields)


def fields(shape: Any) -> set[str]:
    """Names of the fields of a shape."""
    return set(shape.__annotations__)
