"""Clients that read slowly, never, or disconnect hold little memory for a short time and delay nobody else."""

from __future__ import annotations

import asyncio
import hashlib
import logging
import os
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import httpx
import numpy as np
import pytest
from starlette.types import Message, Receive, Scope, Send

from tests.service import toy
from tests.service.conftest import Api, metrics, toy_service
from tests.service.processes import ServerProcess
from wingfit.calibration.result import Comparison
from wingfit.calibration.search import CalibrationSpec
from wingfit.records import Dataset
from wingfit.service.container import Service
from wingfit.service.http import header_limits, request_limits
from wingfit.service.http.concurrency_limit import BACKUPS, MAX_WAITING_BACKUPS, SIMULATIONS
from wingfit.sim.model import Solution

LONG = 120.0  # s, after which the server disconnects a client that does not read, unless that is what is tested
MIB = 2**20


@contextmanager
def reader(port: int, path: str, buffer: int = 4096) -> Iterator[socket.socket]:
    """A client that has asked for ``path``, with a buffer of few bytes."""
    with socket.socket() as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        one.settimeout(20)
        one.connect(("127.0.0.1", port))
        one.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        yield one


def status(one: socket.socket) -> int:
    return int(one.recv(64).split()[1])


def port_of(client: httpx.Client) -> int:
    return int(client.base_url.port or 0)


def eventually(condition: Callable[[], bool], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def answered(client: httpx.Client, path: str) -> None:
    """While the clients that do not read are still connected."""
    assert client.get(path, timeout=LONG / 2).status_code == 200


# -- backups ---------------------------------------------------------------------------------------------------


def copies_held(pid: int) -> list[str]:
    """Copies of the database that the process has open; those that it closes meanwhile may be gone."""
    held = []
    for one in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(OSError):
            held.append(str(one.readlink()))
    return [name for name in held if "copy-" in name]


def test_untaken_backups_are_few_and_end_with_their_clients(tmp_path: Path) -> None:
    with toy_server(tmp_path) as server, ExitStack() as crowd:
        server.api.upload(pad="x" * 30 * MIB)
        readers = [crowd.enter_context(reader(server.port, "/v1/backup")) for _ in range(8)]
        assert status(readers[0]) == 200
        refused = [one for one in readers[1:] if refuses_at_once(one)]
        assert len(refused) == len(readers) - BACKUPS - MAX_WAITING_BACKUPS
        assert len(copies_held(server.process.pid)) == BACKUPS
        answered(server.client, "/v1/health")
        crowd.close()
        eventually(lambda: not copies_held(server.process.pid), 60.0)
        assert server.client.get("/v1/backup").status_code == 200


def refuses_at_once(one: socket.socket) -> bool:
    one.settimeout(0.3)
    try:
        head = one.recv(4096)
    except TimeoutError:
        return False
    assert head.startswith(b"HTTP/1.1 503 ")
    assert b"\r\nretry-after: 5\r\n" in head.lower()
    assert b"backups are waiting" in head
    return True


# -- memory, and who else is served ------------------------------------------------------------------------------


def resident(pid: int) -> float:
    """MiB."""
    (line,) = [line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith("VmRSS")]
    return int(line.split()[1]) / 1024


def test_many_slow_readers_of_a_large_archive_take_little_memory(tmp_path: Path) -> None:
    with toy_server(tmp_path) as server, ExitStack() as crowd:
        archive = toy.archive(pad="x" * 58 * MIB)
        dataset = server.client.post("/v1/datasets", files={"file": ("toy.zip", archive)}).json()["id"]
        path = f"/v1/datasets/{dataset}/archive"
        assert hashlib.sha256(server.client.get(path).content).digest() == hashlib.sha256(archive).digest()
        before = resident(server.process.pid)
        readers = [crowd.enter_context(reader(server.port, path)) for _ in range(100)]
        deadline, most = time.monotonic() + 3.0, 0.0
        while time.monotonic() < deadline:
            answered(server.client, "/v1/health")
            answered(server.client, "/v1/runs?limit=3")
            answered(server.client, "/v1/datasets")
            most = max(most, resident(server.process.pid) - before)
            time.sleep(0.05)
        assert status(readers[0]) == 200
        print(f"100 slow readers take {most:.0f} MiB")
        assert most < 150


def large_comparison(
    _: object, spec: CalibrationSpec, __: Dataset, ___: Mapping[str, float], recording: str
) -> Comparison:
    """One that takes some megabytes as JSON."""
    tracks = np.random.default_rng(1).normal(size=(50_000, 2, 3))
    phase = np.linspace(0, 1, len(tracks))
    return Comparison(recording, phase, ("a", "b"), tracks, tracks, spec.accuracy, Solution(144, 7, 1e-5))


def test_slow_readers_of_simulations_do_not_keep_others_from_simulating(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(toy.ToyEngine, "compare", large_comparison)
    monkeypatch.setattr(header_limits, "SLOW_SECONDS", LONG)
    with toy_service(tmp_path) as (_, api), ExitStack() as crowd:
        run = api.submit(api.upload()["id"])["id"]
        api.finish(run)
        path = f"/v1/runs/{run}/comparison"
        for one in [crowd.enter_context(reader(port_of(api.client), path)) for _ in range(SIMULATIONS)]:
            assert status(one) == 200
        assert len(api.client.get(path, timeout=LONG / 2).content) > 4 * MIB


# -- the slowest client that is waited for ------------------------------------------------------------------------


def read_at(one: socket.socket, bytes_per_second: float, seconds: float) -> int:
    """How much was read until the end, or ``seconds`` have gone; ConnectionError where the server has hung up."""
    began, taken = time.monotonic(), 0
    while (gone := time.monotonic() - began) < seconds:
        piece = one.recv(max(1, min(65536, int(gone * bytes_per_second) - taken)))
        if not piece:
            return taken
        taken += len(piece)
        time.sleep(0.01)
    return taken


@pytest.fixture
def large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Service, Api, str]]:
    """The limits for slow clients a fifteenth, and an archive of 12 MiB."""
    monkeypatch.setattr(header_limits, "SLOW_SECONDS", 1.0)
    monkeypatch.setattr(header_limits, "SLOWEST_BYTES_PER_SECOND", MIB)
    with toy_service(tmp_path) as (service, api):
        yield service, api, f"/v1/datasets/{api.upload(pad='x' * 12 * MIB)['id']}/archive"


def hung_up(api: Api) -> float:
    text = metrics(api.client).text
    return float(text.partition("\nwingfit_slow_clients_total ")[2].split()[0])


def test_the_connection_of_a_slow_client_is_closed(large: tuple[Service, Api, str]) -> None:
    service, api, path = large
    with reader(port_of(api.client), path, 2**18) as one:
        with pytest.raises(ConnectionError):
            read_at(one, 0.3 * MIB, 60.0)
        eventually(lambda: hung_up(api) == 1, 60.0)
        eventually(lambda: service.downloads._free._value == 8, 60.0)


def ask_again_and_again(one: socket.socket, path: str, seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        one.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        time.sleep(0.0005)


def test_the_connection_of_a_client_that_never_reads_is_closed(
    large: tuple[Service, Api, str], caplog: pytest.LogCaptureFixture
) -> None:
    _, api, path = large
    path = path.removesuffix("/archive")
    with reader(port_of(api.client), path) as one:
        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with caplog.at_level(logging.INFO, logger=header_limits.LOG.name), pytest.raises(ConnectionError):
            ask_again_and_again(one, path, 150)
        eventually(lambda: "at least 1024 KiB/s are needed" in caplog.text, 60.0)
    assert hung_up(api) == 1


def test_a_slow_client_that_reads_fast_enough_gets_all(large: tuple[Service, Api, str]) -> None:
    _, api, path = large
    with reader(port_of(api.client), path, 2**18) as one:
        assert read_at(one, 3.0 * MIB, 30.0) > 12 * MIB
    assert hung_up(api) == 0


def test_a_large_body_is_sent_in_chunks() -> None:
    body, sent = os.urandom(2 * request_limits.CHUNK + 5), list[Message]()

    async def app(scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG001
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": body, "more_body": True})
        await send({"type": "http.response.body", "body": body})

    async def send(message: Message) -> None:
        sent.append(message)

    scope: Scope = {"type": "http", "method": "GET", "path": "/", "headers": [(b"host", b"localhost")]}
    asyncio.run(request_limits.RequestLimits(app, ("localhost",), 1)(scope, None, send))  # type: ignore[arg-type]
    bodies = sent[1:]
    assert b"".join(bytes(message["body"]) for message in bodies) == 2 * body
    assert max(len(message["body"]) for message in bodies) == request_limits.CHUNK
    assert [message.get("more_body", False) for message in bodies] == [True] * 5 + [False]


@contextmanager
def toy_server(folder: Path) -> Iterator[ServerProcess]:
    with ServerProcess(folder / "data", ("tests.service.toy_server", "0", f"{LONG}")) as server:
        yield server
