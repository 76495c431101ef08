"""Creates, lists and revokes API keys in the caller's database session."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from wingfit.service.auth.access import Scope, digest, new_secret
from wingfit.service.http.problems import conflict
from wingfit.service.storage import store
from wingfit.service.storage.tables import KeyRow


def make(session: Session, name: str, owner: str, scopes: Sequence[Scope]) -> tuple[KeyRow, str]:
    """Store a new key and return its row and its secret; the secret itself is not stored."""
    secret = new_secret()
    row = KeyRow(id=store.new_id("key"), name=name, owner=owner, scopes=sorted(set(scopes)))
    row.sha256, row.created_at = digest(secret), store.now()
    session.add(row)
    session.flush()
    return row, secret


def every(session: Session) -> list[KeyRow]:
    """Return all keys, including revoked ones, newest first."""
    return list(session.scalars(select(KeyRow).order_by(KeyRow.number.desc())))


def revoke(session: Session, key_id: str) -> KeyRow:
    """Revoke a key and return its row; raise a 404 if there is none, a 409 for the last key that can manage keys."""
    row = store.one(session, KeyRow, key_id)
    others = [key for key in every(session) if key.revoked_at is None and key.id != key_id]
    if "admin" in row.scopes and row.revoked_at is None and not any("admin" in key.scopes for key in others):
        raise conflict(f"{key_id} is the last key that can manage keys; make another key with the scope admin first")
    row.revoked_at = row.revoked_at or store.now()
    return row
