"""Diagnoses on the page: started from a run and from a dataset, followed, and what they found shown."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.service import toy_diagnosis
from tests.service.pages.browsing import Seen
from tests.service.processes import ServerProcess

if TYPE_CHECKING:
    from playwright.sync_api import Browser

TEXT = "document.getElementById('{}').textContent"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("page") / "data"
    with ServerProcess(data, ("tests.service.toy_server", "1.0")) as process:
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
    seen.wait("document.getElementById('diagnose-suspects-summary')?.textContent.includes('all')")
    seen.page.fill("#diagnose-form [name=refits]", "0")
    seen.page.click("#diagnose-form [type=submit]")
    seen.wait("!document.getElementById('diagnose-errors').hidden")
    assert "refits: " in seen.page.inner_text("#diagnose-errors")
    assert len(seen.errors) == 1, "the refused request, which Chromium counts as an error"
    seen.errors.clear()
    seen.page.fill("#diagnose-form [name=refits]", "5")
    seen.page.select_option("#diagnose-form [name=division]", "4")
    seen.page.fill("#diagnose-form [name=name]", "what is missing?")
    seen.page.click("#diagnose-suspects-summary")
    for name in ("hinge_offset", "added_mass"):
        seen.page.check(f"#diagnose-suspects [value={name}]")
    assert "Suspects: hinge offset, added mass" in seen.page.inner_text("#diagnose-suspects-summary")
    seen.page.click("#diagnose-form [type=submit]")
    seen.wait("location.hash.startsWith('#diagnosis=')")
    seen.wait(TEXT.format("diagnosis-progress") + ".includes('testing every effect')")
    spec = server.api.get("/v1/diagnoses")["items"][0]["spec"]
    assert (spec["division"], spec["refits"], sorted(spec["suspects"])) == ("4", 5, ["added_mass", "hinge_offset"])
    assert seen.page.is_visible("#diagnosis-actions [data-action=cancel]")
    assert seen.page.is_hidden("#run")
    seen.wait("document.getElementById('report').shadowRoot?.querySelector('h1')", 40)
    diagnosis = server.api.get("/v1/diagnoses")["items"][0]
    finding = server.api.get(f"/v1/diagnoses/{diagnosis['id']}/finding")
    assert seen.page.is_hidden("#partial")
    assert "good 1.0×" in seen.page.inner_text("#diagnosis-name")
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
    links = seen.page.locator("#finding-model a").evaluate_all("(all) => all.map((one) => one.getAttribute('href'))")
    formats = ("python", "tables", "fmu", "json")
    assert links == [f"v1/diagnoses/{diagnosis['id']}/model?format={one}" for one in formats]
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
    seen.wait("document.getElementById('diagnose-suspects-summary')?.textContent.includes('all')")
    assert "best genome of the run" in seen.page.inner_text("#diagnose-about")
    seen.page.click("#diagnose-form [type=submit]")
    seen.wait("location.hash.startsWith('#diagnosis=')")
    seen.wait(TEXT.format("diagnosis-about") + ".includes('from the best genome of a run')")
    seen.page.click("#diagnosis-actions [data-action=cancel]")
    seen.page.click("#confirm-yes")
    seen.wait(TEXT.format("diagnosis-name") + ".includes('cancelled')")
    (found,) = server.api.get(f"/v1/diagnoses?run_id={run}")["items"]
    assert (found["state"], len(found["spec"]["start"])) == ("CANCELLED", 2)
    assert seen.page.evaluate("document.getElementById('report').shadowRoot.childNodes.length") == 0
    assert seen.errors == []


def test_what_a_diagnosis_knew_is_shown_also_after_it_was_cancelled(seen: Seen, server: ServerProcess) -> None:
    diagnosis = server.api.diagnose(server.api.upload()["id"])["id"]
    server.api.until_diagnosis(diagnosis, lambda now: now["steps"] > toy_diagnosis.STEPS)
    path = f"/v1/diagnoses/{diagnosis}"
    assert server.api.client.post(f"{path}/cancel").is_success
    server.api.until_diagnosis(diagnosis, lambda now: now["state"] == "CANCELLED")
    known = server.api.get(f"{path}/partial")
    seen.show(f"diagnosis={diagnosis}")
    seen.wait("document.getElementById('partial-map')?.data?.length > 1")
    assert seen.data("partial-map", 1, "x") == pytest.approx([200.0, 450.0])  # mm along the span
    assert "4.0 times the noise" in seen.page.inner_text("#partial-nominal")
    assert f"explain {100 * known['leads'][0]['explained']:.0f} %" in seen.page.inner_text(
        "#partial-leads li:first-child"
    )
    assert "ended before it had a finding" in seen.page.inner_text("#partial-stage")
    assert seen.errors == []
