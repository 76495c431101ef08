"""Runs: submission, states, several at once, failure, deletion."""

from __future__ import annotations

import threading
from pathlib import Path

import httpx
import pytest

from tests.service import toy
from tests.service.conftest import Api, Gate, serving
from wingfit.service.app import create_app
from wingfit.service.settings import Settings


def test_a_run_goes_from_queued_to_succeeded(api: Api) -> None:
    dataset = api.upload()
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset["id"], "max_generations": 5, "name": "first"})
    assert answer.status_code == 202
    run = answer.json()
    assert answer.headers["Location"] == f"/v1/runs/{run['id']}"
    assert (run["state"], run["name"], run["spec"]["population"]) == ("QUEUED", "first", 50)
    done = api.finish(run["id"])
    assert (done["state"], done["progress"], done["generations"], done["evaluations"]) == ("SUCCEEDED", 1.0, 10, 500)
    assert done["created_at"] < done["started_at"] < done["finished_at"]
    history = api.history(run["id"])
    assert [item["sequence"] for item in history] == list(range(1, 11))
    assert [item["stage"] for item in history] == ["structural"] * 5 + ["aerodynamic"] * 5
    assert history[0]["mean"] is None, "an infinite mean has no number in JSON"
    assert history[-1]["best_mm"] == done["best_mm"] < history[0]["best_mm"]
    result = api.get(f"/v1/runs/{run['id']}/result")
    assert result["after_mm"] == done["best_mm"]
    assert [r["held_out"] for r in result["recordings"]] == [False, False, True]
    genome = api.get(f"/v1/runs/{run['id']}/genome")
    assert genome == {"genes": result["genes"], "final": True}
    assert genome["genes"][0]["standard_error_percent"] == pytest.approx(2.0)


def test_history_comes_in_pages(api: Api) -> None:
    run = api.submit(api.upload()["id"])
    api.finish(run["id"])
    first = api.get(f"/v1/runs/{run['id']}/history?limit=6")
    rest = api.get(f"/v1/runs/{run['id']}/history?limit=6&after={first['next_cursor']}")
    assert [item["sequence"] for item in first["items"] + rest["items"]] == list(range(1, 11))
    assert rest["next_cursor"] is None
    assert {(item["failed"], *item["reasons"]) for item in first["items"]} == {(1, "diverged at 0.1 s")}


def test_same_seed_same_history_and_another_seed_another(api: Api) -> None:
    dataset = api.upload()["id"]
    runs = [api.submit(dataset, seed=seed)["id"] for seed in (4, 4, 5)]
    for run in runs:
        api.finish(run)
    fitness = [[item["best"] for item in api.history(run)] for run in runs]
    assert fitness[0] == fitness[1] != fitness[2]


def test_no_more_runs_at_once_than_set(settings: Settings) -> None:
    engine = toy.ToyEngine(seconds=0.01)
    with serving(create_app(settings, engine=engine, make_evaluator=toy.NoEvaluator)) as client:
        api = Api(client)
        dataset = api.upload()["id"]
        runs = [api.submit(dataset, seed=seed)["id"] for seed in range(1, 6)]
        states = [api.finish(run)["state"] for run in runs]
    assert states == ["SUCCEEDED"] * 5
    assert engine.most_at_once == settings.max_runs == 2


def test_pause_keeps_what_is_done_and_resume_ends_alike(api: Api, gate: Gate, engine: toy.ToyEngine) -> None:
    dataset = api.upload()["id"]
    run = api.submit(dataset)["id"]
    gate.let(2)
    api.until(run, lambda r: r["generations"] == 2)
    assert api.control(run, "pause")["pending_action"] == "PAUSE"
    gate.let(1)
    paused = api.until(run, lambda r: r["state"] == "PAUSED")
    assert (paused["generations"], paused["pending_action"]) == (3, None)
    assert api.get(f"/v1/runs/{run}/genome")["final"] is False
    assert api.client.post(f"/v1/runs/{run}/pause").status_code == 409
    assert api.control(run, "resume")["state"] in ("QUEUED", "RUNNING")
    gate.let(7)
    assert api.finish(run)["state"] == "SUCCEEDED"
    other = api.submit(dataset)["id"]
    gate.let(10)
    api.finish(other)
    assert engine.started_from == [0, 3, 0]
    assert _numbers(api, run) == _numbers(api, other)
    assert api.get(f"/v1/runs/{run}/result") == api.get(f"/v1/runs/{other}/result")


def test_cancel(api: Api, gate: Gate) -> None:
    dataset = api.upload()["id"]
    run = api.submit(dataset)["id"]
    gate.let(1)
    api.until(run, lambda r: r["generations"] == 1)
    assert api.control(run, "cancel")["pending_action"] == "CANCEL"
    gate.let(1)
    assert api.finish(run)["state"] == "CANCELLED"
    answer = api.client.post(f"/v1/runs/{run}/cancel")
    assert (answer.status_code, answer.json()["state"]) == (409, "CANCELLED")
    assert api.client.get(f"/v1/runs/{run}/result").status_code == 409
    assert len(api.history(run)) == 2


def test_cancel_and_pause_while_queued(api: Api, gate: Gate) -> None:
    dataset = api.upload()["id"]
    busy = [api.submit(dataset)["id"] for _ in range(2)]
    for run in busy:
        api.until(run, lambda r: r["state"] == "RUNNING")
    cancelled, paused = api.submit(dataset)["id"], api.submit(dataset)["id"]
    assert api.control(cancelled, "cancel")["state"] == "CANCELLED"
    assert api.control(paused, "pause")["state"] == "PAUSED"
    gate.let(30)
    assert [api.finish(run)["state"] for run in busy] == ["SUCCEEDED"] * 2
    assert api.run(paused)["state"] == "PAUSED"
    assert api.run(cancelled)["generations"] == 0
    api.control(paused, "resume")
    assert api.finish(paused)["state"] == "SUCCEEDED"


def test_a_failed_run_says_why_without_a_stack_trace(api: Api, gate: Gate) -> None:
    run = api.submit(api.upload()["id"], seed=13)["id"]
    gate.let(3)
    failed = api.finish(run)
    assert (failed["state"], failed["generations"]) == ("FAILED", 2)
    assert failed["error"] == (
        "the server made a mistake (ArithmeticError: the thirteenth seed breaks); the run's data are kept; "
        "please report it"
    )
    other = api.submit(failed["dataset_id"])["id"]
    gate.let(10)
    assert api.finish(other)["state"] == "SUCCEEDED", "a failure must not take the runner with it"


def test_what_refers_to_each_other_is_deleted_in_order(api: Api, gate: Gate) -> None:
    dataset = api.upload()["id"]
    run = api.submit(dataset)["id"]
    assert api.client.delete(f"/v1/datasets/{dataset}").status_code == 409
    active = api.client.delete(f"/v1/runs/{run}")
    assert (active.status_code, active.json()["state"] in ("QUEUED", "RUNNING")) == (409, True)
    gate.let(10)
    api.finish(run)
    assert api.client.delete(f"/v1/datasets/{dataset}").status_code == 409
    assert api.client.delete(f"/v1/runs/{run}").status_code == 204
    assert api.client.delete(f"/v1/runs/{run}").status_code == 404
    assert api.client.get(f"/v1/runs/{run}/history").status_code == 404
    assert api.client.delete(f"/v1/datasets/{dataset}").status_code == 204
    assert api.client.get(f"/v1/datasets/{dataset}/archive").status_code == 404
    assert api.client.post("/v1/runs", json={"dataset_id": dataset}).status_code == 422


def test_runs_are_listed_newest_first_by_dataset_and_state(api: Api, gate: Gate) -> None:
    gate.let(100)
    one, two = api.upload()["id"], api.upload(name="other")["id"]
    runs = [api.submit(dataset, max_generations=1)["id"] for dataset in (one, one, one, two)]
    for run in runs:
        api.finish(run)
    assert [r["id"] for r in api.get("/v1/runs")["items"]] == runs[::-1]
    first = api.get(f"/v1/runs?dataset_id={one}&limit=2")
    rest = api.get(f"/v1/runs?dataset_id={one}&limit=2&cursor={first['next_cursor']}")
    assert [r["id"] for r in first["items"] + rest["items"]] == runs[2::-1]
    assert rest["next_cursor"] is None
    assert api.get("/v1/runs?state=FAILED")["items"] == []
    assert len(api.get("/v1/runs?state=SUCCEEDED")["items"]) == 4


def test_before_the_first_generation_there_is_no_genome(api: Api, gate: Gate) -> None:
    run = api.submit(api.upload()["id"])["id"]
    for path in ("genome", "result", "comparison"):
        assert api.client.get(f"/v1/runs/{run}/{path}").status_code == 409
    assert api.client.get(f"/v1/runs/{run}/comparison?genome=nominal").status_code == 200
    gate.let(10)


def test_runs_wait_for_an_evaluator_that_comes_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wingfit.service.jobs.evaluator_startup.RETRY_SECONDS", (0.05,))
    may_start = threading.Event()

    def make() -> toy.NoEvaluator:
        if not may_start.is_set():
            raise ConnectionError("no cluster at this address")
        return toy.NoEvaluator()

    app = create_app(Settings(data=tmp_path), engine=toy.ToyEngine(), make_evaluator=make)
    with serving(app) as client:
        api = Api(client)
        run = api.submit(api.upload()["id"])["id"]
        health = _health(client, "degraded")
        assert health["detail"] == "ConnectionError: no cluster at this address"
        assert api.run(run)["state"] == "QUEUED"
        may_start.set()
        assert api.finish(run)["state"] == "SUCCEEDED"
        assert _health(client, "ok")["workers"] == 1


def _health(client: httpx.Client, status: str) -> dict[str, object]:
    for _ in range(200):
        health: dict[str, object] = client.get("/v1/health").json()
        if health["status"] == status:
            return health
        threading.Event().wait(0.02)
    raise AssertionError(f"the health stays {health}")


def _numbers(api: Api, run: str) -> list[dict[str, object]]:
    return [{key: value for key, value in item.items() if key != "elapsed_seconds"} for item in api.history(run)]
