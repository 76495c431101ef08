"""Answers requests whose error nothing else answers, and requests that are abandoned because the server stops."""

from __future__ import annotations

import asyncio
import logging
import time

from fastapi import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wingfit.service.http import problems
from wingfit.service.http.problems import ProblemError
from wingfit.service.http.request_limits import SECURITY_HEADERS

LOG = logging.getLogger("wingfit.http")


class ErrorBoundary:
    """Middleware that answers unexpected errors: without their details, and with the usual security headers.

    Starlette's own handler is outside all other middleware: its answer omits these headers and ends the connection.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request; a connection of another type is passed on."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started, since = False, time.monotonic()

        async def watched(message: Message) -> None:
            nonlocal started
            started = started or message["type"] == "http.response.start"
            await send(message)

        open_requests = scope["app"].state.service.open_requests
        open_requests[id(scope)] = scope["method"], scope["path"], since
        try:
            await self.app(scope, receive, watched)
        except asyncio.CancelledError:  # only when the server stops
            LOG.warning("given up: %s %s, since %.1f s", scope["method"], scope["path"], time.monotonic() - since)
            if not started:
                await _secured(problems.response(_STOPPING))(scope, receive, send)
        except Exception as error:
            if started:
                raise
            await _secured(problems.internal(Request(scope), error))(scope, receive, send)
        finally:
            del open_requests[id(scope)]


def _secured(answer: Response) -> Response:
    answer.headers.update(SECURITY_HEADERS)
    return answer


_STOPPING = ProblemError(
    503,
    "stopping",
    "the service stopped before it answered, and may or may not have carried out the request; repeat the request in "
    "some seconds, with the same Idempotency-Key if it had one",
)
