"""Films and trackings over HTTP, on a small film."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.command_line import in_process
from tests.service.conftest import Api, toy_service
from tests.service.films.films import FRAMES, NAMES, SIZE, ended, submitted, uploaded, write_videos
from tests.service.shapes import valid
from wingfit.cli.main import app
from wingfit.client.films.answers import Film, Tracking, TrackingResult

wingfit = in_process(app)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_videos(tmp_path_factory.mktemp("film"))


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    # As in this process (tests/conftest.py): rounding depends on the count of threads.
    with pytest.MonkeyPatch.context() as patch, toy_service(tmp_path_factory.mktemp("films") / "data") as (_, api):
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        yield api


@pytest.fixture(scope="module")
def film(served: Api, folder: Path) -> str:
    return str(uploaded(served, folder)["id"])


def test_a_film_is_tracked_as_the_command_tracks_it(served: Api, film: str, folder: Path, tmp_path: Path) -> None:
    described = valid(Film, served.get(f"/v1/films/{film}"))
    assert described["ready"]
    assert {camera["frames"] for camera in described["cameras"]} == {FRAMES}
    job = submitted(served, film)
    done = valid(Tracking, ended(served, job["id"]))
    assert (done["state"], done["error"], done["progress"]) == ("SUCCEEDED", None, 1.0)
    code, _, err = wingfit("track", folder / "film.yaml", "-o", tmp_path / "tracks.csv")
    assert code == 0, err
    tracks = served.client.get(f"/v1/trackings/{job['id']}/tracks.csv")
    assert tracks.headers["content-type"].startswith("text/csv")
    assert tracks.content == (tmp_path / "tracks.csv").read_bytes()
    found = valid(TrackingResult, served.get(f"/v1/trackings/{job['id']}/result"))
    assert (found["instants"], found["stride"], found["found"]) == (FRAMES, 1, [len(NAMES)] * FRAMES)
    assert len(found["shown"]) == 8


def test_a_frame_is_shown_as_jpeg(served: Api, film: str) -> None:
    answer = served.client.get(f"/v1/films/{film}/frames/left/7")
    assert answer.headers["content-type"] == "image/jpeg"
    image = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert image.shape == SIZE[::-1]
