"""HTTP as it comes in, parsed by httptools, which collects heads and trailers for as long as they are sent."""

from __future__ import annotations

import asyncio
import fcntl
import logging
import os
import socket
import struct
import sys
import termios
from contextlib import suppress

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from wingfit.service.http.problems import ProblemError, response
from wingfit.service.http.request_limits import RAW_HEADERS
from wingfit.service.http.shortcut import BLOCK, SHORTCUT, Block, Shortcut
from wingfit.service.operations.metrics_and_log import METRICS, Metrics

LOG = logging.getLogger("wingfit.http")
HEAD_LIMIT = 64 * 2**10
# A client that takes less of what waits for it is hung up on: it would hold memory, and the places of others.
SLOWEST_BYTES_PER_SECOND = 16 * 2**10
SLOW_SECONDS = 15.0


class Protocol(HttpToolsProtocol):
    """One connection; what is neither body nor ends within ``HEAD_LIMIT`` bytes is refused: a head, or trailers."""

    _unended = 0
    _between = True  # the end of a request and the beginning of the next
    _block: Block | None = None
    _answered = 0.0
    # While the server waits for the client: since when, and how much was not taken then; in all so far.
    _paused_at = 0.0
    _waiting = 0
    _slow_seconds = 0.0
    _slow_bytes = 0
    _slow_timer: asyncio.TimerHandle | None = None

    def data_received(self, data: bytes) -> None:
        """Take the next bytes of the connection."""
        shortcut: Shortcut | None = self.app_state.get(SHORTCUT) if self._is_at_rest() else None
        if shortcut is not None and self._answer_by(shortcut, data):
            return
        self._block = shortcut.block(data) if shortcut else None
        self._unended += len(data)
        super().data_received(data)
        if self._unended > HEAD_LIMIT and not self.transport.is_closing():
            self._refuse(f"the line and headers of the request are longer than {HEAD_LIMIT >> 10} KiB; send less")

    def _is_at_rest(self) -> bool:
        """Whether what comes next is the beginning of a request, and nothing else is to be answered."""
        # An answer may be complete before its request is: what then comes is no request, whatever it looks like.
        busy = not self._between or self.flow.write_paused or self.transport.is_closing()
        return not busy and (self.cycle is None or self.cycle.response_complete)

    def _answer_by(self, shortcut: Shortcut, data: bytes) -> bool:
        answer = shortcut.answer(data, self.server_state.default_headers, self.client)
        if answer is None:
            return False
        self.transport.write(answer)
        self._answered = self.loop.time()
        if self.timeout_keep_alive_task is None:
            self.timeout_keep_alive_handler()
        return True

    def timeout_keep_alive_handler(self) -> None:
        """Hang up, if nothing was asked meanwhile; the timer is not set anew at every short answer."""
        left = self._answered + self.timeout_keep_alive - self.loop.time()
        if left > 0:
            self.timeout_keep_alive_task = self.loop.call_later(left, self.timeout_keep_alive_handler)
        else:
            super().timeout_keep_alive_handler()

    def on_message_begin(self) -> None:
        """Begin what is sent first."""
        super().on_message_begin()
        self._between = False
        self.scope["state"][BLOCK], self._block = self._block, None

    def on_headers_complete(self) -> None:
        """Begin the request."""
        self._unended = 0
        super().on_headers_complete()
        if self.parser.should_upgrade():
            # To what was not agreed on: the parser would take the body for the next request.
            self.cycle.keep_alive = False

    def on_body(self, body: bytes) -> None:
        """Take a part of the body, whose size is watched elsewhere."""
        self._unended = 0
        super().on_body(body)

    def on_message_complete(self) -> None:
        """End it; the next one may follow."""
        self._unended, self._between = 0, True
        super().on_message_complete()

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002  uvicorn's signature
        """Refuse what cannot be parsed."""
        self._refuse("what came is no request of HTTP/1.1 with a known method")

    def pause_writing(self) -> None:
        """Wait for the client, who has not taken what was sent."""
        super().pause_writing()
        if self._slow_timer is None:
            self._paused_at, self._waiting = self.loop.time(), self._untaken()
            self._slow_timer = self.loop.call_later(SLOW_SECONDS - self._slow_seconds, self._judge)

    def resume_writing(self) -> None:
        """Go on: it has."""
        super().resume_writing()
        self._count_taken()

    def connection_lost(self, exc: Exception | None) -> None:
        """End it."""
        if self._slow_timer is not None:
            self._slow_timer.cancel()
        super().connection_lost(exc)

    def _count_taken(self) -> None:
        if self._slow_timer is not None:
            self._slow_timer.cancel()
            self._slow_timer = None
            self._slow_seconds += self.loop.time() - self._paused_at
            self._slow_bytes += self._waiting - self._untaken()

    def _judge(self) -> None:
        """Hang up on a client that was waited for during ``SLOW_SECONDS`` in all, and took too little meanwhile."""
        self._count_taken()
        rate = self._slow_bytes / max(self._slow_seconds, 1e-3)
        self._slow_seconds, self._slow_bytes = 0.0, 0
        if rate >= SLOWEST_BYTES_PER_SECOND:
            self.pause_writing()
            return
        metrics: Metrics | None = self.app_state.get(METRICS)
        if metrics is not None:
            metrics.slow_clients.inc()
        self._forget_untaken()
        self.transport.abort()
        path = self.scope["path"] if self.scope else "a read"  # one that came by the short way was not parsed
        line = "hung up on %s, which took %.1f KiB/s of %s; at least %g KiB/s are needed"
        LOG.info(line, self.client, rate / 2**10, path, SLOWEST_BYTES_PER_SECOND / 2**10)

    def _forget_untaken(self) -> None:
        """Let the operating system drop what waits when the connection is closed; it would keep it for minutes."""
        connection = self.transport.get_extra_info("socket")
        with suppress(OSError, ValueError), socket.socket(fileno=os.dup(connection.fileno())) as same:
            same.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    def _untaken(self) -> int:
        """Bytes that wait for the client: here, and in the buffer of the operating system, which may have megabytes."""
        waiting = self.transport.get_write_buffer_size()
        connection = self.transport.get_extra_info("socket")
        with suppress(OSError, ValueError):  # where it cannot be asked for, or the connection is gone
            left = fcntl.ioctl(connection.fileno(), termios.TIOCOUTQ, b"\0" * 4)
            waiting += int.from_bytes(left, sys.byteorder)
        return waiting

    def _refuse(self, detail: str) -> None:
        """Hang up, with an error in the form of all others: the application has not been asked yet."""
        refusal = response(ProblemError(400, "not-http", detail), {"Connection": "close"})
        lines = [name + b": " + value for name, value in [*refusal.raw_headers, *RAW_HEADERS]]
        self.transport.write(b"\r\n".join([b"HTTP/1.1 400 Bad Request", *lines, b"", bytes(refusal.body)]))
        self.transport.close()
