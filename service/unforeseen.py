"""Errors that nothing else answers."""

from __future__ import annotations

from fastapi import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service import problems
from service.guard import SECURITY_HEADERS


class Unforeseen:
    """Answers them without a word about them, with the headers of any answer.

    The framework's own way is to answer outside all other layers, which would leave out their headers, and to let the
    error go on, which ends the connection. This stands outside the guards, whose mistakes it answers as well.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one connection."""
        begun = False

        async def noted(message: Message) -> None:
            nonlocal begun
            begun = begun or message["type"] == "http.response.start"
            await send(message)

        try:
            await self.app(scope, receive, noted)
        except Exception as error:
            if begun or scope["type"] != "http":
                raise
            answer = problems.of_a_mistake(Request(scope), error)
            answer.headers.update(SECURITY_HEADERS)
            await answer(scope, receive, send)
