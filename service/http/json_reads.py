"""What nearly all requests read: a run, a page of runs, a page of a history; from the database straight to JSON.

The object mapper is passed by, which takes longer than all the rest. What was read is kept until something is written.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from pydantic_core import to_json

from wingfit.client.answers import HistoryItem
from wingfit.service.auth.access import whose
from wingfit.service.http.problems import not_found
from wingfit.service.runs import views
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import RunRow

RUN = tuple(column.name for column in RunRow.__table__.columns if column.name not in ("genome", "result"))
ITEM = tuple(HistoryItem.__annotations__)
# What is kept: answers of at most so many bytes, and runs.
ANSWERS, LONGEST, RUNS = 512, 2**16, 2**14

Key = tuple[object, ...]


class Reading:
    """Reads what the caller may see, as JSON."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._kept: dict[Key, tuple[int, bytes]] = {}

    def run(self, run_id: str) -> bytes:
        """A run, or a 404."""

        def read(owner: str | None) -> bytes:
            with self._database.look() as look:
                row = look.execute(_ONE_RUN, {"id": run_id, "owner": owner}).fetchone()
            if row is None:
                raise not_found("run", run_id)
            return _run(row)

        return self._found(read, run_id)

    def runs(self, limit: int, cursor: str | None, dataset_id: str | None, state: str | None) -> bytes:
        """A page of runs, newest first."""

        def read(owner: str | None) -> bytes:
            wanted = {"dataset_id": dataset_id, "state": state, "owner": owner}
            where = [f"{name} = :{name}" for name, value in wanted.items() if value is not None]
            values: dict[str, Any] = wanted | {"most": limit + 1}
            if cursor is not None:
                where, values["before"] = [*where, "number < :before"], store.number(cursor)
            with self._database.look() as look:
                rows = look.execute(_page_of_runs(tuple(where)), values).fetchall()
            following = store.cursor_before(rows[limit - 1][0]) if len(rows) > limit else None
            return _page([_run(row[1:]) for row in rows[:limit]], following)

        return self._found(read, limit, cursor, dataset_id, state)

    def history(self, run_id: str, after: int, limit: int) -> bytes:
        """A page of a run's generations, ascending, or a 404."""

        def read(owner: str | None) -> bytes:
            with self._database.look() as look:
                if look.execute(_IS_THERE, {"id": run_id, "owner": owner}).fetchone() is None:
                    raise not_found("run", run_id)
                rows = look.execute(_HISTORY, (run_id, after, limit + 1)).fetchall()
            items = [dict(zip(ITEM, row, strict=True)) for row in rows[:limit]]
            for item in items:
                item["reasons"] = _reasons(item["reasons"])
            return to_json({"items": items, "next_cursor": str(rows[limit - 1][0]) if len(rows) > limit else None})

        return self._found(read, run_id, after, limit)

    def _found(self, read: Callable[[str | None], bytes], *asked: object) -> bytes:
        """What ``read(owner)`` finds, once as long as nothing is written."""
        # The version from before the read: a write meanwhile makes what is kept outdated, never the reverse.
        owner, version = whose(), self._database.version
        kept = self._kept.get((owner, *asked))
        if kept and kept[0] == version:
            return kept[1]
        found = read(owner)
        if len(self._kept) >= ANSWERS:
            self._kept.clear()
        if len(found) <= LONGEST:
            self._kept[owner, *asked] = version, found
        return found


# Names of columns, and conditions on them, are our own words; values are bound.
_THE_RUN = "FROM run WHERE id = :id AND (:owner IS NULL OR owner = :owner)"
_ONE_RUN, _IS_THERE = f"SELECT {', '.join(RUN)} {_THE_RUN}", f"SELECT 1 {_THE_RUN}"
_HISTORY = f"SELECT {', '.join(ITEM)} FROM generation WHERE run_id = ? AND sequence > ? ORDER BY sequence LIMIT ?"  # noqa: S608


@lru_cache
def _page_of_runs(where: tuple[str, ...]) -> str:
    conditions = f"WHERE {' AND '.join(where)}" if where else ""
    return f"SELECT number, {', '.join(RUN)} FROM run {conditions} ORDER BY number DESC LIMIT :most"  # noqa: S608


@lru_cache(RUNS)
def _run(row: tuple[Any, ...]) -> bytes:
    """A run as JSON; of the same stored values the same."""
    values = dict(zip(RUN, row, strict=True))
    values["spec"] = json.loads(values["spec"])
    return to_json(views.run_of(values))


@lru_cache
def _reasons(stored: str) -> list[str]:
    """Nearly always none."""
    reasons: list[str] = json.loads(stored)
    return reasons


def _page(items: list[bytes], following: str | None) -> bytes:
    return b'{"items":[' + b",".join(items) + b'],"next_cursor":' + json.dumps(following).encode() + b"}"
