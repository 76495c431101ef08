"""The start page, the tables of runs, diagnoses and datasets, names and notes, and the upload of datasets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.service import toy
from tests.service.conftest import Api, toy_service
from tests.service.pages.browsing import Seen, opened

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROWS = "[...document.querySelectorAll('#listing-table tbody tr:not(.group)')].map((row) => row.cells[1].textContent)"
SORTED = "document.querySelector('#listing-table th[aria-sort]').textContent"
FOCUS = "document.activeElement.dataset.key"
STATE = "document.getElementById('upload-state').textContent"
DROPPED = """([names, bodies]) => {
    const data = new DataTransfer();
    names.forEach((name, k) => data.items.add(new File([bodies[k]], name)));
    document.getElementById('upload').dispatchEvent(new DragEvent('drop', { dataTransfer: data, cancelable: true }));
}"""


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    with toy_service(tmp_path_factory.mktemp("lists") / "data") as (_, api):
        yield api


@pytest.fixture(scope="module")
def datasets(api: Api) -> list[str]:
    """Two datasets with runs; oldest first: "b", "C", "a" of the first, and "d" of the second."""
    ids = [str(api.upload(name=name)["id"]) for name in ("left wing", "right wing")]
    runs = [("b", 0, 2), ("C", 0, 4), ("a", 0, 3), ("d", 1, 2)]
    for name, of, generations in runs:
        made = api.submit(ids[of], name=name, max_generations=generations)["id"]
        assert api.finish(made)["state"] == "SUCCEEDED"
    api.diagnosed(api.diagnose(ids[0], name="why")["id"])
    return ids


@pytest.fixture
def seen(browser: Browser, api: Api, datasets: list[str]) -> Iterator[Seen]:
    seen = opened(browser, api, viewport={"width": 1280, "height": 900})
    del datasets
    yield seen
    assert seen.foreign == []
    seen.page.context.close()


def test_a_table_is_sorted_by_its_heads_and_keeps_the_focus(seen: Seen) -> None:
    seen.show("runs")
    seen.wait(f"{ROWS}.join() === 'd,a,C,b'")
    assert seen.page.evaluate(SORTED) == "Submitted"
    seen.page.focus("[data-key=sort-name]")
    for order, rows, way in (("asc", "a,b,C,d", "ascending"), ("desc", "d,C,b,a", "descending")):
        seen.page.keyboard.press("Enter")
        seen.wait(f"{ROWS}.join() === '{rows}'")
        assert seen.page.evaluate("location.hash") == f"#runs&sort=name&order={order}"
        assert seen.page.get_attribute("#listing-table th[aria-sort]", "aria-sort") == way
        assert seen.page.evaluate(FOCUS) == "sort-name"
    seen.page.go_back()
    seen.wait(f"{ROWS}.join() === 'a,b,C,d'")
    seen.page.reload()
    seen.wait(f"{ROWS}.join() === 'a,b,C,d'")
    heads = seen.page.evaluate("[...document.querySelectorAll('#listing-table th button')].map((b) => b.dataset.key)")
    for kind in ("runs", "diagnoses", "datasets"):
        seen.show(kind)
        seen.wait(f"{ROWS}.length > 0 && {SORTED}.match(/Submitted|Uploaded/)")
        heads = seen.page.evaluate(
            "[...document.querySelectorAll('#listing-table th button')].map((b) => b.dataset.key)"
        )
        for head in heads:
            seen.page.click(f"[data-key={head}]")
            seen.wait(f"document.querySelector('th[aria-sort] button').dataset.key === '{head}' && {ROWS}.length > 0")
    assert seen.errors == []


def test_text_and_groups_select_runs(seen: Seen, datasets: list[str]) -> None:
    seen.show("runs&grouped=1&sort=name&order=asc")
    seen.wait(f"{ROWS}.join() === 'd'")
    assert seen.page.inner_text("#listing-note") == "4 runs of 2 datasets; in each, by name"
    other = seen.page.locator(f"[data-key=group-{datasets[0]}]")
    assert other.get_attribute("aria-expanded") == "false"
    other.press("Enter")
    seen.wait(f"{ROWS}.join() === 'd,a,b,C'")
    assert seen.page.evaluate(FOCUS) == f"group-{datasets[0]}"
    seen.page.click(f"[data-key=group-{datasets[1]}]")
    seen.wait(f"{ROWS}.join() === 'a,b,C'")
    seen.page.fill("#listing-q", "c")
    seen.wait(f"{ROWS}.join() === 'C'")
    assert "q=c" in seen.page.url
    assert seen.page.evaluate("document.activeElement.id") == "listing-q"
    seen.page.uncheck("#listing-grouped")
    seen.wait("!document.querySelector('#listing-table .group')")
    seen.page.fill("#listing-q", "nothing")
    seen.wait("document.getElementById('listing-note').textContent === 'No runs match the filter.'")
    seen.page.fill("#listing-q", "")
    seen.page.select_option("#listing-dataset", datasets[1])
    seen.wait(f"{ROWS}.join() === 'd'")
    assert seen.errors == []


def test_names_and_notes_are_changed_in_the_table_and_on_the_pages(seen: Seen, api: Api, datasets: list[str]) -> None:
    diagnosis = api.get("/v1/diagnoses")["items"][0]["id"]
    run = api.get("/v1/runs?q=d&sort=name&order=desc")["items"][0]["id"]
    pages = (("run", "runs", run), ("diagnosis", "diagnoses", diagnosis), ("dataset", "datasets", datasets[1]))
    for page, kind, identity in pages:
        before = api.get(f"/v1/{kind}/{identity}")["name"]
        seen.show(kind)
        seen.wait(f"document.querySelector('[data-key=edit-{identity}]')")
        seen.page.click(f"[data-key=edit-{identity}]")
        seen.page.fill("#edit-dialog [name=name]", " ")
        seen.page.click("#edit-dialog [type=submit]")
        seen.page.wait_for_selector("#edit-dialog .error:not([hidden])")
        assert seen.page.get_attribute("#edit-dialog [name=name]", "aria-invalid") == "true"
        seen.errors.clear()  # the browser reports the refusal
        seen.page.fill("#edit-dialog [name=name]", f"<b>{kind}</b>")
        seen.page.fill("#edit-dialog [name=notes]", "first\nsecond")
        seen.page.click("#edit-dialog [type=submit]")
        seen.wait(f"document.getElementById('listing-table').textContent.includes('<b>{kind}</b>first')")
        assert seen.page.evaluate(FOCUS) == f"edit-{identity}"
        seen.show(f"{page}={identity}")
        seen.wait(f"document.getElementById('{page}-name').textContent.includes('<b>{kind}</b>')")
        assert seen.page.inner_text(f"#{page} .notes p") == "first\nsecond"
        seen.page.click(f"#{page} .notes .edit")
        seen.page.fill("#edit-dialog [name=name]", before)
        seen.page.fill("#edit-dialog [name=notes]", "")
        seen.page.keyboard.press("Escape")
        seen.page.click(f"#{page} .notes .edit")
        seen.page.fill("#edit-dialog [name=name]", before)
        seen.page.fill("#edit-dialog [name=notes]", "")
        seen.page.click("#edit-dialog [type=submit]")
        seen.wait(f"!document.querySelector('#{page} .notes p')")
        stored = api.get(f"/v1/{kind}/{identity}")
        assert (stored["name"], stored["notes"]) == (before, "")
    assert seen.errors == []


def test_the_start_page_has_findings_runs_and_datasets_in_view(seen: Seen) -> None:
    seen.show("")
    seen.wait("document.querySelector('#newest-diagnoses .card')")
    order = ["newest-diagnoses", "newest-runs", "newest-datasets", "upload"]
    tops = seen.page.evaluate("(ids) => ids.map((id) => document.getElementById(id).getBoundingClientRect())", order)
    assert [box["top"] for box in tops] == sorted(box["top"] for box in tops)
    assert tops[-1]["bottom"] < 1200
    assert tops[-1]["width"] > 1000, "nothing is active: there is no side column"
    assert seen.page.is_hidden("aside")
    assert seen.page.is_hidden("#home-steps")
    assert "named" in seen.page.inner_text("#newest-diagnoses .card")
    seen.page.set_viewport_size({"width": 390, "height": 780})
    cut = "[...document.querySelectorAll('.lines strong')].filter((node) => node.scrollWidth > node.clientWidth).length"
    narrow = "Math.min(...[...document.querySelectorAll('.lines strong')].map((node) => node.clientWidth))"
    assert seen.page.evaluate(cut) == 0, "names are whole on a phone"
    assert seen.page.evaluate(narrow) > 250, "and have the whole line"


def test_a_file_of_tracks_is_sent_to_the_import_page(seen: Seen, tmp_path: Path) -> None:
    """It is no dataset: the page says what to do with it, instead of sending it to be refused."""
    tracks = tmp_path / "my robot.csv"
    tracks.write_text("frame,m1_x,m1_y,m1_z\n0,1,2,3\n")
    seen.show("")
    seen.page.set_input_files("#file", tracks)
    seen.wait(f"{STATE}.includes('not a dataset')")
    assert "wingfit import-forces" in seen.page.inner_text("#upload-state .error")
    assert seen.page.get_attribute("#upload .ways a", "href") == "#import"
    seen.page.click("#upload-state .error a")
    seen.wait("location.hash === '#import' && !document.getElementById('import-page').hidden")
    assert seen.errors == [], "nothing was sent"


def test_errors_of_uploads_stay_until_they_are_dismissed(seen: Seen, tmp_path: Path) -> None:
    bad = tmp_path / "bad.zip"
    bad.write_bytes(b"not an archive")
    seen.show("datasets")
    seen.page.set_input_files("#file", bad)
    seen.wait(f"{STATE}.includes('not a toy archive')")
    seen.errors.clear()  # the browser reports the refusal
    seen.page.evaluate(DROPPED, [["one.zip", "two.zip"], [toy.archive(name=n).decode() for n in ("dropped", "too")]])
    seen.wait(f"{ROWS}.length > 3 && {STATE}.includes('stored as dropped') && {STATE}.includes('stored as too')")
    assert seen.page.is_hidden("#submit-dialog"), "nothing is started after several"
    assert "bad.zip, line 1" in seen.page.inner_text("#upload-state .error")
    assert seen.page.evaluate("document.querySelector('#upload-state .error').getBoundingClientRect().width") > 1000
    seen.page.click("h1 a")
    seen.wait("document.getElementById('newest-datasets').textContent.includes('dropped')")
    assert seen.page.is_visible("#upload-state .error"), "it goes where the upload is"
    seen.page.click("#upload-state .error button")
    assert seen.page.locator("#upload-state .error").count() == 0
    assert seen.page.evaluate("document.activeElement.id") == "pick-file"
    assert seen.errors == []


def test_a_folder_without_description_is_refused_and_one_with_it_sent(seen: Seen, tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    (folder / "recordings").mkdir(parents=True)
    seen.show("datasets")
    (folder / "recordings" / "a.csv").write_text("1\n")
    seen.page.set_input_files("#folder", folder)
    seen.wait(f"{STATE}.includes('the folder has no dataset.yaml')")
    (folder / "dataset.yaml").write_text("name: x\n")
    seen.page.set_input_files("#folder", folder)
    seen.wait(f"{STATE}.includes('campaign.zip, line 1')")
    assert b"PK\x03\x04".hex() in seen.page.evaluate(STATE), "the toy reads no archives, and quotes their beginning"


def test_badges_and_multiples_of_the_noise_are_shown(seen: Seen) -> None:
    seen.show("runs")
    seen.wait(f"{ROWS}.length > 0")
    unknown = "document.querySelector('#listing-table td [title=\"The noise of the recordings is not known\"]')"
    assert seen.page.evaluate(f"{unknown}.textContent") == "–"
    script = """async () => {
        const { fitBadge } = await import('./base/labels.js');
        const { overNoise } = await import('./lists/columns.js');
        const job = (fit_badge, residual_over_noise, held_out_over_noise) => (
            { fit_badge, residual_over_noise, held_out_over_noise, state: 'SUCCEEDED' });
        const badges = [job('good', 1.08, null), job('wrong', 1.2, 12.34), job('doubtful', 2, 1)].map(fitBadge);
        return [badges.map((one) => [one.textContent, one.className]), fitBadge(job(null, null, null)), fitBadge({}),
            overNoise(job('good', 1.08, null), 'residual_over_noise')];
    }"""
    assert seen.page.evaluate(script) == [
        [["good 1.1×", "badge fit-good"], ["wrong 12×", "badge fit-wrong"], ["doubtful 2.0×", "badge fit-doubtful"]],
        None,
        None,
        "1.1",
    ]
    assert seen.errors == []
