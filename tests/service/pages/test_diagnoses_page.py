"""Diagnoses on the page: started from a run and from a dataset, followed, and what they found shown."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.service.pages.browsing import Seen
from tests.service.processes import ServerProcess

if TYPE_CHECKING:
    from playwright.sync_api import Browser

TEXT = "document.getElementById('{}').textContent"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("page") / "data"
    with ServerProcess(data, ("tests.service.toy_server", "0.6")) as process:
        yield process


@pytest.fixture
def seen(browser: Browser, server: ServerProcess) -> Iterator[Seen]:
    context = browser.new_context(viewport={"width": 1300, "height": 900})
    yield Seen.watched(context.new_page(), f"http://127.0.0.1:{server.port}")
    context.close()


def test_a_dataset_is_diagnosed_and_the_finding_shown(seen: Seen, server: ServerProcess) -> None:
    server.api.upload(name="toy wing")
    seen.open()
    seen.wait("document.querySelector('[data-key^=diagnose-]')")
    seen.page.click("[data-key^=diagnose-]")
    seen.wait("location.hash.startsWith('#diagnosis=')")
    seen.wait(TEXT.format("diagnosis-progress") + ".includes('testing every effect')")
    assert seen.page.is_visible("#diagnosis-actions [data-action=cancel]")
    assert seen.page.is_hidden("#run")
    seen.wait("document.getElementById('report').shadowRoot?.querySelector('h1')")
    diagnosis = server.api.get("/v1/diagnoses")["items"][0]
    finding = server.api.get(f"/v1/diagnoses/{diagnosis['id']}/finding")
    shown = seen.page.locator("#report")
    assert "verdict: named" in shown.locator(".over").inner_text()
    assert "The hinge is off its place" in shown.locator("h1 + p").inner_text()
    assert shown.locator("circle.marker").count() == 2 * len(finding["markers"]), "before and after"
    assert shown.locator("li.named h3").inner_text().startswith("Hinge off its place")
    assert any("would differ by 5 times" in words for words in shown.locator("strong").all_inner_texts())
    # The report's own style is applied, in which markers have the colours of the map and hatches their pattern.
    colour = "(node) => getComputedStyle(node).fill"
    assert shown.locator("circle.marker").first.evaluate(colour) != shown.locator("circle.marker").last.evaluate(colour)
    assert "hatch" in shown.locator(".legend .faint").first.evaluate(colour)
    levels = shown.locator("h1, h2, h3").evaluate_all("(all) => all.map((one) => one.ariaLevel - one.tagName[1])")
    assert set(levels) == {2}, "headings continue those of the page"
    with seen.page.expect_popup() as opened:
        seen.page.click("#report-link")
    report = opened.value
    assert "The hinge is off its place" in report.locator("h1 + p").inner_text()
    # The report's own style is applied: its policy lets that in, and nothing else.
    assert report.locator(".over").evaluate("(node) => getComputedStyle(node).marginTop") == "0px"
    report.close()
    seen.page.click("h1 a")
    seen.wait("document.querySelector('#newest-diagnoses .card')?.textContent.includes('named')")
    seen.page.click("#newest-diagnoses .card")
    seen.page.wait_for_selector("#diagnosis-actions [data-action=delete]")
    seen.page.click("#diagnosis-actions [data-action=delete]")
    seen.page.click("#confirm-yes")
    seen.wait("document.querySelector('#newest-diagnoses .none') && !document.getElementById('empty').hidden")
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
    seen.page.click("#confirm-yes")
    seen.wait(TEXT.format("diagnosis-name") + ".includes('cancelled')")
    (found,) = server.api.get(f"/v1/diagnoses?run_id={run}")["items"]
    assert (found["state"], len(found["spec"]["start"])) == ("CANCELLED", 2)
    assert seen.page.evaluate("document.getElementById('report').shadowRoot.childNodes.length") == 0
    assert seen.errors == []
