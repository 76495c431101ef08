"""Uploaded NetCDF: read in a process of its own, stored in a form of our own, and nobody else notices."""

from __future__ import annotations

import errno
import io
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import h5py
import httpx
import pytest
from sqlalchemy import delete, select

from tests.records.compare import assert_same
from tests.records.files.test_confined import looping
from tests.records.samples import falcon_dataset
from tests.service.conftest import Api, toy_service
from wingfit.records import DatasetError, load_archive, wing_or_vehicle
from wingfit.records.errors import fail
from wingfit.records.files import confined
from wingfit.records.files.confined import convert_netcdf, limits_of_upload
from wingfit.records.files.netcdf import write_netcdf
from wingfit.service.settings import Settings
from wingfit.service.storage.tables import ParsedRow


@pytest.fixture
def netcdf() -> bytes:
    return write_netcdf(falcon_dataset(12))


def _never(*_: object, **__: object) -> NoReturn:
    raise AssertionError("the server itself opened a NetCDF file")


def _upload(api: Api, data: bytes, **headers: str) -> httpx.Response:
    return api.client.post("/v1/datasets", files={"file": ("wing.nc", data)}, headers=headers)


def test_the_server_itself_never_opens_one(settings: Settings, netcdf: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = wing_or_vehicle(load_archive(netcdf, "wing.nc"))
    monkeypatch.setattr(h5py, "File", _never)
    with toy_service(settings.data) as (service, api):
        dataset = _upload(api, netcdf).json()
        assert (dataset["name"], dataset["markers"]) == (expected.name, len(expected.wing.markers))
        assert api.client.get(f"/v1/datasets/{dataset['id']}/archive").content == netcdf
        assert_same(service.datasets.get(dataset["id"]), expected)
    with toy_service(settings.data) as (service, api):
        assert_same(service.datasets.get(dataset["id"]), expected)
        assert api.client.delete(f"/v1/datasets/{dataset['id']}").status_code == 204
        with service.database.read() as session:
            assert session.scalars(select(ParsedRow)).all() == []


def test_what_an_earlier_version_stored_is_read_the_same_way_and_once(
    settings: Settings, netcdf: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    with toy_service(settings.data) as (service, api):
        dataset = _upload(api, netcdf).json()["id"]
        with service.database.write() as session:
            session.execute(delete(ParsedRow))
    monkeypatch.setattr(h5py, "File", _never)
    with toy_service(settings.data) as (service, _):
        assert service.datasets.get(dataset).name == falcon_dataset(12).name
    monkeypatch.setattr("wingfit.service.datasets.parsed_datasets.convert_netcdf", _never)
    with toy_service(settings.data) as (service, _):
        assert service.datasets.get(dataset).name == falcon_dataset(12).name


def test_one_that_makes_the_library_loop_hurts_nobody_else(
    api: Api, netcdf: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = replace(limits_of_upload(0), processor_s=4)
    monkeypatch.setattr(confined, "limits_of_upload", lambda _: short)
    dataset = _upload(api, netcdf).json()["id"]
    with ThreadPoolExecutor(1) as other:
        began = time.monotonic()
        hostile = other.submit(_upload, api, looping())
        while not hostile.done():
            before = time.monotonic()
            assert api.client.get("/v1/health").status_code == 200
            assert api.client.get(f"/v1/datasets/{dataset}").status_code == 200
            assert api.upload()["id"]
            assert _upload(api, netcdf).status_code == 201
            assert time.monotonic() - before < 60
        refused = hostile.result()
        assert time.monotonic() - began < 120
    assert refused.status_code == 422
    assert "processor time" in refused.json()["errors"][0]["message"]
    assert refused.json()["errors"][0]["where"] == "wing.nc"


def test_faults_come_as_those_of_a_zip_do(api: Api, netcdf: bytes) -> None:
    buffer = io.BytesIO(netcdf)
    with h5py.File(buffer, "r+") as file:
        file["recordings/vacuum-2hz/time_s"][3] = 0.0
    refused = _upload(api, buffer.getvalue())
    assert refused.status_code == 422
    (error,) = refused.json()["errors"]
    assert error["where"] == "wing.nc: recordings/vacuum-2hz, time index 3"
    assert "times must increase" in error["message"]


def test_what_is_stored_beside_an_archive_counts(tmp_path: Path, netcdf: bytes) -> None:
    with toy_service(tmp_path, max_stored_mb=1) as (service, api):
        assert _upload(api, netcdf).status_code == 201
        with service.database.write() as session:
            row = session.scalars(select(ParsedRow)).one()
            row.body = bytes(10**6 - len(netcdf) - 1)
        refused = _upload(api, netcdf)
        assert refused.status_code == 429
        assert "WINGFIT_MAX_STORED_MB" in refused.json()["detail"]


@pytest.mark.parametrize("repeat", [1, 2])
def test_a_repeated_upload_is_answered_as_the_first(api: Api, netcdf: bytes, repeat: int) -> None:
    first = _upload(api, netcdf, **{"Idempotency-Key": "k"})
    for _ in range(repeat):
        assert _upload(api, netcdf, **{"Idempotency-Key": "k"}).json() == first.json()


def test_a_reader_that_cannot_start_is_the_servers_fault(
    api: Api, netcdf: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    refused = _upload(api, netcdf)
    assert refused.status_code == 503
    assert "cannot start" in refused.json()["detail"]


def test_an_old_file_that_takes_long_holds_up_no_other_dataset_and_is_given_up_once(
    settings: Settings, netcdf: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    began, go_on, tried = threading.Event(), threading.Event(), []

    def slow(_: bytes, label: str, __: object) -> NoReturn:
        tried.append(label)
        began.set()
        assert go_on.wait(60)
        raise fail(label, None, "it is damaged")

    with toy_service(settings.data) as (service, api):
        old, new = (_upload(api, netcdf).json()["id"] for _ in range(2))
        with service.database.write() as session:
            session.execute(delete(ParsedRow).where(ParsedRow.dataset_id == old))
    monkeypatch.setattr("wingfit.service.datasets.parsed_datasets.convert_netcdf", slow)
    with toy_service(settings.data) as (service, _), ThreadPoolExecutor(1) as other:
        waiting = other.submit(service.datasets.get, old)
        assert began.wait(60)
        assert service.datasets.get(new).name == falcon_dataset(12).name
        go_on.set()
        with pytest.raises(DatasetError, match="it is damaged"):
            waiting.result()
        with pytest.raises(DatasetError, match="it is damaged"):
            service.datasets.get(old)
    assert tried == ["wing.nc"]


def test_a_job_waits_for_room_to_read_an_old_file(
    settings: Settings, netcdf: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = []

    def full(*given: Any) -> bytes:
        tried.append(given)
        if len(tried) == 1:
            raise OSError(errno.ENOSPC, "No space left on device")
        return convert_netcdf(*given)

    with toy_service(settings.data) as (service, api):
        run = api.submit(_upload(api, netcdf).json()["id"], max_generations=10_000)["id"]
        api.until(run, lambda one: one["state"] == "RUNNING")
        with service.database.write() as session:
            session.execute(delete(ParsedRow))
    monkeypatch.setattr("wingfit.service.datasets.parsed_datasets.convert_netcdf", full)
    with toy_service(settings.data) as (_, api):
        before = api.run(run)["generations"]
        api.until(run, lambda one: one["generations"] > before)
    assert len(tried) == 2
