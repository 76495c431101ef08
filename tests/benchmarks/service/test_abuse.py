"""Hostile requests are numerous and reproducible; answers and fuzzer reports are judged."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import httpx
import pytest

from benchmarks.abuse import __main__ as abuse
from benchmarks.abuse import fuzz, requests, uploads
from benchmarks.abuse.__main__ import _wrong
from benchmarks.abuse.cases import Case
from benchmarks.abuse.valid_values import ValidValues
from tests.service import toy
from tests.service.conftest import Api, serving
from wingfit.records import load_archive
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

PROBLEM = {"Content-Type": "application/problem+json"}
Json = dict[str, Any]


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_there_are_many_requests_and_a_seed_reproduces_them() -> None:
    first, again = (list(uploads.cases(1)) for _ in range(2))
    assert first == again
    assert first != list(uploads.cases(2))
    assert len(first) + len(list(requests.cases())) > 2000
    load_archive(uploads.small_archive(), "good.zip")


@pytest.mark.parametrize(
    ("answer", "status", "headers", "text", "fine"),
    [
        ("refused", 422, PROBLEM, "{}", True),
        ("refused", 201, {}, "{}", False),
        ("any", 201, {}, "{}", True),
        ("any", 404, PROBLEM, "{}", True),
        ("any", 500, PROBLEM, "{}", False),
        ("any", 503, PROBLEM, "{}", False),
        ("any", 400, {"Content-Type": "text/plain"}, "no", False),
        ("any", 422, PROBLEM, "Traceback (most recent call last)", False),
        ("accepted", 422, PROBLEM, "{}", False),
        ("accepted", 202, {}, "{}", True),
    ],
)
def test_an_answer_is_judged(answer: str, status: int, headers: dict[str, str], text: str, *, fine: bool) -> None:
    case = Case("x", answer=answer)  # type: ignore[arg-type]  # as above
    found = httpx.Response(status, headers=headers, content=text.encode())
    assert (_wrong(case, found) == "") is fine


WELL: Json = {
    "complete": True,
    "stop_reason": "completed",
    "operations": {"total": 45, "tested": 45},
    "test_cases": {"generated": 1960},
    "failures": [],
    "errors": [],
}
FAILURE = {"title": "Server error", "count": 3, "operations": ["POST /v1/runs", "GET /v1/runs"]}


@pytest.mark.parametrize(
    ("changed", "failures"),
    [
        ({}, []),
        ({"failures": [FAILURE]}, ["fuzz: Server error, 3 times in POST /v1/runs, GET /v1/runs"]),
        ({"errors": [{"title": "Network Error", "count": 1}]}, ["fuzz: Network Error, 1 times"]),
        ({"stop_reason": "interrupted"}, ["fuzz: ended early, interrupted"]),
        ({"complete": False, "stop_reason": "error"}, ["fuzz: ended early, error"]),
        ({"operations": {"total": 45, "tested": 44}}, ["fuzz: 44 of 45 calls of the API"]),
        ({"operations": None}, ["fuzz: 0 of all calls of the API"]),
    ],
)
def test_a_report_of_the_fuzzer_is_judged(changed: Json, failures: list[str]) -> None:
    assert fuzz.judged(WELL | changed) == failures
    assert fuzz.counted(WELL | changed) == 1960


def test_a_missing_fuzzer_is_reported_with_the_command_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzz, "program", lambda: None)
    monkeypatch.setattr(sys, "argv", ["abuse", "--json"])
    with pytest.raises(SystemExit, match=r"pip install -e \.\[fuzz\]"):
        abuse.main()


def good_of(dataset: str, run: str) -> Json:
    kind = {"dataset_id": dataset, "run_id": run, "recordings": ["slow"], "effects": ["added_mass"], "terms": []}
    kinds = {name: kind | {"genes": {"stiffness": 1.0}} for name in ("tracks", "forces")}
    more = {"diagnosis_id": "dx_" + "3" * 16, "key_id": "key_" + "4" * 16, "key": "x"}
    return kinds | more | {"effects": ["added_mass"], "examples": []}


def test_values_are_reproducible_and_needed_objects_are_not_deleted() -> None:
    dataset, run = "ds_" + "1" * 16, "run_" + "2" * 16
    values = ValidValues(good_of(dataset, run), [b"zip"], seed=1)
    generated = {"dataset_id": "x", "genome": {}, "population": 900, "preset": "dickinson", "seed": 5}
    filled = [values.body(generated, "tracks", values.dice("POST", seed)) for seed in range(50)]
    assert filled == [values.body(generated, "tracks", values.dice("POST", seed)) for seed in range(50)]
    assert 25 < sum(one["dataset_id"] == dataset for one in filled) < 50
    assert all(one["population"] == 8 and one["seed"] == 5 for one in filled)
    assert all("preset" not in one for one in filled if one["dataset_id"] == dataset)
    assert values.spared({"run_id": run}) == {"run_id": "run_" + "0" * 16}
    assert values.spared({"run_id": "run_" + "9" * 16}) == {"run_id": "run_" + "9" * 16}


@pytest.mark.skipif(fuzz.program() is None, reason="schemathesis is not installed")
@pytest.mark.parametrize("engine", [toy.ToyEngine(), toy.FaultyEngine()], ids=["sound", "faulty"])
def test_the_fuzzer_finds_a_fault_deep_inside(tmp_path: Path, engine: toy.ToyEngine) -> None:
    st = fuzz.program()
    assert st is not None
    app = create_app(Settings(data=tmp_path / "data"), engine=engine, make_evaluator=toy.NoEvaluator)
    with serving(app) as client:
        api = Api(client)
        run = api.submit(dataset := api.upload()["id"])["id"]
        api.finish(run)
        folder = fuzz._given(good_of(dataset, run), 1, tmp_path / "fuzz")
        report = fuzz._round(st, f"{client.base_url}{fuzz.SPECIFICATION}", "fuzzing", 8, 1, folder)
    assert fuzz.counted(report) > 200
    found = fuzz.judged(report)
    assert any("POST /v1/simulations" in one for one in found) == isinstance(engine, toy.FaultyEngine), found
