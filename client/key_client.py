"""Methods of the client that manage API keys."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from wingfit.client.key_answers import Key, NewKey
from wingfit.client.transport import Transport, given, part


class KeyCalls(Transport):
    """Base class of the client: lists, creates and revokes API keys, for which it needs a key with the scope admin."""

    def keys(self) -> list[Key]:
        """List all keys, newest first, without their secrets."""
        return cast(list[Key], self._json("GET", "/v1/keys")["items"])

    def create_key(self, name: str, *, owner: str | None = None, scopes: Sequence[str] = ("read", "write")) -> NewKey:
        """Create a key and return it with its secret, which is never shown again; ``owner`` is by default ``name``."""
        body = given(name=name, owner=owner) | {"scopes": list(scopes)}
        return cast(NewKey, self._json("POST", "/v1/keys", json=body))

    def revoke_key(self, key_id: str) -> Key:
        """Revoke a key, so that requests with it are refused from now on, and return it."""
        return cast(Key, self._json("DELETE", f"/v1/keys/{part(key_id)}"))
