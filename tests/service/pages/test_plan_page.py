"""The section "Plan" of the page of a dataset: form, answer, refusals, and what goes on meanwhile."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.checks.samples import good_wing
from tests.service import toy
from tests.service.conftest import Api, serving
from tests.service.datasets.test_warnings import stored
from tests.service.pages.browsing import DRAWN, Seen, opened
from tests.service.rigs.test_drive import upload
from tests.service.runs import force_data
from wingfit.service.app import create_app
from wingfit.service.settings import Settings

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Route

FEW = ["stroke_bias", "stroke_amplitude", "scale_error", "unit_error"]
BEATS = 400  # many, so that effects that look the same are detected
DONE = "!document.getElementById('plan-answer').hidden && document.getElementById('plan-progress').hidden"
READY = "document.querySelectorAll('#plan-suspects input').length > 10"
FITS = "document.documentElement.scrollWidth <= innerWidth"


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    """A server that plans as in use, and computes no jobs."""
    settings = Settings(data=tmp_path_factory.mktemp("plans") / "data")
    with serving(create_app(settings, make_evaluator=toy.NoEvaluator)) as client:
        yield Api(client)


@pytest.fixture(scope="module")
def dataset(api: Api) -> dict[str, Any]:
    """Forces of two fitted recordings and one held out."""
    return force_data.upload(api, force_data.archive(fewer=3))


def ready(browser: Browser, api: Api, dataset: dict[str, Any], **options: Any) -> Seen:
    """The page of the dataset, with the form of its plan."""
    seen = opened(browser, api, **options)
    seen.show(f"dataset={dataset['id']}")
    seen.wait(READY)
    return seen


def only(seen: Seen, effects: list[str]) -> None:
    """Choose these effects in the form."""
    seen.page.select_option("#plan-form select[name=compare]", "these")
    for name in effects:
        seen.page.check(f"#plan-suspects input[value={name}]")


def closed(seen: Seen) -> None:
    """Check that the page has said nothing and asked nobody else; close it."""
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


def body_of(route: Route) -> dict[str, Any]:
    return dict(route.request.post_data_json or {})


def answered(route: Route, status: int, body: dict[str, Any]) -> None:
    route.fulfill(status=status, content_type="application/json", body=json.dumps(body))


@pytest.fixture(scope="module")
def plan(api: Api, dataset: dict[str, Any]) -> dict[str, Any]:
    """A plan of the genes alone, which takes a moment."""
    body: dict[str, Any] = {"suspects": None, "add": 0}
    answer = api.client.post(f"/v1/datasets/{dataset['id']}/plan", json=body)
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


def test_a_plan_is_asked_for_and_drawn(browser: Browser, api: Api, dataset: dict[str, Any]) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'").Axe()
    seen = ready(browser, api, dataset, color_scheme="light")
    assert "The 2 recordings to fit are counted" in seen.page.inner_text("#plan-about")
    assert not seen.page.is_visible("#plan-form input[name=noise_mm]"), "a setting of tracks"
    only(seen, FEW)
    seen.page.fill("#plan-form input[name=add]", "1")
    seen.page.click("#plan-summary")
    seen.page.fill("#plan-form input[name=beats]", str(BEATS))
    with seen.page.expect_response("**/plan") as found_out:
        seen.page.click("#plan-start")
    seen.wait(DONE)
    plan, sent = found_out.value.json(), dict(found_out.value.request.post_data_json or {})
    defaults = {"target_percent": 7.5, "power": 0.9, "axes": ["x"], "preset": "proposed"}
    assert (
        sent | {"suspects": sorted(sent["suspects"])} == {"suspects": sorted(FEW), "add": 1, "beats": BEATS} | defaults
    )
    _check_genes(seen, plan)
    _check_effects(seen, plan)
    _check_additions(seen, plan)
    for scheme, width in (("light", 1280), ("dark", 390)):
        seen.page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        seen.page.set_viewport_size({"width": width, "height": 800})
        seen.wait(FITS)
        found = axe.run(seen.page, context="#plan-part").response["violations"]
        faults = [(one["id"], [node["target"] for node in one["nodes"]][:3]) for one in found]
        assert faults == [], json.dumps(faults, indent=1)
    closed(seen)


def _check_genes(seen: Seen, plan: dict[str, Any]) -> None:
    rows = seen.rows("plan-genes")
    assert [row[0] for row in rows] == [gene["name"] for gene in plan["genes"]]
    vague = seen.page.eval_on_selector_all(
        "#plan-genes tbody tr", "(rows) => rows.map((row) => row.className === 'vague')"
    )
    assert vague == [not gene["identified"] for gene in plan["genes"]]
    half = float(seen.page.inner_text("#plan-genes .plan-scale span:last-child").strip("+ %"))
    widths = seen.page.eval_on_selector_all("#plan-genes b", "(all) => all.map((one) => parseFloat(one.style.width))")
    assert widths == pytest.approx(
        [min(100.0, 100.0 * gene["relative_percent"] / half) for gene in plan["genes"]], rel=1e-4
    )
    known = sum(gene["identified"] for gene in plan["genes"])
    assert seen.page.inner_text("#plan-numbers dd >> nth=0") == f"{known} of {len(plan['genes'])}"


def _check_effects(seen: Seen, plan: dict[str, Any]) -> None:
    """One row for each, least distinguished first; sorted by another column on request."""
    titles = {one["name"]: one["title"] for one in plan["effects"]}
    alike = {titles[name] for pair in plan["confused"] for name in (pair["one"], pair["other"])}
    assert titles["scale_error"] in alike, "a scale and a unit look the same"
    marked = seen.page.eval_on_selector_all("#plan-effects tr.alike th a", "(all) => all.map((one) => one.textContent)")
    assert set(marked) == alike
    seen.page.click("#plan-effects thead button >> text=× typical")
    assert seen.page.get_attribute("#plan-effects th[aria-sort]", "aria-sort") == "descending"
    seen.page.click("#plan-effects thead button >> text=× typical")
    assert seen.page.get_attribute("#plan-effects th[aria-sort]", "aria-sort") == "ascending"
    parts = {one["title"]: one["smallest_part"] for one in plan["effects"]}
    shown = seen.page.eval_on_selector_all("#plan-effects tbody th a", "(all) => all.map((one) => one.textContent)")
    sizes = [float("inf") if parts[title] is None else parts[title] for title in shown]
    assert len(sizes) == len(FEW)
    assert sizes == sorted(sizes)
    assert len(seen.rows("plan-confused")) == len(plan["confused"])


def _check_additions(seen: Seen, plan: dict[str, Any]) -> None:
    for name, proposals in (("for-genes", plan["for_genes"]), ("for-effects", plan["for_effects"])):
        assert seen.page.locator(f"#plan-{name} strong").all_inner_texts() == [one["words"] for one in proposals]
    assert f"{round(100 * plan['for_genes'][0]['standard_error_factor'])}" in seen.page.inner_text("#plan-for-genes li")
    seen.wait(f"{DRAWN.format('plan-beats', 0)} && {DRAWN.format('plan-conditions', 0)}")
    beats = sorted({one["number"]: one for one in plan["variants"] if one["what"] == "beats"}.items())
    assert seen.data("plan-beats", 0, "x") == [number for number, _ in beats]
    factors = [one["standard_error_factor"] for _, one in beats]
    assert seen.data("plan-beats", 0, "y") == pytest.approx(factors, rel=1e-3)
    assert not seen.page.is_visible("#plan-markers"), "a vehicle has none"


def test_faults_are_placed_at_their_fields(browser: Browser, api: Api, dataset: dict[str, Any]) -> None:
    seen = ready(browser, api, dataset)
    seen.page.fill("#plan-form input[name=add]", "30")
    seen.page.evaluate("document.querySelector('#plan-form input[name=beats]').value = '0'")
    assert not seen.page.is_visible("#plan-form input[name=beats]"), "folded"
    seen.page.click("#plan-start")
    seen.wait("document.querySelectorAll('#plan-form .fault').length === 2")
    faults = {name: seen.page.inner_text(f"#plan-form [data-field={name}] .fault") for name in ("add", "beats")}
    assert "less than or equal to 20" in faults["add"]
    assert "greater than or equal to 1" in faults["beats"]
    for name in faults:
        field = seen.page.locator(f"#plan-form input[name={name}]")
        assert field.get_attribute("aria-invalid") == "true"
        assert field.get_attribute("aria-describedby") == f"plan-fault-{name}"
        assert field.is_visible(), "unfolded, so that it can be corrected"
    assert seen.page.inner_text("#plan-errors") == "the request is invalid"
    assert seen.page.is_enabled("#plan-start")
    seen.errors.remove(next(one for one in seen.errors if "422" in one))  # the browser notes every refused request
    closed(seen)


def test_refusals_are_shown_and_a_plan_can_be_cancelled(
    browser: Browser, api: Api, dataset: dict[str, Any], plan: dict[str, Any]
) -> None:
    """Refused with the server's words; cancelled; made while another page is shown: it can always be asked again."""
    seen = ready(browser, api, dataset)
    waiting: list[Route] = []
    busy = {"title": "Too Many Requests", "status": 429, "detail": "8 plans are waiting, the maximum; try again later"}
    seen.page.route("**/plan", lambda route: answered(route, 429, busy))
    seen.page.click("#plan-start")
    seen.wait("!document.getElementById('plan-errors').hidden")
    assert seen.page.inner_text("#plan-errors") == busy["detail"]
    seen.errors.remove(next(one for one in seen.errors if "429" in one))

    seen.page.unroute("**/plan")
    seen.page.route("**/plan", lambda route: waiting.append(route))
    seen.page.click("#plan-start")
    seen.wait("/^Computing, [1-9].* s; usually/.test(document.getElementById('plan-status').textContent)")
    assert seen.page.is_disabled("#plan-start")
    assert not seen.page.is_visible("#plan-errors"), "those of before are gone"
    seen.page.click("#plan-cancel")
    seen.wait("document.getElementById('plan-progress').hidden")
    assert seen.page.inner_text("#toast") == "The plan was cancelled"
    assert seen.page.is_enabled("#plan-start")
    assert not seen.page.is_visible("#plan-cancel")

    seen.page.click("#plan-start")
    seen.wait("!document.getElementById('plan-progress').hidden")
    seen.page.evaluate("location.hash = 'datasets'")
    seen.wait("document.getElementById('dataset').hidden && !document.getElementById('listing').hidden")
    seen.page.evaluate(f"location.hash = 'dataset={dataset['id']}'")
    seen.wait(f"{READY} && !document.getElementById('dataset').hidden")
    assert seen.page.is_visible("#plan-progress"), "it goes on"
    answered(waiting[-1], 200, plan)
    seen.wait(DONE)
    seen.page.click("#plan-start")
    seen.wait("!document.getElementById('plan-progress').hidden")
    seen.page.evaluate("location.hash = 'datasets'")
    seen.wait("document.getElementById('dataset').hidden")
    answered(waiting[-1], 200, plan)
    seen.wait("document.getElementById('toast').textContent.endsWith('is ready')")
    seen.page.evaluate(f"location.hash = 'dataset={dataset['id']}'")
    seen.wait(DONE)
    assert len(seen.rows("plan-genes")) == len(plan["genes"])
    assert seen.page.inner_text("#plan-start") == "Plan again"
    closed(seen)


def test_a_finished_run_gives_its_genes(
    browser: Browser, api: Api, dataset: dict[str, Any], plan: dict[str, Any]
) -> None:
    """The newest run that fits is chosen; its model and genome are sent, and its own fields are not asked for."""
    seen = opened(browser, api)
    run = {"id": "run_1", "name": "fit", "kind": "forces", "state": "SUCCEEDED", "fit_badge": "good"}
    spec = {
        "preset": "berman_wang",
        "without": [],
        "axes": ["x", "z"],
        "effects": ["stroke_bias"],
        "genes": [],
        "low_pass_hz": None,
        "peel_width_beats": 0.1,
        "method": "gauss_newton",
        "seed": 1,
    }
    runs = {"items": [run | {"spec": spec}], "next_cursor": None}
    seen.page.route("**/v1/runs?*state=SUCCEEDED*", lambda route: answered(route, 200, runs))
    genome = {"genes": [{"name": "C_l", "best": 1.3}, {"name": "stroke_bias.angle", "best": 0.01}]}
    seen.page.route("**/v1/runs/run_1/genome", lambda route: answered(route, 200, genome))
    sent: list[dict[str, Any]] = []

    def planned(route: Route) -> None:
        sent.append(body_of(route))
        answered(route, 200, plan)

    seen.page.route("**/plan", planned)
    seen.show(f"dataset={dataset['id']}")
    seen.wait(f"{READY} && document.querySelector('#plan-form select[name=at]').value === 'run_1'")
    seen.page.click("#plan-summary")
    assert not seen.page.is_visible("#plan-form select[name=preset]")
    assert seen.page.inner_text("#plan-summary") == "Settings: model of the run"
    seen.page.click("#plan-start")
    seen.wait(DONE)
    assert sent[-1]["genome"] == {"C_l": 1.3, "stroke_bias.angle": 0.01}
    model = {"preset": "berman_wang", "axes": ["x", "z"], "effects": ["stroke_bias"], "peel_width_beats": 0.1}
    assert {name: sent[-1][name] for name in model} == model
    assert not {"method", "seed", "low_pass_hz"} & set(sent[-1])
    closed(seen)


def test_a_wing_is_planned_and_series_are_where_their_rig_is(browser: Browser, api: Api, tmp_path: Path) -> None:
    """A wing has its own settings; a long plan shows the genes before the effects; series are planned by a command."""
    path = tmp_path / "wing.nc"
    stored(good_wing(), path)
    wing = api.client.post("/v1/datasets", files={"file": (path.name, path.read_bytes())}).json()
    seen = ready(browser, api, wing)
    seen.page.click("#plan-summary")
    for name, shown in (("noise_mm", True), ("markers", True), ("division", True), ("noise_mn", False)):
        assert seen.page.is_visible(f"#plan-form [name={name}]") is shown, name
    seen.page.select_option("#plan-form select[name=compare]", "none")
    seen.page.select_option("#plan-form select[name=division]", "4")
    seen.page.fill("#plan-form input[name=add]", "0")
    seen.page.fill("#plan-form input[name=markers]", "60")
    assert seen.page.inner_text("#plan-summary") == "Settings: Markers 60; Discretisation 4"
    seen.page.click("#plan-start")
    seen.wait("document.querySelector('#plan-form [data-field=markers] .fault') !== null")
    assert "the wing has 49" in seen.page.inner_text("#plan-form [data-field=markers] .fault")
    seen.errors.remove(next(one for one in seen.errors if "422" in one))
    seen.page.fill("#plan-form input[name=markers]", "9")
    for box in seen.page.locator("#plan-recordings input").all()[1:]:
        box.uncheck()
    with seen.page.expect_response("**/plan") as found_out:
        seen.page.click("#plan-start")
    seen.wait(DONE)
    sent = dict(found_out.value.request.post_data_json or {})
    assert (sent["suspects"], sent["recordings"]) == (None, [wing["recordings"][0]["name"]])
    assert len(seen.rows("plan-genes")) == 18
    assert not seen.page.is_visible("#plan-effects-part")
    assert not seen.page.is_visible("#plan-additions")
    seen.wait(DRAWN.format("plan-markers", 0))
    assert seen.data("plan-markers", 0, "x")[-1] == 9
    _check_long(seen, found_out.value.json())
    series = upload(api)
    seen.page.evaluate(f"location.hash = 'dataset={series}'")
    seen.wait("document.querySelector('#plan-part .copyable') !== null")
    command = seen.page.inner_text("#plan-part .copyable code")
    assert command.startswith(f"wingfit datasets download {series} -o {series}.zip")
    assert command.endswith(f"&& wingfit plan {series}.zip --rig my_rig.py")
    seen.page.evaluate(f"location.hash = 'dataset={wing['id']}'")
    seen.wait(f"{READY} && {DONE}")
    closed(seen)


def _check_long(seen: Seen, of_genes: dict[str, Any]) -> None:
    """All effects take long on a wing: the genes are asked for first, and stay if the effects are cancelled."""
    waiting: list[Route] = []
    seen.page.route("**/plan", lambda route: waiting.append(route))
    seen.page.select_option("#plan-form select[name=compare]", "all")
    seen.page.select_option("#plan-form select[name=division]", "24")
    seen.page.fill("#plan-form input[name=add]", "3")
    for box in seen.page.locator("#plan-recordings input").all():
        box.check()
    seen.page.click("#plan-start")
    seen.wait("document.getElementById('plan-status').textContent.includes('Computing')")
    assert body_of(waiting[0])["suspects"] is None
    genes = [gene | {"relative_percent": 33.0} for gene in of_genes["genes"]]
    answered(waiting[0], 200, of_genes | {"genes": genes})
    seen.wait("document.getElementById('plan-status').textContent.includes('the effects follow')")
    assert body_of(waiting[1])["suspects"] == []
    seen.page.click("#plan-cancel")
    seen.wait(DONE)
    assert seen.page.inner_text("#toast") == "The plan was cancelled; what is shown has no effects"
    assert {row[2] for row in seen.rows("plan-genes")} == {"± 33 %"}, "those that came first"
    seen.page.unroute("**/plan")
