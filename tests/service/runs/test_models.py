"""Calibrated models of runs and diagnoses over HTTP: formats, states in which there is none, and refusals."""

from __future__ import annotations

import ast
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.service.conftest import Api, Gate
from tests.service.runs import force_data
from tests.service.runs.force_data import finished, served, upload
from wingfit.client.client import Client, WingfitError
from wingfit.export.model_file import model_from_json

Json = dict[str, Any]


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    yield from served(tmp_path_factory.mktemp("models"))


@pytest.fixture(scope="module")
def run(real: Api) -> Json:
    return finished(real, upload(real, force_data.archive()))


def test_a_run_that_has_succeeded_has_a_model(real: Api, run: Json) -> None:
    answer = real.client.get(f"/v1/runs/{run['id']}/model?format=json")
    model = model_from_json(answer.content)
    assert answer.headers["Content-Disposition"] == 'attachment; filename="delfly.json"'
    source, dataset = model.provenance, real.get(f"/v1/datasets/{run['dataset_id']}")
    assert (source.origin, source.id, source.dataset, source.seed) == ("run", run["id"], "delfly", 1)
    assert source.dataset_sha256 == dataset["sha256"]
    assert source.source == "global model of 5 recordings (Armanini et al. 2016, Eq. 23)"
    assert model.covariance is not None
    assert {"C_l", "C_l.per_hz", "C_l.per_rad", "C_r", "C_F"} <= set(model.covariance.names)
    result = real.get(f"/v1/runs/{run['id']}/result")
    assert model.misfit == pytest.approx(result["after_mn"] / 1e3)
    law = {one["name"]: one for one in result["global_model"]["genes"]}
    assert model.values["C_l"] == pytest.approx(law["C_l"]["constant"])


def test_it_predicts_what_the_server_predicts(real: Api, run: Json, tmp_path: Path) -> None:
    with Client(str(real.client.base_url)) as client:
        path = client.export_model(run["id"], "python", tmp_path)
        with pytest.raises(WingfitError, match="give no hypothesis"):
            client.export_model(run["id"], "python", tmp_path, hypothesis="nominal")
    assert path.name == "delfly.py"
    text = path.read_text()
    ast.parse(text)
    space: Json = {"__name__": "exported"}
    exec(compile(text, str(path), "exec"), space)  # noqa: S102  (made above)
    condition = {"flap_frequency_hz": 12.2, "airspeed_m_s": 0.7, "body_pitch_deg": 66.0}
    there = real.client.post(f"/v1/runs/{run['id']}/predictions", json=condition)
    assert there.status_code == 200, there.text
    here = space["Model"]().forces(flap_frequency_hz=12.2, airspeed_m_s=0.7, angle_of_attack_deg=66.0)
    means = {axis: sum(there.json()[f"{axis}_n"]) / len(there.json()[f"{axis}_n"]) for axis in "xz"}
    assert here.mean_n.tolist() == pytest.approx([means["x"], means["z"]], abs=2e-6)


def test_tables_are_over_the_fitted_range(real: Api, run: Json, tmp_path: Path) -> None:
    path = tmp_path / "tables.zip"
    path.write_bytes(real.client.get(f"/v1/runs/{run['id']}/model?format=tables").content)
    with zipfile.ZipFile(path) as archive:
        assert set(archive.namelist()) == {"means.csv", "beats.csv", "tables.json"}
        document = json.loads(archive.read("tables.json"))
        head, *rows = archive.read("means.csv").decode().splitlines()
    assert len(rows) == len(document["means"]) > 20
    assert document["failed"] == []
    assert {"flap_frequency_hz", "airspeed_m_s", "mean_force_x_n", "mean_force_x_low_n"} <= set(head.split(","))
    for row in document["means"]:
        assert row["mean_force_x_low_n"] <= row["mean_force_x_n"] <= row["mean_force_x_high_n"]
        assert 10.3 - 1e-9 <= row["flap_frequency_hz"] <= 13.3 + 1e-9


def test_a_model_is_refused_with_a_reason(real: Api, run: Json) -> None:
    path = f"/v1/runs/{run['id']}/model"
    for query, where in (("format=xlsx", "query.format"), ("hypothesis=nominal", "query.hypothesis")):
        refused = real.client.get(f"{path}?{query}")
        assert (refused.status_code, refused.json()["errors"][0]["where"]) == (422, where)
    assert real.client.get(path, headers={"Sec-Fetch-Site": "cross-site"}).status_code == 403
    assert real.client.get(f"/v1/runs/{run['id']}x/model").status_code == 404
    assert real.client.get("/v1/diagnoses/dx_0/model").status_code == 404


def test_a_run_without_result_has_no_model(gate: Gate, api: Api) -> None:
    run = api.submit(api.upload()["id"])["id"]
    refused = api.client.get(f"/v1/runs/{run}/model")
    assert refused.status_code == 409
    assert "it has a model to take away when it has SUCCEEDED" in refused.json()["detail"]
    gate.let(100)


def test_a_finding_of_before_keeps_no_models(api: Api) -> None:
    """As the toy's, which has no fitted models."""
    diagnosis = api.diagnosed(api.diagnose(api.upload()["id"])["id"])["id"]
    for query, status in (("", 409), ("?hypothesis=nominal", 422)):
        refused = api.client.get(f"/v1/diagnoses/{diagnosis}/model{query}")
        assert refused.status_code == status
        assert "diagnose again" in refused.text
