"""The bodies of requests that create API keys or store a key in a browser's cookie."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from wingfit.service.auth.access import Scope

Label = Annotated[str, Field(min_length=1, max_length=100, pattern=r"\S")]
Scopes = Annotated[list[Scope], Field(min_length=1, max_length=3)]

SECRET = "wingfit_" + "x" * 43  # the form of one


class KeyIn(BaseModel):
    """Body of a request to create an API key."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"name": "bench in room 3", "owner": "wind tunnel group", "scopes": ["read", "write"]}]
        },
    )

    name: Label = Field(description="what the key is for")
    owner: Label | None = Field(None, description="owner of what is made with the key; default: the name of the key")
    scopes: Scopes = Field(
        ["read", "write"], description="admin includes both, sees the data of all owners, and manages keys"
    )


class SessionIn(BaseModel):
    """Body of a request to store an API key in the browser's cookie."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"key": SECRET}]})

    key: str = Field(min_length=1, max_length=200)
