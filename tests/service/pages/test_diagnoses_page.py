"""Diagnoses on the page: started from a run and from a dataset, followed, and what they found shown."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.service.pages.browsing import DRAWN, Seen
from tests.service.processes import ServerProcess

if TYPE_CHECKING:
    from playwright.sync_api import Browser

TEXT = "document.getElementById('{}').textContent"


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


def test_a_dataset_is_diagnosed_and_the_finding_shown(seen: Seen, server: ServerProcess) -> None:
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
    finding = server.api.get(f"/v1/diagnoses/{diagnosis['id']}/finding")
    for figure in ("markers-map", "phases-map", "missing-map", "overlay-plot"):
        seen.wait(DRAWN.format(figure, 0))
    assert seen.data("markers-map", 1, "x") == pytest.approx([1e3 * one["y"] for one in finding["markers"]])
    before, after = (np.multiply(1e3, finding["phase_map"][name]) for name in ("before", "after"))
    np.testing.assert_allclose(seen.data("phases-map", 0, "z"), before)
    seen.page.check("input[name=stage][value=after]", force=True)
    seen.wait(f"document.getElementById('phases-map').data[0].z[1][1] === {float(after[1][1])!r}")
    np.testing.assert_allclose(seen.data("missing-map", 0, "z"), finding["missing"][0]["values"])
    phases = finding["overlays"][0]["phase"]
    assert seen.data("overlay-plot", 0, "x") == sorted(phases), "samples in the order of their phases"
    assert seen.data("overlay-plot", 0, "y") == pytest.approx([1.0, 2.0, 3.0])
    assert [row[0] for row in seen.rows("chances")] == list(finding["probabilities"])
    ranked = seen.rows("ranking")
    assert ranked[0][0].startswith("Hinge off its place actuation")
    assert ranked[0][1] == "90 %"
    assert seen.page.locator("#ranking tr.named").count() == 1
    assert seen.rows("before-after")[0][:4] == ["slow", "fitted", "2 mm 1.8 to 2.2", "0.5 mm 0.45 to 0.55"]
    assert seen.rows("found-genes")[0][:3] == ["hinge_offset.z", "0.004", "0.0038 to 0.0042"]
    assert "would differ by 5 times" in seen.page.inner_text("#advice")
    assert "Power of flap frequency with which it grows: 2.0 (1.8 to 2.2)" in seen.page.inner_text("#where-words")
    with seen.page.expect_popup() as opened:
        seen.page.click("#report-link")
    report = opened.value
    assert "The hinge is off its place" in report.locator("p").inner_text()
    # The report's own style is applied: its policy lets that in, and nothing else.
    assert report.locator("p").evaluate("(node) => getComputedStyle(node).color") == "rgb(0, 128, 128)"
    report.close()
    seen.wait("document.querySelector('#newest-diagnoses .card').textContent.includes('named')")
    seen.page.on("dialog", lambda dialog: dialog.accept())
    seen.page.click("#diagnosis-actions [data-action=delete]")
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
    seen.wait(TEXT.format("diagnosis-name") + ".includes('cancelled')")
    (found,) = server.api.get(f"/v1/diagnoses?run_id={run}")["items"]
    assert (found["state"], len(found["spec"]["start"])) == ("CANCELLED", 2)
    assert seen.page.is_hidden("#finding")
    assert seen.errors == []
