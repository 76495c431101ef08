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
from wingfit.service.storage.database import Database
from wingfit.service.storage.listing import Wanted
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


def runs(database: Database, wanted: Wanted[RunRow], limit: int, cursor: str | None) -> bytes:
    """Return a page of up to ``limit`` of the runs that are ``wanted`` as JSON.

    ``cursor``: where the page begins (None: at the first run).
    """
    where, values = wanted.conditions()
    beyond, place = wanted.after(cursor)
    owner = visible_owner()
    own = () if owner is None else ("owner = :owner",)
    query = _page_of_runs((*where, *own, *beyond), wanted.expression, wanted.order)
    with database.look() as connection:
        rows = connection.execute(query, {**values, **place, "owner": owner, "rows": limit + 1}).fetchall()
    next_cursor = wanted.cursor(rows[limit - 1][1], rows[limit - 1][0]) if len(rows) > limit else None
    items = b",".join(_run_json(row[2:]) for row in rows[:limit])
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
def _page_of_runs(where: tuple[str, ...], expression: str = "number", order: str = "number DESC") -> str:
    """Return the query of a page; ``expression``: by which it is sorted, for the cursor; ``order``: after ORDER BY."""
    conditions = f"WHERE {' AND '.join(where)}" if where else ""
    columns = f"number, {expression}, {', '.join(RUN)}"
    return f"SELECT {columns} FROM run {conditions} ORDER BY {order} LIMIT :rows"  # noqa: S608


@lru_cache(RUNS_IN_CACHE)
def _run_json(row: tuple[Any, ...]) -> bytes:
    """Return a run as JSON; ``row``: the columns named in RUN. Equal rows give equal JSON, so it is cached."""
    values = dict(zip(RUN, row, strict=True))
    values["spec"] = json.loads(values["spec"])
    return to_json(views.run_of(values))
