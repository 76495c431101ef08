"""Calibrations of a rig that its user simulates: the result of one process, through pauses and restarts."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import h5netcdf
import pytest

import wingfit
from tests.service.conftest import Api, Json
from tests.service.rigs import decay_rig
from tests.service.rigs.test_drive import DECLARED, client_of, drive_here, service, upload

SETTINGS: Json = {"population": 8, "max_generations": 6, "effects": ["leak"], "seed": 3}


@pytest.fixture(scope="module")
def alone() -> wingfit.SeriesResult:
    """The result in one process."""
    spec = wingfit.CalibrationSpec(population=8, max_generations=6, effects=("leak",), seed=3)
    found = wingfit.calibrate(decay_rig.dataset(), spec, rig=decay_rig.rig)
    assert isinstance(found, wingfit.SeriesResult)
    return found


def submit(api: Api, dataset: str, **changes: Any) -> str:
    return str(api.submit(dataset, rig=DECLARED, **SETTINGS | changes)["id"])


def check(api: Api, run: str, alone: wingfit.SeriesResult) -> None:
    result = api.get(f"/v1/runs/{run}/result")
    assert (result["kind"], result["relative_to"]) == ("series", "noise")
    assert [gene["best"] for gene in result["genes"]] == [gene.best for gene in alone.genes]
    assert [gene["standard_error"] for gene in result["genes"]] == [gene.absolute_error for gene in alone.genes]
    assert (result["after"], result["held_out_after"]) == (alone.after, alone.held_out_after)
    assert result["recordings"][0]["channels"][0]["unit"] == "C"


def test_a_driven_run_estimates_what_one_process_estimates(tmp_path: Path, alone: wingfit.SeriesResult) -> None:
    with service(tmp_path) as api:
        run = submit(api, upload(api))
        assert api.run(run)["name"] == "decay, decay with leak, joint"
        with client_of(api) as client:
            assert wingfit.drive(client, run, decay_rig.rig)["state"] == "SUCCEEDED"
        check(api, run, alone)
        leak = next(gene for gene in api.get(f"/v1/runs/{run}/genome")["genes"] if gene["name"] == "leak.size")
        assert leak["best"] == pytest.approx(decay_rig.LEAK, abs=0.03)
        done = api.run(run)
        assert (done["best_mm"], done["best_mn"]) == (None, None)
        assert 0.0 < done["best_percent"] < 3.0
        assert [one["id"] for one in api.get("/v1/runs")["items"]] == [run]
        head, *rows = api.client.get(f"/v1/runs/{run}/export?format=csv").text.splitlines()
        assert head.startswith("sequence,stage,generation,best,mean,diversity,best_percent,")
        assert len(rows) == done["generations"]
        content = api.client.get(f"/v1/runs/{run}/export?format=netcdf").content
        with h5netcdf.File(io.BytesIO(content)) as file:
            curves = api.get(f"/v1/runs/{run}/result")["curves"]
            assert len(file["curves"]) == len(curves) > 0
            assert list(file["curves/1/best"]) == curves[0]["best"]
        document = api.get(f"/v1/runs/{run}/export?format=json")
        again = api.client.post("/v1/runs?validate_only=true", json=document["request"])
        assert again.status_code == 200, again.text
        for path in ("comparison", "loads", "forces"):
            assert api.client.get(f"/v1/runs/{run}/{path}").status_code == 409
        started = api.diagnose(None, run_id=run, recordings=["from-1"])
        assert (started["rig"], started["spec"]["start"]["rate"]) == ("decay", pytest.approx(0.8, abs=0.1))


def test_it_goes_on_after_a_pause_and_a_restart(tmp_path: Path, alone: wingfit.SeriesResult) -> None:
    with service(tmp_path) as api:
        run = submit(api, upload(api))
        drive_here(api, "runs", run, until=lambda now: now["generations"] >= 2)
        api.control(run, "pause")
        drive_here(api, "runs", run, until=lambda now: now["state"] == "PAUSED")
    with service(tmp_path) as api:
        assert api.run(run)["state"] == "PAUSED"
        api.control(run, "resume")
        drive_here(api, "runs", run, until=lambda now: now["generations"] >= 4)
    with service(tmp_path) as api:
        with client_of(api) as client:
            assert wingfit.drive(client, run, decay_rig.rig)["state"] == "SUCCEEDED"
        check(api, run, alone)


def test_settings_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    with service(tmp_path) as api:
        dataset = upload(api)
        for changes, where, word in (
            ({"rig": None}, "body.rig", "the dataset has series of rig 'decay'"),
            ({"mode": "staged"}, "body", "mode 'staged' is for wings or vehicles"),
            ({"bounds_factor": 3.0}, "body.bounds_factor", "means nothing for a rig of your own"),
            ({"low_pass_hz": 3.0}, "body.low_pass_hz", "means nothing for a rig of your own"),
            ({"effects": ["hinge_offset"]}, "body", "unknown suspect 'hinge_offset'"),
            ({"genes": ["span"]}, "body", "unknown gene 'span'"),
            ({"finish": True}, "body", "auto"),
        ):
            body = {"dataset_id": dataset, "rig": DECLARED, **changes}
            refused = api.client.post("/v1/runs", json={name: one for name, one in body.items() if one is not None})
            assert refused.status_code == 422, changes
            errors = refused.json()["errors"]
            assert any(one["where"] == where and word in one["message"] for one in errors), errors
