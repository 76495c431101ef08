"""uvicorn's HTTP protocol with two limits added: the size of headers and trailers, and how slow a client may be."""

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
from wingfit.service.operations.metrics_and_log import METRICS, Metrics

LOG = logging.getLogger("wingfit.http")
# httptools collects headers and trailers for as long as they are sent.
HEAD_LIMIT = 64 * 2**10
# The connection of a slower client is closed, because it holds memory and one of the limited concurrent requests.
SLOWEST_BYTES_PER_SECOND = 16 * 2**10
SLOW_SECONDS = 15.0


class Protocol(HttpToolsProtocol):
    """One connection. Refuses headers or trailers of more than ``HEAD_LIMIT`` bytes, and closes slow connections.

    A connection is slow if the client receives less than SLOWEST_BYTES_PER_SECOND while the server waits to send.
    """

    _unended = 0
    # While the server waits for the client: since when, and how many bytes were not taken then; totals so far.
    _paused_at = 0.0
    _waiting = 0
    _slow_seconds = 0.0
    _slow_bytes = 0
    _slow_timer: asyncio.TimerHandle | None = None

    def data_received(self, data: bytes) -> None:
        """Parse the next bytes of the connection; refuse the request if its headers are too long."""
        self._unended += len(data)
        super().data_received(data)
        if self._unended > HEAD_LIMIT and not self.transport.is_closing():
            self._refuse(f"the request line and headers are longer than {HEAD_LIMIT >> 10} KiB; send less")

    def on_headers_complete(self) -> None:
        """Begin the request: its headers were received."""
        self._unended = 0
        super().on_headers_complete()
        if self.parser.should_upgrade():
            # No upgrade is supported, and the parser would take the body for the next request.
            self.cycle.keep_alive = False

    def on_body(self, body: bytes) -> None:
        """Receive a part of the request's body; :mod:`wingfit.service.http.request_limits` limits its size."""
        self._unended = 0
        super().on_body(body)

    def on_message_complete(self) -> None:
        """End the request: its body was received, and the next request may follow."""
        self._unended = 0
        super().on_message_complete()

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002  uvicorn's signature
        """Refuse bytes that cannot be parsed as a request."""
        self._refuse("the bytes received are no HTTP/1.1 request with a known method; check the address and the port")

    def pause_writing(self) -> None:
        """Stop writing until the client has received what was sent; start to check how fast it receives."""
        super().pause_writing()
        if self._slow_timer is None:
            self._paused_at, self._waiting = self.loop.time(), self._untaken()
            self._slow_timer = self.loop.call_later(SLOW_SECONDS - self._slow_seconds, self._check_rate)

    def resume_writing(self) -> None:
        """Continue writing: the client has received what was sent."""
        super().resume_writing()
        self._count_taken()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer that checks how fast the client receives."""
        if self._slow_timer is not None:
            self._slow_timer.cancel()
        super().connection_lost(exc)

    def _count_taken(self) -> None:
        if self._slow_timer is not None:
            self._slow_timer.cancel()
            self._slow_timer = None
            self._slow_seconds += self.loop.time() - self._paused_at
            self._slow_bytes += self._waiting - self._untaken()

    def _check_rate(self) -> None:
        """Close the connection if the client received too little while the server waited for SLOW_SECONDS."""
        self._count_taken()
        rate = self._slow_bytes / max(self._slow_seconds, 1e-3)
        self._slow_seconds, self._slow_bytes = 0.0, 0
        if rate >= SLOWEST_BYTES_PER_SECOND:
            self.pause_writing()
            return
        metrics: Metrics | None = self.app_state.get(METRICS)
        if metrics is not None:
            metrics.slow_clients.inc()
        self._discard_untaken()
        self.transport.abort()
        line = "closed the connection of %s, which took %.1f KiB/s of %s; at least %g KiB/s are needed"
        LOG.info(line, self.client, rate / 2**10, self.scope["path"], SLOWEST_BYTES_PER_SECOND / 2**10)

    def _discard_untaken(self) -> None:
        """Make the operating system discard unsent data when the connection closes, not minutes later."""
        connection = self.transport.get_extra_info("socket")
        with suppress(OSError, ValueError), socket.socket(fileno=os.dup(connection.fileno())) as same:
            same.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    def _untaken(self) -> int:
        """Return how many bytes the client has not received: here and in the operating system's send buffer."""
        waiting = self.transport.get_write_buffer_size()
        connection = self.transport.get_extra_info("socket")
        with suppress(OSError, ValueError):  # not supported, or the connection is gone
            left = fcntl.ioctl(connection.fileno(), termios.TIOCOUTQ, b"\0" * 4)
            waiting += int.from_bytes(left, sys.byteorder)
        return waiting

    def _refuse(self, detail: str) -> None:
        """Answer with a problem document (RFC 9457) and close the connection; the application is not called."""
        refusal = response(ProblemError(400, "not-http", detail), {"Connection": "close"})
        lines = [name + b": " + value for name, value in [*refusal.raw_headers, *RAW_HEADERS]]
        self.transport.write(b"\r\n".join([b"HTTP/1.1 400 Bad Request", *lines, b"", bytes(refusal.body)]))
        self.transport.close()
