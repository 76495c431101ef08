"""Those who read and watch while a run is computed: one light process, so that it takes little from what it measures.

Reads are due at even intervals, whether the server keeps up or not, and each is timed from when it was due. So an
answer that comes late also delays those that it kept waiting, as for people it would.
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
LAST_SECONDS = 5.0  # in which the last answers may come
HEAD_END = b"\r\n\r\n"
LENGTH = re.compile(rb"\r\ncontent-length: *(\d+)\r", re.IGNORECASE)


@dataclass(frozen=True)
class Crowd:
    """What is asked of a server until a run ends.

    Attributes:
        port: of the server.
        run: id of the run that is watched.
        watchers: number of those who watch it.
        rate: reads per second; 0 for none.
        paths: what is read, one after the other, again and again.
    """

    port: int
    run: str
    watchers: int
    rate: float = 0.0
    paths: Sequence[str] = ()


@dataclass
class Told:
    """What the crowd met with.

    Attributes:
        seconds: that the visit took.
        reading_seconds: during which reads became due.
        latencies: of each answer, s, from when it was due; by number of its path.
        refused: answers that were not 200.
        unanswered: reads that were due and had no answer in the end.
        late: the longest that this process itself was late in noticing that a read was due, s.
        lags: of each generation at each watcher, s.
        cut: streams that ended before their run.
        processor_seconds: that this process took.
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


def visit(crowd: Crowd) -> Told:
    """Read and watch until the run ends."""
    began, took = time.monotonic(), time.process_time()
    told = uvloop.run(asyncio.wait_for(_visit(crowd), LONGEST_SECONDS))
    told.seconds, told.processor_seconds = time.monotonic() - began, time.process_time() - took
    return told


async def _visit(crowd: Crowd) -> Told:
    told, over = Told(), asyncio.Event()
    watchers = [Watcher(crowd.port, crowd.run, over) for _ in range(crowd.watchers)]
    await asyncio.gather(*(watcher.connect() for watcher in watchers))
    if crowd.rate:
        await Reads(crowd, told).go(over)
    await asyncio.gather(*(watcher.ended for watcher in watchers))
    for watcher in watchers:
        told.lags += watcher.lags()
        told.cut += watcher.cut
    return told


# -- reads --------------------------------------------------------------------------------------------------


class Reads:
    """An open loop: reads become due whatever happens to those before."""

    def __init__(self, crowd: Crowd, told: Told) -> None:
        self._crowd, self._told = crowd, told
        self._requests = [_request(crowd.port, path) for path in crowd.paths]
        self._idle: list[_Reader] = []
        self._waiting: deque[tuple[int, float]] = deque()
        self._open, self._opening = 0, set[asyncio.Task[object]]()
        self._number = 0

    async def go(self, over: asyncio.Event) -> None:
        """Read until it is over, then wait a little for the last answers."""
        self._loop, self._began = asyncio.get_running_loop(), time.monotonic()
        self._tick()
        await over.wait()
        self._next.cancel()
        ended = time.monotonic()
        self._told.reading_seconds = ended - self._began
        while len(self._told.latencies) < self._number and time.monotonic() < ended + LAST_SECONDS:
            await asyncio.sleep(0.01)
        self._told.unanswered = self._number - len(self._told.latencies)
        for reader in list(self._idle):
            reader.close()

    def _tick(self) -> None:
        """Ask what is due by now, and be back when the next is."""
        now, rate = time.monotonic(), self._crowd.rate
        while (due := self._began + self._number / rate) <= now:
            self._told.late = max(self._told.late, now - due)
            self._waiting.append((self._number, due))
            self._number += 1
        self._send()
        # The loop rounds to whole milliseconds, and down to none at all.
        self._next = self._loop.call_later(max(due - now, 0.001), self._tick)

    def free(self, reader: _Reader) -> None:
        """``reader`` can ask."""
        self._idle.append(reader)
        self._send()

    def lost(self, reader: _Reader, asked: tuple[int, float] | None) -> None:
        """The server hung up, as it does after some seconds; what was just ``asked`` is asked again, as clients do."""
        self._open -= 1
        if asked:
            self._waiting.appendleft(asked)
            self._send()
        else:
            self._idle.remove(reader)

    def answered(self, number: int, status: int, seconds: float) -> None:
        """An answer came, so long after it was due."""
        self._told.latencies.append((number % len(self._requests), seconds))
        self._told.refused += status != 200

    def _send(self) -> None:
        while self._waiting and self._idle:
            number, due = self._waiting.popleft()
            self._idle.pop().ask(self._requests[number % len(self._requests)], number, due)
        if self._waiting and self._open < CONNECTIONS:
            self._open += 1
            loop = asyncio.get_running_loop()
            opening = loop.create_task(loop.create_connection(lambda: _Reader(self), "127.0.0.1", self._crowd.port))
            self._opening.add(opening)
            opening.add_done_callback(self._opening.discard)


class _Reader(asyncio.Protocol):
    """One connection, kept alive."""

    def __init__(self, reads: Reads) -> None:
        self._reads = reads
        self._asked: tuple[int, float] | None = None
        self._data = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Be ready."""
        self._transport = cast(asyncio.Transport, transport)
        self._reads.free(self)

    def ask(self, request: bytes, number: int, due: float) -> None:
        """Send a request."""
        self._asked, self._data = (number, due), b""
        self._transport.write(request)

    def data_received(self, data: bytes) -> None:
        """Take a part of the answer."""
        self._data = self._data + data if self._data else data
        status = answered(self._data)
        if status and self._asked:
            number, due = self._asked
            self._asked = None
            self._reads.answered(number, status, time.monotonic() - due)
            self._reads.free(self)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002  as asyncio calls it
        """Be no more."""
        self._reads.lost(self, self._asked)

    def close(self) -> None:
        """Hang up."""
        self._transport.close()


def answered(data: bytes) -> int:
    """Status of the answer that is in ``data``, 0 while it is not all there."""
    end = data.find(HEAD_END)
    length = LENGTH.search(data, 0, end + 2) if end > 0 else None
    return int(data[9:12]) if length and len(data) - end - len(HEAD_END) >= int(length[1]) else 0


def _request(port: int, path: str) -> bytes:
    return f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nAccept: application/json\r\n\r\n".encode()


# -- watching -----------------------------------------------------------------------------------------------


class Watcher(asyncio.Protocol):
    """One who watches a run until its end.

    What is timed is the whole way of a generation: from the end of its computation, which is ``started_at`` of the run
    and ``elapsed_seconds`` of the generation by the server's clock, over its durable storage, until it is here.
    """

    def __init__(self, port: int, run: str, over: asyncio.Event) -> None:
        self._port, self._run, self._over = port, run, over
        self._data = b""
        self._came: list[tuple[float, bytes]] = []
        self._live = False
        self._state: dict[str, object] = {}
        self.ended = asyncio.get_running_loop().create_future()

    @property
    def cut(self) -> bool:
        """Whether the stream ended before the run did."""
        return self._state.get("state") not in FINAL

    async def connect(self) -> None:
        """Begin to watch."""
        await asyncio.get_running_loop().create_connection(lambda: self, "127.0.0.1", self._port)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Ask for the events."""
        self._transport = cast(asyncio.Transport, transport)
        self._transport.write(_request(self._port, f"/v1/runs/{self._run}/events"))

    def data_received(self, data: bytes) -> None:
        """Note when each event came."""
        now = time.time()
        self._data += data
        end = 0
        for event in EVENT.finditer(self._data):
            end = event.end()
            if event[1] == b"state":
                self._state, self._live = json.loads(event[2]), True
            elif self._live:  # what was there before is older than the stream
                self._came.append((now, event[2]))
        self._data = self._data[end:]
        if not self.cut:
            self._transport.close()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002  as asyncio calls it
        """The stream has ended."""
        self._over.set()
        if not self.ended.done():
            self.ended.set_result(None)

    def lags(self) -> list[float]:
        """How long after it was computed each generation came, s."""
        started = self._state.get("started_at")
        if not isinstance(started, str):
            return []
        began = datetime.fromisoformat(started).timestamp()
        return [came - began - json.loads(data)["elapsed_seconds"] for came, data in self._came]
