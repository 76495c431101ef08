"""Checks that a backup, which is not trusted, has exactly the database schema of its version of wingfit.

SQL in a schema (triggers, views, virtual tables, checks, defaults) would run in the server when it uses the tables.
Therefore every table, index, trigger and view is compared with those of an empty database of the same version.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from sqlalchemy import create_engine
from sqlalchemy.pool import StaticPool

from wingfit.service.storage.database import migrate, revisions

OBJECTS = "SELECT type, name, tbl_name, sql FROM sqlite_master ORDER BY type, name LIMIT 1000"
VERSION = ("table", "alembic_version")
# Tokens of SQL: quoted strings, quoted names, words, and every other character.
TOKENS = re.compile(r"""'(?:[^']|'')*'|"\w+"|`\w+`|\[\w+\]|\w+|\S""", re.ASCII)

Objects = dict[tuple[str, str], tuple[str, tuple[str, ...]]]


class SchemaError(ValueError):
    """Raised for a schema that wingfit does not make; the message names the difference."""


def check_schema(database: sqlite3.Connection) -> None:
    """Raise SchemaError unless the schema is exactly that of the schema version that the database states."""
    rows = database.execute(OBJECTS).fetchall()
    present = _objects(rows)
    if len(present) != len(rows):  # SQLite uses the SQL of each, whatever its name
        raise SchemaError("it lists an object of its schema twice")
    expected = _expected("head")
    if present.get(VERSION) != expected[VERSION]:  # before it is read: it could be a view
        raise SchemaError("it has no table alembic_version as wingfit makes it")
    expected = _expected(_version(database))
    for kind, name in sorted(present.keys() ^ expected.keys(), key=repr):
        verb = "has" if (kind, name) in present else "does not have"
        raise SchemaError(f"it {verb} the {kind} {name!a}, unlike what wingfit makes")
    for kind, name in sorted(expected):
        if present[kind, name] != expected[kind, name]:
            raise SchemaError(f"its {kind} {name!a} is not as wingfit makes it")


def _version(database: sqlite3.Connection) -> str:
    versions = database.execute("SELECT version_num FROM alembic_version").fetchall()
    if len(versions) != 1:
        raise SchemaError(f"it states {len(versions)} versions of its schema instead of one")
    (version,) = versions[0]
    known = revisions()
    if version not in known:
        raise SchemaError(
            f"a newer wingfit wrote it (schema {version!a}; this one knows {known[-1]}): install the newer wingfit"
        )
    return str(version)


@lru_cache
def _expected(revision: str) -> Objects:
    """Return the tables, indices, triggers and views of an empty database whose schema version is ``revision``."""
    engine = create_engine("sqlite://", poolclass=StaticPool)
    try:
        migrate(engine, revision)
        with engine.connect() as connection:
            return _objects([tuple(row) for row in connection.exec_driver_sql(OBJECTS)])
    finally:
        engine.dispose()


def _objects(rows: Sequence[Sequence[Any]]) -> Objects:
    return {(kind, name): (table, _normal(str(sql))) for kind, name, table, sql in rows}


def _normal(sql: str) -> tuple[str, ...]:
    """Split ``sql`` into tokens, names unquoted and in upper case, so that equivalent schemas give equal tokens."""
    return tuple(token if token[0] == "'" else token.strip('"`[]').upper() or token for token in TOKENS.findall(sql))
