"""A small film as a user uploads it: videos, the file of calibrated cameras, and the places of the markers."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import httpx

from tests.cameras.films import FRAMES, NAMES, PLACES, RATE, write_film
from tests.service.conftest import FINAL, Api, Json

CAMERAS = ("left", "right")
MARKERS = [
    {"marker": name, **dict(zip(("x_m", "y_m", "z_m"), (round(float(v), 6) for v in place), strict=True))}
    for name, place in zip(NAMES, PLACES, strict=True)
]


def write_videos(folder: Path, frames: int = FRAMES) -> Path:
    """Write the film into ``folder``: cameras.yaml, a video of each camera, markers.csv and film.yaml."""
    film = write_film(folder, frames)
    for camera in CAMERAS:
        images = [cv2.imread(str(folder / camera / f"{number}.png")) for number in range(frames)]
        write_video(folder / f"{camera}.avi", [image for image in images if image is not None])
    film.write_text(
        film.read_text().replace("path: left,", "path: left.avi,").replace("path: right,", "path: right.avi,")
    )
    return folder


def write_video(path: Path, images: Sequence[Any], codec: str = "MJPG") -> None:
    height, width = images[0].shape[:2]
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), RATE, (width, height))
    for image in images:
        video.write(image)
    video.release()


def put(client: httpx.Client, film_id: str, name: str, content: bytes) -> httpx.Response:
    return client.put(f"/v1/films/{film_id}/files/{name}", content=content)


def new_film(api: Api, **changes: Any) -> Json:
    body = {"name": "run 3", "cameras": list(CAMERAS)} | changes
    answer = api.client.post("/v1/films", json=body)
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


def uploaded(api: Api, folder: Path, **changes: Any) -> Json:
    """A film with all its files."""
    film = new_film(api, **changes)
    for name, file in (("cameras", "cameras.yaml"), *((one, f"{one}.avi") for one in CAMERAS)):
        answer = put(api.client, film["id"], name, (folder / file).read_bytes())
        assert answer.status_code == 200, answer.text
        film = answer.json()
    return film


def submitted(api: Api, film_id: str, **changes: Any) -> Json:
    body = {"film_id": film_id, "kind": "dot", "light": "continuous", "places": MARKERS} | changes
    answer = api.client.post("/v1/trackings", json=body)
    assert answer.status_code == 202, answer.text
    return dict(answer.json())


def ended(api: Api, tracking_id: str, seconds: float = 60.0) -> Json:
    deadline = time.monotonic() + seconds
    while (job := api.get(f"/v1/trackings/{tracking_id}"))["state"] not in FINAL:
        assert time.monotonic() < deadline, job
        time.sleep(0.1)
    return job


def processes_of(film_id: str) -> list[int]:
    """The processes that track the film."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            command = path.read_bytes()
        except OSError:  # it has ended
            continue
        if b"tracking_process" in command and film_id.encode() in command:
            found.append(int(path.parent.name))
    return found


__all__ = ["CAMERAS", "FRAMES", "MARKERS", "NAMES", "RATE"]
