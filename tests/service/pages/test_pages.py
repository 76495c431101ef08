"""The pages beside that of one run: lists, comparisons, datasets, effects; by keyboard, and for everyone."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.service import toy
from tests.service.pages.browsing import DRAWN, Seen
from tests.service.processes import ServerProcess
from wingfit.sim.effects.registry import EFFECTS

if TYPE_CHECKING:
    from playwright.sync_api import Browser

TEXT = "document.getElementById('{}').textContent"
ROWS = "document.querySelectorAll('#{} tbody tr').length"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("pages") / "data"
    with ServerProcess(data, ("tests.service.toy_server", "0.01")) as process:
        yield process


@pytest.fixture(scope="module")
def dataset(server: ServerProcess) -> dict[str, Any]:
    return server.api.upload(name="toy wing")


@pytest.fixture(scope="module")
def runs(server: ServerProcess, dataset: dict[str, Any]) -> list[str]:
    """Three that have ended, the first of them longer; oldest first."""
    made = []
    for seed, generations in ((1, 6), (2, 3), (3, 3)):
        run = server.api.submit(dataset["id"], name=f"seed {seed}", seed=seed, max_generations=generations)
        assert server.api.finish(run["id"])["state"] == "SUCCEEDED"
        made.append(str(run["id"]))
    return made


@pytest.fixture(scope="module")
def diagnosis(server: ServerProcess, dataset: dict[str, Any]) -> str:
    made = server.api.diagnose(dataset["id"], name="why")
    assert server.api.diagnosed(made["id"])["state"] == "SUCCEEDED"
    return str(made["id"])


@pytest.fixture
def seen(browser: Browser, server: ServerProcess) -> Iterator[Seen]:
    base = f"http://127.0.0.1:{server.port}"
    context = browser.new_context(viewport={"width": 1300, "height": 900})
    context.grant_permissions(["clipboard-read", "clipboard-write"], origin=base)
    seen = Seen.watched(context.new_page(), base)
    yield seen
    assert seen.foreign == []
    context.close()


def test_all_runs_are_listed_filtered_and_compared(seen: Seen, dataset: dict[str, Any], runs: list[str]) -> None:
    seen.show("runs")
    seen.wait(f"{ROWS.format('listing-table')} === 3")
    assert [row[1] for row in seen.rows("listing-table")] == ["seed 3", "seed 2", "seed 1"]
    assert seen.page.is_hidden("#listing-more")
    assert seen.page.is_disabled("#compare")
    seen.page.select_option("#listing-state", "FAILED")
    seen.wait(f"{TEXT.format('listing-note')} === 'No runs match the filter.'")
    assert "state=FAILED" in seen.page.url
    seen.page.go_back()
    seen.wait(f"{ROWS.format('listing-table')} === 3")
    assert seen.page.input_value("#listing-state") == ""
    for run in runs[:2]:
        seen.page.check(f"[data-key=choose-{run}]")
    seen.page.click("#compare")
    seen.wait(f"location.hash === '#compare={runs[0]},{runs[1]}'")
    seen.wait(DRAWN.format("compare-plot", 1))
    assert [row[0] for row in seen.rows("compare-outcome")] == ["seed 1", "seed 2"]
    assert {row[0]: row[1:] for row in seen.rows("compare-setup")} == {
        "seed": ["1", "2"],
        "max generations": ["6", "3"],
    }
    seen.page.check("#compare-all")
    assert "population" in [row[0] for row in seen.rows("compare-setup")]
    assert len(seen.rows("compare-recordings")) == len(dataset["recordings"])
    assert seen.page.locator("#compare-genes tbody tr").count() == 2
    assert seen.errors == []


def test_a_run_is_exported(seen: Seen, runs: list[str]) -> None:
    seen.open(runs[0])
    seen.wait("!document.getElementById('run').hidden")
    for name, ending in (("csv", "-history.csv"), ("netcdf", ".nc"), ("json", ".json")):
        with seen.page.expect_download() as download:
            seen.page.click(f"#export-{name}")
        assert download.value.suggested_filename == f"{runs[0]}{ending}"


def test_a_comparison_shows_what_the_api_has(seen: Seen, server: ServerProcess, runs: list[str]) -> None:
    seen.show(f"compare={','.join(runs)}")
    seen.wait(DRAWN.format("compare-plot", 2))
    for place, run in enumerate(runs):
        history = server.api.history(run)
        assert seen.data("compare-plot", place, "x") == [item["evaluations"] for item in history]
        assert seen.data("compare-plot", place, "y") == [item["best_mm"] for item in history]
    seen.show(f"compare={runs[0]},run_none")
    seen.wait(TEXT.format("toast") + ".includes('run_none')")


def test_a_long_list_goes_on_where_it_ended(seen: Seen, server: ServerProcess) -> None:
    other = server.api.upload(name="many runs")["id"]
    made = [server.api.submit(other, max_generations=1, name=f"run {number}")["id"] for number in range(103)]
    seen.show(f"runs&dataset_id={other}")
    seen.wait(f"{ROWS.format('listing-table')} === 100")
    # "of more" until the number is known
    seen.wait("document.getElementById('listing-note').textContent === '100 of 103, newest first'")
    seen.page.click("#listing-more")
    seen.wait(f"{ROWS.format('listing-table')} === 103")
    assert [row[1] for row in seen.rows("listing-table")] == [f"run {number}" for number in reversed(range(103))]
    assert seen.page.is_hidden("#listing-more")
    seen.page.select_option("#listing-dataset", "")
    seen.wait(f"location.hash === '#runs' && {ROWS.format('listing-table')} === 100")
    for run in made:
        server.api.finish(run)


def test_a_dataset_has_a_page(seen: Seen, dataset: dict[str, Any], runs: list[str], diagnosis: str) -> None:
    seen.show("datasets")
    seen.wait(f"{TEXT.format('listing-table')}.includes('toy wing')")
    seen.page.click("#listing-table a:text-is('toy wing')")
    seen.wait(DRAWN.format("conditions", 1))
    rows = seen.rows("recordings")
    assert [row[0] for row in rows] == [one["name"] for one in dataset["recordings"]]
    assert [row[1] for row in rows] == ["held out" if one["held_out"] else "to fit" for one in dataset["recordings"]]
    held = [one["flap_frequency_hz"] for one in dataset["recordings"] if one["held_out"]]
    assert seen.data("conditions", 1, "x") == held
    assert dataset["sha256"] in seen.page.inner_text("#dataset-sha")
    seen.wait(f"document.querySelectorAll('#dataset-runs a').length === {len(runs)}")
    assert seen.page.get_attribute("#dataset-diagnoses a", "href") == f"#diagnosis={diagnosis}"
    with seen.page.expect_download() as download:
        seen.page.click("#dataset-archive")
    assert download.value.failure() is None
    seen.page.click("#dataset-run")
    seen.wait("document.getElementById('submit-dialog').open")
    assert seen.page.input_value("#submit-form [name=dataset_id]") == dataset["id"]
    assert seen.errors == []


def test_every_effect_is_explained(seen: Seen) -> None:
    seen.show("effects=added_mass")
    seen.wait("document.querySelectorAll('.effect').length > 0")
    shown = seen.page.evaluate("[...document.querySelectorAll('.effect')].map((node) => node.id.slice(7))")
    assert sorted(shown) == sorted(EFFECTS)
    assert seen.page.evaluate("[...document.querySelectorAll('.effect[open]')].map((node) => node.id)") == [
        "effect-added_mass"
    ]
    told = seen.page.inner_text("#effect-added_mass")
    assert "Theodorsen" in told
    assert "added_mass.k" in told
    seen.page.click("#effect-added_mass a[href='#effects=lumped_mass']")
    seen.wait("document.getElementById('effect-lumped_mass').open")
    seen.show("effects=phlogiston")
    seen.wait(TEXT.format("toast") + ".includes('phlogiston')")
    assert seen.errors == []


def test_the_form_is_checked_while_one_types(seen: Seen, server: ServerProcess, dataset: dict[str, Any]) -> None:
    before = len(server.api.get("/v1/runs?limit=200")["items"])
    seen.show(f"dataset={dataset['id']}")
    seen.page.click("#dataset-run")
    seen.wait(TEXT.format("submit-preview") + ".includes('population 50')")
    seen.page.fill("[name=population]", "2")
    seen.wait("document.querySelector('[name=population]').getAttribute('aria-invalid') === 'true'")
    assert seen.page.inner_text("#submit-preview") == ""
    seen.page.fill("[name=population]", "20")
    seen.wait(TEXT.format("submit-preview") + ".includes('population 20')")
    assert seen.page.is_hidden("#submit-errors")
    assert len(server.api.get("/v1/runs?limit=200")["items"]) == before, "nothing is submitted"


def test_what_is_no_number_is_not_left_out(seen: Seen, dataset: dict[str, Any]) -> None:
    seen.show(f"dataset={dataset['id']}")
    seen.page.click("#dataset-run")
    seen.wait(TEXT.format("submit-preview") + ".includes('population 50')")
    seen.page.click("[name=population]", click_count=3)
    seen.page.keyboard.type("1e999")
    seen.wait("document.querySelector('[name=population]').getAttribute('aria-invalid') === 'true'")
    assert seen.page.inner_text("#submit-preview") == ""
    assert "not a number" in seen.page.inner_text("#submit-errors")


def test_names_are_text_in_figures_too(seen: Seen, server: ServerProcess, dataset: dict[str, Any]) -> None:
    name = '<a href="https://evil.example/">click</a><b>x'
    runs = [server.api.submit(dataset["id"], name=name, seed=seed, max_generations=2)["id"] for seed in (1, 2)]
    for run in runs:
        server.api.finish(run)
    seen.show(f"compare={','.join(runs)}")
    seen.wait(DRAWN.format("compare-plot", 1))
    seen.wait("document.querySelector('#compare-plot .legendtext')")
    assert seen.page.locator("#compare-plot a").count() == 0
    assert name in str(seen.page.text_content("#compare-plot .legend"))


def test_what_was_deleted_elsewhere_is_not_shown_any_longer(
    seen: Seen, server: ServerProcess, dataset: dict[str, Any]
) -> None:
    run = server.api.submit(dataset["id"], name="short-lived", max_generations=1)["id"]
    server.api.finish(run)
    seen.open(run)
    seen.wait("!document.getElementById('run').hidden")
    assert server.client.delete(f"/v1/runs/{run}").status_code == 204
    seen.wait("document.getElementById('run').hidden && !document.getElementById('empty').hidden")
    assert run in seen.page.inner_text("#empty-title")
    assert seen.page.title() == "wingfit"
    for address in ("run=", "compare=", "nothing=1"):
        seen.show(address)
        seen.wait("document.getElementById('empty-title').textContent === 'Newest results'")


def test_what_is_copied_as_python_runs(seen: Seen, server: ServerProcess, runs: list[str]) -> None:
    seen.open(runs[0])
    seen.page.wait_for_selector("#copy-python")
    seen.page.click("#copy-python")
    seen.wait("document.getElementById('toast').textContent === 'Copied'")
    program = seen.page.evaluate("navigator.clipboard.readText()")
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (ended.stdout.strip(), ended.stderr) == ("SUCCEEDED", "")
    newest = server.api.get("/v1/runs?limit=1")["items"][0]
    assert newest["id"] != runs[0]
    assert (newest["spec"], newest["name"]) == (server.api.run(runs[0])["spec"], "seed 1")


def test_the_page_is_used_by_keyboard(seen: Seen, runs: list[str]) -> None:
    seen.show("runs")
    seen.wait(f"{ROWS.format('listing-table')} > 0")
    seen.page.keyboard.press("Tab")
    assert seen.page.evaluate("document.activeElement.id") == "skip"
    seen.page.keyboard.press("Enter")
    assert seen.page.evaluate("document.activeElement.id") == "detail", "the address stays the page's"
    assert seen.page.url.endswith("#runs")
    reached = []
    for _ in range(24):
        seen.page.keyboard.press("Tab")
        reached.append(seen.page.evaluate("document.activeElement.id || document.activeElement.dataset.key || ''"))
    assert reached[:6] == [
        "listing-run", "listing-q", "listing-state", "listing-dataset", "listing-badge", "listing-grouped"
    ]  # fmt: skip
    assert "sort-residual_over_noise" in reached
    assert any(name.startswith("choose-") for name in reached)
    outline = seen.page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
    assert outline != "none", "one sees where one is"
    del runs


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_stands_in_anyones_way(
    browser: Browser, server: ServerProcess, dataset: dict[str, Any], runs: list[str], diagnosis: str, scheme: Any
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'")
    context = browser.new_context(viewport={"width": 1300, "height": 900}, color_scheme=scheme)
    seen = Seen.watched(context.new_page(), f"http://127.0.0.1:{server.port}")
    pages = {
        "": "document.querySelector('#newest-runs .card')",
        f"run={runs[0]}": DRAWN.format("beat", 1),
        "runs": f"{ROWS.format('listing-table')} > 0",
        "runs&grouped=1": "document.querySelector('#listing-table .group')",
        "datasets": f"{ROWS.format('listing-table')} > 0",
        f"dataset={dataset['id']}": DRAWN.format("conditions", 1),
        f"diagnosis={diagnosis}": "document.getElementById('report').shadowRoot?.querySelector('h1')",
        f"compare={','.join(runs)}": DRAWN.format("compare-plot", 1),
        "effects=added_mass": "document.querySelectorAll('.effect').length > 0",
    }
    wrong = {}
    for address, drawn in pages.items():
        seen.show(address)
        seen.wait(drawn)
        found = axe.Axe().run(seen.page).response["violations"]
        told = [(one["id"], [node["target"] for node in one["nodes"]][:3]) for one in found]
        if told:
            wrong[address.split("=")[0]] = told
    seen.show("")
    seen.page.click("[data-key^=run-ds]")
    seen.wait("document.getElementById('submit-dialog').open")
    wrong |= {"form": told} if (told := [one["id"] for one in axe.Axe().run(seen.page).response["violations"]]) else {}
    context.close()
    assert wrong == {}, json.dumps(wrong, indent=1)


def test_from_an_upload_to_a_verdict_through_the_page_alone(seen: Seen, tmp_path: Path) -> None:
    archive = tmp_path / "campaign.zip"
    archive.write_bytes(toy.archive(name="from bench to verdict"))
    seen.show("")
    seen.page.set_input_files("#file", archive)
    seen.wait("document.getElementById('submit-dialog').open")
    assert "from bench to verdict" in seen.page.inner_text("#submit-form [name=dataset_id] option:checked")
    seen.page.fill("#submit-form [name=name]", "first try")
    seen.wait(TEXT.format("submit-preview") + ".includes('first try')")
    seen.page.click("#submit-form [type=submit]")
    seen.wait("location.hash.startsWith('#run=')")
    seen.wait("document.querySelector('#run-name .badge')?.textContent === 'done'", 90)
    seen.wait(f"{ROWS.format('misfit')} > 0")
    seen.page.click("#diagnose-run")
    seen.wait("document.getElementById('diagnose-suspects-summary')?.textContent.includes('all')")
    seen.page.click("#diagnose-form [type=submit]")
    seen.wait("location.hash.startsWith('#diagnosis=')")
    seen.wait("document.getElementById('report').shadowRoot?.querySelector('svg[role=img]')", 30)
    assert "verdict: named" in seen.page.inner_text("#report .over")
    assert "from the best genome of a run" in seen.page.inner_text("#diagnosis-about")
    diagnosis = seen.page.evaluate("location.hash").replace("#diagnosis=", "")
    for name, ending in (("csv", "-ranking.csv"), ("netcdf", ".nc"), ("json", ".json")):
        with seen.page.expect_download() as download:
            seen.page.click(f"#finding-{name}")
        assert download.value.suggested_filename == f"{diagnosis}{ending}"
    assert seen.errors == []


def test_the_description_of_the_api_needs_no_other_origin(seen: Seen) -> None:
    seen.page.goto(f"{seen.base}/docs")
    seen.wait("document.body.innerText.includes('/v1/runs')")
    assert seen.errors == []
