"""HTTP as it comes in, parsed by httptools, which collects heads and trailers for as long as they are sent."""

from __future__ import annotations

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from service.guard import RAW_HEADERS
from service.problems import ProblemError, response

HEAD_LIMIT = 64 * 2**10


class Protocol(HttpToolsProtocol):
    """One connection; what is neither body nor ends within ``HEAD_LIMIT`` bytes is refused: a head, or trailers."""

    _unended = 0

    def data_received(self, data: bytes) -> None:
        """Take the next bytes of the connection."""
        self._unended += len(data)
        super().data_received(data)
        if self._unended > HEAD_LIMIT and not self.transport.is_closing():
            self._refuse(f"the line and headers of the request are longer than {HEAD_LIMIT >> 10} KiB; send less")

    def on_headers_complete(self) -> None:
        """Begin the request."""
        self._unended = 0
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Take a part of the body, whose size is watched elsewhere."""
        self._unended = 0
        super().on_body(body)

    def on_message_complete(self) -> None:
        """End it; the next one may follow."""
        self._unended = 0
        super().on_message_complete()

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002  uvicorn's signature
        """Refuse what cannot be parsed."""
        self._refuse("what came is no request of HTTP/1.1 with a known method")

    def _refuse(self, detail: str) -> None:
        """Hang up, with an error in the form of all others: the application has not been asked yet."""
        refusal = response(ProblemError(400, "not-http", detail), {"Connection": "close"})
        lines = [name + b": " + value for name, value in [*refusal.raw_headers, *RAW_HEADERS]]
        self.transport.write(b"\r\n".join([b"HTTP/1.1 400 Bad Request", *lines, b"", bytes(refusal.body)]))
        self.transport.close()
