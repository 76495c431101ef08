"""Who sent a request (API keys and what they permit), and the database rows that the caller may see.

Only a plain hash of each key's secret is stored: a secret has 256 random bits, so it cannot be guessed from its hash.
The valid keys are held in memory, because one process owns the database and changes them.
"""

from __future__ import annotations

import hashlib
import secrets
import threading
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Literal

from sqlalchemy import event, select
from sqlalchemy.orm import ORMExecuteState, Session, with_loader_criteria

from wingfit.service.storage.tables import KeyRow, OwnedRow

Scope = Literal["read", "write", "admin"]
SECRET_PREFIX = "wingfit_"  # noqa: S105  # by which scanners for leaked secrets recognise one
SECRET_BYTES = 32


@dataclass(frozen=True)
class Caller:
    """The API key with which a request was sent.

    Attributes:
        key: id of the key.
        owner: owner of the datasets and jobs created with the key; several keys may have the same owner.
        scopes: read, write, or admin, which includes both, sees the data of all owners, and manages keys.
    """

    key: str
    owner: str
    scopes: frozenset[str]

    def may(self, scope: Scope) -> bool:
        """Return whether the key permits requests of this ``scope``."""
        return scope in self.scopes or "admin" in self.scopes


# Name of the caller in the ASGI scope, for the middleware outside the authentication.
CALLER_IN_SCOPE = "wingfit.caller"
# None where no key is required, and in the threads that compute.
CALLER: ContextVar[Caller | None] = ContextVar("caller", default=None)


def visible_owner() -> str | None:
    """Return the owner whose rows the caller of this request may see; None: the rows of all owners."""
    caller = CALLER.get()
    return None if caller is None or caller.may("admin") else caller.owner


def owner_of_new() -> str | None:
    """Return the owner of what this request creates; None where no key is required."""
    caller = CALLER.get()
    return caller.owner if caller else None


class OwnSession(Session):
    """A database session whose queries return only the rows that the caller of the request may see."""


@event.listens_for(OwnSession, "do_orm_execute")
def _only_own(state: ORMExecuteState) -> None:
    owner = visible_owner()
    if owner is not None:
        mine = with_loader_criteria(OwnedRow, lambda table: table.owner == owner, include_aliases=True)
        state.statement = state.statement.options(mine)


class KeyRing:
    """The valid API keys, held in memory; finds the caller to whom a secret belongs by the secret's hash."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._callers: dict[str, Caller] = {}
        self._ids: frozenset[str] = frozenset()

    def load(self, session: Session) -> None:
        """Replace the keys by those that are valid now; ``session`` must not have read anything yet."""
        with self._lock:  # around the query, so that an older result cannot overwrite a newer one
            rows = session.scalars(select(KeyRow).where(KeyRow.revoked_at.is_(None)))
            self._callers = {row.sha256: Caller(row.id, row.owner, frozenset(row.scopes)) for row in rows}
            self._ids = frozenset(caller.key for caller in self._callers.values())

    def caller(self, secret: str) -> Caller | None:
        """Return the caller whose key has this secret; None if no valid key has it."""
        return self._callers.get(digest(secret))

    def admits(self, caller: Caller | None) -> bool:
        """Return whether the key of ``caller`` is still valid; True for None, where no key is required."""
        return caller is None or caller.key in self._ids


def new_secret() -> str:
    """Return a new random secret that nobody can guess."""
    return SECRET_PREFIX + secrets.token_urlsafe(SECRET_BYTES)


def digest(secret: str) -> str:
    """Return the hash of a secret as it is stored (SHA-256, hexadecimal)."""
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()
