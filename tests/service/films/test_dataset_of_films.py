"""A dataset is made of tracked films: aligned to a described wing, with noise, frame and cameras."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cameras.films import cameras
from tests.service import toy
from tests.service.conftest import Api, Json, prepare, serving
from tests.service.films.aligned import DEVIATION, write_tracks
from tests.service.films.films import ended, put, submitted, uploaded
from tests.service.shapes import valid
from tests.service.toy_diagnosis import ToyDiagnoser
from tests.tracking.alignment.recorded import PLACE, ROBIRD, TURN, dataset, filmed
from wingfit.client.films.answers import FilmedDataset
from wingfit.records import Dataset
from wingfit.records.files.archive import read_zip
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

CHAMBER = {"rig": "vacuum_chamber", "temperature_c": 20.0}


@pytest.fixture(scope="module")
def served(data: Path) -> Iterator[Api]:
    """A server that reads real datasets; only what computes is a toy."""
    prepare(data)
    app = create_app(Settings(data=data), make_evaluator=toy.NoEvaluator, diagnoser=ToyDiagnoser())
    with pytest.MonkeyPatch.context() as patch, serving(app) as client:
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        yield Api(client)


@pytest.fixture(scope="module")
def trackings(served: Api, film: str, data: Path) -> list[str]:
    every = [submitted(served, film)["id"] for _ in range(2)]
    for number, one in enumerate(every):
        assert ended(served, one)["state"] == "SUCCEEDED"
        write_tracks(data, film, one, filmed(number))
    return every


def _body(trackings: list[str], **changes: Any) -> Json:
    conditions = [dataset().recordings[number].condition for number in range(2)]
    recordings = [
        {
            "tracking_id": one,
            "name": f"run{number}",
            "flap_frequency_hz": condition.flap_frequency,
            "phase_lag_deg": round(float(np.degrees(condition.phase_lag)), 9),
            "pressure_mbar": condition.pressure / 100,
            **CHAMBER,
            "held_out": number == 1,
        }
        for number, (one, condition) in enumerate(zip(trackings, conditions, strict=True))
    ]
    description = (ROBIRD / "dataset.yaml").read_text()
    return {"name": "films", "description": description, "recordings": recordings, "side": "right"} | changes


def test_the_dataset_has_tracks_noise_frame_and_cameras(served: Api, trackings: list[str]) -> None:
    answer = served.client.post("/v1/trackings/dataset", json=_body(trackings))
    assert answer.status_code == 201, answer.text
    found = valid(FilmedDataset, answer.json())
    assert answer.headers["location"] == f"/v1/datasets/{found['dataset']['id']}"
    assert [(one["recording"], one["side"]) for one in found["alignments"]] == [("run0", "right"), ("run1", "right")]
    stored = read_zip(served.client.get(f"/v1/datasets/{found['dataset']['id']}/archive").content, "films.zip")
    assert isinstance(stored, Dataset)
    assert stored.held_out == ("run1",)
    assert stored.frame_error is not None
    for number, one in enumerate(stored.recordings):
        true = filmed(number)
        order = [true.markers.index(name) for name in one.markers]
        assert np.sqrt(np.nanmean((one.positions - true.true[:, order]) ** 2)) < 3e-3
        assert one.standard_deviation == pytest.approx(DEVIATION, rel=1e-3)
        assert one.condition.flap_frequency == pytest.approx(
            dataset().recordings[number].condition.flap_frequency, rel=2e-2
        )
    for pose, camera in zip(stored.cameras, cameras(), strict=True):
        expected = (np.asarray(camera.pose.centre) - PLACE) @ TURN
        assert pose.name == camera.name
        assert pose.centre == pytest.approx(expected, abs=0.02)


def test_a_dataset_may_describe_the_wing_and_a_repeated_request_makes_one(served: Api, trackings: list[str]) -> None:
    made = served.client.post("/v1/trackings/dataset", json=_body(trackings)).json()["dataset"]["id"]
    body = _body(trackings, dataset_id=made, description=None, recordings=_body(trackings)["recordings"][1:])
    headers = {"Idempotency-Key": "again"}
    answers = [served.client.post("/v1/trackings/dataset", json=body, headers=headers) for _ in range(2)]
    assert answers[0].status_code == 201
    assert answers[0].json() == answers[1].json()


def _refused(served: Api, body: Json) -> Json:
    answer = served.client.post("/v1/trackings/dataset", json=body)
    assert answer.status_code == 422, answer.text
    return dict(answer.json()["errors"][0])


def test_what_is_wrong_is_named(served: Api, trackings: list[str]) -> None:
    assert "neither is given" in _refused(served, _body(trackings, description=None))["message"]
    assert "both are given" in _refused(served, _body(trackings, dataset_id="ds_1"))["message"]
    assert _refused(served, _body(trackings, description="wing: {}"))["where"].startswith("body.description")
    twice = _body([trackings[0], trackings[0]])
    assert "two recordings have the tracking_id" in _refused(served, twice)["message"]
    assert _refused(served, _body([trackings[0], "tk_1"]))["where"] == "body.recordings.1.tracking_id"
    cold = _body(trackings)
    cold["recordings"][0]["temperature_c"] = -300.0
    assert "temperature" in str(_refused(served, cold))


def test_a_flap_frequency_that_is_not_that_of_the_film_is_named(served: Api, trackings: list[str]) -> None:
    body = _body(trackings, recordings=_body(trackings)["recordings"][1:])
    body["recordings"][0]["flap_frequency_hz"] *= 1.4
    found = _refused(served, body)
    assert found["where"].startswith("body.recordings.0")
    assert "Hz" in found["message"]


def test_a_file_that_is_damaged_is_named_by_its_recording(
    served: Api, film: str, data: Path, trackings: list[str]
) -> None:
    path = data / "films" / film / "tracked" / trackings[0] / "covariance.npz"
    whole = path.read_bytes()
    path.write_bytes(whole[:100])
    try:
        found = _refused(served, _body(trackings, recordings=_body(trackings)["recordings"][:1]))
    finally:
        path.write_bytes(whole)
    assert found["where"] == "body.recordings.0"
    assert str(data) not in str(found)


def test_cameras_are_those_of_the_tracks(
    served: Api, film: str, folder: Path, data: Path, trackings: list[str]
) -> None:
    """They stay so if others replace them in the film afterwards; tracks of earlier versions have no copy."""
    body = _body(trackings, recordings=_body(trackings)["recordings"][:1])
    before = served.client.post("/v1/trackings/dataset", json=body).json()["dataset"]["id"]
    stated = (folder / "cameras.yaml").read_bytes()
    copied = data / "films" / film / "tracked" / trackings[0] / "cameras.yaml"
    assert put(served.client, film, "cameras", stated.replace(b"700.0", b"701.0")).status_code == 200
    try:
        after = served.client.post("/v1/trackings/dataset", json=body).json()["dataset"]["id"]
        copied.unlink()
        refused = served.client.post("/v1/trackings/dataset", json=body)
    finally:
        copied.write_bytes(stated)
    found = [read_zip(served.client.get(f"/v1/datasets/{one}/archive").content, "a.zip") for one in (before, after)]
    assert [one.cameras[0].focal_px for one in found if isinstance(one, Dataset)] == pytest.approx([700.0, 700.0])
    assert refused.status_code == 409
    assert "were replaced after it was tracked: track it again" in refused.json()["detail"]


def test_recordings_of_other_cameras_have_no_common_frame(
    served: Api, folder: Path, data: Path, trackings: list[str]
) -> None:
    other = uploaded(served, folder)
    moved = (folder / "cameras.yaml").read_text().replace("700.0", "701.0")
    assert put(served.client, other["id"], "cameras", moved.encode()).status_code == 200
    one = submitted(served, other["id"])["id"]
    assert ended(served, one)["state"] == "SUCCEEDED"
    write_tracks(data, other["id"], one, filmed(1))
    found = _refused(served, _body([trackings[0], one]))
    assert found["where"] == "body.recordings.1.tracking_id"
    assert "calibrated otherwise" in found["message"]
