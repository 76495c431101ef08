"""Estimates of a dataset that no model takes: a submission names them, not the options of the run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tests.service.conftest import Api, serving
from tests.service.runs import force_data
from wingfit.records import load_dataset, wing_or_vehicle
from wingfit.service.app import create_app
from wingfit.service.settings import Settings
from wingfit.workers import make_evaluator

EXAMPLE = Path(__file__).parents[3] / "examples" / "robird"


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    settings = Settings(data=tmp_path_factory.mktemp("estimates") / "data")
    with serving(create_app(settings, make_evaluator=lambda: make_evaluator("in_process", None, None))) as client:
        yield Api(client)


@pytest.mark.parametrize(
    ("estimates", "said"),
    [({"C_l": 900.0}, "estimate of gene 'C_l' is 900; it must lie in [0, 5]"), ({"C_x": 1.0}, "unknown gene 'C_x'")],
)
def test_a_submission_names_the_estimate(api: Api, estimates: dict[str, float], said: str) -> None:
    whole = force_data.dataset()
    data = force_data.zipped(replace(whole, rig=replace(whole.vehicle, estimates=estimates)))
    dataset = api.client.post("/v1/datasets", files={"file": ("delfly.zip", data)}).json()
    for path, more in (("/v1/runs", {}), ("/v1/simulations", {"recording": "test-4"})):
        answer = api.client.post(path, json={"dataset_id": dataset["id"]} | more)
        assert answer.status_code == 422, answer.text
        (error,) = answer.json()["errors"]
        assert error["where"] == "dataset.vehicle.estimates"
        assert said in error["message"]
        assert "change vehicle.estimates in dataset.yaml" in error["message"]


def test_a_wings_estimate_is_named_too(api: Api) -> None:
    wing = wing_or_vehicle(load_dataset(EXAMPLE))
    spoilt = replace(wing, rig=replace(wing.wing, estimates={"E_r": 180.0}))  # in gigapascal
    dataset = api.client.post("/v1/datasets", files={"file": ("robird.zip", force_data.zipped(spoilt))}).json()
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset["id"]})
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["where"] == "dataset.wing.estimates"
    assert "check its unit" in error["message"]
