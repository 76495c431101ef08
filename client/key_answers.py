"""JSON answers of the server about API keys and the session of a browser."""

from __future__ import annotations

from typing_extensions import TypedDict


class Key(TypedDict):
    """An API key, without its secret."""

    id: str
    name: str
    owner: str
    scopes: list[str]
    created_at: str
    revoked_at: str | None


class NewKey(Key):
    """A new key with its secret, which only this answer contains."""

    secret: str


class Keys(TypedDict):
    """All keys, newest first."""

    items: list[Key]


class Session(TypedDict):
    """The key with which a request came; ``keys_required`` says whether the server requires one."""

    keys_required: bool
    key_id: str | None
    owner: str | None
    scopes: list[str]
