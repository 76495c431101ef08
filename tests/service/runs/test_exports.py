"""Runs and diagnoses as files: the same numbers as the API's, whole, in pieces where they are long."""

from __future__ import annotations

import asyncio
import csv
import io
import json
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tests.service import toy
from tests.service.conftest import Api, Gate, serving
from tests.service.runs import force_data
from tests.service.runs.export_files import ENDINGS, FORMATS, exported, opened, rows_of, texts, variables
from tests.service.shapes import valid
from wingfit.calibration.result import Comparison
from wingfit.calibration.search import CalibrationSpec
from wingfit.client.export_answers import RunExport
from wingfit.records import Dataset
from wingfit.service.app import create_app
from wingfit.service.http import csv_text
from wingfit.service.http.concurrency_limit import ConcurrencyLimit
from wingfit.service.http.problems import ProblemError
from wingfit.service.runs import exports as run_exports
from wingfit.service.settings import Settings
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import GenerationRow, RunRow
from wingfit.workers import make_evaluator

Json = dict[str, Any]


@pytest.fixture
def done(api: Api) -> Json:
    return api.finish(api.submit(api.upload()["id"], name="=1+1")["id"])


def test_every_form_has_its_type_and_a_name_to_save_it_under(api: Api, done: Json) -> None:
    diagnosis = api.diagnosed(api.diagnose(done["dataset_id"])["id"])["id"]
    plain = api.client.get(f"/v1/runs/{done['id']}/export")
    assert plain.headers["Content-Type"] == FORMATS["json"]
    for path, inner in ((f"runs/{done['id']}", "-history"), (f"diagnoses/{diagnosis}", "-ranking")):
        for form, media_type in FORMATS.items():
            answer = api.client.get(f"/v1/{path}/export?format={form}")
            name = f"{path.partition('/')[2]}{inner if form == 'csv' else ''}{ENDINGS[form]}"
            assert answer.headers["Content-Disposition"] == f'attachment; filename="{name}"'
            described = api.get("/openapi.json")["paths"][f"/v1/{path.partition('/')[0]}/{{{_id(path)}}}/export"]
            content = described["get"]["responses"]["200"]["content"]
            assert set(content) == {one.partition(";")[0] for one in FORMATS.values()}
            assert answer.headers["Content-Type"] == media_type
        refused = api.client.get(f"/v1/{path}/export?format=xlsx")
        assert (refused.status_code, refused.json()["errors"][0]["where"]) == (422, "query.format")
        assert api.client.get(f"/v1/{path[:-1]}x/export?format=netcdf").status_code == 404


def _id(path: str) -> str:
    return "run_id" if path.startswith("runs") else "diagnosis_id"


def test_the_table_of_a_run_is_its_history(api: Api, done: Json) -> None:
    text = exported(api, f"runs/{done['id']}", "csv").decode()
    lines = text.split("\r\n")
    assert lines[-1] == ""
    assert "\n" not in text.replace("\r\n", "")
    assert lines[0] == (
        "sequence,stage,generation,best_m2,mean_m2,diversity,best_mm,evaluations,failed,reasons,elapsed_seconds"
    )
    history = api.history(done["id"])
    rows = rows_of(api, f"runs/{done['id']}")
    assert len(rows) == len(history) == 10
    for row, item in zip(rows, history, strict=True):
        for name in ("sequence", "generation", "evaluations", "failed"):
            assert int(row[name]) == item[name]
        for column, name in (("best_m2", "best"), ("mean_m2", "mean"), ("best_mm", "best_mm")):
            assert (float(row[column]) if row[column] else None) == item[name]
        assert (row["stage"], row["reasons"]) == (item["stage"], "diverged at 0.1 s")
        assert float(row["elapsed_seconds"]) == item["elapsed_seconds"]
    assert rows[0]["mean_m2"] == "", "a mean that does not exist"


def test_the_document_of_a_run_is_all_that_the_api_tells_and_repeats_it(api: Api, done: Json) -> None:
    found = json.loads(exported(api, f"runs/{done['id']}", "json"))
    valid(RunExport, found)
    assert found["schema_id"] == "urn:wingfit:schema:run-export:1"
    assert found["wingfit_version"] == api.get("/v1/health")["version"]
    assert found["run"] == done
    assert found["dataset"] == api.get(f"/v1/datasets/{done['dataset_id']}")
    assert found["result"] == api.get(f"/v1/runs/{done['id']}/result")
    assert found["genome"] == api.get(f"/v1/runs/{done['id']}/genome")
    assert found["history"] == api.history(done["id"])
    again = api.client.post("/v1/runs", json=found["request"])
    assert again.status_code == 202, again.text
    repeated = api.finish(again.json()["id"])
    assert (repeated["name"], repeated["spec"], repeated["best_mm"]) == (done["name"], done["spec"], done["best_mm"])


def test_netcdf_of_a_run_has_the_numbers_of_the_api(api: Api, done: Json) -> None:
    run, history = done["id"], api.history(done["id"])
    genes = api.get(f"/v1/runs/{run}/genome")["genes"]
    with opened(exported(api, f"runs/{run}", "netcdf")) as file:
        assert {name: len(size) for name, size in file.dimensions.items()} == {"generation": 10, "gene": 2}
        assert file.attrs["Conventions"].startswith("CF-1.")
        assert file.attrs["source"].startswith("wingfit ")
        assert file.attrs["history"].splitlines()[0] == f"{done['created_at']} submitted"
        assert file.attrs["dataset_sha256"] == api.get(f"/v1/datasets/{done['dataset_id']}")["sha256"]
        assert json.loads(file.attrs["request"])["seed"] == done["spec"]["seed"]
        for path, variable in variables(file):
            assert variable.attrs["units"], path
            assert variable.attrs["long_name"], path
        for name in ("sequence", "best", "mean", "diversity", "best_mm", "evaluations", "failed", "elapsed_seconds"):
            expected = [np.nan if one[name] is None else one[name] for one in history]
            np.testing.assert_array_equal(file[name][:], expected, err_msg=name)
        assert file["best"].attrs["units"] == "m2"
        assert file["generation_in_stage"][:].tolist() == [one["generation"] for one in history]
        assert texts(file["stage"]) == [one["stage"] for one in history]
        assert texts(file["gene"]) == [gene["name"] for gene in genes]
        for name in ("nominal", "best", "lower", "upper", "standard_error_percent"):
            assert file[f"gene_{name}"][:].tolist() == [gene[name] for gene in genes]
        assert file["gene_identifiable"][:].tolist() == [1, 1]
        for name, held_out in (("slow", "no"), ("fast", "no"), ("unseen", "yes")):
            told, group = api.get(f"/v1/runs/{run}/comparison?recording={name}"), file[f"recordings/{name}"]
            assert (texts(group["marker"]), group.attrs["held_out"]) == (told["markers"], held_out)
            assert group["phase"][:].tolist() == told["phase"]
            assert group["recorded_mm"].attrs["units"] == "mm"
            for series in ("recorded_mm", "simulated_mm"):
                np.testing.assert_array_equal(group[series][:], np.array(told[series], dtype=float))
            assert group["simulated_mm"].attrs["steps_per_beat"] == told["numerics"]["steps_per_beat"]


def test_an_unfinished_run_is_exported_as_far_as_it_is(api: Api, gate: Gate) -> None:
    run = api.submit(api.upload()["id"])["id"]
    path = f"runs/{run}"
    api.until(run, lambda r: r["state"] == "RUNNING")
    assert len(exported(api, path, "csv").splitlines()) == 1
    empty = json.loads(exported(api, path, "json"))
    assert (empty["genome"], empty["result"], empty["history"]) == (None, None, [])
    refused = api.client.get(f"/v1/{path}/export?format=netcdf")
    assert (refused.status_code, refused.json()["state"]) == (409, "RUNNING")
    assert refused.json()["detail"] == "no generation has finished yet"
    gate.let(2)
    api.until(run, lambda r: r["generations"] == 2)
    assert [row["sequence"] for row in rows_of(api, path)] == ["1", "2"]
    part = json.loads(exported(api, path, "json"))
    assert (part["genome"]["final"], part["result"], part["run"]["state"]) == (False, None, "RUNNING")
    assert part["history"] == api.history(run)
    with opened(exported(api, path, "netcdf")) as file:
        assert file["sequence"][:].tolist() == [1, 2]
        assert file.attrs["state"] == "RUNNING"
        assert file["gene_identifiable"][:].tolist() == [-1, -1]
        told = api.get(f"/v1/runs/{run}/comparison?recording=fast")
        np.testing.assert_array_equal(file["recordings/fast/simulated_mm"][:], told["simulated_mm"])
    gate.let(20)


def test_a_recording_that_cannot_be_simulated_does_not_spoil_the_others(tmp_path: Path) -> None:
    class Frail(toy.ToyEngine):
        def compare(
            self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
        ) -> Comparison:
            if recording == "fast":
                raise ValueError("the wing flutters")
            return super().compare(spec, dataset, genome, recording)

    with serving(create_app(Settings(data=tmp_path), engine=Frail(), make_evaluator=toy.NoEvaluator)) as client:
        api = Api(client)
        run = api.finish(api.submit(api.upload()["id"])["id"])["id"]
        with opened(exported(api, f"runs/{run}", "netcdf")) as file:
            fast, slow = (file[f"recordings/{name}"] for name in ("fast", "slow"))
            assert fast["simulated_mm"].attrs["comment"] == "the simulation failed: the wing flutters"
            assert np.isnan(fast["simulated_mm"][:]).all()
            np.testing.assert_array_equal(fast["recorded_mm"][:], slow["recorded_mm"][:])
            assert np.isfinite(slow["simulated_mm"][:]).all()


@pytest.fixture
def long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Database, RunRow, list[int]]]:
    """A run of 25 generations, read ten at a time, and how many each reading asked for."""
    asked: list[int] = []
    original = store.steps

    def counted(
        session: Any, table: type[GenerationRow], run_id: str, after: int, limit: int | None = None
    ) -> list[GenerationRow]:
        asked.append(limit or 0)
        return original(session, table, run_id, after, limit)

    monkeypatch.setattr(run_exports, "BLOCK", 10)
    app = create_app(Settings(data=tmp_path), engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)
    with serving(app) as client:
        api = Api(client)
        run = api.finish(api.submit(api.upload()["id"], max_generations=13)["id"])["id"]
        with app.state.service.database.read() as session:
            row = store.one(session, RunRow, run)
        monkeypatch.setattr(store, "steps", counted)
        yield app.state.service.database, row, asked


def test_a_long_history_is_read_while_it_is_sent(long: tuple[Database, RunRow, list[int]]) -> None:
    database, row, asked = long
    pieces = run_exports.table(database, row)
    assert next(pieces).startswith("sequence")
    assert asked == []
    assert [len(next(pieces).splitlines()), asked] == [10, [10]]
    assert [len(piece.splitlines()) for piece in pieces] == [10, 6]
    assert asked == [10, 10, 6]


def test_a_run_that_is_deleted_meanwhile_does_not_look_whole(long: tuple[Database, RunRow, list[int]]) -> None:
    database, row, _ = long
    pieces = run_exports.table(database, row)
    next(pieces), next(pieces)
    with database.write() as session:
        store.delete_job(session, RunRow, row.id)
    with pytest.raises(ProblemError, match="there is no run"):
        next(pieces)


def test_only_what_simulates_takes_its_turn(tmp_path: Path) -> None:
    entered, go = threading.Event(), threading.Event()

    class Held(toy.ToyEngine):
        def compare(
            self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
        ) -> Comparison:
            entered.set()
            assert go.wait(60)
            return super().compare(spec, dataset, genome, recording)

    app = create_app(Settings(data=tmp_path), engine=Held(), make_evaluator=toy.NoEvaluator)
    with serving(app) as client, ThreadPoolExecutor(1) as pool:
        api, app.state.service.exports = Api(client), ConcurrencyLimit("exports", 1, max_waiting=0)
        run = api.finish(api.submit(api.upload()["id"])["id"])["id"]
        held = pool.submit(exported, api, f"runs/{run}", "netcdf")
        try:
            assert entered.wait(60)
            with httpx.Client(base_url=client.base_url, timeout=60) as other:
                busy = other.get(f"/v1/runs/{run}/export?format=netcdf")
                assert (busy.status_code, busy.json()["type"]) == (503, "urn:wingfit:problem:busy")
                assert len(exported(Api(other), f"runs/{run}", "csv").splitlines()) == 11
                assert exported(Api(other), f"runs/{run}", "json")
        finally:
            go.set()
        assert held.result(60)
        assert exported(api, f"runs/{run}", "netcdf"), "the turn was given back"


def test_a_slot_of_a_request_that_fails_is_released() -> None:
    async def scene() -> None:
        limit = ConcurrencyLimit("simulations", 1, max_waiting=0)
        with pytest.raises(ProblemError, match="no run"):
            async with limit.slot():
                raise ProblemError(404, "not-found", "no run")
        async with asyncio.timeout(60), limit.slot():
            pass

    asyncio.run(scene())


@pytest.mark.parametrize(
    ("cell", "written"),
    [
        ("=cmd|' /C calc'!A0", "'=cmd|' /C calc'!A0"),
        ("+1", "'+1"),
        ("-1", "'-1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1", "'\t=1"),
        ("＝1+1", "'＝1+1"),
        ("\r=1", '"\'\r=1"'),
        ('=HYPERLINK("http://x","y")', '"\'=HYPERLINK(""http://x"",""y"")"'),
        ("test-4, Gauss-Newton", '"test-4, Gauss-Newton"'),
        ("a=b", "a=b"),
        ("", ""),
        (None, ""),
        (-0.1 - 0.2, "-0.30000000000000004"),
        (1e-300, "1e-300"),
        (True, "true"),
        (2**53, "9007199254740992"),
    ],
)
def test_no_text_is_a_formula_and_no_number_loses_digits(cell: csv_text.Cell, written: str) -> None:
    assert csv_text.lines([["x", cell]]) == f"x,{written}\r\n"
    (read,) = csv.reader(io.StringIO(csv_text.lines([["x", cell]]), newline=""))
    assert not isinstance(cell, str) or read[1].removeprefix("'") == cell.removeprefix("'")


def test_a_real_run_on_forces_has_every_source_of_every_recording(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path), make_evaluator=lambda: make_evaluator("in_process", None, None))
    with serving(app) as client:
        api = Api(client)
        files = {"file": ("delfly.zip", force_data.archive(3))}
        dataset = client.post("/v1/datasets", files=files).json()
        run = api.finish(api.submit(dataset["id"])["id"], 120.0)
        assert run["state"] == "SUCCEEDED", run["error"]
        path, history = f"runs/{run['id']}", api.history(run["id"])
        rows = rows_of(api, path)
        assert [(row["stage"], float(row["best_n2"]), float(row["best_mn"])) for row in rows] == [
            (item["stage"], item["best"], item["best_mn"]) for item in history
        ]
        document = json.loads(exported(api, path, "json"))
        valid(RunExport, document)
        assert document["result"] == api.get(f"/v1/{path}/result")
        with opened(exported(api, path, "netcdf")) as file:
            assert file["best"].attrs["units"] == "N2"
            assert list(file["recordings"].groups) == [one["name"] for one in dataset["recordings"]]
            fitted = file[f"recordings/{force_data.FITTED[-1]}"]
            assert {"local", "average", "nominal"} <= set(texts(fitted["source"]))
            assert "local" not in texts(file[f"recordings/{force_data.HELD_OUT}/source"])
            for name, group in file["recordings"].groups.items():
                for k, source in enumerate(texts(group["source"])):
                    told = api.get(f"/v1/{path}/forces?recording={name}&source={source}")
                    quantities = texts(group["quantity"])
                    assert quantities == list(told["recorded_n"])
                    assert group["phase"][:].tolist() == told["phase"]
                    for series, values in (
                        ("recorded_n", group["recorded_n"][:]),
                        ("modelled_n", group["modelled_n"][k]),
                    ):
                        assert values.tolist() == [told[series][quantity] for quantity in quantities]
