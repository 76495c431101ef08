"""The Python client against a running server."""

from __future__ import annotations

import math
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tests.service import toy
from tests.service.processes import ServerProcess, free_port
from wingfit.client.answers import Event
from wingfit.client.client import Client, ServerAwayError, WingfitError
from wingfit.client.transport import parse_events, zip_folder

GENERATIONS = 10


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("client") / "data"
    with ServerProcess(data, ("tests.service.toy_server", "0.02")) as process:
        yield process


@pytest.fixture
def client(server: ServerProcess) -> Iterator[Client]:
    with Client(f"http://127.0.0.1:{server.port}", retry_wait_s=0.05) as client:
        yield client


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "toy.zip"
    path.write_bytes(toy.archive())
    return path


@pytest.fixture
def dataset_id(client: Client, source: Path) -> str:
    return client.upload_dataset(source)["id"]


def test_a_dataset_comes_back_as_it_was_sent(client: Client, source: Path, tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    dataset = client.upload_dataset(source, name="mine", on_bytes=lambda *pair: seen.append(pair))
    size = source.stat().st_size
    assert seen[-1] == (size, size)
    assert dataset["name"] == "mine"
    assert client.dataset(dataset["id"]) == dataset
    assert dataset in client.datasets()
    assert "toy, seen from above" in client.drawing(dataset["id"])
    assert client.download(dataset["id"], tmp_path / "back.zip").read_bytes() == source.read_bytes()
    assert client.download(dataset["id"], tmp_path).name == f"{dataset['id']}.zip"
    client.delete_dataset(dataset["id"])
    with pytest.raises(WingfitError) as error:
        client.dataset(dataset["id"])
    assert error.value.status == 404


def test_a_failed_download_leaves_no_file(client: Client, tmp_path: Path) -> None:
    with pytest.raises(WingfitError, match="no dataset"):
        client.download("ds_none", tmp_path / "x.zip")
    assert list(tmp_path.iterdir()) == []


def test_lists_follow_their_cursors(client: Client, source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = {client.upload_dataset(source)["id"] for _ in range(3)}
    original = client._http.request

    def small_pages(method: str, path: str, **options: Any) -> httpx.Response:
        return original(method, path, **options | {"params": options.get("params", {}) | {"limit": 2}})

    monkeypatch.setattr(client._http, "request", small_pages)
    ids = [dataset["id"] for dataset in client.datasets()]
    assert wanted <= set(ids)
    assert len(ids) == len(set(ids))


def test_wait_reports_growing_progress_to_the_end(client: Client, dataset_id: str) -> None:
    run = client.submit_run(dataset_id, max_generations=5, name="w")
    seen: list[float] = []
    last: list[int] = []

    def watch(now: Any) -> None:
        seen.append(now["progress"])
        last.append(now["evaluations"])

    ended = client.wait(run["id"], watch)
    assert ended["state"] == "SUCCEEDED"
    assert ended["generations"] == GENERATIONS
    assert seen == sorted(seen)
    assert last == sorted(last)
    assert seen[-1] == 1.0
    assert client.wait(run["id"]) == client.run(run["id"])


def test_waiting_from_the_middle_never_goes_back(server: ServerProcess, client: Client, dataset_id: str) -> None:
    run_id = client.submit_run(dataset_id, max_generations=15)["id"]
    server.api.until(run_id, lambda run: run["generations"] > 5)
    seen: list[int] = []
    client.wait(run_id, lambda run: seen.append(run["generations"]))
    assert seen == sorted(seen)
    assert seen[0] > 5


def test_events_are_the_history_and_resume_where_told(client: Client, dataset_id: str) -> None:
    run = client.submit_run(dataset_id, max_generations=5)
    events = list(client.events(run["id"]))
    assert _sequences(events) == list(range(1, GENERATIONS + 1))
    assert events[-1]["data"]["state"] == "SUCCEEDED"
    history = client.history(run["id"])
    assert [item["sequence"] for item in history] == _sequences(events)
    assert [item["sequence"] for item in client.history(run["id"], after=7)] == [8, 9, 10]
    assert _sequences(list(client.events(run["id"], last_event_id="4"))) == list(range(5, GENERATIONS + 1))


def test_events_survive_a_kill_of_the_server(tmp_path: Path, source: Path) -> None:
    server = ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0.1"))
    with server, Client(f"http://127.0.0.1:{server.port}", retry_wait_s=0.1) as client:
        run = client.submit_run(client.upload_dataset(source)["id"], max_generations=10)
        events = []
        for event in client.events(run["id"]):
            events.append(event)
            if event["event"] == "generation" and event["data"]["sequence"] == 4:
                server.kill()
                server.__enter__()
        assert _sequences(events) == list(range(1, 21))
        assert events[-1]["data"]["state"] == "SUCCEEDED"


def test_an_answer_lost_on_the_way_creates_one_run(
    client: Client, dataset_id: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = _lose_first_answer(client, monkeypatch)
    run = client.submit_run(dataset_id, max_generations=1)
    assert len(calls) == 2
    assert [r["id"] for r in client.runs(dataset_id=dataset_id)] == [run["id"]]


def test_a_cancel_is_not_repeated_blindly(client: Client, dataset_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    run = client.submit_run(dataset_id, max_generations=500)
    calls = _lose_first_answer(client, monkeypatch)
    with pytest.raises(ServerAwayError):
        client.cancel(run["id"])
    assert len(calls) == 1
    assert client.wait(run["id"])["state"] == "CANCELLED"


def test_pause_resume_cancel_delete(client: Client, dataset_id: str) -> None:
    run_id = client.submit_run(dataset_id, max_generations=500)["id"]
    with pytest.raises(WingfitError) as refused:
        client.delete_run(run_id)
    assert refused.value.status == 409
    client.pause(run_id)
    assert client.resume(run_id)["state"] in ("QUEUED", "RUNNING")
    client.cancel(run_id)
    assert client.wait(run_id)["state"] == "CANCELLED"
    client.delete_run(run_id)
    with pytest.raises(WingfitError, match=run_id):
        client.run(run_id)


def test_results(client: Client, dataset_id: str) -> None:
    run_id = client.submit_run(dataset_id, max_generations=3)["id"]
    client.wait(run_id)
    result = client.result(run_id)
    assert result["kind"] == "tracks"
    assert result["before_mm"] == pytest.approx(2.0)
    assert client.genome(run_id) == {"genes": result["genes"], "final": True}
    best = client.comparison(run_id)
    nominal = client.comparison(run_id, "fast", "nominal")
    assert (best["recording"], nominal["recording"]) == ("slow", "fast")
    assert len(nominal["simulated_mm"]) == len(nominal["phase"])
    assert None in nominal["recorded_mm"][1][1]


def test_simulate_names_the_wrong_gene(client: Client, dataset_id: str) -> None:
    assert client.simulate(dataset_id, "slow", genome={"stiffness": 2.0})["mean_distance_mm"] is not None
    with pytest.raises(WingfitError) as error:
        client.simulate(dataset_id, "slow", genome={"stifness": 2.0})
    assert error.value.errors[0]["value"] == "stifness"
    assert "stiffness" in str(error.value)


def test_invalid_input_is_told_in_the_servers_words(client: Client, dataset_id: str) -> None:
    assert client.check_run(dataset_id, seed=3)["spec"]["seed"] == 3
    with pytest.raises(WingfitError) as refused:
        client.check_run(dataset_id, seed=-1, population=2)
    with pytest.raises(WingfitError) as error:
        client.submit_run(dataset_id, seed=-1, population=2)
    assert str(refused.value) == str(error.value)
    assert error.value.status == 422
    assert {item["where"] for item in error.value.errors} == {"body.seed", "body.population"}
    assert "(given: -1)" in str(error.value)


def test_an_id_cannot_reach_another_path(client: Client) -> None:
    for bad in ("../datasets", "a/../../health", "..", "a?b", "a#b"):
        with pytest.raises(WingfitError) as error:
            client.run(bad)
        assert error.value.status in (404, 405)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"tolerance": math.nan}, "tolerance is nan; it must be a finite number"),
        ({"bounds_factor": [1.0, math.inf]}, r"bounds_factor\[1\] is inf"),
        ({"rig": object()}, r"rig is of type object; .* give wingfit.declaration\(rig\)"),
        ({"genes": {"E_f": np.arange(2)}}, "genes.E_f is of type ndarray; it must be a number, text, list or dict"),
    ],
)
def test_what_json_has_no_form_for_is_not_sent(wrong: dict[str, Any], words: str) -> None:
    with Client("http://127.0.0.1:9") as client, pytest.raises(WingfitError, match=words):
        client.submit_run("anything", **wrong)


def test_no_server_says_how_to_start_one() -> None:
    with (
        Client(f"http://127.0.0.1:{free_port()}", retries=0) as client,
        pytest.raises(ServerAwayError, match="wingfit serve"),
    ):
        client.health()


@pytest.mark.parametrize("url", ["127.0.0.1:8321", "ftp://x", "http://", "http://a:b:c"])
def test_a_bad_address_is_named(url: str) -> None:
    with pytest.raises(WingfitError, match="bad server address"):
        Client(url)


def test_events_patience_ends(client: Client, dataset_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    run_id = client.submit_run(dataset_id, max_generations=1)["id"]

    def gone(*_: Any, **__: Any) -> Any:
        raise httpx.ConnectError("gone")

    monkeypatch.setattr(client._http, "stream", gone)
    with pytest.raises(ServerAwayError):
        list(client.events(run_id, patience_s=0.1))


def test_a_folder_is_zipped_the_same_way_twice(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    (folder / "recordings").mkdir(parents=True)
    (folder / "dataset.yaml").write_text("name: x\n")
    (folder / "recordings" / "a.csv").write_text("1\n")
    (folder / ".DS_Store").write_text("noise")
    first = zip_folder(folder, tmp_path / "1.zip").read_bytes()
    (folder / "dataset.yaml").touch()
    assert zip_folder(folder, tmp_path / "2.zip").read_bytes() == first
    with zipfile.ZipFile(tmp_path / "1.zip") as archive:
        assert archive.namelist() == ["dataset.yaml", "recordings/a.csv"]


def test_a_folder_without_description_is_refused(client: Client, tmp_path: Path) -> None:
    with pytest.raises(WingfitError, match=r"dataset\.yaml"):
        client.upload_dataset(tmp_path)
    with pytest.raises(WingfitError, match="does not exist"):
        client.upload_dataset(tmp_path / "nothing")


def test_parse_events() -> None:
    lines = [": alive", "", "id: 3", "event: generation", 'data: {"a":', "data: 1}", "", "id: 4", 'data: {"cut": 1}']
    assert list(parse_events(iter(lines))) == [{"id": "3", "event": "generation", "data": {"a": 1}}]


@pytest.mark.parametrize("route", ["/v1/simulations", "/v1/loads", "/v1/runs/run_1/loads", "/v1/runs/run_1/comparison"])
def test_a_simulation_may_take_longer_than_other_answers(route: str) -> None:
    """Given up and sent again, it would be computed once more each time."""
    asked: list[str] = []

    class Slow(BaseHTTPRequestHandler):
        def answer(self) -> None:
            asked.append(self.path)
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            time.sleep(0.5)
            self.send_response(200)
            self.send_header("Content-Length", "2")
            self.end_headers()
            self.wfile.write(b"{}")

        do_GET = do_POST = answer

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Slow) as server:
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        with Client(f"http://127.0.0.1:{server.server_port}", timeout_s=0.2, simulating_s=30.0) as client:
            calls: dict[str, Callable[[], Any]] = {
                "/v1/simulations": lambda: client.simulate("ds_1", "slow"),
                "/v1/loads": lambda: client.loads_under("ds_1", "slow"),
                "/v1/runs/run_1/loads": lambda: client.loads("run_1"),
                "/v1/runs/run_1/comparison": lambda: client.comparison("run_1"),
            }
            assert calls[route]() == {}
        server.shutdown()
    assert [path.partition("?")[0] for path in asked] == [route]


def _sequences(events: list[Event]) -> list[int]:
    return [event["data"]["sequence"] for event in events if event["event"] == "generation"]


def _lose_first_answer(client: Client, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The first request arrives, its answer does not."""
    calls: list[str] = []
    original = client._http.request

    def request(method: str, path: str, **options: Any) -> httpx.Response:
        response = original(method, path, **options)
        if method == "POST":
            calls.append(path)
            if len(calls) == 1:
                raise httpx.ReadError("lost")
        return response

    monkeypatch.setattr(client._http, "request", request)
    return calls
