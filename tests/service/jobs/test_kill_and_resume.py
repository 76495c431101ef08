"""Real calibrations, of tracks and of forces, killed in mid-run, end with the numbers of undisturbed ones."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.service.conftest import FINAL, Api
from tests.service.processes import ROOT, ServerProcess
from tests.service.runs import force_data

EXAMPLE = ROOT / "examples" / "robird"
SPEC = {"division": "4", "population": 6, "max_generations": 4, "stall": 4, "seed": 3}
PATIENCE = 300.0

Json = dict[str, Any]
Outcome = tuple[list[Json], Json, Json]
"""History without times, result and genome of a run."""


def server(data: Path, evaluator: str) -> ServerProcess:
    env = {"WINGFIT_EVALUATOR": evaluator}
    if evaluator == "processes":
        env["WINGFIT_WORKERS"] = "2"
    return ServerProcess(data, ("wingfit.service.server",), env, forked=True)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Outcome]:
    """What a run on tracks and one on forces end with on a server that is left alone."""
    with server(tmp_path_factory.mktemp("undisturbed") / "data", "in_process") as one:
        return _outcome(one.api, _submit(one.api)), _outcome(one.api, _submit_forces(one.api))


def test_runs_killed_in_search_and_in_gauss_newton_equal_undisturbed(
    tmp_path: Path, undisturbed: tuple[Outcome, Outcome]
) -> None:
    data = tmp_path / "killed"
    with server(data, "processes") as first:
        tracks = _submit(first.api)
        first.api.until(tracks, lambda r: r["generations"] >= 2 or r["state"] in FINAL, PATIENCE)
        before = first.api.history(tracks)
        first.kill()
    assert before, "nothing was stored before the kill"
    with server(data, "processes") as second:
        state = second.api.run(tracks)
        assert state["state"] in ("QUEUED", "RUNNING"), "the kill came too late to test anything"
        assert _outcome(second.api, tracks) == undisturbed[0]
        assert second.api.history(tracks)[: len(before)] == before
        forces = _submit_forces(second.api)
        second.api.until(forces, lambda r: r["generations"] >= 2, PATIENCE)
        second.kill()
    with server(data, "in_process") as third:
        state = third.api.until(forces, lambda r: _in_newton(r["stage"]) or r["state"] in FINAL, PATIENCE)
        before = third.api.history(forces)
        third.kill()
        assert state["state"] == "RUNNING", "the kill came too late to test anything"
    with server(data, "processes") as fourth:
        outcome = _outcome(fourth.api, forces)
        assert fourth.api.history(forces)[: len(before)] == before
    assert outcome == undisturbed[1]
    assert {_in_newton(item["stage"]) for item in outcome[0]} == {True, False}


def _in_newton(stage: str | None) -> bool:
    return stage is not None and stage.endswith(", Gauss-Newton")


def _submit_forces(api: Api) -> str:
    answer = api.client.post("/v1/datasets", files={"file": ("delfly.zip", force_data.archive())})
    assert answer.status_code == 201, answer.text
    search = {"method": "cma_es", "finish": True, "population": 12, "max_generations": 12, "stall": 12, "seed": 3}
    answer = api.client.post("/v1/runs", json=search | {"dataset_id": answer.json()["id"], "axes": ["x", "z"]})
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def _submit(api: Api) -> str:
    answer = api.client.post("/v1/datasets", files={"file": ("robird.zip", _zipped())})
    assert answer.status_code == 201, answer.text
    dataset = answer.json()
    body = SPEC | {"dataset_id": dataset["id"], "recordings": _two_recordings(dataset)}
    answer = api.client.post("/v1/runs", json=body)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def _two_recordings(dataset: Json) -> list[str]:
    """One of each rig, so that both stages run and the test stays short."""
    fitted = [recording for recording in dataset["recordings"] if not recording["held_out"]]
    rigs = {recording["rig"]: recording["name"] for recording in reversed(fitted)}
    return sorted(rigs.values())


def _outcome(api: Api, run: str) -> Outcome:
    finished = api.finish(run, PATIENCE)
    assert finished["state"] == "SUCCEEDED", finished["error"]
    history = [{key: value for key, value in item.items() if key != "elapsed_seconds"} for item in api.history(run)]
    assert len(history) == finished["generations"]
    return history, api.get(f"/v1/runs/{run}/result"), api.get(f"/v1/runs/{run}/genome")


def _zipped() -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(EXAMPLE / "dataset.yaml", "dataset.yaml")
        for file in sorted((EXAMPLE / "recordings").iterdir()):
            archive.write(file, f"recordings/{file.name}")
    return packed.getvalue()
