"""Answers the commonest reads before the framework does, which takes longer to find a route than these take to read.

Plain ASGI, within guard and gate. What is asked in any other than the usual form, and all that goes wrong, is left to
the routes, which say so in words.
"""

from __future__ import annotations

import re
import sqlite3
from typing import Any, NamedTuple

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from wingfit.service.http import responses as http
from wingfit.service.http.events import watched
from wingfit.service.http.json_reads import Reading
from wingfit.service.http.problems import ProblemError
from wingfit.service.storage.database import DatabaseClosedError

START = ["", "v1", "runs"]
_PAIR = rb"[a-z_]+=[A-Za-z0-9_-]{1,200}"
QUERY = re.compile(rb"(%b(&%b)*)?" % (_PAIR, _PAIR))


class Template(NamedTuple):
    """Of a path: as which a request is counted."""

    path: str


RUNS, RUN, HISTORY = Template("/v1/runs"), Template("/v1/runs/{run_id}"), Template("/v1/runs/{run_id}/history")
EVENTS = Template("/v1/runs/{run_id}/events")


class UnusualError(Exception):
    """The routes shall answer."""


# For which the routes have words.
LEFT = (UnusualError, ProblemError, DatabaseClosedError, sqlite3.Error)


class Quick:
    """Answers ``GET`` of a run, of a page of runs, of a page of a history, and of the events of a run."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one connection."""
        try:
            answer = _answer(scope)
        except LEFT:
            await self.app(scope, receive, send)
            return
        await answer(scope, receive, send)


def read(path: str, query: bytes, reading: Reading) -> tuple[Template, bytes]:
    """What a ``GET`` of the path is answered with; one of ``LEFT`` where the routes shall answer."""
    place = path.split("/")
    if place[:3] != START:
        raise UnusualError
    asked = _asked(query)
    match place[3:]:
        case []:
            found = RUNS, _runs(reading, asked)
        case [run_id]:
            found = RUN, reading.run(run_id)
        case [run_id, "history"]:
            found = HISTORY, _history(reading, run_id, asked)
        case _:
            raise UnusualError
    if asked:
        raise UnusualError
    return found


def _answer(scope: Scope) -> Response:
    if scope["type"] != "http" or scope["method"] != "GET":
        raise UnusualError
    service, headers = scope["app"].state.service, Headers(scope=scope)
    if scope["path"].endswith("/events"):
        return _events(scope, service, headers.get("Last-Event-ID"))
    scope["route"], body = read(scope["path"], scope["query_string"], service.reading)
    service.shortcut.remember(scope)
    if scope["route"] is RUN:
        return http.marked(body, http.JSON, headers.get("If-None-Match"))
    return http.json_of(body)


def _events(scope: Scope, service: Any, last: str | None) -> Response:
    # After a restart of the server all who watch come at once.
    *start, run_id, _ = scope["path"].split("/")
    if start != START or scope["query_string"]:
        raise UnusualError
    service.reading.run(run_id)  # or there is none that the caller may see
    scope["route"] = EVENTS
    answer: Response = service.events.answer(watched(service.calibrating, run_id), last)
    return answer


def _runs(reading: Reading, asked: dict[str, str]) -> bytes:
    # Filters may look at many rows before they find one, and large pages at much: a thread takes these.
    limit = _whole(asked.pop("limit", str(http.PAGE)), 1, http.PAGE)
    return reading.runs(limit, asked.pop("cursor", None), None, None)


def _history(reading: Reading, run_id: str, asked: dict[str, str]) -> bytes:
    after = _whole(asked.pop("after", "0"), 0, http.LARGEST_INTEGER)
    limit = _whole(asked.pop("limit", str(http.HISTORY_PAGE)), 1, http.HISTORY_PAGE)
    return reading.history(run_id, after, limit)


def _asked(query: bytes) -> dict[str, str]:
    if not QUERY.fullmatch(query):
        raise UnusualError
    return dict(pair.split("=") for pair in query.decode().split("&")) if query else {}


def _whole(text: str, least: int, most: int) -> int:
    if not text.isdecimal() or not least <= int(text) <= most:
        raise UnusualError
    return int(text)
