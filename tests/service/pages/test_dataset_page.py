"""The page of a dataset with a likely mistake, which is shown after the upload and later; and its drawing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.service import toy
from tests.service.conftest import Api, serving
from tests.service.datasets.test_warnings import stored, thin
from tests.service.pages.browsing import Seen
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

if TYPE_CHECKING:
    from playwright.sync_api import Browser

CHANGE = "dataset.yaml, recordings[2].pressure_mbar: 101.325 -> 1013.25"
SHOWN = """document.querySelector('#drawing svg') && document.getElementById('conditions').data
    && document.querySelectorAll('#warnings li').length === 1"""


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    """A server that reads and checks datasets as in use, and computes nothing."""
    settings = Settings(data=tmp_path_factory.mktemp("warnings") / "data")
    with serving(create_app(settings, make_evaluator=toy.NoEvaluator)) as client:
        yield Api(client)


@pytest.fixture(scope="module")
def wrong(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with a pressure in kPa."""
    path = tmp_path_factory.mktemp("wrong") / "thin.zip"
    stored(thin(), path)
    return path


def test_a_likely_mistake_is_shown_after_the_upload(browser: Browser, api: Api, wrong: Path) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'").Axe()
    context = browser.new_context(viewport={"width": 1280, "height": 800}, color_scheme="light")
    seen = Seen.watched(context.new_page(), str(api.client.base_url).rstrip("/"))
    seen.show("")
    seen.page.set_input_files("#file", wrong)
    seen.wait(SHOWN)
    assert "it has 1 likely mistake" in seen.page.inner_text("#toast")
    assert not seen.page.is_visible("#submit-dialog"), "nothing is started before the mistake has been looked at"
    assert seen.page.inner_text("#warnings-title") == "1 likely mistake in this dataset"
    shown = seen.page.evaluate("[...document.querySelectorAll('#warnings dd')].map((node) => node.textContent)")
    assert shown[0] == "recording 'wt-08.5ms-lag3-2.0hz'"
    assert shown[1].startswith("pressure_mbar is 101.325")
    assert shown[2:] == ["600 to 1085 mbar", "the pressure is in kPa", CHANGE]
    assert seen.page.inner_text("#warnings .copyable code") == "wingfit datasets check FOLDER --fix NEW_FOLDER"
    drawn = {name: seen.page.locator(f"#drawing svg {name}").count() for name in ("path.hinge", "path.rod", "circle")}
    assert drawn == {"path.hinge": 1, "path.rod": 2, "circle": 49}
    light = _paper(seen)
    seen.page.emulate_media(color_scheme="dark")
    seen.page.set_viewport_size({"width": 390, "height": 800})
    seen.page.reload()
    seen.wait(SHOWN)
    assert _paper(seen) != light, "the drawing has the colours of the page"
    found = axe.run(seen.page, context="#dataset").response["violations"]
    faults = [(one["id"], [node["target"] for node in one["nodes"]][:3]) for one in found]
    assert faults == [], json.dumps(faults, indent=1)
    assert (seen.errors, seen.foreign) == ([], [])
    context.close()


def _paper(seen: Seen) -> str:
    """Check that the page fits on its screen; return the colour of the drawing's paper."""
    assert seen.page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "nothing is wider than the screen"
    return str(seen.page.evaluate("getComputedStyle(document.querySelector('#drawing .paper')).fill"))


def test_lists_of_datasets_say_which_have_warnings(browser: Browser, api: Api, wrong: Path, tmp_path: Path) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'").Axe()
    good = tmp_path / "good.zip"
    stored(replace(thin(), name="good", recordings=thin().recordings[:1]), good)
    for path in (wrong, good):
        answer = api.client.post("/v1/datasets", files={"file": path.read_bytes()})
        assert answer.status_code == 201, answer.text
    seen = Seen.watched(browser.new_page(viewport={"width": 1280, "height": 800}), str(api.client.base_url).rstrip("/"))
    for address, places in (("", "#newest-datasets li"), ("datasets", "#listing tbody tr")):
        seen.show(address)
        seen.wait(f"document.querySelectorAll('{places}').length >= 2")
        texts = "[node.querySelector('a').textContent, node.querySelector('.badge')?.textContent]"
        script = f"(nodes) => nodes.map((node) => {texts})"
        rows = dict(seen.page.eval_on_selector_all(places, script))
        assert rows["good"] is None
        assert rows[thin().name] == "1 likely mistake"
        assert "pressure_mbar is 101.325" in str(seen.page.get_attribute(f"{places} .badge", "title"))
        found = axe.run(seen.page).response["violations"]
        assert [one["id"] for one in found] == []
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.close()
