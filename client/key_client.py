"""Calls of the client for API keys."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict, cast

from wingfit.client.transport import Transport, given, part


class Key(TypedDict):
    """An API key, without its secret."""

    id: str
    name: str
    owner: str
    scopes: list[str]
    created_at: str
    revoked_at: str | None


class NewKey(Key):
    """A key that was made now, with its secret, which is told this once."""

    secret: str


class KeyCalls(Transport):
    """What a key with the scope admin may ask for."""

    def keys(self) -> list[Key]:
        """List all keys, newest first."""
        return cast(list[Key], self._json("GET", "/v1/keys")["items"])

    def create_key(self, name: str, *, owner: str | None = None, scopes: Sequence[str] = ("read", "write")) -> NewKey:
        """Make a key; its secret is in the answer, and nowhere else."""
        asked = given(name=name, owner=owner) | {"scopes": list(scopes)}
        return cast(NewKey, self._json("POST", "/v1/keys", json=asked))

    def revoke_key(self, key_id: str) -> Key:
        """Make a key good for nothing."""
        return cast(Key, self._json("DELETE", f"/v1/keys/{part(key_id)}"))
