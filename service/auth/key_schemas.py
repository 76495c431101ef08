"""Keys and the session of a browser, as they go over the wire."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from wingfit.service.auth.access import Caller, Scope
from wingfit.service.storage.tables import KeyRow

Label = Annotated[str, Field(min_length=1, max_length=100, pattern=r"\S")]
Scopes = Annotated[list[Scope], Field(min_length=1, max_length=3)]

_KEY: dict[str, Any] = {
    "id": "key_5c1e07a94bd83f26",
    "name": "bench in room 3",
    "owner": "wind tunnel group",
    "scopes": ["read", "write"],
    "created_at": "2026-11-05T09:30:00.000000Z",
    "revoked_at": None,
}
_SECRET = "wingfit_" + "x" * 43  # the form of one


class KeyIn(BaseModel):
    """What to make a key for."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{key: _KEY[key] for key in ("name", "owner", "scopes")}]},
    )

    name: Label = Field(description="what it is for")
    owner: Label | None = Field(None, description="to whom belongs what is made with it; the name if left out")
    scopes: Scopes = Field(["read", "write"], description="admin includes both, sees everyone's, and manages keys")


class KeyOut(BaseModel):
    """A key, without its secret."""

    model_config = ConfigDict(json_schema_extra={"examples": [_KEY]})

    id: str
    name: str
    owner: str
    scopes: list[str]
    created_at: str
    revoked_at: str | None

    @classmethod
    def of(cls, row: KeyRow) -> KeyOut:
        """A row on the wire."""
        return cls.model_validate({name: getattr(row, name) for name in cls.model_fields})


class NewKeyOut(KeyOut):
    """A key that was made now, with its secret, which is told this once."""

    model_config = ConfigDict(json_schema_extra={"examples": [_KEY | {"secret": _SECRET}]})

    secret: str


class KeysOut(BaseModel):
    """All keys, newest first."""

    items: list[KeyOut]


class SessionIn(BaseModel):
    """A key that a browser is to use from now on."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"key": _SECRET}]})

    key: str = Field(min_length=1, max_length=200)


class SessionOut(BaseModel):
    """Who is calling."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "keys_required": True,
                    "key_id": _KEY["id"],
                    "owner": _KEY["owner"],
                    "scopes": _KEY["scopes"],
                }
            ]
        }
    )

    keys_required: bool
    key_id: str | None
    owner: str | None
    scopes: list[str]

    @classmethod
    def of(cls, caller: Caller | None, *, required: bool) -> SessionOut:
        """Of a caller."""
        if caller is None:
            return cls(keys_required=required, key_id=None, owner=None, scopes=[])
        return cls(keys_required=required, key_id=caller.key, owner=caller.owner, scopes=sorted(caller.scopes))
