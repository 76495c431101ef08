"""Exports of diagnoses; exports by the Python client and the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.report.findings import bare, force_finding, wing_finding
from tests.service import toy, toy_diagnosis
from tests.service.conftest import Api, Gate, serving
from tests.service.runs.export_files import FORMATS, exported, opened, rows_of, texts, variables
from tests.service.shapes import valid
from wingfit.cli.main import app as commands
from wingfit.client.client import Client, WingfitError
from wingfit.client.export_answers import DiagnosisExport
from wingfit.diagnosis.finding import Finding
from wingfit.report import finding_json
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

Json = dict[str, Any]


@pytest.fixture
def done(api: Api) -> Json:
    return api.finish(api.submit(api.upload()["id"])["id"])


def test_a_diagnosis_is_exported_with_its_finding(api: Api) -> None:
    made = api.diagnosed(api.diagnose(api.upload()["id"], name="=what?")["id"])
    path = f"diagnoses/{made['id']}"
    finding = api.get(f"/v1/{path}/finding")
    found = json.loads(exported(api, path, "json"))
    valid(DiagnosisExport, found)
    assert (found["diagnosis"], found["finding"]) == (made, finding)
    assert found["dataset"] == api.get(f"/v1/datasets/{made['dataset_id']}")
    rows = rows_of(api, path)
    assert [row["rank"] for row in rows] == ["1", "2", "3"]
    assert [row["effects"] for row in rows] == ["hinge_offset", "camera_shift", ""]
    for row, one in zip(rows, finding["hypotheses"], strict=True):
        for name in ("probability", "evidence", "score", "freedom", "explained"):
            assert float(row[name]) == one[name]
        assert (row["misfit_m"], row["refitted"]) == (repr(one["misfit"]), "true")
    assert rows[2]["predicted"] == "", "not left out one by one"
    with opened(exported(api, path, "netcdf")) as file:
        group, one = file["recordings"], finding["recordings"][0]
        assert (texts(group["recording"]), group["held_out"][:].tolist()) == (["slow"], [0])
        assert group["before_low"][0] == one["before"]["low"]
        assert file.attrs["verdict"] == "named"


def test_a_diagnosis_that_has_not_ended_is_not_exported(api: Api, gate: Gate) -> None:
    diagnosis = api.diagnose(api.upload()["id"])["id"]
    api.until_diagnosis(diagnosis, lambda one: one["state"] == "RUNNING")
    for form in FORMATS:
        refused = api.client.get(f"/v1/diagnoses/{diagnosis}/export?format={form}")
        assert (refused.status_code, refused.json()["state"]) == (409, "RUNNING")
        assert "when it has SUCCEEDED" in refused.json()["detail"]
    gate.let(100)


@pytest.mark.parametrize("found", [wing_finding(), force_finding(), bare(wing_finding())])
def test_the_maps_of_a_diagnosis_are_those_of_its_finding(found: Finding, tmp_path: Path) -> None:
    class Mapped(toy_diagnosis.ToyDiagnoser):
        def stored(self, finding: Finding) -> Json:  # noqa: ARG002
            return finding_json(found)

    app = create_app(
        Settings(data=tmp_path), engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator, diagnoser=Mapped()
    )
    with serving(app) as client:
        api = Api(client)
        made = api.diagnosed(api.diagnose(api.upload()["id"])["id"])
        finding = api.get(f"/v1/diagnoses/{made['id']}/finding")
        data = exported(api, f"diagnoses/{made['id']}", "netcdf")
    with opened(data) as file:
        for path, variable in variables(file):
            assert variable.attrs["units"], path
            assert variable.attrs["long_name"], path
        there = {name for name in ("recordings", "markers", "phase_map", "missing") if finding[name]}
        assert set(file.groups) == there
        _check_maps(file, finding)


def _check_maps(file: Any, finding: Json) -> None:
    if given := finding["phase_map"]:
        for name in ("phase", "before", "after", "noise"):
            np.testing.assert_array_equal(file[f"phase_map/{name}"][...], given[name])
        assert file["phase_map/before"].attrs["units"] == finding["unit"]
    for number, load in enumerate(finding["missing"], 1):
        group = file[f"missing/{number}"]
        assert (group.attrs["recording"], group.attrs["rod"]) == (load["recording"], load["rod"])
        assert group["value"].attrs["units"].replace(" m-1", "/m") == load["unit"]
        np.testing.assert_array_equal(group["station"][:], load["stations"])
        np.testing.assert_array_equal(group["value"][:], load["values"])
        np.testing.assert_array_equal(group["error"][:], load["errors"])
    if markers := finding["markers"]:
        assert texts(file["markers/marker"]) == [one["name"] for one in markers]
        for name in ("span", "chord", "before", "after", "direction"):
            expected = np.array([one[name] for one in markers], dtype=float)
            np.testing.assert_array_equal(file[f"markers/{name}"][:], expected)
    for stage in ("before", "after") if finding["recordings"] else ():
        for end, label in (("value", stage), ("low", f"{stage}_low"), ("high", f"{stage}_high")):
            expected = np.array([one[stage][end] for one in finding["recordings"]], dtype=float)
            np.testing.assert_array_equal(file[f"recordings/{label}"][:], expected)


def test_the_client_writes_whole_files(api: Api, done: Json, tmp_path: Path) -> None:
    diagnosis = api.diagnosed(api.diagnose(done["dataset_id"])["id"])["id"]
    seen: list[int] = []
    with Client(str(api.client.base_url)) as client:
        path = client.export_run(done["id"], "csv", tmp_path / "h.csv", on_bytes=lambda got, _: seen.append(got))
        assert path.read_bytes() == exported(api, f"runs/{done['id']}", "csv")
        assert seen[-1] == path.stat().st_size
        assert client.export_run(done["id"], "netcdf", tmp_path).name == f"{done['id']}.nc"
        assert client.export_diagnosis(diagnosis, "csv", tmp_path).name == f"{diagnosis}-ranking.csv"
        assert json.loads(client.export_diagnosis(diagnosis, "json", tmp_path / "d").read_text())["finding"]
        with pytest.raises(WingfitError, match="there is no run"):
            client.export_run("run_none", "csv", tmp_path / "none.csv")
    names = {one.name for one in tmp_path.iterdir() if one.is_file()}
    assert names == {"h.csv", f"{done['id']}.nc", f"{diagnosis}-ranking.csv", "d"}


def test_a_file_that_is_cut_off_is_not_kept(api: Api, done: Json, tmp_path: Path) -> None:
    def interrupted(_got: int, _total: int) -> None:
        raise KeyboardInterrupt

    kept = tmp_path / "h.csv"
    kept.write_text("earlier")
    with Client(str(api.client.base_url)) as client, pytest.raises(KeyboardInterrupt):
        client.export_run(done["id"], "csv", kept, on_bytes=interrupted)
    assert [one.name for one in tmp_path.iterdir() if one.is_file()] == ["h.csv"]
    assert kept.read_text() == "earlier"


def test_the_command_line_writes_files_and_prints_text(
    api: Api, done: Json, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("WINGFIT_URL", str(api.client.base_url))
    runner, run = CliRunner(), done["id"]
    diagnosis = api.diagnosed(api.diagnose(done["dataset_id"])["id"])["id"]
    table = exported(api, f"runs/{run}", "csv")
    for more in ([], ["-o", "-"]):
        shown = runner.invoke(commands, ["runs", "export", run, "--format", "csv", *more])
        assert (shown.exit_code, shown.stdout_bytes) == (0, table)
    assert json.loads(runner.invoke(commands, ["runs", "export", run]).stdout)["run"] == done
    saved = tmp_path / "ranking.csv"
    words = ["diagnoses", "export", diagnosis, "--format", "csv", "--output", str(saved)]
    said = runner.invoke(commands, words)
    assert (said.exit_code, said.stdout) == (0, "")
    assert saved.read_bytes() == exported(api, f"diagnoses/{diagnosis}", "csv")
    for words, expected in (
        (["--format", "netcdf"], "name a file"),
        (["--format", "xlsx"], "must be one of json, csv, netcdf"),
        (["--format", "netcdf", "-o", "run.csv"], "must end in .nc"),
    ):
        refused = runner.invoke(commands, ["runs", "export", run, *words], env={"COLUMNS": "200"})
        assert (refused.exit_code, expected in refused.stderr) == (2, True), refused.stderr
