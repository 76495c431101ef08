"""Errors that nothing else answers, and requests that are given up because the server stops."""

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


class Unforeseen:
    """Answers them without a word about them, with the headers of any answer.

    The framework's own way is to answer outside all other layers, which would leave out their headers, and to let the
    error go on, which ends the connection. This stands outside the guards, whose mistakes it answers as well.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one connection."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        begun, since = False, time.monotonic()

        async def noted(message: Message) -> None:
            nonlocal begun
            begun = begun or message["type"] == "http.response.start"
            await send(message)

        under_way = scope["app"].state.service.under_way
        under_way[id(scope)] = scope["method"], scope["path"], since
        try:
            await self.app(scope, receive, noted)
        except asyncio.CancelledError:  # by the stop of the server alone
            LOG.warning("given up: %s %s, since %.1f s", scope["method"], scope["path"], time.monotonic() - since)
            if not begun:
                await _guarded(problems.response(_STOPPING))(scope, receive, send)
        except Exception as error:
            if begun:
                raise
            await _guarded(problems.of_a_mistake(Request(scope), error))(scope, receive, send)
        finally:
            del under_way[id(scope)]


def _guarded(answer: Response) -> Response:
    answer.headers.update(SECURITY_HEADERS)
    return answer


_STOPPING = ProblemError(
    503,
    "stopping",
    "the service stops before the request was answered, and may have done it or not; repeat it in some seconds, with "
    "the same Idempotency-Key where it had one",
)
