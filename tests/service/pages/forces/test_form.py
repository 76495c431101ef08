"""Runs on forces submitted through the form, and followed while they go on."""

from __future__ import annotations

from typing import Any

import pytest

from tests.records.samples import falcon_dataset
from tests.service.conftest import Api
from tests.service.pages.browsing import DRAWN, Seen
from tests.service.pages.forces.conftest import PATIENCE, submitted
from tests.service.runs import force_data


def test_a_live_run_on_forces_grows_and_is_cancelled(seen: Seen, api: Api, dataset: dict[str, Any]) -> None:
    run_id = submitted(api, dataset, method="genetic", mode="joint", stall=1000, max_generations=10_000)
    seen.open(run_id)
    seen.wait("document.getElementById('history').data?.[1].y.length > 3", 60)
    assert "RMS difference" in seen.page.inner_text("#numbers")
    seen.wait(DRAWN.format("beat-0", 1))
    assert "nominal" in seen.page.inner_text("#beats-note")
    assert not seen.page.is_visible("#estimates-section")
    mean, best = (seen.page.evaluate(f"document.getElementById('history').data[{k}].y[2]") for k in (0, 1))
    item = api.history(run_id)[2]
    assert (best, mean) == pytest.approx((item["best"], item["mean"]))
    seen.page.click("[data-action=cancel]")
    seen.page.click("#confirm-yes")
    seen.wait("document.querySelector('#run-name .badge').textContent === 'cancelled'", 30)
    assert seen.errors == []


def test_the_form_has_what_belongs_to_forces_and_says_what_is_wrong(
    seen: Seen, api: Api, dataset: dict[str, Any]
) -> None:
    seen.open()
    seen.page.click(f"[data-key='run-{dataset['id']}']")
    seen.wait("document.querySelectorAll('#terms input').length === 7")
    page = seen.page
    assert not page.is_visible("[name=division]")
    assert not page.is_visible("[name=population]"), "Gauss-Newton has none"
    page.select_option("[name=method]", "genetic")
    assert page.is_visible("[name=population]")
    assert page.is_visible("[name=finish]")
    page.select_option("[name=method]", "auto")
    assert page.is_visible("[name=population]")
    assert not page.is_visible("[name=finish]"), "auto ends with Gauss-Newton in any case"
    assert page.inner_text("[name=method] option[value=auto]") == "auto, recommended"
    seen.wait("document.getElementById('submit-preview').textContent.includes('local, auto')")
    page.select_option("[name=method]", "gauss_newton")
    page.fill("[name=low_pass_hz]", "1000")
    page.click("#submit-form [type=submit]")
    seen.wait("!document.getElementById('submit-errors').hidden")
    assert "1000 Hz" in page.inner_text("#submit-errors")
    page.fill("[name=low_pass_hz]", "60")
    page.fill("[name=peel_width_beats]", "3")
    page.click("#submit-form [type=submit]")
    seen.wait("document.getElementById('submit-errors').textContent.includes('peel_width_beats')")
    assert page.get_attribute("[name=peel_width_beats]", "aria-invalid") == "true"
    page.fill("[name=peel_width_beats]", "0.05")
    page.uncheck("#axes input[value=x]")
    page.click("#submit-form [type=submit]")
    seen.wait("document.getElementById('submit-errors').textContent.includes('axes')")
    assert page.get_attribute("[name=axes]", "aria-invalid") == "true"
    page.check("#axes input[value=z]")
    page.check("#axes input[value=x]")
    page.uncheck("#terms input[value=clap_and_peel]")
    page.select_option("[name=mode]", "joint")
    page.click("#submit-form [type=submit]")
    seen.wait("location.hash.startsWith('#run=')")
    run_id = page.evaluate("location.hash").removeprefix("#run=")
    spec = api.run(run_id)["spec"]
    assert (spec["method"], spec["mode"], spec["preset"]) == ("gauss_newton", "joint", "proposed")
    assert spec["peel_width_beats"] == 0.05
    assert (spec["without"], spec["low_pass_hz"], sorted(spec["axes"])) == (["clap_and_peel"], 60.0, ["x", "z"])
    seen.wait("document.getElementById('run-about').textContent.includes('without clap and peel')")
    api.finish(run_id, PATIENCE)


def test_a_run_from_several_starts_shows_the_present_one_beside_the_best(
    seen: Seen, api: Api, dataset: dict[str, Any]
) -> None:
    run_id = submitted(api, dataset, method="auto", mode="joint", population=8, max_generations=3)
    assert api.finish(run_id, PATIENCE)["state"] == "SUCCEEDED"
    seen.open(run_id)
    seen.wait("document.getElementById('history').data?.length === 3")
    name, mean, best, start = (
        seen.page.evaluate(f"document.getElementById('history').data[{k}].{what}")
        for k, what in ((2, "name"), (0, "y"), (1, "y"), (2, "y"))
    )
    items = api.history(run_id)
    assert name == "this start"
    assert len([y for y in mean if y is not None]) == 3, "the generations of the search"
    behind = [item for item in items[3:] if item["mean"] != item["best"]]
    assert behind
    assert [y for y in start if y is not None] == pytest.approx([item["mean"] for item in behind])
    assert [y for y in best if y is not None] == pytest.approx([item["best"] for item in items])
    assert seen.errors == []


def test_the_terms_follow_the_model(seen: Seen, api: Api, dataset: dict[str, Any]) -> None:
    seen.open()
    seen.page.click(f"[data-key='run-{dataset['id']}']")
    seen.wait("document.querySelectorAll('#terms input').length === 7")
    for preset in api.get("/v1/models")["presets"]:
        seen.page.select_option("[name=preset]", preset["name"])
        boxes = seen.page.evaluate("[...document.querySelectorAll('#terms input')].map((i) => i.value)")
        assert boxes == preset["terms"]
        assert preset["source"] in seen.page.inner_text("#preset-about")


def test_wing_and_vehicle_stand_side_by_side(seen: Seen, api: Api, dataset: dict[str, Any], local: str) -> None:
    answer = api.client.post("/v1/datasets", files={"file": ("falcon.zip", force_data.zipped(falcon_dataset()))})
    assert answer.status_code == 201, answer.text
    wing = answer.json()
    seen.open()
    seen.page.click(f"[data-key='run-{dataset['id']}']")
    seen.wait("document.querySelectorAll('#terms input').length === 7")
    seen.page.select_option("[name=dataset_id]", wing["id"])
    seen.wait("!document.querySelector('[data-kind=tracks]').hidden")
    assert not seen.page.is_visible("[name=preset]")
    modes = seen.page.evaluate("[...document.querySelector('[name=mode]').options].map((o) => o.value)")
    assert modes == ["", "staged", "joint", "local"]
    seen.page.select_option("[name=division]", "4")
    seen.page.click("#submit-form [type=submit]")
    seen.wait("location.hash.startsWith('#run=')")
    run_id = seen.page.evaluate("location.hash").removeprefix("#run=")
    assert api.run(run_id)["spec"]["division"] == "4"
    api.client.post(f"/v1/runs/{run_id}/cancel")
    seen.wait("document.getElementById('run-about').innerText.includes('solved to 0.1 mm')")
    assert seen.page.is_visible("#tracks-part")
    assert not seen.page.is_visible("#forces-part")
    seen.page.evaluate(f"location.hash = 'run={local}'")
    seen.wait(DRAWN.format("beat-0", 3))
    assert not seen.page.is_visible("#tracks-part")
    api.finish(run_id, PATIENCE)
    assert seen.errors == []
