"""From films to tracks on the page: upload, look, label, track, and lead the tracks to the import."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("cv2", reason="pip install 'wingfit[cameras]'")

import cv2
import numpy as np

from tests.cameras.films import FRAMES, NAMES, RATE, SIZE, cameras, wing, write_film
from tests.service import toy
from tests.service.conftest import Api, serving
from tests.service.films.aligned import write_tracks
from tests.service.films.films import ended
from tests.service.pages.browsing import DRAWN, Seen, opened
from tests.tracking.alignment.recorded import ROBIRD, dataset, filmed
from wingfit.records.array_types import Array
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

if TYPE_CHECKING:
    from playwright.sync_api import Browser, FilePayload

CAMERAS = ("left", "right")
NOTE = "document.querySelectorAll('#look-views .note')[{}].textContent"
FOUND = f"{len(NAMES)} dots found in frame {{}}"
TRACKED = "!document.getElementById('tracking-result').hidden"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("films") / "data"


@pytest.fixture(scope="module")
def api(data: Path) -> Iterator[Api]:
    settings = Settings(data=data)
    with serving(create_app(settings, make_evaluator=toy.NoEvaluator)) as client:
        yield Api(client)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with cameras.yaml, and a video of each camera: clip-left.avi, clip-right.avi."""
    folder = tmp_path_factory.mktemp("film")
    write_film(folder)
    for name in CAMERAS:
        codec = cv2.VideoWriter.fourcc(*"MJPG")
        writer = cv2.VideoWriter(str(folder / f"clip-{name}.avi"), codec, RATE, SIZE, isColor=False)
        for number in range(FRAMES):
            writer.write(np.asarray(cv2.imread(str(folder / name / f"{number}.png"), cv2.IMREAD_GRAYSCALE)))
        writer.release()
    return folder


@pytest.fixture
def seen(browser: Browser, api: Api) -> Iterator[Seen]:
    seen = opened(browser, api)
    yield seen
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


@pytest.fixture(scope="module")
def film(api: Api, files: Path) -> str:
    """The id of a film with all files."""
    answer = api.client.post("/v1/films", json={"name": "whole", "cameras": list(CAMERAS)})
    made = str(answer.json()["id"])
    for slot, file in (("cameras", "cameras.yaml"), *((one, f"clip-{one}.avi") for one in CAMERAS)):
        answer = api.client.put(f"/v1/films/{made}/files/{slot}", content=(files / file).read_bytes())
        assert answer.status_code == 200, answer.text
    return made


@pytest.fixture(scope="module")
def tracking(api: Api, film: str) -> str:
    body = {"film_id": film, "kind": "dot", "light": "continuous", "last_frame": 12}
    return str(api.client.post("/v1/trackings", json=body).json()["id"])


def look(seen: Seen, film: str) -> None:
    """Open the page of a film of dots, and wait until the dots of its first frames are found."""
    seen.show(f"film={film}")
    seen.wait("document.querySelectorAll('#look-views canvas').length === 2")
    seen.page.select_option("[name=kind]", "dot")
    for camera in range(len(CAMERAS)):
        seen.wait(f"{NOTE.format(camera)} === '{FOUND.format(0)}'")


def test_from_films_to_tracks_and_a_dataset(seen: Seen, api: Api, files: Path, tmp_path: Path) -> None:
    seen.show("")
    seen.page.click(".menu a[href='#films']")
    seen.page.wait_for_selector("#films-form")
    seen.page.set_input_files("#films-yaml", files / "cameras.yaml")
    seen.wait("document.querySelector('#films-form [name=cameras]').value === 'left, right'")
    seen.page.fill("#films-form [name=name]", "run 3")
    seen.page.click("#films-form [type=submit]")
    seen.wait("document.getElementById('film-files-note')?.textContent.startsWith('Missing: left, right')")
    assert seen.page.is_hidden("#track-part")
    seen.page.set_input_files("#film-picked", files / "clip-left.avi")
    seen.wait("document.getElementById('film-files-note').textContent.startsWith('Missing: right.')")
    seen.page.reload()  # the missing file is still to be chosen, and only that
    seen.wait("document.getElementById('film-files-note')?.textContent.startsWith('Missing: right.')")
    assert "25 frames, 320 × 240 pixels, 100 frames per second" in seen.page.inner_text("#film-files li:nth-child(2)")
    seen.page.set_input_files("#film-files li:nth-child(3) input", files / "clip-right.avi")
    seen.wait("!document.getElementById('track-part').hidden")
    assert seen.page.inner_text("#film-files-note") == "All files are here."

    seen.page.select_option("[name=kind]", "dot")
    seen.page.select_option("#track-form [name=light]", "continuous")
    seen.page.fill("#track-form [name=last_frame]", "many")
    seen.page.click("#track-form [type=submit]")
    seen.page.wait_for_selector("#track-errors li")
    assert "last_frame: " in seen.page.inner_text("#track-errors")
    assert seen.page.get_attribute("#track-form [name=last_frame]", "aria-invalid") == "true"
    seen.errors.clear()  # the browser reports the refusal
    seen.page.fill("#track-form [name=last_frame]", "20")
    seen.page.click("#track-form [type=submit]")
    seen.wait(f"location.hash.startsWith('#tracking=') && {TRACKED}", 60)
    numbers = seen.page.inner_text("#tracking-numbers")
    assert "Instants\n20" in numbers
    assert "Markers found, median\n12 of 12" in numbers
    assert [row[1] for row in seen.rows("tracked-markers")] == ["100.0"] * len(NAMES)
    assert [row[0] for row in seen.rows("tracked-cameras")] == list(CAMERAS)
    assert all(float(row[1].replace("< ", "")) < 0.2 for row in seen.rows("tracked-cameras"))
    seen.wait(DRAWN.format("found-plot", 0))
    assert seen.data("found-plot", 0, "y") == [12] * 20
    assert seen.page.locator("#seen-instant option").count() == 8
    assert "12 markers seen and projected" in seen.page.inner_text("#seen-views .film-view:nth-child(2) .note")

    tracking = seen.page.url.rpartition("=")[2]
    with seen.page.expect_download() as download:
        seen.page.click("#tracking-csv")
    download.value.save_as(tmp_path / "tracks.csv")
    assert (tmp_path / "tracks.csv").read_text() == api.client.get(f"/v1/trackings/{tracking}/tracks.csv").text
    seen.page.click("#tracking-dataset")
    seen.wait("document.getElementById('import-summary')?.textContent.startsWith('plain table, 12 markers, 20 frames')")
    assert seen.page.inner_text("#import-file-name").startswith("run_3")


def test_tracks_become_a_dataset_of_a_described_wing(
    seen: Seen, api: Api, data: Path, film: str, tracking: str
) -> None:
    assert ended(api, tracking)["state"] == "SUCCEEDED"
    write_tracks(data, film, tracking, filmed(1))
    seen.show(f"tracking={tracking}")
    seen.wait("document.querySelector('#filmed-recordings tbody tr')")
    row = "#filmed-recordings tbody tr:first-child [name={}]"
    seen.page.fill("#filmed-dataset [name=name]", "filmed wing")
    seen.page.set_input_files("#filmed-wing-file", ROBIRD / "dataset.yaml")
    seen.page.evaluate("document.querySelector('#filmed-dataset [name=wing]').value = 'file'")
    seen.page.select_option("#filmed-dataset [name=side]", "right")
    conditions = dataset().recordings[1].condition
    seen.page.fill(row.format("flap_frequency_hz"), str(conditions.flap_frequency))
    seen.page.fill(row.format("pressure_mbar"), str(conditions.pressure / 100))
    seen.page.fill(row.format("temperature_c"), "-300")
    seen.page.click("#filmed-dataset [type=submit]")
    seen.wait("!document.getElementById('filmed-errors').hidden")
    assert "Phase lag, deg of" in seen.page.inner_text("#filmed-errors")
    seen.page.fill(row.format("phase_lag_deg"), str(round(float(np.degrees(conditions.phase_lag)), 6)))
    seen.page.click("#filmed-dataset [type=submit]")
    seen.wait("document.getElementById('filmed-errors').textContent.includes('temperature')", 60)
    seen.errors.clear()  # the browser reports the refusal
    seen.page.fill(row.format("temperature_c"), "20")
    seen.page.click("#filmed-dataset [type=submit]")
    seen.wait("!document.getElementById('filmed-result').hidden", 60)
    [aligned] = seen.rows("filmed-aligned")
    assert aligned[1] == "right"
    assert float(aligned[2]) < 3.0
    seen.page.click("#filmed-open")
    seen.wait("location.hash.startsWith('#dataset=')")
    stored = api.client.get(f"/v1/datasets/{seen.page.url.rpartition('=')[2]}").json()
    assert stored["name"] == "filmed wing"


def test_faults_are_shown_at_the_file_concerned(seen: Seen, api: Api, files: Path) -> None:
    film = api.client.post("/v1/films", json={"name": "faulty", "cameras": list(CAMERAS)}).json()["id"]
    seen.show(f"film={film}")
    seen.wait("document.querySelectorAll('#film-files li').length === 3")
    other: FilePayload = {"name": "clip 7.avi", "mimeType": "video/avi", "buffer": b"x"}
    text: FilePayload = {"name": "notes left.txt", "mimeType": "text/plain", "buffer": b"no video"}
    seen.page.set_input_files("#film-picked", [other, text])
    assert "clip 7.avi: the name contains none of the cameras' (left, right)" in seen.page.inner_text("#film-unmatched")
    seen.page.wait_for_selector("#film-files li:nth-child(2) .error")
    assert "video" in seen.page.inner_text("#film-files li:nth-child(2) .error")
    assert seen.page.locator("#film-files .error").count() == 1
    seen.errors.clear()  # the browser reports the refusal
    seen.page.set_input_files("#film-picked", files / "clip-left.avi")
    seen.wait("document.querySelectorAll('#film-files .badge.good').length === 1")
    assert seen.page.locator("#film-files .error").count() == 0
    seen.page.click("#film-delete")
    seen.page.keyboard.press("Escape")
    assert api.get(f"/v1/films/{film}")["name"] == "faulty"
    seen.page.click("#film-delete")
    seen.page.click("#confirm-yes")
    seen.wait("location.hash === '#films' && !document.getElementById('films-list').hidden")
    assert api.client.get(f"/v1/films/{film}").status_code == 404


def click(seen: Seen, camera: int, pixel: Array, beside: float = 4.0) -> None:
    """Click the picture of ``camera`` ``beside`` screen pixels from ``pixel``; the whole picture is shown."""
    canvas = seen.page.locator("#look-views canvas").nth(camera)
    box = canvas.bounding_box()
    assert box is not None
    x, y = 1 + (pixel + 0.5) * (box["width"] - 2) / SIZE[0]  # 1: the border
    canvas.click(position={"x": float(x) + beside, "y": float(y)})


def test_markers_are_labelled_by_clicks_and_keys(seen: Seen, film: str) -> None:
    look(seen, film)
    pixels = [camera.project(wing(0.0)) for camera in cameras()]
    seen.page.click("#label-summary")
    click(seen, 0, pixels[0][0], beside=60.0)
    assert seen.rows("label-table") == []
    assert "No detection near the click" in seen.page.inner_text("#look-views .note >> nth=0")
    for marker in range(5):
        for camera in range(2):
            assert seen.page.inner_text(f"#look-views .hint >> nth={camera}") == f"Click marker m0{marker + 1}."
            click(seen, camera, pixels[camera][marker])
    seen.page.click("#track-form [type=submit]")
    assert "At least 6 markers labelled in 2 cameras are needed" in seen.page.inner_text("#track-errors")
    seen.page.reload()  # labels outlive it
    look(seen, film)
    assert "5 markers labelled in 2 cameras or more; at least 6 are needed." in seen.page.inner_text("#label-state")
    seen.page.focus("#look-views canvas >> nth=0")
    for key in ("ArrowRight", "Enter", "u"):
        seen.page.keyboard.press(key)
    assert len(seen.rows("label-table")) == 5, "undone"
    for camera in range(2):
        click(seen, camera, pixels[camera][5])
    found = [[*map(float, cell.split(", "))] for row in seen.rows("label-table") for cell in row[1:3]]
    assert np.abs(np.array(found).reshape(6, 2, 2) - np.stack(pixels, axis=1)[:6]).max() < 0.5, "of the detections"
    assert seen.page.inner_text("#label-state").endswith("that is enough.")
    seen.page.fill("[aria-label='Number of the frame of camera left']", "1")
    seen.page.press("[aria-label='Number of the frame of camera left']", "Enter")
    for camera in range(2):
        seen.wait(f"{NOTE.format(camera)} === '{FOUND.format(1)}'")
    click(seen, 0, cameras()[0].project(wing(1 / RATE))[6])
    assert "The labels of camera left are in frame 0" in seen.page.inner_text("#label-state")
    seen.page.select_option("#track-form [name=light]", "continuous")
    seen.page.fill("#track-form [name=last_frame]", "12")
    with seen.page.expect_request("**/v1/trackings") as sent:
        seen.page.click("#track-form [type=submit]")
    labels = json.loads(sent.value.post_data or "")["labels"]
    assert {(one["camera"], one["frame"]) for one in labels} == {("left", 0), ("right", 0)}
    assert sorted(one["marker"] for one in labels) == [f"m0{k // 2 + 1}" for k in range(12)]
    seen.wait(TRACKED, 60)
    assert "labelled by hand" in seen.page.inner_text("#tracking-about")
    names = [row[0] for row in seen.rows("tracked-markers")]
    assert {*names} >= {f"m0{k + 1}" for k in range(6)}
    assert len(names) == len(NAMES)


@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 390)])
def test_nothing_is_in_the_way(browser: Browser, api: Api, film: str, tracking: str, scheme: Any, width: int) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'")
    seen = opened(browser, api, viewport={"width": width, "height": 800}, color_scheme=scheme)
    look(seen, film)
    seen.page.click("#label-summary")
    click(seen, 0, cameras()[0].project(wing(0.0))[0])
    faults = [violations(seen, axe)]
    seen.show("films")
    seen.wait("document.querySelectorAll('#trackings-table tbody tr').length > 0")
    faults.append(violations(seen, axe))
    seen.show(f"tracking={tracking}")
    seen.wait(TRACKED, 60)
    seen.wait(DRAWN.format("found-plot", 0))
    faults.append(violations(seen, axe))
    assert faults == [[], [], []], json.dumps(faults, indent=1)
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


def violations(seen: Seen, axe: Any) -> list[Any]:
    """What hinders a reader on the page that is shown; "wide" if something is wider than the screen."""
    found = axe.Axe().run(seen.page).response["violations"]
    wide = seen.page.evaluate("document.documentElement.scrollWidth > innerWidth")
    return [(one["id"], [node["target"] for node in one["nodes"]][:3]) for one in found] + ["wide"] * wide


def test_a_tracking_is_cancelled_and_deleted(seen: Seen, api: Api, film: str) -> None:
    body = {"film_id": film, "kind": "dot", "light": "continuous", "last_frame": 10}
    ids = [api.client.post("/v1/trackings", json=body | {"name": f"turn {k}"}).json()["id"] for k in range(4)]
    seen.show(f"tracking={ids[-1]}")  # waits for its turn
    seen.page.click("#tracking-actions [data-action=cancel]")
    seen.page.click("#confirm-yes")
    seen.wait("document.getElementById('tracking-name').textContent === 'turn 3 cancelled'")
    for other in ids[:-1]:
        api.client.post(f"/v1/trackings/{other}/cancel")
    seen.page.click("#tracking-film")
    seen.wait("document.getElementById('film-trackings')?.textContent.includes('turn 3 cancelled')")
    seen.page.click("#film-trackings a:text('turn 3')")
    seen.page.click("#tracking-actions [data-action=delete]")
    seen.page.click("#confirm-yes")
    seen.wait("location.hash === '#films' && document.querySelectorAll('#trackings-table tbody tr').length > 0")
    assert api.client.get(f"/v1/trackings/{ids[-1]}").status_code == 404
