"""Reads which API keys are valid in a backup, and which owners its data have."""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_args

from wingfit.service.auth.access import Scope
from wingfit.service.storage.store import now

TABLES = ("dataset", "run", "diagnosis", "film", "tracking")


class ContentsError(ValueError):
    """Raised for an API key in a backup that wingfit did not make; the message says which."""


@dataclass(frozen=True)
class BackupKey:
    """An API key that is valid in a backup."""

    id: str
    name: str
    owner: str
    scopes: tuple[str, ...]
    created_at: str


@dataclass(frozen=True)
class BackupOwner:
    """Numbers of what one owner has in a backup; owner None: made while no key was required.

    Of films and trackings a backup has the descriptions, without videos and tracks.
    """

    owner: str | None
    datasets: int
    runs: int
    diagnoses: int
    films: int
    trackings: int


@dataclass(frozen=True)
class Contents:
    """Keys and owners in a backup: its valid API keys, oldest first, and the owners of its data, sorted by name."""

    keys: tuple[BackupKey, ...]
    owners: tuple[BackupOwner, ...]


def contents(database: sqlite3.Connection) -> Contents:
    """Read keys and owners in ``database``, whose schema was checked; ContentsError for a key not made by wingfit."""
    return Contents(tuple(_keys(database)), tuple(_owners(database)))


def revoke_keys(database: sqlite3.Connection) -> None:
    """Revoke all API keys in ``database``, a backup that is being restored."""
    if _columns(database, "key"):
        database.execute("UPDATE key SET revoked_at = ? WHERE revoked_at IS NULL", (now(),))


def _keys(database: sqlite3.Connection) -> Iterator[BackupKey]:
    if not _columns(database, "key"):
        return  # a version of wingfit without keys
    rows = database.execute(
        "SELECT id, name, owner, scopes, created_at, sha256, revoked_at FROM key ORDER BY number"
    ).fetchall()
    for *shown, digest, revoked in rows:
        key = _key(shown)
        valid = isinstance(digest, str) and re.fullmatch(r"[0-9a-f]{64}", digest)
        if key is None or not valid or not isinstance(revoked, str | None):
            raise ContentsError(f"its key {str(shown[0])[:40]!a} is none that wingfit made")
        if revoked is None:
            yield key


def _key(values: list[Any]) -> BackupKey | None:
    if not all(isinstance(value, str) for value in values):
        return None
    key_id, name, owner, text, created_at = values
    try:
        scopes = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(scopes, list) or not all(scope in get_args(Scope) for scope in scopes):
        return None
    return BackupKey(key_id, name, owner, tuple(scopes), created_at)


def _owners(database: sqlite3.Connection) -> Iterator[BackupOwner]:
    counts: dict[str | None, dict[str, int]] = {}
    for table in TABLES:
        columns = _columns(database, table)
        if not columns:
            continue
        owner = "owner" if "owner" in columns else "NULL"
        for name, count in database.execute(f"SELECT {owner}, count(*) FROM {table} GROUP BY 1"):  # noqa: S608
            counts.setdefault(name if name is None else str(name), {})[table] = count
    for name in sorted(counts, key=lambda name: (name is not None, name or "")):
        yield BackupOwner(name, *(counts[name].get(table, 0) for table in TABLES))


def _columns(database: sqlite3.Connection, table: str) -> set[str]:
    """Return the names of the columns of ``table``; an empty set if the database has no such table."""
    return {str(name) for (name,) in database.execute("SELECT name FROM pragma_table_info(?)", (table,))}
