"""A rig that its user simulates: the same finding as in one process, whoever dies in between."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import h5netcdf
import httpx
import pytest

import wingfit
from tests.records.series_samples import arm_dataset
from tests.service.conftest import Api, As, Json, serving
from tests.service.rigs import decay_rig
from wingfit.client.client import Client, WingfitError
from wingfit.records.files.archive import write_zip
from wingfit.records.files.netcdf import write_netcdf
from wingfit.rigs import load
from wingfit.rigs.declaration import declaration
from wingfit.service.app import create_app
from wingfit.service.settings import Settings
from wingfit.workers.in_process import InProcessEvaluator

NOTHING = {"id": "none", "reason": "late"}
DECLARED = declaration(decay_rig.rig)


@contextmanager
def service(folder: Path) -> Iterator[Api]:
    app = create_app(Settings(data=folder), make_evaluator=InProcessEvaluator)
    with serving(app) as client:
        yield Api(client)


@pytest.fixture
def real(tmp_path: Path) -> Iterator[Api]:
    with service(tmp_path / "data") as api:
        yield api


def upload(
    api: Api,
    dataset: wingfit.SeriesDataset | None = None,
    write: Callable[[wingfit.SeriesDataset], bytes] = write_zip,
) -> str:
    answer = api.client.post("/v1/datasets", files={"file": ("decay", write(dataset or decay_rig.dataset()))})
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def client_of(api: Api) -> Client:
    return Client(str(api.client.base_url))


@contextmanager
def driver(api: Api, job: str) -> Iterator[None]:
    """A driver in a thread, which has ended when the block is left."""

    def drive() -> None:
        with client_of(api) as client:
            wingfit.drive(client, job, decay_rig.rig)

    thread = threading.Thread(target=drive, daemon=True)
    thread.start()
    try:
        yield
    finally:
        thread.join(60.0)
    assert not thread.is_alive()


def without_time(finding: Json) -> Json:
    return {name: value for name, value in finding.items() if name != "seconds"}


@pytest.fixture(scope="module")
def alone() -> Json:
    """The finding in one process."""
    finding = wingfit.diagnose(decay_rig.dataset(), rig=decay_rig.rig)
    return without_time(wingfit.finding_json(finding))


def check_netcdf(content: bytes, found: Json) -> None:
    """The file has what a series has, in its units, and nothing of a beat."""
    with h5netcdf.File(io.BytesIO(content)) as file:
        assert set(file) == {"recordings", "channels", "overlays"}
        assert not [name for name in file["recordings"].variables if "flap" in name or "pressure" in name]
        assert file["recordings/before"].attrs["units"] == "1"
        assert list(file["recordings/before"]) == [one["before"]["value"] for one in found["recordings"]]
        assert list(file["channels/noise"]) == [one["noise"] for one in found["channels"]]
        first = found["overlays"][0]
        for name in ("recorded", "before", "after"):
            assert list(file[f"overlays/1/{name}"]) == first[name]
            assert file[f"overlays/1/{name}"].attrs["units"] == first["unit"]
        assert file["overlays/1"].attrs["recording"] == first["recording"]


def test_a_driven_diagnosis_finds_what_one_process_finds(real: Api, alone: Json) -> None:
    one = real.diagnose(upload(real), rig=DECLARED)
    assert (one["rig"], one["driven"], one["kind"]) == ("decay", True, "series")
    seen: list[str] = []
    with client_of(real) as client:
        last = wingfit.drive(client, one["id"], decay_rig.rig, on_work=lambda work: seen.append(work["state"]))
    assert last["state"] == "SUCCEEDED"
    assert seen[-1] == "SUCCEEDED"
    found = real.get(f"/v1/diagnoses/{one['id']}/finding")
    assert found["named"] == ["leak"]
    assert without_time(found) == alone
    report = real.client.get(f"/v1/diagnoses/{one['id']}/report").text
    assert "leak" in report
    for kind, start in (("csv", b"rank,effects,"), ("netcdf", b"\x89HDF"), ("json", b"{")):
        exported = real.client.get(f"/v1/diagnoses/{one['id']}/export?format={kind}")
        assert (exported.status_code, exported.content[: len(start)]) == (200, start)
        if kind == "netcdf":
            check_netcdf(exported.content, found)
    assert real.client.post(f"/v1/drive/{one['id']}/results", json={"driver": "late", "results": [NOTHING]}).json() == {
        "taken": 0,
        "unknown": 1,
    }


def test_suspects_of_a_request_are_the_only_ones_that_are_considered(real: Api) -> None:
    faulty = declaration(replace(decay_rig.rig, faults=True))
    one = real.diagnose(upload(real), rig=faulty, suspects=["gain.charge"])
    with client_of(real) as client:
        assert wingfit.drive(client, one["id"], replace(decay_rig.rig, faults=True))["state"] == "SUCCEEDED"
    found = real.get(f"/v1/diagnoses/{one['id']}/finding")
    assert {name for each in found["hypotheses"] for name in each["effects"]} == {"gain.charge"}
    assert "leak" not in found["named"]


def test_it_waits_for_a_driver_and_survives_the_death_of_either_side(tmp_path: Path, alone: Json) -> None:
    with service(tmp_path) as api:
        one = api.diagnose(upload(api), rig=DECLARED)["id"]
        time.sleep(0.3)
        assert api.diagnosis(one)["state"] == "QUEUED"  # no driver
        taken = 0
        while taken < 40:  # a driver that returns some results, and vanishes with others
            work = api.client.post(f"/v1/drive/{one}/work", json={"driver": "one", "limit": 3, "wait_s": 5}).json()
            if not work["simulations"]:  # a busy machine had none ready in time
                continue
            taken += len(work["simulations"])
            results = [_result(call) for call in work["simulations"][: 3 if taken < 40 else 1]]
            assert api.client.post(f"/v1/drive/{one}/results", json={"driver": "one", "results": results}).json() == {
                "taken": len(results),
                "unknown": 0,
            }
        assert api.diagnosis(one)["state"] == "RUNNING"
    with service(tmp_path) as api:
        with client_of(api) as client:
            assert wingfit.drive(client, one, decay_rig.rig)["state"] == "SUCCEEDED"
        assert without_time(api.get(f"/v1/diagnoses/{one}/finding")) == alone


def drive_here(api: Api, kind: str, job: str, until: Callable[[Json], bool]) -> None:
    """Simulate for a job until its answer is as wanted."""
    deadline = time.monotonic() + 60
    while not until(api.get(f"/v1/{kind}/{job}")):
        assert time.monotonic() < deadline
        work = api.client.post(f"/v1/drive/{job}/work", json={"driver": "here", "limit": 50, "wait_s": 0.1}).json()
        results = [_result(call) for call in work["simulations"]]
        if results:
            api.client.post(f"/v1/drive/{job}/results", json={"driver": "here", "results": results})


def _result(simulation: Json) -> Json:
    recording = decay_rig.dataset().recording(simulation["recording"])
    genes = {"leak.size": 0.0} | simulation["genes"]
    run = wingfit.Run(recording.name, recording.times, {}, {}, recording.times)
    try:
        charge = decay_rig.simulate(genes, run)["charge"]
    except ValueError as error:
        return {"id": simulation["id"], "reason": f"the simulation fails: {error}"}
    return {"id": simulation["id"], "channels": {"charge": charge.tolist()}}


def test_what_was_simulated_is_not_asked_again(tmp_path: Path) -> None:
    with service(tmp_path) as api:
        one = api.diagnose(upload(api), rig=DECLARED)["id"]
        first = _take(api, one, "one")
        api.client.post(
            f"/v1/drive/{one}/results", json={"driver": "one", "results": [_result(call) for call in first]}
        )
    with service(tmp_path) as api:
        again = _take(api, one, "two")
        assert again
        assert not {call["id"] for call in first} & {call["id"] for call in again}
        assert api.client.post(f"/v1/diagnoses/{one}/cancel").status_code == 202
        assert api.diagnosed(one)["state"] == "CANCELLED"
        assert api.client.post(f"/v1/drive/{one}/work", json={"driver": "two"}).json()["state"] == "CANCELLED"


def _take(api: Api, job: str, driver: str) -> list[Json]:
    answer = api.client.post(f"/v1/drive/{job}/work", json={"driver": driver, "limit": 1000, "wait_s": 10})
    assert answer.status_code == 200, answer.text
    return list(answer.json()["simulations"])


def test_malformed_results_are_refused_and_nothing_is_lost(real: Api) -> None:
    one = real.diagnose(upload(real), rig=DECLARED)["id"]
    first, *_ = _take(real, one, "one")
    good, path = _result(first), f"/v1/drive/{one}/results"

    def send(**changes: Any) -> httpx.Response:
        return real.client.post(path, json={"driver": "one", "results": [good | changes]})

    for changes, word in (
        ({"channels": {"charge": [1.0, 2.0]}}, "has 2 values; recording"),
        ({"channels": {"voltage": [1.0] * 60}}, "no channel 'charge', but voltage"),
        ({"channels": None}, "give either channels, or the reason"),
        ({"reason": "both"}, "give either channels, or the reason"),
        ({"channels": {"charge": ["1"] * 60}}, "valid number"),
    ):
        refused = send(**changes)
        assert refused.status_code == 422, changes
        assert word in refused.json()["errors"][0]["message"]
    body = b'{"driver":"one","results":[{"id":"%s","channels":{"charge":[NaN]}}]}' % first["id"].encode()
    assert real.client.post(path, content=body, headers={"Content-Type": "application/json"}).status_code == 422
    twice = real.client.post(path, json={"driver": "one", "results": [good, good]})
    assert twice.status_code == 422
    assert twice.json()["errors"][0]["where"] == "body.results.1.id"
    assert send(id="elsewhere").json() == {"taken": 0, "unknown": 1}
    assert send().json() == {"taken": 1, "unknown": 0}
    assert send().json() == {"taken": 0, "unknown": 1}
    real.client.post(f"/v1/diagnoses/{one}/cancel")


def test_simulations_that_fail_have_their_reason(real: Api) -> None:
    one = real.diagnose(upload(real), rig=DECLARED)["id"]
    while real.diagnosis(one)["state"] in ("QUEUED", "RUNNING"):
        results = [{"id": call["id"], "reason": "no licence for the solver"} for call in _take(real, one, "one")]
        if results:
            real.client.post(f"/v1/drive/{one}/results", json={"driver": "one", "results": results})
    done = real.diagnosed(one)
    assert done["state"] == "FAILED"
    assert "no licence for the solver" in done["error"]


def test_a_driver_with_another_rig_is_refused(real: Api) -> None:
    one = real.diagnose(upload(real), rig=DECLARED | {"genes": [DECLARED["genes"][0] | {"upper": 6.0}]})["id"]
    with client_of(real) as client, pytest.raises(WingfitError, match="genes of rig 'decay': not those"):
        wingfit.drive(client, one, decay_rig.rig)
    real.client.post(f"/v1/diagnoses/{one}/cancel")


def test_requests_that_do_not_fit_are_refused_with_the_remedy(real: Api) -> None:
    decay, arm = upload(real), upload(real, arm_dataset())
    for body, where, word in (
        ({"dataset_id": decay}, "body.rig", "wingfit diagnose DATASET --rig my_rig.py"),
        ({"dataset_id": decay, "rig": "mine"}, "body.rig", "no rig 'mine' is installed on the server"),
        ({"dataset_id": decay, "rig": "../my_rig.py"}, "body.rig", "no rig '../my_rig.py' is installed"),
        ({"dataset_id": decay, "rig": DECLARED, "division": "4"}, "body.division", "means nothing for a rig of your"),
        ({"dataset_id": decay, "rig": DECLARED | {"channels": {"charge": "mC"}}}, "body", "'C' in dataset 'decay'"),
        ({"dataset_id": decay, "rig": DECLARED | {"genes": 5}}, "body.rig.declaration.genes", "list"),
        ({"dataset_id": decay, "rig": DECLARED, "suspects": ["gusts"]}, "body", "unknown suspect 'gusts'"),
        ({"dataset_id": decay, "rig": DECLARED, "genes": ["span"]}, "body", "unknown gene 'span'"),
        ({"dataset_id": decay, "rig": DECLARED, "recordings": ["from-9"]}, "body", "no recording 'from-9'"),
        ({"dataset_id": arm, "rig": DECLARED}, "body", "which rig 'decay' does not simulate"),
    ):
        refused = real.client.post("/v1/diagnoses", json=body)
        assert refused.status_code == 422, body
        errors = refused.json()["errors"]
        assert any(one["where"] == where and word in one["message"] for one in errors), errors


def test_a_wing_needs_no_driver_and_no_rig(api: Api) -> None:
    dataset = api.upload()["id"]
    one = api.diagnose(dataset)["id"]
    assert api.client.post(f"/v1/drive/{one}/work", json={"driver": "one"}).status_code == 409
    assert api.client.post("/v1/drive/dx_0/work", json={"driver": "one"}).status_code == 404
    assert api.client.post("/v1/drive/key_0/work", json={"driver": "one"}).status_code == 404
    refused = api.client.post("/v1/diagnoses", json={"dataset_id": dataset, "rig": DECLARED})
    assert "the dataset describes its own rig" in refused.json()["errors"][0]["message"]
    assert api.get("/v1/rigs") == {"rigs": []}


def test_several_drivers_share_the_work(real: Api, alone: Json) -> None:
    one = real.diagnose(upload(real), rig=DECLARED)["id"]

    def driven() -> None:
        with client_of(real) as client:
            wingfit.drive(client, one, decay_rig.rig)

    threads = [threading.Thread(target=driven) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert without_time(real.get(f"/v1/diagnoses/{one}/finding")) == alone


class TestOwners:
    """Drivers of others can neither see nor answer."""

    @pytest.fixture
    def settings(self, tmp_path: Path) -> Settings:
        return Settings(data=tmp_path / "data", require_keys=True)

    def test_a_job_of_another_owner_is_not_there(self, as_: As) -> None:
        ann, bob = as_("ann"), as_("bob")
        one = ann.diagnose(upload(ann, write=write_netcdf), rig=DECLARED)["id"]
        for path in ("work", "results"):
            body = {"driver": "bob"} | ({"results": [{"id": "x", "reason": "no"}]} if path == "results" else {})
            assert bob.client.post(f"/v1/drive/{one}/{path}", json=body).status_code == 404
            assert as_("ann-reads").client.post(f"/v1/drive/{one}/{path}", json=body).status_code == 403
        assert ann.diagnosis(one)["state"] == "QUEUED"


def test_the_values_of_a_series_can_be_looked_at(api: Api) -> None:
    dataset = upload(api, arm_dataset(40), write_netcdf)
    shown = api.get(f"/v1/datasets/{dataset}")
    assert (shown["kind"], shown["rig"]["name"]) == ("series", "motor arm")
    assert {one["name"] for one in shown["rig"]["channels"]} == set(shown["recordings"][0]["channels"])
    assert shown["recordings"][0]["flap_frequency_hz"] is None
    values = api.get(f"/v1/datasets/{dataset}/series?recording=heavy")
    assert (values["recording"], values["stride"], len(values["time_s"])) == ("heavy", 1, 40)
    first = api.get(f"/v1/datasets/{dataset}/series")
    assert first["recording"] == "light-1"
    assert set(first["inputs"]) == {one["name"] for one in shown["rig"]["inputs"]}
    assert api.client.get(f"/v1/datasets/{dataset}/series?recording=none").status_code == 422
    assert api.client.get(f"/v1/datasets/{api.upload()['id']}/series").status_code == 409
    undrawn = api.client.get(f"/v1/datasets/{dataset}/drawing")
    assert (undrawn.status_code, "needs a wing or a vehicle" in undrawn.json()["detail"]) == (409, True)
    assert api.client.post("/v1/runs", json={"dataset_id": dataset}).status_code == 422


def test_an_installed_rig_is_simulated_by_the_server(real: Api, alone: Json, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("decay", "tests.service.rigs.decay_rig:rig", "wingfit.rigs")
    monkeypatch.setattr(load, "entry_points", lambda group: EntryPoints([point]).select(group=group))
    assert real.get("/v1/rigs") == {"rigs": ["decay"]}
    dataset = upload(real)
    one = real.diagnose(dataset, rig="decay")
    assert (one["rig"], one["driven"]) == ("decay", False)
    assert real.diagnosed(one["id"])["state"] == "SUCCEEDED"
    assert without_time(real.get(f"/v1/diagnoses/{one['id']}/finding")) == alone
    run = real.submit(dataset, rig="decay", method="gauss_newton")
    assert real.finish(run["id"])["state"] == "SUCCEEDED"
    again = real.diagnose(None, run_id=run["id"])  # with the rig of the run
    assert again["rig"] == "decay"
    assert real.diagnosed(again["id"])["verdict"] == "named"
    monkeypatch.setattr(load, "entry_points", lambda group: EntryPoints([]).select(group=group))
    late = real.client.post("/v1/diagnoses", json={"run_id": run["id"]})
    assert "no rig 'decay' is installed on the server; it has none" in late.json()["errors"][0]["message"]
