"""Import of tracks on the page: from the file of a digitiser to a dataset, without a command line."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.importers.start.test_start import wing_table
from tests.oracles.track_files import flapping, text_writers
from tests.service import toy
from tests.service.conftest import Api, serving
from tests.service.pages.browsing import Seen, opened
from wingfit.service.app import WEB, create_app
from wingfit.service.settings import Settings

if TYPE_CHECKING:
    from playwright.sync_api import Browser

TEXT = "document.getElementById('{}').textContent"
SHOWN = "!document.getElementById('import-result').hidden"
DIVE = """pt1_X,pt1_Y,pt1_Z,pt2_X,pt2_Y,pt2_Z,pt3_X,pt3_Y,pt3_Z
0.0,49.9,6.0,20.0,480.0,3.0,1,2,3
0.1,37.2,49.1,20.3,409.6,265.9,1,2,3
0.0,33.7,57.2,NaN,NaN,NaN,1,2,3
-0.1,46.1,31.8,19.8,456.1,161.2,1,2,3
0.0,49.2,-5.6,20.0,476.7,-70.5,1,2,3
0.0,41.3,-36.0,20.2,428.3,-258.0,1,2,3
0.1,37.4,-44.0,NaN,NaN,NaN,1,2,3
0.0,41.9,-34.7,19.7,432.0,-247.5,1,2,3
"""
CONDITIONS = {"flap_frequency_hz": "3", "phase_lag_deg": "7", "pressure_mbar": "10", "temperature_c": "20"}
AXES = {"axis-x": "aft", "axis-y": "out", "axis-z": "up"}


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    """A server that reads datasets as in use, and computes nothing."""
    settings = Settings(data=tmp_path_factory.mktemp("import") / "data")
    with serving(create_app(settings, make_evaluator=toy.NoEvaluator)) as client:
        yield Api(client)


@pytest.fixture
def seen(browser: Browser, api: Api) -> Iterator[Seen]:
    seen = opened(browser, api)
    yield seen
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


def choose(seen: Seen, name: str, content: str | bytes) -> None:
    seen.show("import")
    seen.wait("document.getElementById('import-file')")
    raw = content.encode() if isinstance(content, str) else content
    seen.page.set_input_files("#import-file", {"name": name, "mimeType": "text/plain", "buffer": raw})


def select(seen: Seen, values: dict[str, str]) -> None:
    for name, value in values.items():
        seen.page.select_option(f"#import-form [name={name}]", value)


def asked(seen: Seen) -> list[str]:
    script = "[...document.querySelectorAll('#import-asked .field:not(.answered)')].map((node) => node.dataset.option)"
    return list(seen.page.evaluate(script))


def picture(seen: Seen) -> str:
    return str(seen.page.evaluate("document.getElementById('import-canvas').toDataURL()"))


def add(seen: Seen, **values: str) -> None:
    for name, value in (CONDITIONS | values).items():
        seen.page.fill(f"#import-recording [name={name}]", value)
    seen.page.select_option("#import-recording [name=rig]", "vacuum_chamber")
    seen.page.click("#import-recording [type=submit]")


def imported(seen: Seen) -> None:
    """Import the dive, and name its two markers as those of the template."""
    choose(seen, "dive_xyzpts.csv", DIVE)
    seen.wait("document.querySelector('#import-form [name=unit]')?.tagName === 'SELECT'")
    seen.page.select_option("#import-form [name=unit]", "mm")
    seen.page.fill("#import-form [name=rate_hz]", "60")
    seen.page.press("#import-form [name=rate_hz]", "Tab")
    seen.wait(SHOWN)
    select(seen, AXES)
    seen.wait(f"{TEXT.format('import-facts')}.includes('of the wing')")
    seen.page.fill("[aria-label='Name of pt1']", "root")
    seen.page.fill("[aria-label='Name of pt2']", "tip")
    seen.page.uncheck("[aria-label='Use pt3']")


def test_the_form_asks_what_the_file_does_not_state(seen: Seen) -> None:
    seen.show("")
    seen.page.click("a[href='#import'] >> nth=0")
    choose(seen, "dive_xyzpts.csv", DIVE)
    seen.wait("document.querySelectorAll('#import-asked .field').length === 2")
    assert asked(seen) == ["unit", "rate_hz"]
    known = seen.page.inner_text("#import-known")
    ranges = "x -0.100 to 20.3, y 2.00 to 480, z -258 to 266"
    assert known == f"Format: DLTdv CSV; 3 markers, 8 frames; the numbers in it are {ranges}."
    assert "in the unit of the calibration" in seen.page.inner_text("#import-asked")
    assert not seen.page.evaluate(SHOWN)
    seen.page.select_option("#import-form [name=unit]", "mm")
    seen.wait("document.querySelectorAll('#import-asked .answered').length === 1")
    assert asked(seen) == ["rate_hz"]
    seen.page.fill("#import-form [name=rate_hz]", "60")
    seen.page.press("#import-form [name=rate_hz]", "Enter")
    seen.wait(SHOWN)
    assert seen.rows("import-facts") == [["Unit", "mm", "you"], ["Rate", "60 Hz", "you"],
        ["Axes", "of the file; how they lie in the wing is not stated", "nobody"]]  # fmt: skip
    assert (
        seen.page.inner_text("#import-summary") == "DLTdv CSV, 3 markers, 8 frames, 0.1167 s, 60.00 frames per second"
    )
    assert seen.rows("import-markers")[1][2:] == [
        "pt2", "75 %", "19.7 to 20.3", "409.6 to 480.0", "-258.0 to 265.9", "272.16"
    ]  # fmt: skip
    assert seen.page.inner_text("#import-gaps") == "Missing positions: 2 of 24 (2 not a number)."
    choose(seen, "walk.trc", text_writers.trc(flapping()))
    seen.wait(f"{TEXT.format('import-summary')}.startsWith('TRC')")
    assert asked(seen) == [], "this file states both, and the answers about the other one are gone"


def test_from_a_file_to_a_dataset(seen: Seen, api: Api, tmp_path: Path) -> None:
    imported(seen)
    with seen.page.expect_download() as download:
        seen.page.click("#import-download")
    download.value.save_as(tmp_path / "dive.csv")
    lines = (tmp_path / "dive.csv").read_text().splitlines()
    assert lines[0] == "time_s,root_x_m,root_y_m,root_z_m,tip_x_m,tip_y_m,tip_z_m"
    assert lines[3].endswith(",0.0,0.0337,0.0572,,,")
    seen.page.fill("#import-recording [name=name]", "vacuum-3hz")
    seen.page.fill("#import-recording [name=flap_frequency_hz]", "fast")
    seen.page.click("#import-recording [type=submit]")
    shown = seen.page.inner_text("#import-recording-errors")
    assert "Pressure, mbar: is empty" in shown
    assert "“fast” is no number" in shown
    assert seen.page.get_attribute("#import-recording [name=rig]", "aria-invalid") == "true"
    add(seen)
    seen.wait(f"{TEXT.format('import-recordings')}.includes('vacuum-3hz')")
    seen.page.check("#import-recording [name=held_out]")
    add(seen, name="again", window_from="0", window_to="0.12", airspeed_m_s="5", standard_deviation_mm="0.5")
    seen.wait("document.querySelectorAll('#import-recordings tbody tr').length === 2")
    seen.page.fill("#import-dataset [name=name]", 'dives: "first" #1')
    seen.page.click("#import-dataset [type=submit]")
    assert "no line that begins with “wing:”" in seen.page.inner_text("#import-dataset-errors")
    seen.page.set_input_files("#import-description-file", WEB / "importing" / "wing-template.yaml")
    seen.wait("document.querySelector('#import-dataset [name=description]').value.includes('wing:')")
    seen.page.click("#import-dataset [type=submit]")
    seen.wait("location.hash.startsWith('#dataset=')")
    stored = api.get(f"/v1/datasets/{seen.page.url.rpartition('=')[2]}")
    assert (stored["name"], stored["markers"], stored["kind"]) == ('dives: "first" #1', 2, "tracks")
    first, second = stored["recordings"]
    assert (first["name"], first["held_out"], first["frames"], first["airspeed_m_s"]) == ("vacuum-3hz", False, 8, 0)
    assert (second["name"], second["held_out"], second["airspeed_m_s"]) == ("again", True, 5)
    assert first["missing_percent"] == 12.5
    archive = api.client.get(f"/v1/datasets/{stored['id']}/archive").content
    with zipfile.ZipFile(io.BytesIO(archive)) as packed:
        entries = packed.read("dataset.yaml").decode().splitlines()
    (entry,) = (line for line in entries if '- {name: "again"' in line)
    assert entry.endswith(", standard_deviation_m: 0.0005}")
    seen.wait(f"{TEXT.format('recordings')}.includes('vacuum-3hz')")


def test_errors_of_the_upload_are_shown_with_the_lines_of_the_description(seen: Seen) -> None:
    imported(seen)
    add(seen, name="dive")
    seen.wait(f"{TEXT.format('import-recordings')}.includes('dive')")
    template = (WEB / "importing" / "wing-template.yaml").read_text()
    wrong = "name: old\nrecordings:\n- {name: gone}\n" + template.replace("chord_m: 0.07", "chord_m: 70")
    line = next(k for k, text in enumerate(wrong.splitlines(), 1) if "chord_m: 70" in text)
    seen.page.fill("#import-dataset [name=description]", wrong)
    seen.page.fill("#import-dataset [name=name]", "new")
    seen.page.click("#import-dataset [type=submit]")
    seen.page.wait_for_selector("#import-dataset-errors li")
    shown = seen.page.inner_text("#import-dataset-errors")
    assert f"dataset.yaml, line {line}, column" in shown
    assert "wing.stations[1].chord_m: is 70.0 m; it must lie in [0.0001, 5] m" in shown
    seen.errors.clear()  # the browser reports the refusal
    with seen.page.expect_download() as download:
        seen.page.click("#import-archive")
    assert download.value.suggested_filename == "new.zip"


def test_faults_of_a_file_are_shown_in_full(seen: Seen) -> None:
    choose(seen, "cut.trc", "\n".join(text_writers.trc(flapping()).split("\n")[:-20]))
    seen.wait("document.querySelectorAll('#import-asked .field').length === 1")
    assert asked(seen) == ["incomplete"]
    assert "The file has 41 frames, but states 60" in seen.page.inner_text("#import-asked")
    seen.page.check("[name=incomplete]")
    seen.wait(SHOWN)
    bad = text_writers.plain(flapping()).replace(".", "..", 30)
    choose(seen, "bad.csv", bad)
    seen.page.wait_for_selector("#import-errors li")
    assert seen.page.locator("#import-errors li").count() > 5
    assert not seen.page.evaluate(SHOWN)
    seen.page.click("#import-more summary")
    seen.page.fill("#import-form [name=rate_hz]", "-3")
    seen.page.press("#import-form [name=rate_hz]", "Enter")
    seen.wait("document.querySelector('#import-form [name=rate_hz]').getAttribute('aria-invalid') === 'true'")
    assert "Frames per second: Input should be greater than or equal" in seen.page.inner_text("#import-errors")
    seen.errors.clear()  # the browser reports the refusals


def test_the_preview_moves_by_keyboard_and_time(seen: Seen) -> None:
    choose(seen, "flight.trc", text_writers.trc(flapping(frames=400)))
    seen.wait(SHOWN)
    assert "One in 2 of the 400 frames is shown" in seen.page.inner_text("#import-preview-note")
    before = picture(seen)
    assert len(set(before)) > 20
    seen.page.focus("#import-canvas")
    seen.page.keyboard.press("ArrowLeft")
    turned = picture(seen)
    seen.page.keyboard.press("+")
    closer = picture(seen)
    seen.page.focus("#import-time")
    seen.page.keyboard.press("ArrowRight")
    assert seen.page.inner_text("#import-time-value") == "0.008 s"
    later = picture(seen)
    seen.page.uncheck("#import-labels")
    unnamed = picture(seen)
    box = seen.page.locator("#import-canvas").bounding_box()
    assert box is not None
    seen.page.mouse.move(box["x"] + 200, box["y"] + 100)
    seen.page.mouse.down()
    seen.page.mouse.move(box["x"] + 300, box["y"] + 150)
    seen.page.mouse.up()
    dragged = picture(seen)
    assert len({before, turned, closer, later, unnamed, dragged}) == 6
    seen.page.focus("#import-play")
    seen.page.keyboard.press("Enter")
    seen.wait("Number(document.getElementById('import-time').value) > 3")
    seen.page.keyboard.press("Enter")
    assert seen.page.inner_text("#import-play") == "Play"


def test_a_file_can_be_dropped(seen: Seen) -> None:
    seen.show("import")
    seen.wait("document.getElementById('import-drop')")
    transfer = seen.page.evaluate_handle(
        "(text) => { const t = new DataTransfer(); t.items.add(new File([text], 'dive.csv')); return t; }", DIVE
    )
    seen.page.dispatch_event("#import-drop", "drop", {"dataTransfer": transfer})
    seen.wait(f"{TEXT.format('import-known')}.includes('DLTdv')")


def test_the_datasets_lead_to_the_import(seen: Seen) -> None:
    seen.show("datasets")
    seen.page.click("#listing-import")
    seen.wait("document.getElementById('import-file')")
    assert seen.page.title() == "Import tracks · wingfit"
    assert seen.page.get_attribute(".menu a[href='#datasets']", "aria-current") == "page"
    seen.show("runs")
    seen.wait("document.getElementById('import-page').hidden && document.getElementById('listing-import').hidden")


@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 390)])
def test_nothing_is_in_the_way(browser: Browser, api: Api, scheme: Any, width: int) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'")
    seen = opened(browser, api, viewport={"width": width, "height": 800}, color_scheme=scheme)
    imported(seen)
    seen.page.click("#import-more summary")
    seen.page.click("#import-recording [type=submit]")
    add(seen, name="dive")
    seen.wait(f"{TEXT.format('import-recordings')}.includes('dive')")
    found = axe.Axe().run(seen.page).response["violations"]
    wrong = [(one["id"], [node["target"] for node in one["nodes"]][:3]) for one in found]
    assert wrong == [], json.dumps(wrong, indent=1)
    assert seen.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing is wider than the screen"
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


def test_a_wing_is_described_by_its_tracks(seen: Seen, api: Api) -> None:
    choose(seen, "two wings.csv", wing_table(both=True))
    seen.wait(SHOWN)
    select(seen, AXES)
    seen.wait(f"{TEXT.format('import-facts')}.includes('of the wing')")
    seen.page.click("#import-describe")
    seen.page.wait_for_selector("#import-describe-errors li")
    assert "“Only these markers” in,mid,tip" in seen.page.inner_text("#import-describe-errors")
    seen.errors.clear()  # the browser reports the refusal
    for name in ("left_in", "left_mid", "left_tip"):
        seen.page.uncheck(f"[aria-label='Use {name}']")
    seen.page.fill("[aria-label='Name of in']", "root")
    seen.page.click("#import-describe")
    seen.wait("!document.getElementById('import-described').hidden")
    assert "assumed: a rectangle around the markers" in seen.page.inner_text("#import-described")
    seen.page.click("#import-recording [type=submit]")
    seen.wait(f"{TEXT.format('import-recordings')}.includes('two_wings')")
    assert "ASSUMED" in seen.page.input_value("#import-dataset [name=description]")
    seen.page.click("#import-dataset [type=submit]")
    seen.wait("location.hash.startsWith('#dataset=')")
    stored = api.get(f"/v1/datasets/{seen.page.url.rpartition('=')[2]}")
    assert (stored["name"], stored["markers"], stored["kind"], stored["warnings"]) == ("two_wings", 3, "tracks", [])


def test_positions_are_stored_without_a_wing(seen: Seen, api: Api) -> None:
    choose(seen, "arm.csv", wing_table())
    seen.wait(SHOWN)
    assert seen.page.is_hidden("#import-describe"), "without axes there is no wing"
    seen.page.fill("[aria-label='Name of in']", "elbow")
    seen.page.click("#import-series")
    seen.wait("location.hash.startsWith('#dataset=')")
    stored = api.get(f"/v1/datasets/{seen.page.url.rpartition('=')[2]}")
    assert (stored["name"], stored["kind"]) == ("arm", "series")
    assert [one["name"] for one in stored["rig"]["channels"]][:2] == ["elbow_y_m", "elbow_z_m"]
