"""Request and response bodies of keys and of the session of a browser."""

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
_SECRET = "wingfit_" + "x" * 43  # an example of the form


class KeyIn(BaseModel):
    """A key to be made."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{key: _KEY[key] for key in ("name", "owner", "scopes")}]},
    )

    name: Label = Field(description="what the key is for")
    owner: Label | None = Field(None, description="owner of what is made with the key; default: the name of the key")
    scopes: Scopes = Field(
        ["read", "write"], description="admin includes both, sees the data of all owners, and manages keys"
    )


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
        """The key of a row."""
        return cls.model_validate({name: getattr(row, name) for name in cls.model_fields})


class NewKeyOut(KeyOut):
    """A new key with its secret, which is shown only this once."""

    model_config = ConfigDict(json_schema_extra={"examples": [_KEY | {"secret": _SECRET}]})

    secret: str


class KeysOut(BaseModel):
    """All keys, newest first."""

    items: list[KeyOut]


class SessionIn(BaseModel):
    """The key that a browser will use from now on."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"key": _SECRET}]})

    key: str = Field(min_length=1, max_length=200)


class SessionOut(BaseModel):
    """The caller."""

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
        """The session of ``caller``; ``required``: whether the server requires keys."""
        if caller is None:
            return cls(keys_required=required, key_id=None, owner=None, scopes=[])
        return cls(keys_required=required, key_id=caller.key, owner=caller.owner, scopes=sorted(caller.scopes))
