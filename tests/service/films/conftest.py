"""A small film in a folder, and a service with it, for the tests of a module that leave it as it is."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from tests.service.conftest import Api, toy_service
from tests.service.films.films import CAMERAS, FRAMES, uploaded, write_video, write_videos

REPEATED = 6


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_videos(tmp_path_factory.mktemp("film"))


@pytest.fixture(scope="session")
def long_film(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same film, again and again, which takes long to track."""
    longer = tmp_path_factory.mktemp("long")
    shutil.copy(folder / "cameras.yaml", longer)
    for camera in CAMERAS:
        images = [cv2.imread(str(folder / camera / f"{number}.png")) for number in range(FRAMES)]
        write_video(longer / f"{camera}.avi", [image for image in images if image is not None] * REPEATED)
    return longer


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("films") / "data"


@pytest.fixture(scope="module")
def served(data: Path) -> Iterator[Api]:
    # As in this process (tests/conftest.py): rounding depends on the count of threads.
    with pytest.MonkeyPatch.context() as patch, toy_service(data) as (_, api):
        patch.setenv("OPENBLAS_NUM_THREADS", "1")
        yield api


@pytest.fixture(scope="module")
def film(served: Api, folder: Path) -> str:
    return str(uploaded(served, folder)["id"])
