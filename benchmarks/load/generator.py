"""The load generator: one process that sends reads and follows event streams while a run is computed.

Reads are due at even intervals whether the server keeps up or not (an open loop), and each is timed from when it was
due. So a late answer also lengthens the times of the reads that waited behind it, as it would for users.
"""

from __future__ import annotations

import asyncio
import json
import re
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import cast

import uvloop

CONNECTIONS = 64
EVENT = re.compile(rb"id: \d+\nevent: (\w+)\ndata: (\{.*\})\n\n")
FINAL = frozenset({"SUCCEEDED", "FAILED", "CANCELLED"})
LONGEST_SECONDS = 900.0
LAST_SECONDS = 5.0  # longest wait for the last answers after the end of the run
HEAD_END = b"\r\n\r\n"
LENGTH = re.compile(rb"\r\ncontent-length: *(\d+)\r", re.IGNORECASE)


@dataclass(frozen=True)
class Traffic:
    """The requests to send to a server until a run ends.

    Attributes:
        port: port of the server.
        run: id of the run whose events are streamed.
        watchers: number of event streams of that run.
        rate: reads per second; 0 for none.
        paths: URL paths to read, one after the other, repeated.
    """

    port: int
    run: str
    watchers: int
    rate: float = 0.0
    paths: Sequence[str] = ()


@dataclass
class Observed:
    """Measurements of the load generator during one run.

    Attributes:
        seconds: duration of the load.
        reading_seconds: time during which reads became due.
        latencies: (index of the path, time in s from when the read was due to its answer) of each answer.
        refused: number of answers whose status was not 200.
        unanswered: number of reads that were due and got no answer.
        late: longest delay of this process in noticing that a read was due, s.
        lags: delay (s) of each generation at each event stream, from its computation to its arrival.
        cut: number of event streams that ended before the run did.
        processor_seconds: processor time of this process.
    """

    seconds: float = 0.0
    reading_seconds: float = 0.0
    latencies: list[tuple[int, float]] = field(default_factory=list)
    refused: int = 0
    unanswered: int = 0
    late: float = 0.0
    lags: list[float] = field(default_factory=list)
    cut: int = 0
    processor_seconds: float = 0.0


def generate(traffic: Traffic) -> Observed:
    """Send the reads and follow the event streams of ``traffic`` until its run ends; return the measurements."""
    start, took = time.monotonic(), time.process_time()
    observed = uvloop.run(asyncio.wait_for(_generate(traffic), LONGEST_SECONDS))
    observed.seconds, observed.processor_seconds = time.monotonic() - start, time.process_time() - took
    return observed


async def _generate(traffic: Traffic) -> Observed:
    observed, over = Observed(), asyncio.Event()
    watchers = [Watcher(traffic.port, traffic.run, over) for _ in range(traffic.watchers)]
    await asyncio.gather(*(watcher.connect() for watcher in watchers))
    if traffic.rate:
        await Reads(traffic, observed).go(over)
    await asyncio.gather(*(watcher.ended for watcher in watchers))
    for watcher in watchers:
        observed.lags += watcher.lags()
        observed.cut += watcher.cut
    return observed


# -- reads --------------------------------------------------------------------------------------------------


class Reads:
    """Sends the reads in an open loop: each becomes due at its time, independently of earlier answers.

    ``observed``: where the measurements are stored.
    """

    def __init__(self, traffic: Traffic, observed: Observed) -> None:
        self._traffic, self._observed = traffic, observed
        self._requests = [_request(traffic.port, path) for path in traffic.paths]
        self._idle: list[_Reader] = []
        self._waiting: deque[tuple[int, float]] = deque()
        self._open, self._opening = 0, set[asyncio.Task[object]]()
        self._number = 0

    async def go(self, over: asyncio.Event) -> None:
        """Read until ``over`` is set, then wait up to ``LAST_SECONDS`` for the last answers."""
        self._loop, self._start = asyncio.get_running_loop(), time.monotonic()
        self._tick()
        await over.wait()
        self._next.cancel()
        ended = time.monotonic()
        self._observed.reading_seconds = ended - self._start
        while len(self._observed.latencies) < self._number and time.monotonic() < ended + LAST_SECONDS:
            await asyncio.sleep(0.01)
        self._observed.unanswered = self._number - len(self._observed.latencies)
        for reader in list(self._idle):
            reader.close()

    def _tick(self) -> None:
        """Send the reads that are due, and schedule the next call."""
        now, rate = time.monotonic(), self._traffic.rate
        while (due := self._start + self._number / rate) <= now:
            self._observed.late = max(self._observed.late, now - due)
            self._waiting.append((self._number, due))
            self._number += 1
        self._send()
        # The event loop rounds delays to whole milliseconds; a delay of zero would keep the processor busy.
        self._next = self._loop.call_later(max(due - now, 0.001), self._tick)

    def free(self, reader: _Reader) -> None:
        """Called when the connection ``reader`` can send a request: send the read that has waited longest, if any."""
        self._idle.append(reader)
        self._send()

    def lost(self, reader: _Reader, request: tuple[int, float] | None) -> None:
        """Called when the server closed ``reader``; ``request`` (number, due time), if any, is sent again."""
        self._open -= 1
        if request:
            self._waiting.appendleft(request)
            self._send()
        else:
            self._idle.remove(reader)

    def answered(self, number: int, status: int, seconds: float) -> None:
        """Record that read ``number`` was answered with the HTTP ``status``, ``seconds`` after it was due."""
        self._observed.latencies.append((number % len(self._requests), seconds))
        self._observed.refused += status != 200

    def _send(self) -> None:
        """Send waiting reads on idle connections; if reads still wait, open one more connection, up to CONNECTIONS."""
        while self._waiting and self._idle:
            number, due = self._waiting.popleft()
            self._idle.pop().send(self._requests[number % len(self._requests)], number, due)
        if self._waiting and self._open < CONNECTIONS:
            self._open += 1
            loop = asyncio.get_running_loop()
            opening = loop.create_task(loop.create_connection(lambda: _Reader(self), "127.0.0.1", self._traffic.port))
            self._opening.add(opening)
            opening.add_done_callback(self._opening.discard)


class _Reader(asyncio.Protocol):
    """One persistent HTTP connection, which sends one read at a time."""

    def __init__(self, reads: Reads) -> None:
        self._reads = reads
        self._pending: tuple[int, float] | None = None
        self._data = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Report that the connection can send a request."""
        self._transport = cast(asyncio.Transport, transport)
        self._reads.free(self)

    def send(self, request: bytes, number: int, due: float) -> None:
        """Send ``request``, the bytes of read ``number``, which was due at the time ``due`` (``time.monotonic``)."""
        self._pending, self._data = (number, due), b""
        self._transport.write(request)

    def data_received(self, data: bytes) -> None:
        """Receive a part of an answer, and report the answer once it is complete."""
        self._data = self._data + data if self._data else data
        status = answered(self._data)
        if status and self._pending:
            number, due = self._pending
            self._pending = None
            self._reads.answered(number, status, time.monotonic() - due)
            self._reads.free(self)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002  as asyncio calls it
        """Report that the connection is closed."""
        self._reads.lost(self, self._pending)

    def close(self) -> None:
        """Close the connection."""
        self._transport.close()


def answered(data: bytes) -> int:
    """Return the HTTP status of the answer in the received bytes ``data``; 0 while the answer is incomplete."""
    end = data.find(HEAD_END)
    length = LENGTH.search(data, 0, end + 2) if end > 0 else None
    return int(data[9:12]) if length and len(data) - end - len(HEAD_END) >= int(length[1]) else 0


def _request(port: int, path: str) -> bytes:
    return f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nAccept: application/json\r\n\r\n".encode()


# -- event streams -----------------------------------------------------------------------------------------------


class Watcher(asyncio.Protocol):
    """Connection to one event stream of a run.

    For each generation it measures the delay from the end of its computation (the run's ``started_at`` plus the
    generation's ``elapsed_seconds``, by the server's clock), over its storage on disk, to its arrival here. ``over`` is
    set when the stream ends.
    """

    def __init__(self, port: int, run: str, over: asyncio.Event) -> None:
        self._port, self._run, self._over = port, run, over
        self._data = b""
        self._arrived: list[tuple[float, bytes]] = []
        self._live = False
        self._state: dict[str, object] = {}
        self.ended = asyncio.get_running_loop().create_future()

    @property
    def cut(self) -> bool:
        """Whether the stream ended before the run did."""
        return self._state.get("state") not in FINAL

    async def connect(self) -> None:
        """Open the connection."""
        await asyncio.get_running_loop().create_connection(lambda: self, "127.0.0.1", self._port)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Request the events."""
        self._transport = cast(asyncio.Transport, transport)
        self._transport.write(_request(self._port, f"/v1/runs/{self._run}/events"))

    def data_received(self, data: bytes) -> None:
        """Store each generation with its time of arrival; close the stream once the run has ended."""
        now = time.time()
        self._data += data
        end = 0
        for event in EVENT.finditer(self._data):
            end = event.end()
            if event[1] == b"state":
                self._state, self._live = json.loads(event[2]), True
            elif self._live:  # earlier generations were computed before the stream start
                self._arrived.append((now, event[2]))
        self._data = self._data[end:]
        if not self.cut:
            self._transport.close()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002  as asyncio calls it
        """Signal that the stream has ended."""
        self._over.set()
        if not self.ended.done():
            self.ended.set_result(None)

    def lags(self) -> list[float]:
        """Return the delay (s) of each generation, from its computation to its arrival here."""
        started = self._state.get("started_at")
        if not isinstance(started, str):
            return []
        start = datetime.fromisoformat(started).timestamp()
        return [arrived - start - json.loads(data)["elapsed_seconds"] for arrived, data in self._arrived]
