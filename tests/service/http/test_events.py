"""Server-sent events: complete, in order, resumable, ending."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from tests.service.conftest import Api, Gate
from wingfit.service.http import events as streams

Event = tuple[str, str, dict[str, Any]]


def events(api: Api, run: str, last: str | None = None) -> Iterator[Event]:
    headers = {"Last-Event-ID": last} if last else {}
    with api.client.stream("GET", f"/v1/runs/{run}/events", headers=headers) as answer:
        assert answer.status_code == 200
        assert answer.headers["Content-Type"].startswith("text/event-stream")
        yield from parse(answer)


def parse(answer: httpx.Response) -> Iterator[Event]:
    fields: dict[str, str] = {}
    for line in answer.iter_lines():
        if not line and fields:
            yield fields["id"], fields["event"], json.loads(fields["data"])
            fields = {}
        elif line.startswith(":"):
            yield "", "comment", {}
        elif line:
            name, _, value = line.partition(": ")
            fields[name] = value


def test_a_stream_sends_every_event_and_ends(api: Api) -> None:
    run = api.submit(api.upload()["id"])["id"]
    told = list(events(api, run))
    generations = [data for _, kind, data in told if kind == "generation"]
    assert [data["sequence"] for data in generations] == list(range(1, 11))
    assert [data["progress"] for data in generations] == sorted(data["progress"] for data in generations)
    assert told[-1][1:] == ("state", api.run(run))
    assert told[-1][2]["state"] == "SUCCEEDED"
    history = api.history(run)
    assert [{key: data[key] for key in history[0]} for data in generations] == history
    assert all(data["eta_seconds"] is not None for data in generations)


def test_too_many_event_streams_get_a_503(api: Api, gate: Gate, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "MAX_STREAMS", 1)
    run = api.submit(api.upload()["id"])["id"]
    open_stream = events(api, run)
    assert next(open_stream)[1] == "state"
    refused = api.client.get(f"/v1/runs/{run}/events")
    assert (refused.status_code, refused.json()["type"]) == (503, "urn:wingfit:problem:busy")
    gate.let(10)
    list(open_stream)
    assert list(events(api, run))[-1][1] == "state"


def test_a_reconnect_misses_nothing_and_repeats_nothing(api: Api, gate: Gate) -> None:
    run = api.submit(api.upload()["id"])["id"]
    gate.let(4)
    first: list[Event] = []
    for event in events(api, run):
        first.append(event)
        if event[1] == "generation" and event[2]["sequence"] == 3:
            break
    gate.let(6)
    second = list(events(api, run, first[-1][0]))
    sequences = [data["sequence"] for _, kind, data in first + second if kind == "generation"]
    assert sequences == list(range(1, 11))
    assert second[-1][2]["state"] == "SUCCEEDED"


def test_a_state_does_not_skip_generations(api: Api, gate: Gate) -> None:
    """A client that loses the connection right after a state event must go on where the generations were."""
    run = api.submit(api.upload()["id"])["id"]
    gate.let(2)
    api.until(run, lambda r: r["generations"] == 2)
    watching = events(api, run, "1")
    told = [next(watching), next(watching)]
    assert [(event[0], event[1]) for event in told] == [("2", "generation"), ("2", "state")]
    assert told[1][2]["state"] == "RUNNING"
    api.control(run, "pause")
    assert next(watching)[2]["pending_action"] == "PAUSE"
    gate.let(1)
    assert [next(watching)[1], next(watching)[2]["state"]] == ["generation", "PAUSED"]
    api.control(run, "cancel")
    assert [event[2]["state"] for event in watching] == ["CANCELLED"]


def test_a_silent_stream_is_kept_alive(api: Api, gate: Gate, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wingfit.service.http.events.HEARTBEAT_SECONDS", 0.05)
    run = api.submit(api.upload()["id"])["id"]
    kinds = []
    for event in events(api, run):
        kinds.append(event[1])
        if kinds.count("comment") == 3:
            break
    gate.let(10)
    assert set(kinds) == {"state", "comment"}


@pytest.mark.parametrize("last", ["x", "-1", "1" * 16, "\u00b2"])
def test_an_unknown_event_id_is_refused(api: Api, last: str) -> None:
    run = api.submit(api.upload()["id"])["id"]
    headers = {b"Last-Event-ID": last.encode("latin-1")}
    assert api.client.get(f"/v1/runs/{run}/events", headers=headers).status_code == 422
