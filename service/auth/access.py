"""Who is calling: API keys, what each may do, and whose data a session sees.

A key is a secret of 256 random bits, so that a plain hash of it cannot be searched. Only that hash is stored. The keys
are kept in memory, because one process owns the database and changes them.
"""

from __future__ import annotations

import hashlib
import secrets
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Literal

from sqlalchemy import event, select
from sqlalchemy.orm import ORMExecuteState, Session, with_loader_criteria

from wingfit.service.storage.tables import KeyRow, OwnedRow

Scope = Literal["read", "write", "admin"]
SECRET_PREFIX = "wingfit_"  # noqa: S105  # by which scanners of leaked secrets know one
SECRET_BYTES = 32


@dataclass(frozen=True)
class Caller:
    """Who sent a request.

    Attributes:
        key: id of the key.
        owner: to whom belongs what the key makes; several keys may have one owner.
        scopes: read, write, or admin, which includes both, sees what others own, and manages keys.
    """

    key: str
    owner: str
    scopes: frozenset[str]

    def may(self, scope: Scope) -> bool:
        """Whether the key is good for ``scope``."""
        return scope in self.scopes or "admin" in self.scopes

    @property
    def sees(self) -> str | None:
        """Whose data the caller sees; None: everyone's."""
        return None if self.may("admin") else self.owner


# Name under which the gate puts the caller into the scope of a request, for the layers outside the gate.
CALLER_OF = "wingfit.caller"
# None where no key is asked for, and in the threads that compute.
CALLER: ContextVar[Caller | None] = ContextVar("caller", default=None)


@contextmanager
def calling(caller: Caller | None) -> Iterator[None]:
    """Within the block ``caller`` is who calls."""
    token = CALLER.set(caller)
    try:
        yield
    finally:
        CALLER.reset(token)


def whose() -> str | None:
    """Whose data may be seen now; None: everyone's."""
    caller = CALLER.get()
    return caller.sees if caller else None


def owner_of_new() -> str | None:
    """To whom belongs what is made now."""
    caller = CALLER.get()
    return caller.owner if caller else None


class OwnSession(Session):
    """A session that sees what its caller may see, whatever it is asked: no route can forget to ask."""


@event.listens_for(OwnSession, "do_orm_execute")
def _only_own(state: ORMExecuteState) -> None:
    owner = whose()
    if owner is not None:
        mine = with_loader_criteria(OwnedRow, lambda table: table.owner == owner, include_aliases=True)
        state.statement = state.statement.options(mine)


class KeyRing:
    """The keys that are good, by the hash of their secret."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._good: dict[str, Caller] = {}
        self._ids: frozenset[str] = frozenset()

    def load(self, session: Session) -> None:
        """Read the keys that are good now; ``session`` has read nothing yet."""
        with self._lock:  # around the reading: what was read before a change must not be kept after it
            rows = session.scalars(select(KeyRow).where(KeyRow.revoked_at.is_(None)))
            self._good = {row.sha256: Caller(row.id, row.owner, frozenset(row.scopes)) for row in rows}
            self._ids = frozenset(caller.key for caller in self._good.values())

    def caller(self, secret: str) -> Caller | None:
        """Whose key it is; None where it is no key, or one that was revoked."""
        return self._good.get(digest(secret))

    def admits(self, caller: Caller | None) -> bool:
        """Whether the key of ``caller`` is still good; True for None, where no key is needed."""
        return caller is None or caller.key in self._ids

    @property
    def edition(self) -> object:
        """Another one when other keys are good."""
        return self._good

    def __len__(self) -> int:
        return len(self._good)


def new_secret() -> str:
    """A secret that nobody can guess."""
    return SECRET_PREFIX + secrets.token_urlsafe(SECRET_BYTES)


def digest(secret: str) -> str:
    """What is stored of a secret."""
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()
