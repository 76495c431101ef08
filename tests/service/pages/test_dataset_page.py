"""The page of a dataset: what was recorded in pictures, and likely mistakes, shown after the upload and later."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tests.checks.samples import good_vehicle, good_wing
from tests.service import toy
from tests.service.conftest import Api, serving
from tests.service.datasets.test_warnings import stored, thin
from tests.service.pages.browsing import DRAWN, Seen, opened
from wingfit.records import Dataset
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Route

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


def uploaded(api: Api, dataset: Dataset, path: Path) -> str:
    stored(dataset, path)
    answer = api.client.post("/v1/datasets", files={"file": (path.name, path.read_bytes())})
    assert answer.status_code == 201, answer.text
    return str(answer.json()["id"])


def points(seen: Seen, name: str) -> list[list[float | None]]:
    """The points of a trace of the picture."""
    script = """(name) => { const one = document.getElementById('picture').data.findLast((each) => each.name === name);
        return Array.from(one.x, (x, k) => [x, one.y[k], one.z[k]]); }"""
    return list(seen.page.evaluate(script, name))


def lengths(lines: list[list[float | None]]) -> list[float]:
    """Lengths of the lines of a trace: two points each, then a gap."""
    return [math.dist(one, other) for one, other in zip(lines[::3], lines[1::3], strict=True)]  # type: ignore[arg-type]


def three_markers(names: tuple[str, ...]) -> Dataset:
    """The wing with these markers alone, too few to refuse wrong axes; x and y of the tracks are exchanged."""
    good = good_wing()
    made = []
    for one in good.recordings[:1]:
        places = one.positions[:, [one.markers.index(name) for name in names]][:, :, [1, 0, 2]]
        plain = replace(one, markers=names, values=places.reshape(len(places), -1), standard_deviation=None)
        made.append(replace(plain, noise_correlation=None))
    markers = tuple(one for one in good.wing.markers if one.name in names)
    return replace(good, rig=replace(good.wing, markers=markers, reference_markers=names[:1]), recordings=tuple(made))


def test_markers_are_drawn_where_they_were_recorded(browser: Browser, api: Api, tmp_path: Path) -> None:
    good = good_wing()
    gap = good.recordings[0].values.copy()
    gap[20:27] = np.nan
    dataset = uploaded(api, replace(good, recordings=(replace(good.recordings[0], values=gap),)), tmp_path / "gap.nc")
    seen = opened(browser, api)
    seen.show(f"dataset={dataset}")
    seen.wait(f"{DRAWN.format('picture', 8)} && {DRAWN.format('samples', 2)}")
    tracks, wing = api.get(f"/v1/datasets/{dataset}/tracks"), api.get(f"/v1/datasets/{dataset}/wing")
    rest = {one["name"]: one["position_mm"] for one in wing["markers"]}
    assert points(seen, "recorded") == tracks["positions_mm"][0]
    assert points(seen, "axes")[0:2] == [[0, 0, 0], [0.3 * wing["span_mm"], 0, 0]]
    seen.page.select_option("#picture-described", "rest")
    seen.page.focus("#picture-phase")
    seen.page.keyboard.press("ArrowRight")
    later = json.dumps(tracks["positions_mm"][1][0][0])
    seen.wait(f"document.getElementById('picture').data.find((one) => one.name === 'recorded').x[0] === {later}")
    assert points(seen, "recorded") == tracks["positions_mm"][1]
    assert points(seen, "described") == [pytest.approx(one) for one in rest.values()]
    both = zip(tracks["markers"], tracks["positions_mm"][1], strict=True)
    expected = [math.dist(place, rest[name]) for name, place in both if None not in place]
    assert sorted(lengths(points(seen, "distance")) + lengths(points(seen, "far"))) == pytest.approx(sorted(expected))
    scene = seen.page.evaluate("document.getElementById('picture').layout.scene")
    sizes = {k: scene[f"{k}axis"]["range"][1] - scene[f"{k}axis"]["range"][0] for k in "xyz"}
    label, top = points(seen, "labels")[-1], scene["zaxis"]["range"][1]
    assert label[2] is not None
    assert label[2] < top - 0.15 * sizes["z"], "there is room above the label of the stroke plane"
    scale = [sizes[k] / scene["aspectratio"][k] for k in "xyz"]
    assert scale == pytest.approx([scale[0]] * 3), "one scale on all axes"
    assert seen.rows("distances")[0][0] == tracks["markers"][int(np.argmax(tracks["distance_mm"]))]
    for node in ("#picture", "#checks-summary"):
        box = seen.page.locator(node).bounding_box()
        assert box is not None
        assert box["y"] + box["height"] < 900, f"{node} is on the first screen"
    seen.wait("document.getElementById('checks-summary').textContent === '11 checks found nothing'")
    seen.page.click("#checks-summary")
    assert seen.page.locator("#checks li").count() == 11
    _check_gaps(seen, api, dataset)
    _check_names(seen)
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


def _check_names(seen: Seen) -> None:
    """Of 49 names as many are written as there is room for, and none over another; turning makes room for others."""
    seen.page.check("#picture-names")
    seen.wait("document.getElementById('picture').data.find((one) => one.name === 'names').x.length === 49")
    script = """async () => {
        const { placed, projected } = await import('./dataset/labels.js');
        const node = document.getElementById('picture'), { scene } = node.layout;
        const one = node.data.findLast((each) => each.name === 'described');
        const ranges = ['xaxis', 'yaxis', 'zaxis'].map((name) => scene[name].range);
        const ratio = ['x', 'y', 'z'].map((name) => scene.aspectratio[name]);
        const points = Array.from(one.x, (x, k) => [x, one.y[k], one.z[k]]);
        const places = projected(points, scene.camera, { ranges, ratio, height: node.clientHeight });
        const found = placed(one.customdata, places);
        const names = node.data.find((each) => each.name === 'names');
        const shown = names.text.filter((_, m) => names.textfont.color[m] !== 'rgba(0,0,0,0)');
        return [found.map((each) => each.name), found.map((each) => each.box), Array.from(shown), places];
    }"""
    written = {}
    for view in ("oblique", "above"):
        seen.page.select_option("#picture-view", view)
        seen.wait(f"document.getElementById('picture').layout.scene.uirevision === '{view}'")
        names, shown, texts, places = seen.page.evaluate(script)
        assert texts == names
        assert all(
            one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
            for k, one in enumerate(shown)
            for other in shown[:k]
        )
        spread = [max(place[k] for place in places) - min(place[k] for place in places) for k in (0, 1)]
        assert 100 < max(spread) < seen.page.evaluate("document.getElementById('picture').clientWidth")
        written[view] = names
    assert 15 < len(written["oblique"]) < 49
    assert len(written["above"]) > len(written["oblique"]), "seen from above, the markers are farther apart"


def _check_gaps(seen: Seen, api: Api, dataset: str) -> None:
    """The coordinates of the marker that is shown, with the gap of seven frames."""
    marker = seen.page.input_value("#samples-marker")
    samples = api.get(f"/v1/datasets/{dataset}/samples?marker={marker}")
    assert seen.data("samples", 0, "x") == samples["time_s"]
    assert seen.data("samples", 2, "y") == samples["channels"][2]["values"]
    missing = samples["channels"][0]["missing"]
    assert missing["samples"] >= 7
    assert any(one["samples"] == 7 for one in missing["gaps"])
    assert f"{missing['samples']} of 124 samples missing" in seen.page.inner_text("#samples-note")
    shapes = "document.getElementById('samples').layout.shapes.filter((one) => one.type === 'rect').length"
    assert seen.page.evaluate(shapes) == 3 * len(missing["gaps"])


def test_exchanged_axes_are_seen_at_once(browser: Browser, api: Api, tmp_path: Path) -> None:
    dataset = uploaded(api, three_markers(("m49", "m23", "m05")), tmp_path / "swapped.nc")
    seen = opened(browser, api)
    seen.show(f"dataset={dataset}")
    seen.wait(DRAWN.format("picture", 8))
    tracks, wing = api.get(f"/v1/datasets/{dataset}/tracks"), api.get(f"/v1/datasets/{dataset}/wing")
    assert lengths(points(seen, "distance")) == []
    far = lengths(points(seen, "far"))
    assert len(far) == 3
    assert min(far) > 0.15 * wing["span_mm"]
    places = {one["name"]: np.array(one["position_mm"]) - wing["hinge_mm"] for one in wing["markers"]}
    angle = math.radians(tracks["angle_deg"][0])
    turn = np.array([[1, 0, 0], [0, math.cos(angle), -math.sin(angle)], [0, math.sin(angle), math.cos(angle)]])
    both = zip(tracks["markers"], tracks["positions_mm"][0], strict=True)
    assert far == pytest.approx([math.dist(at, turn @ places[name] + wing["hinge_mm"]) for name, at in both])
    assert tracks["misfit_percent"] > 15
    assert seen.page.locator("#picture-note .bad-word").inner_text().endswith(" % of the span")
    assert seen.page.locator("#distances tr.far").count() == 3
    assert "the tracks are" in seen.page.inner_text("#warnings")
    seen.wait("document.getElementById('checks-summary').textContent === 'The other 10 checks found nothing'")
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


def test_forces_are_drawn_over_the_beat_and_over_time(browser: Browser, api: Api, tmp_path: Path) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'").Axe()
    good = good_vehicle()
    values = good.recordings[0].values.copy()
    values[300:310] = np.nan
    changed = replace(good.recordings[0], values=values, standard_deviation=np.array([0.002, 0.003]))
    dataset = uploaded(api, replace(good, recordings=(changed, *good.recordings[1:])), tmp_path / "vehicle.nc")
    seen = opened(browser, api)
    seen.show(f"dataset={dataset}")
    seen.wait(f"{DRAWN.format('data-force-0', 1)} && {DRAWN.format('data-motion', 1)}")
    forces, samples = api.get(f"/v1/datasets/{dataset}/forces"), api.get(f"/v1/datasets/{dataset}/samples")
    means: dict[str, Any] = {one["name"]: one["mean_n"] for one in forces["forces"]}
    assert seen.data("data-force-0", 1, "y") == means["lift"]
    assert seen.data("data-motion", 0, "y") == forces["flap_deg"]
    seen.page.click("#forces-view >> text=x, z of the body")
    seen.wait("document.getElementById('data-force-1-title').textContent.startsWith('Force along z')")
    seen.wait(f"document.getElementById('data-force-1').data[1].y[5] === {means['z'][5]}")
    every = [value for value in seen.data("data-force-1", 0, "y") if value is not None]
    assert every == [value for value in samples["channels"][1]["values"] if value is not None]
    seen.page.click("#forces-view >> text=Over time")
    seen.wait(f"document.getElementById('data-force-0').data[0].x.length === {len(samples['time_s'])}")
    assert seen.data("data-force-0", 0, "y") == samples["channels"][0]["values"]
    assert seen.page.evaluate("document.getElementById('data-force-0').layout.shapes.length") == 1
    assert "10 of " in seen.page.inner_text("#forces-note")
    assert "standard deviation 2.0 mN" in seen.page.inner_text("#noise")
    assert seen.page.locator("#force-axes text").all_text_contents() == ["x (nose)", "z (belly)", "lift", "drag"]
    found = axe.run(seen.page, context="#dataset").response["violations"]
    assert [one["id"] for one in found] == []
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


def test_the_list_of_checks_has_a_name_at_every_moment(browser: Browser, api: Api, tmp_path: Path) -> None:
    """While the checks are fetched, and when they cannot be."""
    dataset = uploaded(api, good_vehicle(), tmp_path / "named.nc")
    seen = opened(browser, api)
    waiting: list[Route] = []
    held = True
    seen.page.route("**/checks", lambda route: waiting.append(route) if held else route.abort())
    seen.show(f"dataset={dataset}")
    seen.wait(DRAWN.format("data-force-0", 1))
    assert seen.page.inner_text("#checks-summary") == "The checks are being fetched"
    held = False  # the page fetches them again whenever it finds the server
    while waiting:
        waiting.pop().abort()
    seen.wait("document.getElementById('checks-summary').textContent === 'The checks could not be fetched'")
    seen.page.context.close()
