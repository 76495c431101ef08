"""Answers a read that comes with the same headers as one before, below the framework.

A client sends the headers of its requests again and again, byte for byte. Once guard and gate have let a quick read
pass, its headers are remembered with who asked. A quick read that comes with them again is let in as that one was,
without being parsed. For these reads guard and gate look at nothing but the headers and the keys that are good.
"""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from starlette.types import Scope

from wingfit.service.auth.access import CALLER, Caller, KeyRing, calling
from wingfit.service.http import quick, responses
from wingfit.service.http.json_reads import Reading
from wingfit.service.http.request_limits import RAW_HEADERS
from wingfit.service.operations.metrics_and_log import REQUEST, REQUEST_ID, Metrics, new_request, told
from wingfit.service.storage import fail_points

LINE = re.compile(rb"GET (/v1/runs[A-Za-z0-9_/-]{0,250})(?:\?([A-Za-z0-9_&=-]{0,500}))? HTTP/1\.1")
END = b"\r\n\r\n"
MOST, LONGEST = 256, 4096
# On which no answer to these reads depends, but for guard and gate.
HARMLESS = frozenset(
    b"host accept accept-encoding accept-language authorization cache-control connection cookie dnt origin pragma "
    b"priority referer sec-ch-ua sec-ch-ua-mobile sec-ch-ua-platform sec-fetch-dest sec-fetch-mode sec-fetch-site "
    b"sec-gpc user-agent".split()
)
SHORTCUT, BLOCK = "shortcut", "block"  # where they are in the state of server and request
GUARD = b"".join(b"%b: %b\r\n" % header for header in RAW_HEADERS)

Client = tuple[str, int] | None
Fields = Sequence[tuple[bytes, bytes]]


class Block(NamedTuple):
    """The headers of a request, and the keys that were good when it came."""

    headers: bytes
    edition: object


class Shortcut:
    """The headers that were let in, and the way by which they come in again."""

    def __init__(self, reading: Reading, keys: KeyRing, metrics: Metrics) -> None:
        self._reading, self._keys, self._metrics = reading, keys, metrics
        # By a hash, as keys are stored: the headers of a request hold the caller's.
        self._known: dict[bytes, tuple[object, Caller | None]] = {}

    def block(self, data: bytes) -> Block | None:
        """The headers of what came in, if it is one request without a body."""
        if len(data) > LONGEST or not data.startswith(b"GET ") or data.find(END) != len(data) - len(END):
            return None
        return Block(data.partition(b"\r\n")[2], self._keys.edition)

    def remember(self, scope: Scope) -> None:
        """Let in what comes with the headers of a request that guard and gate have let in."""
        block: Block | None = scope.get("state", {}).get(BLOCK)
        if block is None or not _harmless(scope["headers"], block.headers):
            return
        if len(self._known) >= MOST:
            self._known.clear()
        self._known[_digest(block.headers)] = block.edition, CALLER.get()

    def answer(self, data: bytes, own: Fields, client: Client) -> bytes | None:
        """What a request is answered with, after the ``own`` headers of the server; None where it must be parsed."""
        began = time.perf_counter()
        line, _, headers = data.partition(b"\r\n")
        match = LINE.fullmatch(line)
        if match is None:
            return None
        edition, caller = self._known.get(_digest(headers), (None, None))
        if edition is not self._keys.edition:
            return None
        path = match[1].decode()
        try:
            with calling(caller):
                template, body = quick.read(path, match[2] or b"", self._reading)
        except Exception:
            return None  # whatever it is, the framework meets with it as well, and has words for it
        request = new_request()
        fail_points.passing("answer")
        seconds = time.perf_counter() - began
        self._metrics.count("GET", template.path, 200, seconds)
        token = REQUEST.set(request)
        try:
            told({"method": "GET", "path": path, "client": client}, 200, seconds)
        finally:
            REQUEST.reset(token)
        mark = responses.mark_of(body) if template is quick.RUN else {}
        return _raw(body, own, mark | {"Content-Type": responses.JSON, REQUEST_ID: request})


def _harmless(fields: Fields, headers: bytes) -> bool:
    # As many fields as lines: what was parsed is the whole block, line by line, should the parser ever become lenient.
    return (
        headers.count(b"\n") == len(fields) + 1
        and all(name in HARMLESS for name, _ in fields)
        and all(value.lower() == b"keep-alive" for name, value in fields if name == b"connection")
    )


def _digest(headers: bytes) -> bytes:
    return hashlib.sha256(headers).digest()


def _raw(body: bytes, own: Fields, fields: Mapping[str, str]) -> bytes:
    lines = [b"%b: %b\r\n" % field for field in own]
    lines += [f"{name.lower()}: {value}\r\n".encode() for name, value in fields.items()]
    return b"HTTP/1.1 200 OK\r\n%b%bcontent-length: %d\r\n\r\n%b" % (b"".join(lines), GUARD, len(body), body)
