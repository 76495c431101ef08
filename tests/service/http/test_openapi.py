"""The OpenAPI document: complete, and in step with docs/api.md."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel, TypeAdapter

from tests.checks.samples import good_vehicle
from tests.records.series_samples import arm_dataset
from tests.service import toy
from tests.service.conftest import Api
from tests.service.films.films import ended, submitted, uploaded, write_videos
from wingfit.calibration.spec import CalibrationSpec, resolved
from wingfit.client.transport import parse_events
from wingfit.records import Dataset
from wingfit.records.files.netcdf import write_netcdf
from wingfit.service.diagnoses.requests import DiagnosisIn
from wingfit.service.examples import EXAMPLES
from wingfit.service.films.requests import FilmIn, TrackingIn
from wingfit.service.outcomes.requests import LoadsIn, PredictionIn, SimulationIn
from wingfit.service.planning.requests import PlanIn
from wingfit.service.runs.requests import Method, Mode, RunIn
from wingfit.sim.virtual_rigs.balance import delfly
from wingfit.sim.virtual_rigs.campaign import robird_wing

DOCS = Path(__file__).parents[3] / "docs" / "api.md"
Specification = dict[str, Any]


@pytest.fixture(scope="module")
def specification(shared: tuple[Api, str]) -> Specification:
    answer = shared[0].client.get("/openapi.json")
    assert answer.status_code == 200
    return dict(answer.json())


def operations(specification: Specification) -> list[tuple[str, str, Specification]]:
    return [
        (method.upper(), path, operation)
        for path, methods in specification["paths"].items()
        for method, operation in methods.items()
    ]


def test_every_operation_is_described(specification: Specification) -> None:
    assert specification["openapi"].startswith("3.1")
    for method, path, operation in operations(specification):
        assert operation["summary"], (method, path)
        assert operation["description"], (method, path)
        default = operation["responses"]["default"]["content"]
        assert list(default) == ["application/problem+json"], (method, path)
        assert "application/json" not in operation["responses"]["422"]["content"], (method, path)
        if "{" in path:
            assert "404" in operation["responses"], (method, path)


def test_every_reference_exists(specification: Specification) -> None:
    names = set(re.findall(r"#/components/schemas/([\w-]+)", str(specification)))
    assert names <= set(specification["components"]["schemas"])
    assert "Problem" in names


def test_creating_calls_link_to_the_calls_on_their_result(specification: Specification) -> None:
    by_id = {operation["operationId"]: path for _, path, operation in operations(specification)}
    links = specification["paths"]["/v1/runs"]["post"]["responses"]["202"]["links"]
    reached = {by_id[link["operationId"]] for link in links.values()}
    assert {path for path in by_id.values() if "{run_id}" in path} <= reached
    of_dataset = specification["paths"]["/v1/datasets"]["post"]["responses"]["201"]["links"]
    assert of_dataset["Submit a calibration"]["requestBody"] == {"dataset_id": "$response.body#/id"}
    assert of_dataset["Fetch a dataset"]["parameters"] == {"dataset_id": "$response.body#/id"}


def test_parameters_and_form_fields_are_never_null(specification: Specification) -> None:
    for method, path, operation in operations(specification):
        for parameter in operation.get("parameters", ()):
            assert "null" not in str(parameter["schema"]), (method, path, parameter["name"])
    form = specification["components"]["schemas"]["Body_upload_v1_datasets_post"]["properties"]
    assert form["name"]["maxLength"] == 200
    assert "anyOf" not in form["name"]


def test_unchanged_answers_are_304_as_described(api: Api, specification: Specification, tmp_path: Path) -> None:
    run = api.submit(api.upload()["id"])["id"]
    diagnosis = api.diagnose(api.run(run)["dataset_id"])["id"]
    api.finish(run)
    api.diagnosed(diagnosis)
    film = uploaded(api, write_videos(tmp_path, frames=3))["id"]
    tracking = ended(api, submitted(api, film)["id"])["id"]
    ids = {"run_id": run, "dataset_id": api.run(run)["dataset_id"], "diagnosis_id": diagnosis}
    ids |= {"film_id": film, "tracking_id": tracking, "camera": "left", "number": "0"}
    file = {"file": ("arm.nc", write_netcdf(arm_dataset()))}
    vehicle = {"file": ("delfly.nc", write_netcdf(good_vehicle()))}
    others = {
        f"/v1/datasets/{{dataset_id}}/{name}": {"dataset_id": api.client.post("/v1/datasets", files=one).json()["id"]}
        for name, one in (("series", file), ("forces", vehicle))
    }
    tried = 0
    for method, path, operation in operations(specification):
        marked = any(parameter["name"] == "If-None-Match" for parameter in operation.get("parameters", ()))
        assert ("304" in operation["responses"]) is marked, path
        if marked:
            answer = api.client.request(
                method,
                path.format(**(ids | others.get(path, {}))),
                headers={"If-None-Match": "*"},
            )
            assert (answer.status_code, answer.content) == (304, b""), path
            tried += 1
    assert tried >= 12


def test_events_are_as_described(api: Api, specification: Specification) -> None:
    dataset = api.upload()["id"]
    run, diagnosis = api.submit(dataset)["id"], api.diagnose(dataset)["id"]
    api.finish(run)
    api.diagnosed(diagnosis)
    for kind, job in (("run", run), ("diagnosis", diagnosis)):
        path = f"/v1/{'runs' if kind == 'run' else 'diagnoses'}/{{{kind}_id}}/events"
        described = specification["paths"][path]["get"]["responses"]["200"]["content"]["text/event-stream"]["schema"]
        with api.client.stream("GET", path.replace(f"{{{kind}_id}}", job)) as answer:
            events = list(parse_events(answer.iter_lines()))
        assert {event["event"] for event in events} == set(described["properties"]["event"]["enum"])
        assert all(set(described["required"]) == set(event) and event["id"] for event in events)


@pytest.mark.parametrize("filename", ["a.zip", "a.nc", "a", "a.tar"])
def test_an_archive_comes_back_as_described(
    shared: tuple[Api, str], specification: Specification, filename: str
) -> None:
    api, _ = shared
    dataset = api.client.post("/v1/datasets", files={"file": (filename, toy.archive())}).json()["id"]
    described = specification["paths"]["/v1/datasets/{dataset_id}/archive"]["get"]["responses"]["200"]["content"]
    assert api.client.get(f"/v1/datasets/{dataset}/archive").headers["Content-Type"] in described


def test_every_call_is_in_the_documentation_and_every_documented_one_exists(specification: Specification) -> None:
    text = DOCS.read_text()
    documented = {
        (method, re.sub(r"{\w+}", "{}", path.split("?")[0]))
        for method, path in re.findall(r"`(GET|POST|PUT|PATCH|DELETE) (/v1/[^`\s]*)", text)
    }
    for action in ("pause", "resume"):
        assert f"(`/{action}`" in text.replace(", `/", "`(`/") or f"/{action}" in text
        documented.add(("POST", f"/v1/runs/{{}}/{action}"))
    existing = {
        (method, re.sub(r"{\w+}", "{}", path))
        for method, path, _ in operations(specification)
        if path.startswith("/v1")
    }
    assert documented == existing


@pytest.mark.parametrize(
    "model",
    [
        RunIn,
        SimulationIn,
        LoadsIn,
        PredictionIn,
        PlanIn,
        DiagnosisIn,
        FilmIn,
        TrackingIn,
    ],
)
def test_examples_of_requests_are_valid(model: type[BaseModel]) -> None:
    extra = model.model_config["json_schema_extra"]
    assert isinstance(extra, dict)
    examples = extra["examples"]
    assert isinstance(examples, list)
    for example in examples:
        model.model_validate(example)


@pytest.mark.parametrize("shape", list(EXAMPLES))
def test_examples_of_answers_are_valid(shape: type, specification: Specification) -> None:
    assert specification["components"]["schemas"][shape.__name__]["examples"] == [EXAMPLES[shape]]
    TypeAdapter(shape).validate_python(EXAMPLES[shape])


def test_settings_in_answers_are_described_as_in_requests(specification: Specification) -> None:
    schemas = specification["components"]["schemas"]
    for answer, request in (("RunSpec", "RunIn"), ("DiagnosisSpec", "DiagnosisIn")):
        described = {
            name: field["description"]
            for name, field in schemas[request]["properties"].items()
            if "description" in field
        }
        assert len(described) > 5
        for name in described.keys() & schemas[answer]["properties"].keys():
            assert schemas[answer]["properties"][name]["description"] == described[name]


def test_the_documentation_page_needs_no_other_origin(shared: tuple[Api, str], specification: Specification) -> None:
    page = shared[0].client.get("/docs")
    assert page.status_code == 200
    assert not re.findall(r"""(?:src|href)=["'](?:https?:)?//""", page.text)
    for method, path, _ in operations(specification):
        assert f"{method} {path}" in page.text


def test_the_schema_of_datasets_is_published(shared: tuple[Api, str]) -> None:
    schema = shared[0].client.get("/v1/schemas/dataset").json()
    assert schema["$schema"].startswith("https://json-schema.org/")
    kinds = [schema["$defs"][part["$ref"].rpartition("/")[2]]["properties"] for part in schema["anyOf"]]
    assert ["wing" in kinds[0], "vehicle" in kinds[1]] == [True, True]


@pytest.mark.parametrize("which", ["wing", "vehicle"])
def test_modes_and_methods_are_those_that_a_calibration_takes(which: str) -> None:
    """The documented ones are accepted, the others refused, and the default is what is taken unasked."""
    dataset = Dataset("d", robird_wing() if which == "wing" else delfly(), ())
    rows = dict(re.findall(r"^\| `(mode|method)` \| (.*) \|$", DOCS.read_text(), re.MULTILINE))
    (of_this,) = re.findall(rf"of a {which} ([^;]*)", rows["mode"])
    accepted = {mode for mode in get_args(Mode) if _accepts(CalibrationSpec(mode=mode), dataset)}
    assert set(re.findall(r"`(\w+)`", of_this)) == accepted
    assert set(re.findall(r"`(\w+)`", rows["method"])) == set(get_args(Method))
    unasked = resolved(CalibrationSpec(), dataset)
    assert f"`{unasked.mode}` (default)" in of_this
    assert f"`{unasked.method}` (default of a {which})" in rows["method"]


def _accepts(spec: CalibrationSpec, dataset: Dataset) -> bool:
    try:
        resolved(spec, dataset)
    except ValueError:
        return False
    return True
