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
SPEC = {"division": "4", "population": 8, "max_generations": 6, "stall": 6, "seed": 3}
PATIENCE = 300.0

Json = dict[str, Any]


def server(data: Path, evaluator: str) -> ServerProcess:
    env = {"WINGFIT_EVALUATOR": evaluator}
    if evaluator == "processes":
        env["WINGFIT_WORKERS"] = "2"
    return ServerProcess(data, ("wingfit.service.server",), env)


@pytest.mark.skipif(not (EXAMPLE / "dataset.yaml").exists(), reason=f"the example campaign {EXAMPLE.name} is not there")
def test_killed_in_mid_run_and_resumed_equals_undisturbed(tmp_path: Path) -> None:
    with server(tmp_path / "undisturbed", "in_process") as one:
        run = _submit(one.api)
        expected = _outcome(one.api, run)
    with server(tmp_path / "killed", "processes") as first:
        run = _submit(first.api)
        first.api.until(run, lambda r: r["generations"] >= 2 or r["state"] in FINAL, PATIENCE)
        before = first.api.history(run)
        first.kill()
    assert before, "nothing was stored before the kill"
    with server(tmp_path / "killed", "processes") as second:
        state = second.api.run(run)
        assert state["state"] in ("QUEUED", "RUNNING"), "the kill came too late to test anything"
        outcome = _outcome(second.api, run)
        assert second.api.history(run)[: len(before)] == before
    assert outcome == expected


def test_a_run_on_forces_killed_in_search_and_in_gauss_newton_equals_undisturbed(tmp_path: Path) -> None:
    with server(tmp_path / "undisturbed", "in_process") as one:
        expected = _outcome(one.api, _submit_forces(one.api))
    data, before = tmp_path / "killed", []
    with server(data, "processes") as first:
        run = _submit_forces(first.api)
        first.api.until(run, lambda r: r["generations"] >= 2, PATIENCE)
        first.kill()
    with server(data, "in_process") as second:
        state = second.api.until(run, lambda r: _in_newton(r["stage"]) or r["state"] in FINAL, PATIENCE)
        before = second.api.history(run)
        second.kill()
        assert state["state"] == "RUNNING", "the kill came too late to test anything"
    with server(data, "processes") as third:
        outcome = _outcome(third.api, run)
        assert third.api.history(run)[: len(before)] == before
    assert outcome == expected
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


def _outcome(api: Api, run: str) -> tuple[list[Json], Json, Json]:
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
