"""Small pieces that the routes share: documented errors, repeated requests, answers sent once."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import Header, Query, Request
from pydantic_core import to_json
from sqlalchemy.orm import Session
from starlette.responses import JSONResponse, Response

from wingfit.service.auth.access import CALLER
from wingfit.service.http import problems
from wingfit.service.http.problems import error_item, invalid
from wingfit.service.storage import store
from wingfit.service.storage.database import Database

PAGE, LARGEST_PAGE = 50, 200
HISTORY_PAGE, LARGEST_HISTORY_PAGE = 1000, 10_000
LARGEST_INTEGER = 2**53 - 1  # that every reader of JSON takes

Limit = Annotated[int, Query(ge=1, le=LARGEST_PAGE, description="items on a page")]
Cursor = Annotated[str | None, Query(max_length=200, description="next_cursor of the last page")]
RepeatKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="names this request: the same key and body give the same answer again",
    ),
]
IfNoneMatch = Annotated[str | None, Header(alias="If-None-Match", description="the ETag that the caller has")]

Responses = dict[int | str, dict[str, Any]]
JSON = "application/json"
LOCATION = {"Location": {"description": "where it is", "schema": {"type": "string"}}}


def errors(*statuses: int) -> Responses:
    """Documents the problems that a route may answer with; `default` stands for those of every route."""
    content = {problems.MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    documented: Responses = {
        status: {"description": HTTPStatus(status).phrase, "content": content} for status in (422, *statuses)
    }
    documented["default"] = {
        "description": (
            "host (400), key (401), scope or origin (403), size (413), internal (500), busy or ending (503), "
            "disk full (507)"
        ),
        "headers": {"Retry-After": {"description": "of a 503: seconds", "schema": {"type": "integer"}}},
        "content": content,
    }
    return documented


async def refuse_unknown_query(request: Request) -> None:
    """A 422 for a query parameter that the route does not have: a misspelt one would be ignored in silence."""
    path = getattr(request.scope.get("route"), "path", "")
    if not request.query_params:
        return
    operation = request.app.openapi()["paths"].get(path, {}).get(request.method.lower())
    if operation is None:
        return
    known = {one["name"] for one in operation.get("parameters", ()) if one["in"] == "query"}
    faults = [
        error_item(f"query.{name[:200]}", value, f"unknown; known are {', '.join(sorted(known)) or 'none'}")
        for name, value in request.query_params.multi_items()
        if name not in known
    ]
    if faults:
        raise invalid("the request has query parameters that do not exist here", faults)


def repeat(request: Request, key: str | None, *parts: str) -> store.Repeat | None:
    """What makes a request the same as an earlier one with the same key."""
    if key is None:
        return None
    caller = CALLER.get()
    path = f"{request.url.path} of {caller.owner}" if caller else request.url.path
    return store.Repeat(path, key, hashlib.sha256(json.dumps(parts).encode()).hexdigest())


def created(
    database: Database, again: store.Repeat | None, create: Callable[[Session], store.Answer]
) -> tuple[store.Answer, bool]:
    """Create once: the answer, and whether it is new. Creation and answer are one transaction."""
    with database.write() as session:
        earlier = store.earlier_answer(session, again)
        if earlier:
            return earlier, False
        answer = create(session)
        store.keep_answer(session, again, answer)
    return answer, True


def sent(answer: store.Answer) -> Response:
    """``answer`` on the wire."""
    return JSONResponse(answer.body, answer.status, {"Location": answer.location})


def tagged(answer: object, known: str | None) -> Response:
    """``answer`` as JSON with an ETag, or 304 when the caller has it."""
    return marked(to_json(answer), JSON, known)


def json_of(body: bytes) -> Response:
    """``body``, which is JSON already."""
    return Response(body, media_type=JSON)


def marked(body: bytes, media_type: str, known: str | None, headers: Mapping[str, str] | None = None) -> Response:
    """``body`` with an ETag and further ``headers``, or 304 when the caller has it."""
    mark = mark_of(body)
    if matches(known, mark["ETag"]):
        return Response(status_code=304, headers={"ETag": mark["ETag"]})
    return Response(body, media_type=media_type, headers={**mark, **(headers or {})})


def mark_of(body: bytes) -> dict[str, str]:
    """The headers by which who has ``body`` asks whether it is outdated."""
    return {"ETag": f'"{hashlib.sha256(body).hexdigest()[:32]}"', "Cache-Control": "no-cache"}


def attachment(filename: str) -> dict[str, str]:
    """The header by which a browser saves an answer under ``filename``."""
    return {"Content-Disposition": f'attachment; filename="{filename}"'}


def matches(known: str | None, tag: str) -> bool:
    """Whether an ``If-None-Match`` names ``tag``."""
    given = [part.strip().removeprefix("W/") for part in (known or "").split(",")]
    return tag in given or "*" in given
