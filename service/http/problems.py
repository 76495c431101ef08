"""Errors as problem documents (RFC 9457): what is wrong, where in the request, and what to do."""

from __future__ import annotations

import json
import logging
import math
import sqlite3
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from python_multipart.exceptions import FormParserError
from sqlalchemy.exc import OperationalError
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartException
from starlette.responses import Response

from wingfit.service.storage import disk_space
from wingfit.service.storage.database import DatabaseClosedError, is_full

MEDIA_TYPE = "application/problem+json"
LONGEST_VALUE = 200
KINDS = {413: "too-large", 422: "invalid"}
# Seconds after which to repeat the request, by the kind of problems that end by themselves.
RETRY_AFTER = {"busy": 5, "not-ready": 5, "stopping": 5, "disk-full": 30}
LONG_HEADER = "Maximum header size exceeded"  # what the parser of forms says
LOG = logging.getLogger("wingfit.http")

ErrorItem = dict[str, Any]


class ProblemError(Exception):
    """An error that is sent as a problem document.

    Attributes:
        status: HTTP status.
        kind: last part of the document's ``type`` URI, e.g. "not-found".
        detail: what is wrong and what to do, for the user.
        errors: one item for each fault in the request, see :func:`error_item`.
        extra: further members of the document.
    """

    def __init__(self, status: int, kind: str, detail: str, *, errors: Sequence[ErrorItem] = (), **extra: Any) -> None:
        super().__init__(detail)
        self.status, self.kind, self.detail, self.errors, self.extra = status, kind, detail, list(errors), extra


def not_found(what: str, name: str, remedy: str = "") -> ProblemError:
    """Return a 404: there is no ``what`` (e.g. "run") called ``name``; ``remedy``: what to do instead."""
    return ProblemError(404, "not-found", f"there is no {what} {shown(name)!r}{'; ' if remedy else ''}{remedy}")


def conflict(detail: str, **extra: Any) -> ProblemError:
    """Return a 409: the present state of the resource does not allow the request; ``extra``: further members."""
    return ProblemError(409, "conflict", detail, **extra)


def invalid(detail: str, errors: Sequence[ErrorItem]) -> ProblemError:
    """Return a 422: the request is not valid; ``errors``: one item for each fault, see :func:`error_item`."""
    return ProblemError(422, "invalid", detail, errors=errors)


def error_item(where: str, value: object, message: str) -> ErrorItem:
    """Describe one fault: ``where`` in the request (e.g. "body.genes.0"), ``value`` there, what is wrong with it."""
    return {"where": where, "value": shown(value), "message": message}


def shown(value: object) -> object:
    """Return ``value`` in a form that an error message can quote: long texts shortened, and always valid JSON."""
    if value is None or isinstance(value, bool) or (isinstance(value, float) and math.isfinite(value)):
        return value
    if isinstance(value, int) and abs(value) < 2**63:
        return value
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= LONGEST_VALUE else text[:LONGEST_VALUE] + "..."


def response(problem: ProblemError, headers: Mapping[str, str] | None = None) -> Response:
    """Return the HTTP response that sends ``problem``, with further ``headers``."""
    body: dict[str, Any] = {
        "type": f"urn:wingfit:problem:{problem.kind}",
        "title": HTTPStatus(problem.status).phrase,
        "status": problem.status,
        "detail": problem.detail,
        **problem.extra,
    }
    if problem.errors:
        body["errors"] = problem.errors
    retry = {"Retry-After": str(RETRY_AFTER[problem.kind])} if problem.kind in RETRY_AFTER else {}
    # json.dumps writes ASCII, so that a lone surrogate in the request can be repeated.
    return Response(json.dumps(body), problem.status, {**retry, **(headers or {})}, MEDIA_TYPE)


def install(app: FastAPI) -> None:
    """Make ``app`` answer every error with a problem document."""
    app.add_exception_handler(ProblemError, _on_problem)
    app.add_exception_handler(HTTPException, _on_http)
    app.add_exception_handler(RequestValidationError, _on_validation)
    app.add_exception_handler(DatabaseClosedError, _on_closed)
    app.add_exception_handler(OperationalError, _on_operational)
    app.add_exception_handler(sqlite3.OperationalError, _on_operational)


async def _on_problem(_: Request, error: Exception) -> Response:
    assert isinstance(error, ProblemError)  # noqa: S101  # for the type checker; registered for it alone
    return response(error)


async def _on_http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)  # noqa: S101
    if detail := disk_space.while_spooling(error.__cause__):
        return _without_room(request, error.__cause__, detail)
    kind = KINDS.get(error.status_code) or HTTPStatus(error.status_code).phrase.lower().replace(" ", "-")
    return response(ProblemError(error.status_code, kind, _broken_form(error) or str(error.detail)), error.headers)


def _broken_form(error: HTTPException) -> str | None:
    """Say what is wrong with a form that cannot be parsed, and what to do; None if ``error`` has another cause."""
    fault = error.__context__.__cause__ if isinstance(error.__context__, MultiPartException) else None
    if not isinstance(fault, FormParserError):
        return None
    if str(fault) == LONG_HEADER:
        return "the name of a file or field of the form is too long: at most 4 kB; shorten the name"
    return f"the form cannot be read as multipart/form-data: {fault}; send it as 'curl -F file=@PATH' does"


async def _on_validation(_: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)  # noqa: S101
    return response(invalid("the request is invalid", [from_pydantic(item) for item in error.errors()]))


async def _on_closed(_: Request, error: Exception) -> Response:
    return response(ProblemError(503, "stopping", str(error)))


async def _on_operational(request: Request, error: Exception) -> Response:
    if not is_full(error):
        return internal(request, error)
    detail = "the disk of the server is full or fails; nothing was stored. Free some space, and repeat the request"
    return _without_room(request, error, detail)


def _without_room(request: Request, error: BaseException | None, detail: str) -> Response:
    LOG.error("%s %a: %s", request.method, request.scope["path"], error)
    return response(ProblemError(507, "disk-full", detail))


def internal(request: Request, error: Exception) -> Response:
    """Return the response to an unexpected error, and log it: 507 for a full disk, else 500 without details."""
    if detail := disk_space.anywhere(error):
        return _without_room(request, error, detail)
    LOG.error("%s %a failed", request.method, request.scope["path"], exc_info=error)
    return response(ProblemError(500, "internal", "an internal error; the log of the server has the details"))


def from_pydantic(item: Mapping[str, Any]) -> ErrorItem:
    """Convert ``item``, an error of pydantic, to an item of ``errors``, see :func:`error_item`."""
    where = ".".join(str(part) for part in item["loc"])
    value = None if item["type"] == "missing" else item.get("input")
    return error_item(where, value, item["msg"])
