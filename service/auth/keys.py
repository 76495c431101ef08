"""Making, listing and revoking API keys, in a session of the caller's."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from wingfit.service.auth.access import Scope, digest, new_secret
from wingfit.service.http.problems import conflict, not_found
from wingfit.service.storage import store
from wingfit.service.storage.tables import KeyRow


def make(session: Session, name: str, owner: str, scopes: Sequence[Scope]) -> tuple[KeyRow, str]:
    """A new key and its secret, which is told this once."""
    secret = new_secret()
    row = KeyRow(id=store.new_id("key"), name=name, owner=owner, scopes=sorted(set(scopes)))
    row.sha256, row.created_at = digest(secret), store.now()
    session.add(row)
    session.flush()
    return row, secret


def every(session: Session) -> list[KeyRow]:
    """All keys, also revoked ones, newest first."""
    return list(session.scalars(select(KeyRow).order_by(KeyRow.number.desc())))


def revoke(session: Session, key_id: str) -> KeyRow:
    """Make a key good for nothing; a 409 for the last that can manage keys."""
    row = session.scalar(select(KeyRow).where(KeyRow.id == key_id))
    if row is None:
        raise not_found("key", key_id)
    others = [one for one in every(session) if one.revoked_at is None and one.id != key_id]
    if "admin" in row.scopes and row.revoked_at is None and not any("admin" in one.scopes for one in others):
        raise conflict(f"{key_id} is the last key that can manage keys; make another one with the scope admin first")
    row.revoked_at = row.revoked_at or store.now()
    return row
