"""The most frequent reads, from the database straight to JSON: a page of runs, a page of a run's history.

They bypass SQLAlchemy's object mapper, which would load and parse the unneeded columns ``genome``, ``result`` and
``rig`` and take longer than all the rest (docs/decisions/0010-reads.md).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from pydantic_core import to_json
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from wingfit.client.answers import HistoryItem
from wingfit.service.auth.access import visible_owner
from wingfit.service.http import responses as http
from wingfit.service.http.problems import not_found
from wingfit.service.runs import views
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import RunRow

RUN = tuple(column.name for column in RunRow.__table__.columns if column.name not in ("genome", "result", "rig"))
ITEM = tuple(HistoryItem.__annotations__)
RUNS_IN_CACHE = 2**14

# Column names and conditions are constants of this module; values are bound.
_WHERE_RUN = "FROM run WHERE id = :id AND (:owner IS NULL OR owner = :owner)"
_RUN_EXISTS = f"SELECT 1 {_WHERE_RUN}"
_HISTORY = f"SELECT {', '.join(ITEM)} FROM generation WHERE run_id = ? AND sequence > ? ORDER BY sequence LIMIT ?"  # noqa: S608


async def answer(read: Callable[[], bytes], *, short: bool) -> Response:
    """Return a response with the JSON that ``read`` returns; ``short``: in the event loop, else in a thread."""
    body = read() if short else await run_in_threadpool(read)
    return Response(body, media_type=http.JSON)


def runs(database: Database, limit: int, cursor: str | None, dataset_id: str | None, state: str | None) -> bytes:
    """Return a page of up to ``limit`` runs as JSON, newest first.

    ``cursor``: where the page begins (None: at the newest); ``dataset_id``, ``state``: of the runs (None: any).
    """
    equal = {"dataset_id": dataset_id, "state": state, "owner": visible_owner()}
    where = [f"{name} = :{name}" for name, value in equal.items() if value is not None]
    values: dict[str, Any] = equal | {"rows": limit + 1}
    if cursor is not None:
        where, values["before"] = [*where, "number < :before"], store.number(cursor)
    with database.look() as connection:
        rows = connection.execute(_page_of_runs(tuple(where)), values).fetchall()
    next_cursor = store.cursor_before(rows[limit - 1][0]) if len(rows) > limit else None
    items = b",".join(_run_json(row[1:]) for row in rows[:limit])
    return b'{"items":[' + items + b'],"next_cursor":' + to_json(next_cursor) + b"}"


def history(database: Database, run_id: str, after: int, limit: int) -> bytes:
    """Return a page of up to ``limit`` generations of a run as JSON, ascending, with sequence numbers above ``after``.

    Raises a 404 if the caller may see no such run.
    """
    with database.look() as connection:
        if connection.execute(_RUN_EXISTS, {"id": run_id, "owner": visible_owner()}).fetchone() is None:
            raise not_found("run", run_id)
        rows = connection.execute(_HISTORY, (run_id, after, limit + 1)).fetchall()
    items = [dict(zip(ITEM, row, strict=True)) for row in rows[:limit]]
    for item in items:
        item["reasons"] = json.loads(item["reasons"])
    return to_json({"items": items, "next_cursor": str(rows[limit - 1][0]) if len(rows) > limit else None})


@lru_cache
def _page_of_runs(where: tuple[str, ...]) -> str:
    conditions = f"WHERE {' AND '.join(where)}" if where else ""
    return f"SELECT number, {', '.join(RUN)} FROM run {conditions} ORDER BY number DESC LIMIT :rows"  # noqa: S608


@lru_cache(RUNS_IN_CACHE)
def _run_json(row: tuple[Any, ...]) -> bytes:
    """Return a run as JSON; ``row``: the columns named in RUN. Equal rows give equal JSON, so it is cached."""
    values = dict(zip(RUN, row, strict=True))
    values["spec"] = json.loads(values["spec"])
    return to_json(views.run_of(values))
