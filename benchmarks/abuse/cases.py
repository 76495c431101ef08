"""Description of one malformed or hostile request to the server."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal


@dataclass(frozen=True)
class Case:
    """A request that must be refused, or must do no harm.

    Attributes:
        name: what is wrong with it.
        method: of HTTP.
        path: URL path with its query; ``{dataset}``, ``{run}`` and ``{recording}`` are replaced by existing ids.
        more: further keyword arguments of the HTTP client.
        raw: bytes to send on a bare socket instead.
        answer: "refused" if it must be refused, "any" if it may be, "accepted" if it must not be.
    """

    name: str
    method: str = "POST"
    path: str = "/v1/datasets"
    more: Mapping[str, Any] = field(default_factory=dict)
    raw: bytes = b""
    answer: Literal["refused", "any", "accepted"] = "refused"


def upload(name: str, data: bytes, filename: str = "hostile.zip", **more: Any) -> Case:
    """A case that uploads ``data`` as a dataset file called ``filename``; ``more``: other attributes of the case."""
    return Case(f"upload: {name}", more={"files": {"file": (filename, data)}}, **more)
