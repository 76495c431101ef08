"""Helpers that the routes share: documentation of errors, repeatable requests (Idempotency-Key), ETags."""

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
LARGEST_INTEGER = 2**53 - 1  # the largest that every JSON parser reads exactly

Limit = Annotated[int, Query(ge=1, le=LARGEST_PAGE, description="number of items on a page")]
Cursor = Annotated[str | None, Query(max_length=4000, description="next_cursor of the page before")]
RepeatKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="names this request: the same key and body have no further effect and give the same answer",
    ),
]
IfNoneMatch = Annotated[str | None, Header(alias="If-None-Match", description="the ETag that the caller has")]

Responses = dict[int | str, dict[str, Any]]
JSON = "application/json"
LOCATION = {"Location": {"description": "path of the new resource", "schema": {"type": "string"}}}


def errors(*statuses: int) -> Responses:
    """Return the OpenAPI description of the problems that a route may answer with.

    ``statuses``: HTTP statuses beside 422; the entry `default` documents those of every route.
    """
    content = {problems.MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    documented: Responses = {
        status: {"description": HTTPStatus(status).phrase, "content": content} for status in (422, *statuses)
    }
    documented["default"] = {
        "description": (
            "host (400), key (401), scope or origin (403), size (413), internal (500), busy or stopping (503), "
            "disk full (507)"
        ),
        "headers": {"Retry-After": {"description": "of a 503: seconds", "schema": {"type": "integer"}}},
        "content": content,
    }
    return documented


async def refuse_unknown_query(request: Request) -> None:
    """Raise a 422 for an unknown query parameter, because a misspelt one would be ignored silently."""
    path = getattr(request.scope.get("route"), "path", "")
    if not request.query_params:
        return
    operation = request.app.openapi()["paths"].get(path, {}).get(request.method.lower())
    if operation is None:
        return
    known = {one["name"] for one in operation.get("parameters", ()) if one["in"] == "query"}
    faults = [
        error_item(f"query.{name[:200]}", value, f"unknown parameter; known: {', '.join(sorted(known)) or 'none'}")
        for name, value in request.query_params.multi_items()
        if name not in known
    ]
    if faults:
        raise invalid("the request has unknown query parameters", faults)


def repeat(request: Request, key: str | None, *parts: str) -> store.Repeat | None:
    """Identify a request by path, owner, Idempotency-Key ``key`` and hash of its body ``parts``; None if no key."""
    if key is None:
        return None
    caller = CALLER.get()
    path = f"{request.url.path} of {caller.owner}" if caller else request.url.path
    return store.Repeat(path, key, hashlib.sha256(json.dumps(parts).encode()).hexdigest())


def created(
    database: Database, again: store.Repeat | None, create: Callable[[Session], store.Answer]
) -> tuple[store.Answer, bool]:
    """Call ``create``, which creates a resource, and store its answer in the same transaction.

    A repetition (``again`` identifies the request) creates nothing. Returns the answer, and whether it is new.
    """
    with database.write() as session:
        earlier = store.earlier_answer(session, again)
        if earlier:
            return earlier, False
        answer = create(session)
        store.keep_answer(session, again, answer)
    return answer, True


def sent(answer: store.Answer) -> Response:
    """Return the HTTP response that sends ``answer``, the answer to a request that created a resource."""
    return JSONResponse(answer.body, answer.status, {"Location": answer.location})


def tagged(answer: object, known: str | None) -> Response:
    """Return ``answer`` as JSON with an ETag; a 304 if the ``If-None-Match`` header ``known`` has this ETag."""
    return marked(to_json(answer), JSON, known)


def marked(body: bytes, media_type: str, known: str | None, headers: Mapping[str, str] | None = None) -> Response:
    """Return ``body`` with an ETag and ``headers``; a 304 if the ``If-None-Match`` header ``known`` has this ETag."""
    tag = f'"{hashlib.sha256(body).hexdigest()[:32]}"'
    if matches(known, tag):
        return Response(status_code=304, headers={"ETag": tag})
    return Response(body, media_type=media_type, headers={"ETag": tag, "Cache-Control": "no-cache", **(headers or {})})


def attachment(filename: str) -> dict[str, str]:
    """Return the header that makes a browser save an answer as ``filename``."""
    return {"Content-Disposition": f'attachment; filename="{filename}"'}


def matches(known: str | None, tag: str) -> bool:
    """Return whether the ``If-None-Match`` header ``known`` contains ``tag`` or "*"."""
    given = [part.strip().removeprefix("W/") for part in (known or "").split(",")]
    return tag in given or "*" in given
