"""Upload, list, fetch; what is wrong with an upload is said, and nothing of it is kept."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from tests.service import toy
from tests.service.conftest import Api, serving
from wingfit.records import Dataset
from wingfit.service.app import create_app
from wingfit.service.datasets import parsed_datasets
from wingfit.service.http import request_limits
from wingfit.service.settings import Settings
from wingfit.service.storage.database import Database


def test_an_archive_comes_back_byte_for_byte(api: Api) -> None:
    data = toy.archive()
    answer = api.client.post("/v1/datasets", files={"file": ("a.zip", data)}, data={"name": "my wing"})
    assert answer.status_code == 201
    dataset = answer.json()
    assert answer.headers["Location"] == f"/v1/datasets/{dataset['id']}"
    digest = hashlib.sha256(data).hexdigest()
    assert (dataset["name"], dataset["sha256"], dataset["size_bytes"]) == ("my wing", digest, len(data))
    fetched = api.client.get(f"/v1/datasets/{dataset['id']}/archive")
    assert fetched.content == data
    assert fetched.headers["ETag"] == f'"{digest}"'
    again = api.client.get(f"/v1/datasets/{dataset['id']}/archive", headers={"If-None-Match": f'"{digest}"'})
    assert (again.status_code, again.content) == (304, b"")
    assert api.get(f"/v1/datasets/{dataset['id']}") == dataset


def test_a_name_in_use_is_numbered_and_one_that_is_stated_stays(api: Api) -> None:
    assert [api.upload(name="delfly")["name"] for _ in range(3)] == ["delfly", "delfly, 2", "delfly, 3"]
    stated = [
        api.client.post("/v1/datasets", files={"file": ("a.zip", toy.archive(name="delfly"))}, data={"name": name})
        for name in ("delfly", "   ", "a\u0000b", "\u202eevil")
    ]
    assert [answer.status_code for answer in stated] == [201, 422, 422, 422]
    assert stated[0].json()["name"] == "delfly"
    assert api.upload(name="   ")["name"] == "toy", "a name that cannot be seen gives way to that of the file"


def test_a_dataset_is_described_in_units_that_people_read(api: Api) -> None:
    dataset = api.upload()
    assert dataset["markers"] == 2
    assert [r["held_out"] for r in dataset["recordings"]] == [False, False, True]
    recording = dataset["recordings"][0]
    assert (recording["frames"], recording["markers"], recording["missing_percent"]) == (4, 2, 12.5)
    assert recording["phase_lag_deg"] == pytest.approx(45.0)
    assert recording["pressure_mbar"] == pytest.approx(100.0)
    assert recording["temperature_c"] == pytest.approx(20.0)


def test_the_described_wing_is_drawn(api: Api) -> None:
    address = f"/v1/datasets/{api.upload()['id']}/drawing"
    answer = api.client.get(address)
    assert (answer.status_code, answer.headers["Content-Type"]) == (200, "image/svg+xml")
    policy = answer.headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none';")
    assert "sandbox" in policy
    assert answer.text.count("<circle") == 2
    assert "toy, seen from above" in answer.text
    again = api.client.get(address, headers={"If-None-Match": answer.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert api.client.get("/v1/datasets/none/drawing").status_code == 404


def test_a_malformed_archive_is_a_422_that_says_where(api: Api) -> None:
    answer = api.client.post("/v1/datasets", files={"file": ("broken.zip", b"PK broken")})
    assert answer.status_code == 422
    assert answer.headers["Content-Type"] == "application/problem+json"
    error = answer.json()["errors"][0]
    assert error["where"] == "broken.zip, line 1"
    assert "not a toy archive" in error["message"]
    assert api.get("/v1/datasets")["items"] == []


@pytest.mark.parametrize(
    ("files", "data", "where"),
    [
        ({}, {"name": "x"}, "body.file"),
        ({"file": ("a.zip", toy.archive())}, {"name": "n" * 201}, "body.name"),
    ],
)
def test_a_form_that_does_not_fit_is_a_422(
    api: Api, files: dict[str, tuple[str, bytes]], data: dict[str, str], where: str
) -> None:
    answer = api.client.post("/v1/datasets", files=files, data=data)
    assert (answer.status_code, answer.json()["errors"][0]["where"]) == (422, where)


def test_a_broken_form_is_a_problem(api: Api) -> None:
    headers = {"Content-Type": "multipart/form-data"}
    answer = api.client.post("/v1/datasets", content=b"--nonsense", headers=headers)
    assert answer.status_code in (400, 422)
    assert answer.headers["Content-Type"] == "application/problem+json"


def test_a_name_that_is_too_long_for_the_form_is_named(api: Api) -> None:
    answer = api.client.post("/v1/datasets", files={"file": (f"{'a' * 4300}.zip", toy.archive())})
    assert answer.status_code == 400
    assert "the name of a file or field of the form is too long: at most 4 kB" in answer.json()["detail"]
    files = {"file": (f"{'a' * 4000}.zip", toy.archive())}
    assert api.client.post("/v1/datasets", files=files).status_code == 201


def test_what_is_too_large_is_a_413(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request_limits, "UPLOAD_LIMIT", 1000)
    monkeypatch.setattr(request_limits, "FORM_OVERHEAD", 200)
    big = toy.archive(pad="x" * 3000)
    answer = api.client.post("/v1/datasets", files={"file": ("a.zip", big)})
    assert (answer.status_code, answer.headers["Content-Type"]) == (413, "application/problem+json")

    def chunks() -> object:
        yield b"--b\r\nContent-Disposition: form-data; name=file; filename=a.zip\r\n\r\n"
        for _ in range(10):
            yield b"x" * 500

    headers = {"Content-Type": "multipart/form-data; boundary=b"}
    answer = api.client.post("/v1/datasets", content=chunks(), headers=headers)  # type: ignore[arg-type]
    assert (answer.status_code, answer.json()["type"]) == (413, "urn:wingfit:problem:too-large")
    assert api.get("/v1/datasets")["items"] == []


def test_of_large_datasets_only_the_last_is_kept_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    engine = toy.ToyEngine()
    loaded = [engine.load(toy.archive(name=f"{k}"), "a.zip") for k in range(parsed_datasets.KEPT + 2)]
    database = Database(tmp_path)
    kept = parsed_datasets.Datasets(database, engine)

    def held() -> list[int]:
        for number, dataset in enumerate(loaded):
            kept.keep(str(number), dataset)
        return [int(name) for name in kept._kept]

    assert held() == list(range(2, parsed_datasets.KEPT + 2))
    size = sum(recording.values.nbytes for recording in loaded[0].recordings)
    monkeypatch.setattr(parsed_datasets, "KEPT_BYTES", 3 * size)
    assert held() == [parsed_datasets.KEPT - 1, parsed_datasets.KEPT, parsed_datasets.KEPT + 1]
    monkeypatch.setattr(parsed_datasets, "KEPT_BYTES", 1)
    assert held() == [parsed_datasets.KEPT + 1]
    database.close()


def test_lists_come_in_pages_with_opaque_cursors(api: Api) -> None:
    ids = [api.upload(name=f"d{i}")["id"] for i in range(5)]
    seen, cursor = [], None
    while True:
        query = "?limit=2" + (f"&cursor={cursor}" if cursor else "")
        page = api.get(f"/v1/datasets{query}")
        seen += [item["id"] for item in page["items"]]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert seen == ids[::-1]
    for bad in ("nonsense", "YmVmb3JlOi0x", "%F0%9F%A6%85"):
        assert api.client.get(f"/v1/datasets?cursor={bad}").status_code == 422


def test_repeated_with_the_same_key_nothing_is_created_twice(api: Api) -> None:
    headers = {"Idempotency-Key": "upload-1"}
    first = _upload(api, headers, "one")
    again = _upload(api, headers, "one")
    assert (first.status_code, first.json()) == (again.status_code, again.json())
    assert again.headers["Location"] == first.headers["Location"]
    assert len(api.get("/v1/datasets")["items"]) == 1
    other = _upload(api, headers, "two")
    assert (other.status_code, other.json()["errors"][0]["where"]) == (422, "header.Idempotency-Key")
    body = {"dataset_id": first.json()["id"], "max_generations": 1}
    runs = [api.client.post("/v1/runs", json=body, headers=headers) for _ in range(3)]
    assert {run.status_code for run in runs} == {202}
    assert len({run.json()["id"] for run in runs}) == 1, "the key of an upload does not clash with that of a run"
    assert len(api.get("/v1/runs")["items"]) == 1
    assert api.client.post("/v1/runs", json=body | {"seed": 2}, headers=headers).status_code == 422


def test_what_was_deleted_is_neither_told_of_nor_made_again(api: Api) -> None:
    dataset = _upload(api, {"Idempotency-Key": "d"}, "one").json()["id"]
    body, key = {"dataset_id": dataset, "max_generations": 1}, {"Idempotency-Key": "r"}
    run = api.client.post("/v1/runs", json=body, headers=key).json()["id"]
    diagnosis = api.client.post("/v1/diagnoses", json={"dataset_id": dataset}, headers=key).json()["id"]
    api.finish(run)
    api.diagnosed(diagnosis)
    cases: list[tuple[str, str, Callable[[], httpx.Response]]] = [
        ("runs", run, lambda: api.client.post("/v1/runs", json=body, headers=key)),
        ("diagnoses", diagnosis, lambda: api.client.post("/v1/diagnoses", json={"dataset_id": dataset}, headers=key)),
        ("datasets", dataset, lambda: _upload(api, {"Idempotency-Key": "d"}, "one")),
    ]
    for kind, made, again in cases:
        assert again().json()["id"] == made
        assert api.client.delete(f"/v1/{kind}/{made}").status_code == 204
        gone = again()
        assert (gone.status_code, "use a new key" in gone.json()["detail"]) == (409, True)
        assert not api.get(f"/v1/{kind}")["items"]
    assert _upload(api, {"Idempotency-Key": "e"}, "one").status_code == 201


def test_repeated_at_the_same_time_nothing_is_created_twice(api: Api) -> None:
    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(lambda _: _upload(api, {"Idempotency-Key": "k"}, "one"), range(8)))
    assert {answer.status_code for answer in answers} == {201}
    assert len({answer.json()["id"] for answer in answers}) == 1
    assert len(api.get("/v1/datasets")["items"]) == 1


def test_a_failed_request_does_not_use_up_its_key(api: Api) -> None:
    headers = {"Idempotency-Key": "upload-1"}
    assert api.client.post("/v1/datasets", files={"file": ("a.zip", b"bad")}, headers=headers).status_code == 422
    assert _upload(api, headers, "good").status_code == 201


def _upload(api: Api, headers: dict[str, str], name: str) -> httpx.Response:
    files = {"file": ("a.zip", toy.archive(name=name))}
    return api.client.post("/v1/datasets", files=files, headers=headers)


def test_many_who_need_one_dataset_have_it_loaded_once(tmp_path: Path) -> None:
    loads = []

    class Slow(toy.ToyEngine):
        def load(self, data: bytes, filename: str) -> Dataset:
            loads.append(filename)
            time.sleep(0.2)
            return super().load(data, filename)

    app = create_app(Settings(data=tmp_path), engine=Slow(), make_evaluator=toy.NoEvaluator)
    with serving(app) as client:
        body = {"dataset_id": Api(client).upload()["id"]}
        app.state.service.datasets._kept.clear()
        loads.clear()

        def check(_: int) -> int:
            return httpx.post(f"{client.base_url}/v1/runs?validate_only=true", json=body, timeout=60).status_code

        with ThreadPoolExecutor(6) as pool:
            assert list(pool.map(check, range(6))) == [200] * 6
    assert len(loads) == 1
