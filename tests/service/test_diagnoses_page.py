"""Diagnoses on the page: started from a run and from a dataset, followed, and their report shown in its frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.service.browsing import Seen, chromium
from tests.service.processes import ServerProcess

if TYPE_CHECKING:
    from playwright.sync_api import Browser

TEXT = "document.getElementById('{}').textContent"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("page") / "data"
    with ServerProcess(data, ("tests.service.toy_server", "0.4")) as process:
        yield process


@pytest.fixture
def seen(browser: Browser, server: ServerProcess) -> Iterator[Seen]:
    context = browser.new_context(viewport={"width": 1300, "height": 900})
    yield Seen.watched(context.new_page(), f"http://127.0.0.1:{server.port}")
    context.close()


def test_a_dataset_is_diagnosed_and_the_report_shown(seen: Seen, server: ServerProcess) -> None:
    server.api.upload(name="toy wing")
    seen.open()
    seen.wait("document.querySelector('[data-key^=diagnose-]')")
    seen.page.click("[data-key^=diagnose-]")
    seen.wait("location.hash.startsWith('#diagnosis=')")
    seen.wait(TEXT.format("diagnosis-progress") + ".includes('testing every effect')")
    assert seen.page.is_visible("#diagnosis-actions [data-action=cancel]")
    assert seen.page.is_hidden("#run")
    seen.wait(TEXT.format("verdict") + " === 'named'")
    assert "The hinge is off its place" in seen.page.inner_text("#diagnosis-summary")
    diagnosis = server.api.get("/v1/diagnoses")["items"][0]
    assert seen.page.get_attribute("#report", "src") == f"v1/diagnoses/{diagnosis['id']}/report"
    frame = seen.page.frame_locator("#report")
    assert "The hinge is off its place" in frame.locator("p").inner_text()
    # The report's own style is applied: its policy lets that in, and nothing else.
    assert frame.locator("p").evaluate("(node) => getComputedStyle(node).color") == "rgb(0, 128, 128)"
    seen.wait("document.querySelector('#diagnoses .card').textContent.includes('named')")
    seen.page.on("dialog", lambda dialog: dialog.accept())
    seen.page.click("#diagnosis-actions [data-action=delete]")
    seen.wait("document.querySelector('#diagnoses .none') && !document.getElementById('empty').hidden")
    assert seen.errors == []
    assert seen.foreign == []


def test_a_run_is_diagnosed_from_its_best_genome_and_cancelled(seen: Seen, server: ServerProcess) -> None:
    run = server.api.submit(server.api.upload()["id"], max_generations=1)["id"]
    server.api.finish(run)
    seen.open(run)
    seen.wait("!document.getElementById('diagnose-run').hidden")
    seen.page.click("#diagnose-run")
    seen.wait("location.hash.startsWith('#diagnosis=')")
    seen.wait(TEXT.format("diagnosis-about") + ".includes('from the best genome of a run')")
    seen.page.click("#diagnosis-actions [data-action=cancel]")
    seen.wait(TEXT.format("diagnosis-name") + ".includes('cancelled')")
    (found,) = server.api.get(f"/v1/diagnoses?run_id={run}")["items"]
    assert (found["state"], len(found["spec"]["start"])) == ("CANCELLED", 2)
    assert seen.page.is_hidden("#report")
    assert seen.errors == []
