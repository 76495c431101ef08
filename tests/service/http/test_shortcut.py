"""Below the framework: the same answers as within it, to the same callers, and nothing that must be parsed."""

from __future__ import annotations

import gc
import logging
import select
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import Any

import httpx
import pytest

from tests.service.conftest import Api, made, toy_service
from tests.service.http.test_json_reads import USUAL
from wingfit.service.container import Service
from wingfit.service.http import shortcut
from wingfit.service.http.header_limits import Protocol
from wingfit.service.operations.metrics_and_log import REQUEST

Answer = tuple[str, dict[str, str], bytes]


class Line:
    """A connection on which every byte is the test's own."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=10.0)
        self._file = self._socket.makefile("rb")
        self.host = f"127.0.0.1:{port}"

    def send(self, data: bytes) -> None:
        self._socket.sendall(data)

    def answer(self) -> Answer:
        status = self._file.readline().decode().strip()
        fields = {}
        while line := self._file.readline().strip():
            name, _, value = line.decode().partition(": ")
            assert name not in fields
            fields[name] = value
        return status, fields, self._file.read(int(fields["content-length"]))

    def until(self, part: bytes) -> None:
        """Take what comes until it has ``part``."""
        taken = b""
        while part not in taken:
            more = self._socket.recv(65536)
            assert more, taken
            taken += more

    def silent(self, seconds: float) -> bool:
        """Whether nothing comes, nor a hanging up."""
        return not select.select([self._socket], [], [], seconds)[0]

    def hung_up(self, seconds: float) -> bool:
        return bool(select.select([self._socket], [], [], seconds)[0]) and not self._socket.recv(1)

    @property
    def name(self) -> Any:
        return self._socket.getsockname()

    def get(self, path: str, *headers: str) -> Answer:
        self.send(self.head(path, *headers))
        return self.answer()

    def head(self, path: str, *headers: str, version: str = "1.1") -> bytes:
        lines = [f"GET {path} HTTP/{version}", f"Host: {self.host}", *headers, "", ""]
        return "\r\n".join(lines).encode()

    def close(self) -> None:
        self._file.close()
        self._socket.close()


class Used:
    """A server with a run that has ended."""

    def __init__(self, service: Service, api: Api) -> None:
        self.service, self.api = service, api
        self.dataset = self.api.upload()["id"]
        self.run = self.api.submit(self.dataset)["id"]
        self.api.finish(self.run)
        self.api.finish(self.api.submit(self.dataset, seed=2)["id"])
        self.port = int(api.client.base_url.port or 0)
        self.short: list[bool] = []
        answer = service.shortcut.answer

        def noted(*asked: Any) -> bytes | None:
            found = answer(*asked)
            self.short.append(found is not None)
            return found

        service.shortcut.answer = noted  # type: ignore[method-assign, assignment]

    def connection(self, line: Line) -> Protocol:
        """The server's end of it."""
        deadline = time.monotonic() + 5.0
        while time.monotonic() < deadline:
            found = [one for one in gc.get_objects() if isinstance(one, Protocol) and one.client == line.name]
            if found:
                return found[0]
        raise AssertionError("the server does not have the connection")

    @contextmanager
    def line(self) -> Iterator[Line]:
        line = Line(self.port)
        self.short.clear()
        try:
            yield line
        finally:
            line.close()

    def path(self, form: str) -> str:
        cursor = self.api.get("/v1/runs?limit=1")["next_cursor"]
        return "/v1/" + form.replace("RUN", self.run).replace("CURSOR", cursor)


def waited(what: Callable[[], object]) -> None:
    deadline = time.monotonic() + 5.0
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Used]:
    with toy_service(tmp_path_factory.mktemp("used")) as (service, api):
        yield Used(service, api)


@pytest.mark.parametrize("form", USUAL)
def test_the_framework_answers_alike(used: Used, form: str) -> None:
    path = used.path(form)
    with used.line() as line:
        first, second = (line.get(path, f"User-Agent: {form}") for _ in range(2))
    assert used.short == [False, True]
    assert first[0] == second[0] == "HTTP/1.1 200 OK"
    assert first[2] == second[2]
    own = {"date", "x-request-id", "server"}
    assert {name: text for name, text in first[1].items() if name not in own} == {
        name: text for name, text in second[1].items() if name not in own
    }
    assert first[1].keys() == second[1].keys()
    assert first[1]["x-request-id"] != second[1]["x-request-id"]


def test_headers_that_were_let_in_are_good_for_all_quick_reads_and_nothing_else(used: Used) -> None:
    with used.line() as line:
        line.get("/v1/runs", "User-Agent: all")
        for path in (f"/v1/runs/{used.run}", f"/v1/runs/{used.run}/history?limit=3"):
            assert line.get(path, "User-Agent: all")[0] == "HTTP/1.1 200 OK"
        assert used.short == [False, True, True]
        for path, status in (
            ("/v1/runs/none", 404), ("/v1/runs?limit=0", 422), ("/v1/health", 200),
            (f"/v1/runs/{used.run}/genome", 200),
            ("/v1/runs/../datasets", 404), ("/v1/runs/%2e%2e", 404), ("/v1/runsx", 404),
        ):  # fmt: skip
            assert line.get(path, "User-Agent: all")[0].split()[1] == str(status), path
        assert not any(used.short[3:])


@pytest.mark.parametrize(
    "headers",
    [
        ["X-Request-ID: mine"], ["If-None-Match: none"], ["Content-Length: 0"], ["Connection: upgrade"], ["Expect: x"],
        ["X-Forwarded-For: 1.2.3.4"], ["User-Agent: " + 5000 * "x"],
    ],
    ids=lambda headers: headers[-1][:20],
)  # fmt: skip
def test_what_an_answer_may_depend_on_is_parsed(used: Used, headers: list[str]) -> None:
    with used.line() as line:
        for _ in range(2):
            line.send(line.head("/v1/runs?limit=1", *headers))
            line.answer()
    assert used.short == [False, False]


def test_what_comes_in_pieces_or_together_is_parsed(used: Used) -> None:
    with used.line() as line:
        head = line.head("/v1/runs?limit=1", "User-Agent: pieces")
        cases = (
            ((head,), [False]),
            ((head + head,), [False]),
            ((head[:20], head[20:]), [False]),
            ((head, head), [True, True]),
        )
        for pieces, short in cases:
            used.short.clear()
            for piece in pieces:
                line.send(piece)
                waited(lambda: used.short)  # the first has come by itself
            for _ in range(sum(map(len, pieces)) // len(head)):
                assert line.answer()[0] == "HTTP/1.1 200 OK"
            assert used.short == short
        used.short.clear()
        line.send(line.head("/v1/runs?limit=1", "User-Agent: pieces", version="1.0"))
        assert line.answer()[0] == "HTTP/1.1 200 OK"
        assert line.hung_up(5.0)
        assert used.short == [False]


def test_what_is_asked_while_another_answer_is_under_way_waits(used: Used) -> None:
    with used.line() as line:
        head = line.head("/v1/runs?limit=1", "User-Agent: waits")
        line.send(head)
        line.answer()
        held = Event()
        used.service.engine.gate = lambda _: held.wait()  # type: ignore[attr-defined]
        run = used.api.submit(used.dataset, seed=3)["id"]
        line.send(line.head(f"/v1/runs/{run}/events", "User-Agent: waits"))
        line.until(b'"state":"RUNNING"')
        used.short.clear()
        line.send(head)
        try:
            assert line.silent(0.3)
            assert used.short == [], "not even tried"
        finally:
            held.set()
    used.api.finish(run)


def test_headers_are_remembered_of_none_but_their_own_request(used: Used) -> None:
    """What comes while an answer is under way is not what is then let in."""
    with used.line() as line:
        line.get("/v1/runs?limit=1", "User-Agent: own")
        for _ in range(2):
            # The first is answered by a thread; the second waits behind it, in a piece of its own.
            line.send(line.head("/v1/runs?limit=2&state=SUCCEEDED", "User-Agent: own"))
            line.send(line.head("/v1/runs?limit=1", "User-Agent: other", "Accept: x"))
            assert [line.answer()[0] for _ in range(2)] == 2 * ["HTTP/1.1 200 OK"]
        assert used.connection(line)._block is None


def test_who_does_not_read_is_sent_no_more(used: Used) -> None:
    with used.line() as line:
        protocol = used.connection(line)
        for _ in range(2):
            line.get("/v1/runs?limit=1", "User-Agent: slow")
        assert used.short == [False, True]
        protocol.loop.call_soon_threadsafe(protocol.pause_writing)
        waited(lambda: protocol.flow.write_paused)
        line.send(line.head("/v1/runs?limit=1", "User-Agent: slow"))
        assert line.silent(0.3)
        protocol.loop.call_soon_threadsafe(protocol.resume_writing)
        assert line.answer()[0] == "HTTP/1.1 200 OK"
        assert used.short == [False, True]


def test_an_upgrade_that_nobody_agreed_to_hides_no_request(used: Used) -> None:
    with used.line() as line:
        hidden = line.head("/v1/runs?limit=1", "User-Agent: hidden")
        line.get("/v1/runs?limit=1", "User-Agent: hidden")
        upgrade = f"POST /v1/runs HTTP/1.1\r\nHost: {line.host}\r\nConnection: Upgrade\r\nUpgrade: x\r\n"
        line.send(f"{upgrade}Content-Length: {len(hidden)}\r\n\r\n".encode() + hidden)
        assert line.answer()[0] != "HTTP/1.1 200 OK"
        assert line.hung_up(5.0)


def test_what_goes_wrong_is_left_to_the_framework(used: Used, monkeypatch: pytest.MonkeyPatch) -> None:
    with used.line() as line:
        path = f"/v1/runs/{used.run}"
        line.get(path, "User-Agent: wrong")

        def fail(*_: object) -> bytes:
            raise ValueError("what is stored cannot be read")

        monkeypatch.setattr(used.service.reading, "run", fail)
        status, _, body = line.get(path, "User-Agent: wrong")
        assert (status.split()[1], b"cannot be read" in body) == ("500", False)
        monkeypatch.undo()
        assert line.get(path, "User-Agent: wrong")[0] == "HTTP/1.1 200 OK"
        assert used.short == [False, False, True]


def test_a_body_is_no_request_whatever_it_looks_like(used: Used) -> None:
    with used.line() as line:
        head = line.head("/v1/runs?limit=1", "User-Agent: body")
        line.send(head)
        line.answer()
        line.send(head)
        line.answer()
        assert used.short == [False, True]
        # Answered before its body has come.
        refused = f"POST /v1/runs HTTP/1.1\r\nHost: {line.host}\r\nContent-Length: {2**21}\r\n\r\n".encode()
        line.send(refused)
        assert line.answer()[0].split()[1] == "413"
        line.send(head)
        assert line.silent(0.3)
    assert used.short == [False, True, False]


def test_requests_by_the_short_way_are_counted_and_logged(used: Used, caplog: pytest.LogCaptureFixture) -> None:
    count = 'wingfit_http_requests_total{method="GET",path="/v1/runs/{run_id}/history",status="200"}'

    def counted() -> float:
        lines = used.api.client.get("/v1/metrics").text.splitlines()
        return next((float(one.rsplit(" ", 1)[1]) for one in lines if one.startswith(count)), 0.0)

    before = counted()
    caplog.handler.addFilter(lambda record: setattr(record, "of_request", REQUEST.get()) or True)  # type: ignore[func-returns-value]
    with used.line() as line, caplog.at_level(logging.INFO, "wingfit.access"):
        ids = [line.get(f"/v1/runs/{used.run}/history", "User-Agent: counted")[1]["x-request-id"] for _ in range(2)]
    assert used.short[:2] == [False, True]
    assert counted() == before + 2
    told = [one for one in caplog.records if one.getMessage() == f"GET /v1/runs/{used.run}/history 200"]
    assert [hasattr(one, "ms") and hasattr(one, "client") for one in told] == [True, True]
    assert [vars(one)["of_request"] for one in told] == ids


def test_what_is_remembered_is_bounded(used: Used) -> None:
    with used.line() as line:
        for number in range(2 * shortcut.MOST):
            line.get("/v1/runs?limit=1", f"User-Agent: {number}")
    assert 0 < len(used.service.shortcut._known) <= shortcut.MOST


@pytest.mark.parametrize("first", ["/v1/runs?limit=1", "/v1/health"])
def test_who_asks_nothing_is_hung_up_on_and_who_asks_is_not(used: Used, first: str) -> None:
    """By the answers that are short as by the others."""
    with used.line() as line:
        line.get("/v1/runs?limit=1", "User-Agent: patient")
    with used.line() as line:
        used.connection(line).timeout_keep_alive = 1.0  # type: ignore[assignment]
        line.get(first, "User-Agent: patient")
        for _ in range(15):
            time.sleep(0.1)
            line.get("/v1/runs?limit=1", "User-Agent: patient")
        assert used.short[-15:] == [True] * 15
        assert line.silent(0.3)
        assert line.hung_up(5.0)


# -- keys ---------------------------------------------------------------------------------------------------


def test_whose_headers_came_in_is_who_asks(tmp_path: Path) -> None:
    secrets = {name: made(tmp_path, name, *scopes) for name, scopes in KEYS.items()}
    with toy_service(tmp_path, require_keys=True) as (service, api):
        client = api.client
        apis = {name: Api(as_key(client, secret)) for name, secret in secrets.items()}
        used = Used(service, apis["ann"])
        for _ in range(3):
            assert [len(apis[name].get("/v1/runs")["items"]) for name in KEYS] == [2, 2, 0]
            assert apis["bob"].client.get(f"/v1/runs/{used.run}").status_code == 404
            assert client.get("/v1/runs").status_code == 401
        assert used.short.count(True) >= 6
        # A key that is not good any more is let in no more, not even in words that were.
        ann = next(key for key in apis["admin"].get("/v1/keys")["items"] if key["name"] == "ann")
        assert apis["admin"].client.delete(f"/v1/keys/{ann['id']}").status_code == 200
        assert apis["ann"].client.get("/v1/runs").status_code == 401
        assert apis["ann"].client.get(f"/v1/runs/{used.run}").status_code == 401
        assert len(apis["admin"].get("/v1/runs")["items"]) == 2


def test_keys_that_change_while_a_request_is_let_in_count(tmp_path: Path) -> None:
    """The request was let in by keys that are good no more, and its headers must not be."""
    with toy_service(tmp_path) as (service, api):
        used = Used(service, api)
        remember = used.service.shortcut.remember

        def late(scope: Any) -> None:
            used.service.load_keys()
            remember(scope)

        used.service.shortcut.remember = late  # type: ignore[method-assign]
        with used.line() as line:
            for _ in range(3):
                line.get("/v1/runs?limit=1", "User-Agent: late")
    assert used.short == [False] * 3


KEYS = {"admin": ["admin"], "ann": ["read", "write"], "bob": ["read", "write"]}


def as_key(client: httpx.Client, secret: str) -> httpx.Client:
    return httpx.Client(base_url=client.base_url, headers={"Authorization": f"Bearer {secret}"}, timeout=20.0)
