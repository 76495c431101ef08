"""Trackings over HTTP, on a small film: the tracks, what is refused, and how they end."""

from __future__ import annotations

import errno
import io
import json
import os
import re
import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cameras.films import PLACES, cameras, wing
from tests.command_line import in_process
from tests.service import toy
from tests.service.conftest import Api, toy_service
from tests.service.films.films import (
    FRAMES,
    MARKERS,
    NAMES,
    RATE,
    ended,
    new_film,
    processes_of,
    put,
    submitted,
    uploaded,
)
from tests.service.shapes import valid
from wingfit.cli.main import app
from wingfit.client.films.answers import Film, Tracking, TrackingResult, TrackingStep
from wingfit.client.transport import parse_events
from wingfit.records import Marker
from wingfit.service.films import tracking_process
from wingfit.service.films.child import FAULTS, error_of

wingfit = in_process(app)
LABEL = {"camera": "left", "frame": 0, "marker": "m00", "x_px": 100.0, "y_px": 100.0}


@pytest.fixture(scope="module")
def done(served: Api, film: str) -> str:
    """A tracking that has succeeded."""
    tracking = valid(Tracking, ended(served, submitted(served, film, name="first")["id"]))
    assert (tracking["state"], tracking["error"], tracking["progress"]) == ("SUCCEEDED", None, 1.0)
    assert (tracking["name"], tracking["film_id"], tracking["dataset_id"]) == ("first", film, None)
    return str(tracking["id"])


def test_a_film_is_tracked_as_the_command_tracks_it(served: Api, done: str, folder: Path, tmp_path: Path) -> None:
    code, _, err = wingfit("track", folder / "film.yaml", "-o", tmp_path / "tracks.csv")
    assert code == 0, err
    tracks = served.client.get(f"/v1/trackings/{done}/tracks.csv")
    assert tracks.headers["content-type"].startswith("text/csv")
    assert f"{done}-tracks.csv" in tracks.headers["content-disposition"]
    assert tracks.content == (tmp_path / "tracks.csv").read_bytes()


def test_the_result_shows_what_was_seen(served: Api, done: str) -> None:
    found = valid(TrackingResult, served.get(f"/v1/trackings/{done}/result"))
    assert (found["instants"], found["stride"], found["found"]) == (FRAMES, 1, [len(NAMES)] * FRAMES)
    assert len(found["times_s"]) == FRAMES
    assert len(found["shown"]) == 8
    assert [one["frame"] for one in found["shown"][-1]["cameras"]] == [FRAMES - 1] * 2
    for instant in found["shown"]:
        for camera in instant["cameras"]:
            assert [marker["marker"] for marker in camera["markers"]] == list(NAMES)
            apart = [np.subtract(one["seen_px"], one["projected_px"]) for one in camera["markers"]]
            assert np.abs(apart).max() < 0.5


def test_covariances_and_pictures_are_files(served: Api, done: str) -> None:
    archive = served.client.get(f"/v1/trackings/{done}/covariance.npz")
    with np.load(io.BytesIO(archive.content)) as of:
        assert of["covariance"].shape == (FRAMES, len(NAMES), 3, 3)
    report = served.client.get(f"/v1/trackings/{done}/report.html")
    policy = report.headers["content-security-policy"]
    assert "12 of 12 markers in the median" in report.text
    # Scripts run in an origin of their own, so that they reach nothing of the server.
    assert re.search(r"sandbox (?!.*allow-same-origin)", policy)
    assert "default-src 'none'" in policy
    assert "connect-src" not in policy


def test_steps_are_events(served: Api, done: str) -> None:
    with served.client.stream("GET", f"/v1/trackings/{done}/events") as answer:
        events = list(parse_events(answer.iter_lines()))
    steps = [valid(TrackingStep, event["data"]) for event in events[:-1]]
    assert [step["sequence"] for step in steps] == list(range(1, len(steps) + 1))
    assert [step["progress"] for step in steps] == sorted(step["progress"] for step in steps)
    assert {step["stage"] for step in steps} == {"detecting", "instants", "rays", "following"}
    assert events[-1]["data"] == served.get(f"/v1/trackings/{done}")


def test_trackings_are_listed_by_film(served: Api, film: str, done: str) -> None:
    assert done in [one["id"] for one in served.get(f"/v1/trackings?film_id={film}")["items"]]
    assert served.get("/v1/trackings?film_id=fl_0")["items"] == []
    assert served.get("/v1/health")["trackings_active"] == 0


def test_what_was_detected_serves_the_next_tracking(served: Api, data: Path, film: str, done: str) -> None:
    stored = {path: path.stat().st_mtime_ns for path in (data / "films" / film / "detected").rglob("*")}
    assert len(stored) >= 4
    again = ended(served, submitted(served, film)["id"])["id"]
    assert {path: path.stat().st_mtime_ns for path in (data / "films" / film / "detected").rglob("*")} == stored
    tracks = [served.client.get(f"/v1/trackings/{one}/tracks.csv").content for one in (done, again)]
    assert tracks[0] == tracks[1]


def test_damaged_detections_are_made_anew(served: Api, data: Path, film: str, done: str) -> None:
    for path in (data / "films" / film / "detected").rglob("*.npz"):
        path.write_bytes(b"cut")
    again = ended(served, submitted(served, film)["id"])
    assert (again["state"], again["error"]) == ("SUCCEEDED", None)
    tracks = [served.client.get(f"/v1/trackings/{one}/tracks.csv").content for one in (done, again["id"])]
    assert tracks[0] == tracks[1]


@pytest.mark.parametrize(
    ("changes", "where", "words"),
    [
        ({"film_id": "fl_0000000000000000"}, "body.film_id", "there is no such film"),
        ({"kind": "dots"}, "body.kind", "'chequer' or 'dot'"),
        ({"light": None}, "body.light", "'strobe' or 'continuous'"),
        ({"light": "strobe", "clocks_within_ms": 2.0}, "body.clocks_within_ms", "leave it out"),
        ({"clocks_within_ms": 1001}, "body.clocks_within_ms", "1000"),
        ({"first_frame": 9, "last_frame": 9}, "body.last_frame", "more than first_frame, 9"),
        ({"first_frame": 25}, "body.first_frame", "camera left has 25 frames, counted from 0; begin earlier"),
        ({"places": [*MARKERS, MARKERS[3] | {"marker": "m99"}]}, "body.places", "'m03' and 'm99' have one place"),
        ({"first_frame": 2.5}, "body.first_frame", "integer"),
        ({"dataset_id": "ds_0"}, "body.places", "not both"),
        ({"dataset_id": "ds_0", "places": []}, "body.dataset_id", "there is no such dataset"),
        ({"places": MARKERS[:5]}, "body.places", "5 markers; at least 6 are needed"),
        ({"places": [MARKERS[0], *MARKERS]}, "body.places", "two markers have the name 'm00'"),
        ({"places": [one | {"z_m": 1000.0 * k} for k, one in enumerate(MARKERS)]}, "body.places", "in metres"),
        ({"places": [{**MARKERS[0], "w_m": 1.0}]}, "body.places.0.w_m", "not permitted"),
        ({"labels": [LABEL | {"camera": "top"}]}, "body.labels.0", "unknown camera 'top'"),
        ({"labels": [LABEL, LABEL | {"marker": "m99"}]}, "body.labels.1", "unknown marker 'm99'"),
        ({"labels": [LABEL | {"x_px": 320.0}]}, "body.labels.0", "outside the image of 320 x 240 px"),
        ({"labels": [LABEL]}, "body.labels", "0 markers are labelled in two cameras"),
        ({"labels": [LABEL | {"frame": -1}]}, "body.labels.0.frame", "greater than or equal to 0"),
        ({"lihgt": "strobe"}, "body.lihgt", "not permitted"),
    ],
)  # fmt: skip
def test_a_tracking_that_cannot_be_is_refused(
    served: Api, film: str, changes: dict[str, Any], where: str, words: str
) -> None:
    body = {"film_id": film, "kind": "dot", "light": "continuous", "places": MARKERS} | changes
    answer = served.client.post("/v1/trackings", json=body)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["where"] == where
    assert words in error["message"]


def test_labels_name_markers(served: Api, film: str, folder: Path, tmp_path: Path) -> None:
    """As in the command: eight markers without known places, named in frame 5 of both cameras."""
    labels = [
        {"camera": camera.name, "frame": 5, "marker": f"tip{k}", "x_px": float(x), "y_px": float(y)}
        for camera in cameras()
        for k, (x, y) in enumerate(camera.project(wing(5 / RATE))[:8])
    ]
    done = ended(served, submitted(served, film, places=[], labels=labels)["id"])
    assert (done["state"], done["error"]) == ("SUCCEEDED", None)
    assert len(done["spec"]["labels"]) == 16
    tracks = served.client.get(f"/v1/trackings/{done['id']}/tracks.csv")
    rows = [f"{one['camera']},5,{one['marker']},{one['x_px']!r},{one['y_px']!r}" for one in labels]
    (folder / "labels.csv").write_text("\n".join(["camera,frame,marker,x_px,y_px", *rows]) + "\n")
    text = (folder / "film.yaml").read_text().replace("  places: markers.csv\n", "") + "labels: labels.csv\n"
    (folder / "labelled.yaml").write_text(text)
    code, _, err = wingfit("track", folder / "labelled.yaml", "-o", tmp_path / "tracks.csv")
    assert code == 0, err
    assert tracks.content == (tmp_path / "tracks.csv").read_bytes()
    assert tracks.text.startswith("time_s,tip0_x_m,")


def test_the_markers_of_a_wing_are_those_of_its_dataset(
    served: Api, film: str, done: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = [(float(x), float(y), float(z)) for x, y, z in PLACES.round(6)]
    markers = tuple(Marker(name, place, 1e-5) for name, place in zip(NAMES, places, strict=True))
    with monkeypatch.context() as patch:
        described = toy._wing()
        patch.setattr(toy, "_wing", lambda: replace(described, markers=markers))
        dataset = served.upload()["id"]
    tracking = submitted(served, film, places=[], dataset_id=dataset)
    assert tracking["dataset_id"] == dataset
    assert tracking["spec"]["places"] == MARKERS
    assert served.client.delete(f"/v1/datasets/{dataset}").status_code == 204  # the places were copied
    assert ended(served, tracking["id"])["state"] == "SUCCEEDED"
    tracks = [served.client.get(f"/v1/trackings/{one}/tracks.csv").content for one in (done, tracking["id"])]
    assert tracks[0] == tracks[1]


def test_a_wing_with_few_markers_is_refused(served: Api, film: str) -> None:
    body = {"film_id": film, "kind": "dot", "light": "continuous", "dataset_id": served.upload()["id"]}
    answer = served.client.post("/v1/trackings", json=body)
    assert (answer.status_code, "2 markers; at least 6" in answer.text) == (422, True), answer.text


def test_a_film_without_all_its_files_is_not_tracked(served: Api, folder: Path) -> None:
    film = new_film(served)["id"]
    put(served.client, film, "left", (folder / "left.avi").read_bytes())
    answer = served.client.post("/v1/trackings", json={"film_id": film, "kind": "dot", "light": "continuous"})
    assert answer.status_code == 409
    assert "cameras, right; upload each: PUT /v1/films/" in answer.json()["detail"]


def test_a_tracking_that_fails_says_why(served: Api, film: str) -> None:
    tracking = ended(served, submitted(served, film, kind="chequer", last_frame=4)["id"])
    assert tracking["state"] == "FAILED"
    assert "at least 6 are needed: check kind" in tracking["error"]
    dark = ended(served, submitted(served, film, light="strobe")["id"])
    assert dark["state"] == "FAILED"
    assert dark["error"].startswith(("video of camera left: ", "video of camera right: ")), dark["error"]
    for what in ("result", "tracks.csv", "covariance.npz", "report.html"):
        answer = served.client.get(f"/v1/trackings/{tracking['id']}/{what}")
        assert (answer.status_code, answer.json()["state"]) == (409, "FAILED")


def test_a_full_disk_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(tracking_process, "_tracked", full)
    monkeypatch.setattr(tracking_process, "_end_with_server", lambda: None)
    with pytest.raises(SystemExit) as ended:
        tracking_process.main([str(tmp_path)] * 3)
    assert ended.value.code == FAULTS
    assert "the disk of the server: is full: free some space" in str(
        error_of(json.loads(capsys.readouterr().out)["faults"])
    )


def test_a_cancelled_tracking_ends_with_its_process(tmp_path: Path, long_film: Path) -> None:
    with toy_service(tmp_path / "data") as (_, api):
        film = uploaded(api, long_film)
        tracking = submitted(api, film["id"])["id"]
        while not api.get(f"/v1/trackings/{tracking}")["steps"]:
            time.sleep(0.05)
        assert len(processes_of(film["id"])) == 1
        busy = put(api.client, film["id"], "left", (long_film / "left.avi").read_bytes())
        assert (busy.status_code, busy.json()["state"]) == (409, "RUNNING")
        start = time.monotonic()
        assert api.client.post(f"/v1/trackings/{tracking}/cancel").status_code == 202
        assert ended(api, tracking)["state"] == "CANCELLED"
        assert time.monotonic() - start < 30.0
        assert processes_of(film["id"]) == []
        assert not (tmp_path / "data" / "films" / film["id"] / "tracked" / tracking).exists()


def test_what_is_deleted_leaves_no_files(tmp_path: Path, folder: Path) -> None:
    with toy_service(tmp_path / "data") as (_, api):
        film = uploaded(api, folder)["id"]
        tracking = ended(api, submitted(api, film)["id"])["id"]
        place = tmp_path / "data" / "films" / film
        refused = api.client.delete(f"/v1/films/{film}")
        assert (refused.status_code, "1 tracking refers to film" in refused.text) == (409, True)
        assert (place / "tracked" / tracking / "tracks.csv").exists()
        assert {path.stat().st_mode & 0o077 for path in place.rglob("*")} == {0}
        assert api.client.delete(f"/v1/trackings/{tracking}").status_code == 204
        assert not (place / "tracked" / tracking).exists()
        assert api.client.delete(f"/v1/films/{film}").status_code == 204
        assert list((tmp_path / "data" / "films").iterdir()) == []
        assert api.client.get(f"/v1/films/{film}").status_code == 404


def test_a_waiting_tracking_whose_files_are_gone_says_so(tmp_path: Path, folder: Path) -> None:
    with toy_service(tmp_path / "data") as (service, api):
        film = uploaded(api, folder)["id"]
        evaluator, service.runner._evaluator = service.runner._evaluator, None  # so that it waits
        tracking = submitted(api, film)["id"]
        (left,) = (tmp_path / "data" / "films" / film / "videos").glob("left.*")
        left.unlink()
        assert evaluator is not None
        service.runner.attach(evaluator)
        failed = ended(api, tracking)
        assert (failed["state"], "not on this server: left; upload them" in failed["error"]) == ("FAILED", True), failed


def test_files_that_are_gone_are_named(tmp_path: Path, folder: Path) -> None:
    """As after the restoration of a backup, which has no films."""
    with toy_service(tmp_path / "data") as (_, api):
        film = uploaded(api, folder)["id"]
        tracking = ended(api, submitted(api, film)["id"])["id"]
        shutil.rmtree(tmp_path / "data" / "films")
        described = valid(Film, api.get(f"/v1/films/{film}"))
        assert (described["ready"], described["missing"]) == (False, ["cameras", "left", "right"])
        assert described["cameras"][0]["bytes"] is None
        gone = api.client.get(f"/v1/trackings/{tracking}/tracks.csv")
        assert (gone.status_code, "submit the tracking of film" in gone.text) == (409, True)
        assert api.get(f"/v1/trackings/{tracking}/result")["instants"] == FRAMES
        assert api.client.get(f"/v1/films/{film}/frames/left/0").status_code == 404
        for name, file in (("cameras", "cameras.yaml"), ("left", "left.avi"), ("right", "right.avi")):
            assert put(api.client, film, name, (folder / file).read_bytes()).status_code == 200
        assert api.get(f"/v1/films/{film}")["ready"]
