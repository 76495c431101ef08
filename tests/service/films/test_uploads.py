"""Films over HTTP: what is uploaded and shown, and what is refused and then not kept."""

from __future__ import annotations

import errno
import os
import shutil
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.cameras.films import SIZE, cameras
from tests.service.conftest import Api, toy_service
from tests.service.films.films import CAMERAS, FRAMES, RATE, new_film, put, uploaded, write_video
from tests.service.shapes import valid
from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.project import write_cameras
from wingfit.client.films.answers import Film, FoundMarkers
from wingfit.service.films import files as film_files
from wingfit.service.films import films as service_films
from wingfit.service.films import videos


def stored(data: Path, film: str) -> list[Path]:
    return [path for path in (data / "films" / film).rglob("*") if path.is_file()]


def test_a_film_is_described(served: Api, film: str, folder: Path) -> None:
    found = valid(Film, served.get(f"/v1/films/{film}"))
    sizes = [(folder / f"{camera}.avi").stat().st_size for camera in CAMERAS]
    assert (found["ready"], found["calibration"], found["missing"]) == (True, True, [])
    assert found["size_bytes"] == sum(sizes)
    assert [camera["bytes"] for camera in found["cameras"]] == sizes
    facts = {(one["frames"], one["width_px"], one["height_px"], one["rate_hz"]) for one in found["cameras"]}
    assert facts == {(FRAMES, *SIZE, RATE)}
    assert film in [one["id"] for one in served.get("/v1/films")["items"]]


def test_a_stated_rate_replaces_that_of_the_video(served: Api, folder: Path) -> None:
    film = new_film(served, rate_hz={"left": 1000.0})["id"]
    answer = put(served.client, film, "left", (folder / "left.avi").read_bytes())
    assert answer.json()["cameras"][0]["rate_hz"] == 1000.0


def test_a_frame_is_shown_as_jpeg(served: Api, film: str, folder: Path) -> None:
    path = f"/v1/films/{film}/frames/left"
    for number in (7, 8, 3):  # forwards, and back
        answer = served.client.get(f"{path}/{number}")
        assert answer.headers["content-type"] == "image/jpeg"
        image = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_UNCHANGED)
        true = cv2.imread(str(folder / "left" / f"{number}.png"), cv2.IMREAD_GRAYSCALE)
        assert image is not None
        assert true is not None
        assert np.abs(image.astype(float) - true).mean() < 2.0
    small = served.client.get(f"{path}/3?width_px=80")
    image = cv2.imdecode(np.frombuffer(small.content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert image.shape == (60, 80)
    assert small.headers["etag"] != answer.headers["etag"]
    known = served.client.get(f"{path}/3", headers={"If-None-Match": answer.headers["etag"]})
    assert known.status_code == 304
    beyond = served.client.get(f"{path}/{FRAMES}")
    assert (beyond.status_code, f"the film has {FRAMES}, counted from 0" in beyond.text) == (404, True)
    assert served.client.get(f"{path}/3?width_px=3").status_code == 422
    assert served.client.get(f"/v1/films/{film}/frames/top/3").status_code == 404


def test_markers_of_a_frame_are_found(served: Api, film: str) -> None:
    found = valid(FoundMarkers, served.get(f"/v1/films/{film}/frames/right/0/markers?kind=dot"))
    assert len(found["markers"]) == 12
    assert served.client.get(f"/v1/films/{film}/frames/right/0/markers?kind=star").status_code == 422


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"cameras": ["left"]}, "body.cameras"),
        ({"cameras": [f"c{k}" for k in range(9)]}, "body.cameras"),
        ({"cameras": ["left", "left"]}, "body.cameras"),
        ({"cameras": ["left", "cameras"]}, "body.cameras"),
        ({"cameras": ["left", "../right"]}, "body.cameras.1"),
        ({"cameras": ["left", "right\n"]}, "body.cameras.1"),
        ({"rate_hz": {"left": 0.0}}, "body.rate_hz.left"),
        ({"rate_hz": {"top": 100.0}}, "body.rate_hz"),
        ({"name": ""}, "body.name"),
        ({"owner": "ann"}, "body.owner"),
    ],
)
def test_a_film_that_cannot_be_is_refused(served: Api, changes: dict[str, Any], where: str) -> None:
    body = {"name": "run 3", "cameras": list(CAMERAS)} | changes
    answer = served.client.post("/v1/films", json=body)
    assert answer.status_code == 422, answer.text
    assert [error["where"] for error in answer.json()["errors"]] == [where]


def test_a_repeated_request_makes_one_film(served: Api) -> None:
    count = len(served.get("/v1/films?limit=200")["items"])
    body, headers = {"name": "once", "cameras": list(CAMERAS)}, {"Idempotency-Key": "film-1"}
    answers = [served.client.post("/v1/films", json=body, headers=headers) for _ in range(2)]
    assert answers[0].json() == answers[1].json()
    assert answers[0].headers["location"] == f"/v1/films/{answers[0].json()['id']}"
    assert len(served.get("/v1/films?limit=200")["items"]) == count + 1


AVI = b"RIFF\0\0\0\0AVI " + b"\0" * 2000
PLAYLIST = b"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("left", b"no video at all", "is no video in a known container; upload AVI, MP4"),
        ("left", b"", "is no video in a known container"),
        ("left", PLAYLIST, "is no video in a known container"),
        ("left", AVI, "video of camera left: cannot be read as a video"),
        ("cameras", b"\xff\xfe nothing", "none of the known files of cameras"),
        ("cameras", b"1,2\n" * 11, "is a file of DLT coefficients; convert it: wingfit cameras convert"),
        ("cameras", b"format: wingfit cameras\nversion: 9\ncameras: []\n", "version 1"),
    ],
)
def test_a_file_that_cannot_be_used_is_not_kept(served: Api, data: Path, name: str, content: bytes, words: str) -> None:
    film = new_film(served)["id"]
    answer = put(served.client, film, name, content)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert (error["where"], words in error["message"]) == (f"files.{name}", True), error
    assert str(data) not in answer.text
    assert stored(data, film) == []
    assert served.get(f"/v1/films/{film}")["cameras"][0]["bytes"] is None


def test_a_video_without_its_end_is_used_as_far_as_it_goes(served: Api, folder: Path) -> None:
    film, whole = new_film(served)["id"], (folder / "left.avi").read_bytes()
    answer = put(served.client, film, "left", whole[: len(whole) // 2])
    assert answer.status_code == 200, answer.text
    assert served.client.get(f"/v1/films/{film}/frames/left/5").status_code == 200
    beyond = served.client.get(f"/v1/films/{film}/frames/left/{FRAMES - 1}")
    assert (beyond.status_code, "the film has 1" in beyond.text) == (404, True), beyond.text
    assert put(served.client, film, "left", whole[:300]).status_code == 422
    assert served.client.get(f"/v1/films/{film}/frames/left/5").status_code == 200  # a refused file replaces none


def test_names_of_files_are_those_of_the_cameras(served: Api, data: Path) -> None:
    film = new_film(served)["id"]
    answer = put(served.client, film, "top", AVI)
    assert answer.status_code == 404
    assert "the film has left, right; the file of calibrated cameras is cameras" in answer.json()["detail"]
    assert put(served.client, film, "..%2F..%2Fleft", AVI).status_code == 404
    assert put(served.client, "fl_0000000000000000", "left", AVI).status_code == 404
    assert stored(data, film) == []


def test_no_id_leads_out_of_the_folder(served: Api, data: Path) -> None:
    for name in ("..", "..%2F..%2Felsewhere", "fl_" + "0" * 5000, "%00", "deleted-x"):
        for path in (f"/v1/films/{name}", f"/v1/films/{name}/frames/left/0", f"/v1/trackings/{name}/tracks.csv"):
            for method in ("GET", "DELETE"):
                answer = served.client.request(method, path)
                assert answer.status_code in (404, 405), (method, path, answer.text)
    assert not (data.parent / "elsewhere").exists()
    assert data.exists()


def test_cameras_must_have_those_of_the_film(served: Api, folder: Path, tmp_path: Path) -> None:
    film = new_film(served)["id"]
    write_cameras(tmp_path / "one.yaml", CameraSet(cameras()[:1]))
    answer = put(served.client, film, "cameras", (tmp_path / "one.yaml").read_bytes())
    assert (answer.status_code, "has no camera 'right', but left; upload" in answer.text) == (422, True), answer.text
    assert put(served.client, film, "cameras", (folder / "cameras.yaml").read_bytes()).json()["calibration"]


def test_videos_have_the_size_of_the_calibration(served: Api, data: Path, folder: Path, tmp_path: Path) -> None:
    write_video(tmp_path / "small.avi", [np.zeros((120, 160, 3), np.uint8)] * 5)
    small, calibration = (tmp_path / "small.avi").read_bytes(), (folder / "cameras.yaml").read_bytes()
    film = new_film(served)["id"]
    assert put(served.client, film, "cameras", calibration).status_code == 200
    answer = put(served.client, film, "left", small)
    assert answer.status_code == 422
    assert "films 160 x 120 px and was calibrated at 320 x 240 px" in answer.json()["errors"][0]["message"]
    assert len(stored(data, film)) == 1
    other = new_film(served)["id"]
    assert put(served.client, other, "left", small).status_code == 200
    answer = put(served.client, other, "cameras", calibration)
    assert (answer.status_code, answer.json()["errors"][0]["where"]) == (422, "files.cameras")


def test_two_cameras_have_no_copies_of_one_video(served: Api, film: str, folder: Path) -> None:
    answer = put(served.client, film, "right", (folder / "left.avi").read_bytes())
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["where"] == "files.right"
    assert "is the video of camera 'left' too; upload the one that this camera filmed" in error["message"]
    assert put(served.client, film, "left", (folder / "left.avi").read_bytes()).status_code == 200  # itself again


def test_a_replaced_file_is_removed_with_what_was_detected(served: Api, data: Path, folder: Path) -> None:
    film = new_film(served)["id"]
    put(served.client, film, "left", (folder / "left.avi").read_bytes())
    first = served.client.get(f"/v1/films/{film}/frames/left/3")
    (before,) = stored(data, film)
    (data / "films" / film / "detected").mkdir()
    put(served.client, film, "left", (folder / "right.avi").read_bytes())
    (after,) = stored(data, film)
    assert after != before
    assert not (data / "films" / film / "detected").exists()
    second = served.client.get(f"/v1/films/{film}/frames/left/3")
    assert first.headers["etag"] != second.headers["etag"]
    assert first.content != second.content


def test_uploads_of_one_file_at_once_leave_one(served: Api, data: Path, folder: Path) -> None:
    film, video = uploaded(served, folder)["id"], (folder / "left.avi").read_bytes()
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda _: put(served.client, film, "left", video), range(6)))
    assert {answer.status_code for answer in answers} == {200}, [answer.text for answer in answers]
    assert served.get(f"/v1/films/{film}")["ready"]
    assert sorted(path.name.split(".")[0] for path in stored(data, film)) == ["cameras", "left", "right"]
    assert served.client.get(f"/v1/films/{film}/frames/left/3").status_code == 200


@pytest.fixture
def small(tmp_path: Path) -> Iterator[Api]:
    """A service that takes videos of 1 MiB, of each owner 2 MiB."""
    with toy_service(tmp_path / "data", max_film_mib=1, max_films_mib=2) as (_, api):
        yield api


def test_a_file_that_is_too_large_is_refused(small: Api, tmp_path: Path) -> None:
    film = new_film(small)["id"]

    def pieces() -> Iterator[bytes]:
        yield AVI
        for _ in range(32):
            yield bytes(2**16)

    for content in (bytes(2**20 + 1), pieces()):
        answer = small.client.put(f"/v1/films/{film}/files/left", content=content)
        assert (answer.status_code, "MiB" in answer.json()["detail"]) == (413, True), answer.text
    assert small.client.put(f"/v1/films/{film}/files/cameras", content=bytes(2**20)).status_code in (413, 422)
    assert stored(tmp_path / "data", film) == []


def test_no_owner_fills_the_disk_with_films(small: Api, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    write_video(tmp_path / "noise.avi", [noise] * 16)
    write_video(tmp_path / "other.avi", [noise[::-1].copy()] * 16)
    video, another = ((tmp_path / name).read_bytes() for name in ("noise.avi", "other.avi"))
    assert 0.7e6 < len(video) < 2**20
    film, other = new_film(small)["id"], new_film(small)["id"]
    assert put(small.client, film, "left", video).status_code == 200
    assert put(small.client, film, "right", another).status_code == 200
    assert put(small.client, film, "right", another).status_code == 200  # in place of the one before
    answer = put(small.client, other, "left", video)
    assert (answer.status_code, "WINGFIT_MAX_FILMS_MIB" in answer.text) == (429, True), answer.text
    assert stored(tmp_path / "data", other) == []
    assert small.client.delete(f"/v1/films/{film}").status_code == 204
    assert put(small.client, other, "left", video).status_code == 200


def test_the_database_keeps_room_on_the_disk(
    served: Api, data: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film, video = new_film(served)["id"], (folder / "left.avi").read_bytes()
    usage = shutil.disk_usage(data)
    left = film_files.RESERVED_MIB * 2**20 + len(video) // 2
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage._replace(free=left))
    answer = put(served.client, film, "left", video)
    assert (answer.status_code, answer.json()["type"]) == (507, "urn:wingfit:problem:disk-full")
    assert "has no room for the file" in answer.json()["detail"]
    assert stored(data, film) == []


def test_a_disk_that_fills_up_keeps_nothing(
    served: Api, data: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    film = new_film(served)["id"]
    monkeypatch.setattr(film_files, "_to_disk", full)
    answer = put(served.client, film, "left", (folder / "left.avi").read_bytes())
    assert (answer.status_code, answer.json()["type"]) == (507, "urn:wingfit:problem:disk-full")
    assert stored(data, film) == []


def test_a_client_that_is_gone_or_silent_leaves_nothing(
    served: Api, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = new_film(served)["id"]
    host, port = served.client.base_url.host, served.client.base_url.port
    head = (
        f"PUT /v1/films/{film}/files/left HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Length: 5000000\r\n\r\n".encode()
    )
    with socket.create_connection((host, port or 0)) as gone:
        gone.sendall(head + AVI)
        deadline = time.monotonic() + 60
        while not stored(data, film):
            assert time.monotonic() < deadline
            time.sleep(0.01)
    while stored(data, film):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    monkeypatch.setattr(film_files, "SILENT_SECONDS", 0.3)
    with socket.create_connection((host, port or 0)) as silent:
        silent.sendall(head + AVI)
        silent.settimeout(10)
        assert silent.recv(100).startswith(b"HTTP/1.1 408")
    assert stored(data, film) == []


def test_without_opencv_the_remedy_is_stated(
    served: Api, film: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service_films, "find_spec", lambda _: None)
    body = {"film_id": film, "kind": "dot", "light": "continuous"}
    answers = [
        put(served.client, film, "left", (folder / "left.avi").read_bytes()),
        served.client.get(f"/v1/films/{film}/frames/left/0"),
        served.client.get(f"/v1/films/{film}/frames/left/0/markers"),
        served.client.post("/v1/trackings", json=body),
    ]
    for answer in answers:
        assert (answer.status_code, answer.json()["type"]) == (501, "urn:wingfit:problem:not-installed")
        assert "pip install 'wingfit[cameras]'" in answer.json()["detail"]
    assert served.get(f"/v1/films/{film}")["ready"]


def test_a_frame_that_takes_too_long_is_given_up(served: Api, film: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(videos, "SECONDS", 0.0)
        answer = served.client.get(f"/v1/films/{film}/frames/left/1")
        assert (answer.status_code, "was not read within" in answer.text) == (503, True)
    assert served.client.get(f"/v1/films/{film}/frames/left/1").status_code == 200


def test_few_processes_read_videos(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(videos, "MOST_PROCESSES", 1)
    paths = [folder / "left.avi", folder / "right.avi"]
    kept = videos.Videos()
    try:
        for path in (*paths, paths[0]):
            assert kept.ask(path, None, do="facts")[0]["frames"] == FRAMES
        assert list(kept._kept) == [paths[0]]
        process = kept._kept[paths[0]]._child
        process.kill()
        process.wait()
        assert kept.ask(paths[0], None, do="facts")[0]["frames"] == FRAMES
    finally:
        kept.close()
