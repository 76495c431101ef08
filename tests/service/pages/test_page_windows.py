"""The page in several windows, without a network, with odd names and dropped files: nothing stale, no dead end."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.service import toy
from tests.service.conftest import Api, toy_service
from tests.service.pages.browsing import DRAWN, Seen, opened

if TYPE_CHECKING:
    from playwright.sync_api import Browser

POLL = "document.dispatchEvent(new Event('visibilitychange'))"
HIDDEN = "Object.defineProperty(document, 'hidden', {get: () => !window.shown, configurable: true})"
TEXT = "document.getElementById('{}').textContent"
ODD = ("Z\u0351\u036b\u0343" * 40, "שלום עולם 😀" * 10, "<img src=x onerror=alert(1)>" + "x" * 170)
DROPPED = """(over) => {
  const data = new DataTransfer();
  data.items.add(new File(["x"], "x.zip"));
  const event = new DragEvent("drop", {dataTransfer: data, bubbles: true, cancelable: true});
  document.querySelector(over).dispatchEvent(event);
  return event.defaultPrevented;
}"""


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    with toy_service(tmp_path_factory.mktemp("windows") / "data") as (_, api):
        yield api


@pytest.fixture
def seen(browser: Browser, api: Api) -> Iterator[Seen]:
    seen = opened(browser, api)
    yield seen
    others = [error for error in seen.errors if "Failed to load resource" not in error]  # refused or without a network
    seen.page.context.close()
    assert others == []


def finished(api: Api, name: str, **more: Any) -> dict[str, Any]:
    run = api.submit(api.upload(name=name)["id"], name=name, max_generations=2, **more)
    return api.finish(run["id"])


def test_a_run_renamed_in_another_window_is_shown_and_not_overwritten_unasked(seen: Seen, api: Api) -> None:
    run = finished(api, "before")
    seen.open(run["id"])
    seen.page.click("#run .notes .edit")
    seen.page.fill("#edit-dialog [name=name]", "mine")
    api.client.patch(f"/v1/runs/{run['id']}", json={"name": "theirs", "notes": "why"})
    seen.page.evaluate(POLL)
    seen.wait("document.getElementById('run-name').textContent.startsWith('theirs')")
    assert seen.page.title() == "theirs · wingfit"
    seen.page.click("#edit-dialog [type=submit]")
    seen.wait("document.querySelector('#edit-dialog .error').textContent.includes('the name is “theirs”')")
    assert api.run(run["id"])["name"] == "theirs"
    seen.page.click("#edit-dialog [type=submit]")
    seen.wait("document.getElementById('run-name').textContent.startsWith('mine')")
    assert (api.run(run["id"])["name"], api.run(run["id"])["notes"]) == ("mine", "")


def test_what_is_deleted_in_another_window_is_not_shown_any_more(seen: Seen, api: Api) -> None:
    run = finished(api, "to delete")
    seen.open(run["id"])
    seen.wait("!document.getElementById('run').hidden")
    seen.page.click("#run [data-action=delete]")
    assert api.client.delete(f"/v1/runs/{run['id']}").status_code == 204
    seen.page.click("#confirm-yes")
    seen.wait(f"{TEXT.format('toast')} === 'to delete was deleted already'")
    seen.wait("location.hash === ''")
    film = api.client.post("/v1/films", json={"name": "film", "cameras": ["left", "right"]}).json()
    for page, path, thing in (("dataset", "datasets", run["dataset_id"]), ("film", "films", film["id"])):
        seen.show(f"{page}={thing}")
        seen.wait("document.querySelector('main h2:not([hidden])') && document.title !== 'wingfit'")
        assert api.client.delete(f"/v1/{path}/{thing}").status_code == 204
        seen.page.evaluate(POLL)
        seen.wait(f"{TEXT.format('empty-title')} === \"there is no {page} '{thing}'\"")


def test_the_page_of_a_dataset_follows_its_runs(seen: Seen, api: Api) -> None:
    dataset = api.upload(name="busy")["id"]
    seen.show(f"dataset={dataset}")
    seen.wait(f"{TEXT.format('dataset-runs')} === 'None yet.'")
    run = api.submit(dataset, name="elsewhere", max_generations=2000)["id"]
    seen.page.evaluate(POLL)
    seen.wait(f"{TEXT.format('dataset-runs')}.includes('elsewhere')")
    seen.page.click("#dataset-delete")
    seen.page.click("#confirm-yes")
    seen.wait(f"{TEXT.format('toast')} === '1 run refers to dataset {dataset}; delete it first'")
    api.control(run, "cancel")
    api.finish(run)
    seen.page.evaluate(POLL)
    seen.wait(f"{TEXT.format('dataset-runs')}.includes('cancelled')")


def test_questions_about_a_page_close_when_it_is_left(seen: Seen, api: Api) -> None:
    run = finished(api, "left")
    seen.open()
    for button, dialog in (("#run .notes .edit", "edit"), ("#run [data-action=delete]", "confirm")):
        seen.open(run["id"])
        seen.page.click(button)
        assert seen.page.is_visible(f"#{dialog}-dialog")
        seen.page.go_back()
        seen.wait(f"!document.getElementById('{dialog}-dialog')")
    seen.show(f"dataset={run['dataset_id']}")
    seen.page.click("#dataset-run")
    seen.page.wait_for_selector("#submit-dialog[open]")
    seen.page.go_back()
    seen.wait("!document.getElementById('submit-dialog').open")
    assert api.run(run["id"])["state"] == "SUCCEEDED", "nothing was deleted"


def test_what_could_not_be_fetched_comes_with_the_network(seen: Seen, api: Api) -> None:
    run = finished(api, "unreached")
    seen.show("effects")
    seen.wait("document.querySelector('#effects-list summary')")
    seen.page.context.set_offline(True)
    seen.page.evaluate("location.hash = 'runs'")
    seen.wait(f"{TEXT.format('toast')}.startsWith('This device has no network connection')")
    seen.page.context.set_offline(False)
    seen.wait(f"{TEXT.format('listing-table')}.includes('unreached')")
    seen.page.context.set_offline(True)
    seen.page.evaluate(f"location.hash = 'dataset={run['dataset_id']}'")
    seen.wait(f"{TEXT.format('empty-title')}.startsWith('This device has no network')")
    seen.page.context.set_offline(False)
    seen.wait(f"{TEXT.format('dataset-name')} === 'unreached' && !document.getElementById('dataset').hidden")
    assert seen.page.is_hidden("#empty")


def test_a_window_behind_others_leaves_its_connection_to_them(seen: Seen, api: Api) -> None:
    """Browsers open six connections to a server, and a window that follows a run needs one."""
    run = api.submit(api.upload(name="followed")["id"], max_generations=2000)["id"]
    followed: list[str] = []
    seen.page.on("request", lambda request: followed.append(request.url) if "/events" in request.url else None)
    seen.page.add_init_script(HIDDEN)
    seen.open(run)
    seen.wait("document.querySelector('#run-name .badge')?.textContent === 'running'")
    assert followed == []
    seen.page.evaluate(f"window.shown = true; {POLL}")
    seen.wait("!document.getElementById('history').hidden")
    with seen.page.expect_event("requestfailed", lambda request: "/events" in request.url):
        seen.page.evaluate(f"window.shown = false; {POLL}")
    api.control(run, "pause")
    api.until(run, lambda now: now["state"] == "PAUSED")
    seen.page.click("[data-action=pause]")
    seen.wait(f"{TEXT.format('toast')} === 'Could not pause: meanwhile the run is paused'")
    seen.page.evaluate(f"window.shown = true; {POLL}")
    seen.page.click("[data-action=cancel]")
    seen.page.click("#confirm-yes")
    seen.wait("document.querySelector('#run-name .badge').textContent === 'cancelled'")
    assert len(followed) == 2


def test_charts_of_a_page_that_was_left_at_once_fit_when_it_is_opened_again(browser: Browser, api: Api) -> None:
    seen = opened(browser, api, viewport={"width": 390, "height": 780})
    dataset = api.upload(name="left at once")["id"]
    with seen.page.expect_request("**/plotly.min.js"):
        seen.show(f"dataset={dataset}")
    seen.show("effects")
    seen.wait(DRAWN.format("conditions", 0))
    seen.show(f"dataset={dataset}")
    seen.wait("document.getElementById('conditions').clientWidth > 0")
    seen.wait(
        "document.getElementById('conditions')._fullLayout.width === document.getElementById('conditions').clientWidth"
    )
    seen.wait("document.documentElement.scrollWidth <= 390")
    seen.page.context.close()


def test_odd_names_stay_in_their_place(browser: Browser, api: Api) -> None:
    seen = opened(browser, api, viewport={"width": 360, "height": 740})
    for name in ODD:
        dataset = api.client.post("/v1/datasets", files={"file": ("t.zip", toy.archive())}, data={"name": name}).json()
        run = api.submit(dataset["id"], name=name, max_generations=1)
        api.finish(run["id"])
        for address in (f"dataset={dataset['id']}", f"run={run['id']}"):
            seen.show(address)
            seen.wait(f"document.title === {json.dumps(f'{name.strip()} · wingfit')}")
            seen.wait("document.querySelector('#dataset-runs a, #run-name .badge')")
            seen.wait("document.documentElement.scrollWidth <= 360")
    assert seen.page.locator("main img[src=x]").count() == 0
    assert seen.errors == []
    seen.page.context.close()


def test_dropped_files_do_not_take_the_place_of_the_page(seen: Seen) -> None:
    seen.show("runs")
    seen.wait("document.getElementById('upload')")
    assert seen.page.evaluate(DROPPED, "header.top"), "else the browser opens the file"
    assert "into the box" in seen.page.inner_text("#toast")


def test_twenty_files_at_once_and_the_same_file_twice(seen: Seen, tmp_path: Path) -> None:
    files = []
    for k in range(20):
        files.append(tmp_path / f"file-{k}.zip")
        files[-1].write_bytes(b"bad" if k % 10 == 0 else toy.archive(name=f"of twenty {k}"))
    seen.show("datasets")
    seen.wait("document.getElementById('file')")
    seen.page.set_input_files("#file", files)
    seen.wait(f"{TEXT.format('upload-state')}.includes('file-19.zip: stored as of twenty 19')")
    assert seen.page.locator("#upload-state .error").count() == 2
    assert seen.page.locator("#upload-state a").count() == 18
    seen.page.set_input_files("#file", files[1])
    seen.wait(f"{TEXT.format('toast')}.includes('of twenty 1, 2. The same file is stored already, as of twenty 1')")
