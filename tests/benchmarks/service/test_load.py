"""The load benchmark: times from when a read was due, lags, percentiles, and a filled database."""

from __future__ import annotations

import json
import socketserver
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar

import httpx
import pytest

from benchmarks.load.__main__ import LIMITS, READ, missed
from benchmarks.load.beside import Load, Trial, _figures, per_read_us
from benchmarks.load.figures import milliseconds, percentile
from benchmarks.load.filling import Filled, fill
from benchmarks.load.generator import Observed, Traffic, answered, generate
from benchmarks.load.mix import KINDS, SHARES, reads, walk
from benchmarks.load.pages import timed
from tests.service import toy
from tests.service.conftest import Api, serving
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

Json = dict[str, Any]
RUNS, EACH, LONGEST = 60, 13, 120


@pytest.mark.parametrize(
    ("values", "percent", "found"),
    [
        ([], 99, None),
        ([3.0], 50, 3.0),
        ([3.0, 1.0, 2.0], 50, 2.0),
        ([1.0, 2.0], 50, 1.0),
        (range(1, 101), 99, 99),
        (range(1, 1001), 99, 990),
        (range(1, 11), 99, 10),
        (range(1, 11), 100, 10),
        (range(1, 11), 0, 1),
    ],
)
def test_percentiles(values: list[float], percent: float, found: float | None) -> None:
    assert percentile(values, percent) == found


def test_times_are_told_in_milliseconds() -> None:
    assert milliseconds([0.001, 0.002, 0.0301]) == {"p50_ms": 2.0, "p99_ms": 30.1, "max_ms": 30.1}


def test_an_answer_counts_when_it_is_all_there() -> None:
    whole = b"HTTP/1.1 404 Not Found\r\nContent-Length: 4\r\nx: y\r\n\r\nbody"
    assert [answered(whole[:part]) for part in range(len(whole) + 1)] == [0] * len(whole) + [404]
    assert answered(b"HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n") == 200


# -- the crowd before a server of our own ----------------------------------------------------------------------


class Slow(socketserver.StreamRequestHandler):
    """Answers no read before ``opens``; tells of one generation, and of the end at ``ends``."""

    opens, ends = 0.0, 0.0
    ending: ClassVar[bytes] = b"SUCCEEDED"
    started = ""
    drops: ClassVar[Iterator[int]] = iter(())

    def handle(self) -> None:
        while line := self.rfile.readline():
            while self.rfile.readline().strip():
                pass
            if b"/events" in line:
                self._events()
                return
            time.sleep(max(0.0, self.opens - time.monotonic()))
            if b"/dropped" in line and next(self.drops, None) is not None:
                return
            status = b"503 Busy" if b"busy" in line else b"200 OK"
            self.wfile.write(b"HTTP/1.1 " + status + b"\r\ncontent-length: 2\r\n\r\n{}")

    def _events(self) -> None:
        self.wfile.write(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n")
        old, new = ({"sequence": n, "elapsed_seconds": 100.0 - n} for n in (1, 2))
        self._send(_event(1, "generation", old) + _event(1, "state", {"state": "RUNNING", "started_at": self.started}))
        self._send(_event(2, "generation", new))
        time.sleep(max(0.0, self.ends - time.monotonic()))
        ended = {"state": self.ending.decode(), "started_at": self.started}
        self._send(_event(2, "state", ended))

    def _send(self, data: bytes) -> None:
        self.wfile.write(b"%x\r\n%s\r\n" % (len(data), data))


class _Server(socketserver.ThreadingTCPServer):
    daemon_threads, request_queue_size = True, 128


@contextmanager
def slow(opens_after: float, ends_after: float, ending: bytes = b"SUCCEEDED") -> Iterator[int]:
    class Handler(Slow):
        opens, ends = time.monotonic() + opens_after, time.monotonic() + ends_after
        started = (datetime.now(UTC) - timedelta(seconds=98.5)).isoformat()

    Handler.ending, Handler.drops = ending, iter(range(5))
    with _Server(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield server.server_address[1]
        server.shutdown()


def _event(sequence: int, kind: str, data: Json) -> bytes:
    return f"id: {sequence}\nevent: {kind}\ndata: {json.dumps(data)}\n\n".encode()


def test_a_read_is_timed_from_when_it_was_due_also_behind_those_that_wait() -> None:
    """The server sleeps for 0.6 s. Reads that became due meanwhile, most of them not even sent, have waited as well."""
    with slow(0.6, 0.8) as port:
        observed = generate(Traffic(port, "run", watchers=1, rate=400.0, paths=["/a", "/busy"]))
    late = [seconds for _, seconds in observed.latencies if seconds > 0.1]
    assert len(late) >= 0.4 * 400, "as many as were due in the first 0.4 s and more, not one for each connection"
    assert max(late) > 0.45
    assert len({round(seconds, 2) for seconds in late}) > 20, "the earlier it was due, the longer it took"
    assert (observed.unanswered, observed.cut) == (0, 0)
    assert observed.refused == sum(number == 1 for number, _ in observed.latencies) == len(observed.latencies) // 2
    assert len(observed.latencies) == pytest.approx(400 * observed.reading_seconds, abs=2)


def test_a_read_on_a_connection_that_was_just_closed_is_asked_again() -> None:
    with slow(0.0, 0.3) as port:
        observed = generate(Traffic(port, "run", watchers=1, rate=100.0, paths=["/dropped"]))
    assert (observed.unanswered, observed.refused) == (0, 0)
    assert len(observed.latencies) == pytest.approx(100 * observed.reading_seconds, abs=2)


def test_lags_are_from_the_end_of_a_computation_and_only_of_what_came_live() -> None:
    with slow(0.0, 0.1) as port:
        observed = generate(Traffic(port, "run", watchers=5))
    assert len(observed.lags) == 5
    assert all(0.5 <= lag < 5.0 for lag in observed.lags), observed.lags  # it said that it was computed 0.5 s before
    assert (observed.cut, observed.latencies) == (0, [])


def test_a_stream_that_ends_before_its_run_is_seen() -> None:
    with slow(0.0, 0.05, b"RUNNING") as port:
        assert generate(Traffic(port, "run", watchers=3)).cut == 3


# -- what is made of it ----------------------------------------------------------------------------------------


def trial(seconds: float, server: float, own: float, reads: int = 0) -> Trial:
    latencies = [(number % 2, 0.001 * (number + 1)) for number in range(reads)]
    observed = Observed(10.0, 5.0, latencies, processor_seconds=own, lags=[0.1])
    return Trial(seconds, 480, server, ["run", "list"], observed)


def test_slowdown_and_shares_are_beside_the_undisturbed_run_of_the_same_round() -> None:
    alone = [trial(8.0, 1.0, 0.1), trial(16.0, 2.0, 0.1), trial(10.0, 1.0, 0.1)]
    loaded = [trial(8.8, 2.0, 0.6, 100), trial(20.0, 3.0, 0.6, 100), trial(10.5, 2.0, 0.6, 100)]
    found = _figures(Load("full", 20.0, 1), loaded, alone)
    assert (found["slowdowns_percent"], found["slowdown_percent"]) == ([10.0, 25.0, 5.0], 10.0)
    assert (found["server_percent_of_a_processor"], found["generator_percent_of_a_processor"]) == (10.0, 5.0)
    assert (found["reads_per_second"], found["reads"]["of"], found["reads"]["p99_ms"]) == (20.0, 300, 99.0)
    assert found["reads_by_kind"]["run"]["max_ms"] == 99.0
    assert found["reads_by_kind"]["history"]["max_ms"] is None
    assert per_read_us(found, {"server_processor_seconds": 1.5}) == 5000.0


def test_everything_that_is_not_as_it_must_be_is_named() -> None:
    fine: Json = {**LIMITS, "reads_per_second": 99.5}
    load = {"requested_per_second": 100.0, "refused": 0, "unanswered": 0, "cut": 0}
    assert missed(fine | {"beside": {READ: load}}) == []
    for name in LIMITS:
        assert name in missed(fine | {"beside": {READ: load}, name: LIMITS[name] + 0.1})[0]
        assert missed(fine | {"beside": {READ: load}, name: None})
    assert "90 of 100" in missed(fine | {"beside": {READ: load}, "reads_per_second": 90.0})[0]
    for what in ("refused", "unanswered", "cut"):
        assert missed(fine | {"beside": {READ: load, "watched": load | {what: 1}}}) == [f"watched: 1 {what}"]


# -- a filled database -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Filled, httpx.Client]]:
    settings = Settings(data=tmp_path_factory.mktemp("filled"))
    with serving(_app(settings)) as client:
        api = Api(client)
        api.finish(api.submit(api.upload()["id"])["id"])
    filled = fill(settings.data, RUNS, EACH, LONGEST)
    with serving(_app(settings)) as client:
        yield filled, client


def _app(settings: Settings) -> Any:
    return create_app(settings, engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)


def test_what_was_filled_is_what_the_api_lists(used: tuple[Filled, httpx.Client]) -> None:
    filled, client = used
    stored, api = walk(client), Api(client)
    assert len(set(stored.ids)) == len(stored.ids) == filled.runs == RUNS
    assert sorted(stored.generations) == [10, *[EACH] * (RUNS - 2), LONGEST]
    assert sum(stored.generations) == filled.generations
    for run, generations in zip(stored.ids, stored.generations, strict=True):
        assert [item["sequence"] for item in api.history(run)] == list(range(1, generations + 1))
    assert (stored.ids[0], stored.generations[0]) == (filled.longest, filled.longest_generations)
    last = api.history(filled.longest)[-1]
    longest = api.run(filled.longest)
    assert (last["evaluations"], last["elapsed_seconds"] > 0) == (longest["evaluations"], True)
    states = {state: len(api.get(f"/v1/runs?limit=200&state={state}")["items"]) for state in toy_states()}
    assert (sum(states.values()), states["SUCCEEDED"] > RUNS / 2, states["FAILED"] > 0, states["CANCELLED"] > 0) == (
        RUNS, True, True, True,
    )  # fmt: skip
    assert len(api.get("/v1/datasets")["items"]) == 20
    for run in stored.ids[:12]:
        result = client.get(f"/v1/runs/{run}/result")
        assert result.status_code == (200 if api.run(run)["state"] == "SUCCEEDED" else 409)


def toy_states() -> tuple[str, ...]:
    return ("SUCCEEDED", "FAILED", "CANCELLED")


def test_the_mix_reads_what_is_there_in_its_shares(used: tuple[Filled, httpx.Client]) -> None:
    _, client = used
    stored = walk(client)
    asked = reads(stored, stored.ids[3], 4000, 1)
    assert asked == reads(stored, stored.ids[3], 4000, 1) != reads(stored, stored.ids[3], 4000, 2)
    for kind, share in zip(KINDS, SHARES, strict=True):
        assert sum(one == kind for one, _ in asked) == pytest.approx(4000 * share, rel=0.1)
    paths = sorted({path for _, path in asked})
    assert any("cursor=" in path for path in paths)
    port = client.base_url.port
    assert port
    assert timed(port, paths[:: len(paths) // 100])["p50_ms"] > 0
    with pytest.raises(RuntimeError, match="404"):
        timed(port, ["/v1/runs/none"])


def test_nothing_is_copied_where_no_run_has_succeeded(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"no run in .* has succeeded"):
        fill(tmp_path, RUNS, EACH, LONGEST)
