"""JSON answers of the server about API keys, and about the key that a caller uses."""

from __future__ import annotations

from typing_extensions import TypedDict


class Key(TypedDict):
    """An API key without its secret; ``owner``: owner of what is created with it; ``scopes``: read, write, admin."""

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
    """The key that came with a request, null if none; ``keys_required``: whether the server requires a key."""

    keys_required: bool
    key_id: str | None
    owner: str | None
    scopes: list[str]
