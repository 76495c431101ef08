"""Sends large bodies in pieces, each once the client has taken the one before.

Handed over whole, a body would wait in the buffer of its connection for as long as the client takes, and the request
would count as answered meanwhile: what bounds the requests under way would not bound the bodies in memory.
"""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send

PIECE = 256 * 2**10


class Pieces:
    """Plain ASGI, like :mod:`wingfit.service.http.request_limits`."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one connection."""
        await self.app(scope, receive, _in_pieces(send))


def _in_pieces(send: Send) -> Send:
    async def sent(message: Message) -> None:
        body = message.get("body", b"")
        if len(body) <= PIECE:
            await send(message)
            return
        view = memoryview(body)
        for start in range(0, len(body), PIECE):
            last = start + PIECE >= len(body)
            more = not last or message.get("more_body", False)
            await send({"type": message["type"], "body": view[start : start + PIECE], "more_body": more})

    return sent
