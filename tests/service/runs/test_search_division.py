"""The discretisation of the search (``search_division``) in requests for runs and in the answers about them."""

from __future__ import annotations

from typing import Any

import pytest

from tests.service.conftest import Api
from wingfit.calibration.spec import CalibrationSpec
from wingfit.records import Dataset
from wingfit.service.runs.engine import Engine
from wingfit.service.runs.spec_views import run_name
from wingfit.sim.virtual_rigs.campaign import robird_wing


@pytest.mark.parametrize("how", [{"method": "auto"}, {"finish": True}, {"method": "cma_es", "finish": True}])
def test_it_is_accepted_and_reported(api: Api, how: dict[str, Any]) -> None:
    body = {"dataset_id": api.upload()["id"], "division": "11", "search_division": "4", **how}
    answer = api.client.post("/v1/runs?validate_only=true", json=body)
    assert answer.is_success, answer.text
    assert (answer.json()["spec"]["division"], answer.json()["spec"]["search_division"]) == ("11", "4")
    assert answer.json()["name"].endswith(", searched with division 4")
    run = api.submit(**body, max_generations=1)
    assert api.run(run["id"])["spec"]["search_division"] == "4"


def test_off_unless_asked_for(api: Api) -> None:
    dataset = api.upload()["id"]
    for body in ({}, {"search_division": None}, {"search_division": None, "method": "gauss_newton"}):
        answer = api.client.post("/v1/runs?validate_only=true", json={"dataset_id": dataset} | body)
        assert answer.is_success, answer.text
        assert answer.json()["spec"]["search_division"] is None
        assert "searched" not in answer.json()["name"]


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({"search_division": "banana", "method": "auto"}, "must be a preset 4, 11, 24"),
        ({"search_division": 4, "method": "auto"}, "string"),
        ({"search_division": "4"}, "search_division '4' with method 'genetic' would end at the minimum of that"),
        ({"search_division": "4", "method": "cma_es"}, "add finish (Gauss-Newton afterwards), use method 'auto', or"),
        ({"search_division": "4", "method": "gauss_newton"}, "'gauss_newton' has none; use method 'auto', or leave it"),
    ],
)
def test_it_is_refused_in_words_where_it_does_not_fit(api: Api, body: dict[str, Any], said: str) -> None:
    answer = api.client.post("/v1/runs", json={"dataset_id": api.upload()["id"]} | body)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert (error["where"], error["value"]) == ("body.search_division", body["search_division"])
    assert said in error["message"]
    assert api.get("/v1/runs")["items"] == []


def test_a_diagnosis_has_no_such_setting(api: Api) -> None:
    body = {"dataset_id": api.upload()["id"], "search_division": "4"}
    answer = api.client.post("/v1/diagnoses", json=body)
    assert answer.status_code == 422, answer.text
    assert [error["where"] for error in answer.json()["errors"]] == ["body.search_division"]


def test_the_engine_refuses_what_cannot_be_made() -> None:
    dataset, spec = Dataset("d", robird_wing(), ()), CalibrationSpec(method="auto", search_division="99")
    with pytest.raises(ValueError, match="search_division: division '99' is not valid; give a preset"):
        Engine().check(spec, dataset)
    assert run_name(dataset, spec) == "d, division 11, auto, searched with division 99"
