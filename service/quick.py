"""Answers the commonest reads before the framework does, which takes longer to find a route than these take to read.

Plain ASGI, within guard and gate. What is asked in any other than the usual form, and all that goes wrong, is left to
the routes, which say so in words.
"""

from __future__ import annotations

import re
import sqlite3
from typing import NamedTuple

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from service import http
from service.database import DatabaseClosedError
from service.problems import ProblemError
from service.reading import Reading

START = ["", "v1", "runs"]
_PAIR = rb"[a-z_]+=[A-Za-z0-9_-]{1,200}"
QUERY = re.compile(rb"(%b(&%b)*)?" % (_PAIR, _PAIR))


class Template(NamedTuple):
    """Of a path: as which a request is counted."""

    path: str


class _UnusualError(Exception):
    """The routes shall answer."""


class Quick:
    """Answers ``GET`` of a run, of a page of runs, and of a page of a history."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one connection."""
        try:
            answer = _answer(scope)
        except (_UnusualError, ProblemError, DatabaseClosedError, sqlite3.Error):
            await self.app(scope, receive, send)
            return
        await answer(scope, receive, send)


def _answer(scope: Scope) -> Response:
    if scope["type"] != "http" or scope["method"] != "GET":
        raise _UnusualError
    place = scope["path"].split("/")
    if place[:3] != START:
        raise _UnusualError
    asked, reading = _asked(scope["query_string"]), scope["app"].state.service.reading
    match place[3:]:
        case []:
            path, answer = "/v1/runs", _runs(reading, asked)
        case [run_id]:
            known = Headers(scope=scope).get("If-None-Match")
            path, answer = "/v1/runs/{run_id}", http.marked(reading.run(run_id), http.JSON, known)
        case [run_id, "history"]:
            path, answer = "/v1/runs/{run_id}/history", _history(reading, run_id, asked)
        case _:
            raise _UnusualError
    if asked:
        raise _UnusualError
    scope["route"] = Template(path)
    return answer


def _runs(reading: Reading, asked: dict[str, str]) -> Response:
    # Filters may look at many rows before they find one, and large pages at much: a thread takes these.
    limit = _whole(asked.pop("limit", str(http.PAGE)), 1, http.PAGE)
    return http.json_of(reading.runs(limit, asked.pop("cursor", None), None, None))


def _history(reading: Reading, run_id: str, asked: dict[str, str]) -> Response:
    after = _whole(asked.pop("after", "0"), 0, http.LARGEST_INTEGER)
    limit = _whole(asked.pop("limit", str(http.HISTORY_PAGE)), 1, http.HISTORY_PAGE)
    return http.json_of(reading.history(run_id, after, limit))


def _asked(query: bytes) -> dict[str, str]:
    if not QUERY.fullmatch(query):
        raise _UnusualError
    return dict(pair.split("=") for pair in query.decode().split("&")) if query else {}


def _whole(text: str, least: int, most: int) -> int:
    if not text.isdecimal() or not least <= int(text) <= most:
        raise _UnusualError
    return int(text)
