"""The TCP forwarder of the containers: bytes both ways, the end of either side, and an unreachable server."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress

import pytest

from tests.oracles.processes import REPOSITORY, free_port

SECONDS = 20.0


@contextmanager
def target() -> Iterator[tuple[int, socket.socket]]:
    with closing(socket.create_server(("127.0.0.1", 0))) as listening:
        listening.settimeout(SECONDS)
        yield listening.getsockname()[1], listening


@contextmanager
def front(target_port: int) -> Iterator[tuple[int, subprocess.Popen[str]]]:
    port = free_port()
    forward = [sys.executable, "-m", "wingfit.service.operations.forward"]
    process = subprocess.Popen(
        [*forward, f"127.0.0.1:{target_port}", "--host=127.0.0.1", f"--port={port}"],
        cwd=REPOSITORY, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        yield port, process
    finally:
        process.kill()
        process.communicate(timeout=SECONDS)


def connect(port: int) -> socket.socket:
    deadline = time.monotonic() + SECONDS
    while time.monotonic() < deadline:
        with suppress(ConnectionRefusedError):
            return socket.create_connection(("127.0.0.1", port), SECONDS)
        time.sleep(0.05)
    raise AssertionError("the forwarder does not listen")


def read_all(connection: socket.socket) -> bytes:
    pieces = []
    while piece := connection.recv(65536):
        pieces.append(piece)
    return b"".join(pieces)


def test_bytes_go_both_ways_and_an_answer_after_the_end_of_the_request() -> None:
    sent, answer = bytes(range(256)) * 20_000, b"answer" * 400_000
    seen = []

    def serve(listening: socket.socket) -> None:
        connection, _ = listening.accept()
        with closing(connection):
            seen.append(read_all(connection))  # ends only if the end of the request is passed on
            connection.sendall(answer)

    with target() as (target_port, listening), front(target_port) as (port, _):
        server = threading.Thread(target=serve, args=(listening,), daemon=True)
        server.start()
        with closing(connect(port)) as client:
            client.sendall(sent)
            client.shutdown(socket.SHUT_WR)
            assert read_all(client) == answer
        server.join(SECONDS)
    assert seen == [sent]


def test_a_client_that_leaves_a_stream_ends_it_at_the_server() -> None:
    """Else the server would keep places for event streams of readers who have gone."""
    with target() as (target_port, listening), front(target_port) as (port, _):
        client = connect(port)
        connection, _ = listening.accept()
        with closing(connection):
            connection.settimeout(SECONDS)
            connection.sendall(b"event")
            assert client.recv(5) == b"event"
            client.close()
            assert connection.recv(1) == b""


def test_an_unreachable_server_is_logged_and_the_next_connection_is_served() -> None:
    away = free_port()
    with front(away) as (port, process):
        with closing(connect(port)) as client:
            assert client.recv(1) == b""
        assert process.stderr
        assert f"cannot reach 127.0.0.1:{away}" in process.stderr.readline()
        with closing(socket.create_server(("127.0.0.1", away))) as listening, closing(connect(port)) as client:
            listening.settimeout(SECONDS)
            connection, _ = listening.accept()
            with closing(connection):
                connection.sendall(b"here")
                assert client.recv(4) == b"here"


@pytest.mark.parametrize("wrong", ["api", "api:", ":8321", "api:http"])
def test_an_invalid_target_is_refused(wrong: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "wingfit.service.operations.forward", wrong],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "write host:port, for example api:8321" in done.stderr
