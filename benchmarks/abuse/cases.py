"""Describes one malformed or hostile request to the server."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal


@dataclass(frozen=True)
class Case:
    """A request that must be refused, or must do no harm.

    Attributes:
        name: description of what is wrong with the request.
        method: HTTP method.
        path: URL path with its query; placeholders such as ``{dataset}``, ``{run}`` and ``{recording}`` are replaced by
            existing ids.
        more: further keyword arguments of the HTTP client.
        raw: bytes to send on a bare socket instead of the other attributes; empty for none.
        answer: "refused" if the server must refuse the request, "accepted" if it must accept it, "any" if it may do
            either.
    """

    name: str
    method: str = "POST"
    path: str = "/v1/datasets"
    more: Mapping[str, Any] = field(default_factory=dict)
    raw: bytes = b""
    answer: Literal["refused", "any", "accepted"] = "refused"


def upload(name: str, data: bytes, filename: str = "hostile.zip", **more: Any) -> Case:
    """Return a case, described by ``name``, that uploads ``data`` as a dataset file called ``filename``.

    ``more``: other attributes of the case.
    """
    return Case(f"upload: {name}", more={"files": {"file": (filename, data)}}, **more)
