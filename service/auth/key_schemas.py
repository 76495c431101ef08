"""The bodies of requests about keys and the session of a browser."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from wingfit.service.auth.access import Scope

Label = Annotated[str, Field(min_length=1, max_length=100, pattern=r"\S")]
Scopes = Annotated[list[Scope], Field(min_length=1, max_length=3)]

SECRET = "wingfit_" + "x" * 43  # the form of one


class KeyIn(BaseModel):
    """What to make a key for."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"name": "bench in room 3", "owner": "wind tunnel group", "scopes": ["read", "write"]}]
        },
    )

    name: Label = Field(description="what it is for")
    owner: Label | None = Field(None, description="to whom belongs what is made with it; the name if left out")
    scopes: Scopes = Field(["read", "write"], description="admin includes both, sees everyone's, and manages keys")


class SessionIn(BaseModel):
    """A key that a browser is to use from now on."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"key": SECRET}]})

    key: str = Field(min_length=1, max_length=200)
