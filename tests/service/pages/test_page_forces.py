"""The page of a run on forces, in a browser, before the real service with forces of the virtual balance."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.records.samples import falcon_dataset
from tests.service.conftest import Api, serving
from tests.service.pages.browsing import DRAWN, Seen
from tests.service.runs import force_data
from wingfit.cli.base.rounding import correlation, kept, with_unit
from wingfit.service.app import create_app
from wingfit.service.settings import Settings
from wingfit.workers import make_evaluator

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Route

PATIENCE = 120.0


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    settings = Settings(data=tmp_path_factory.mktemp("page") / "data")
    with serving(create_app(settings, make_evaluator=lambda: make_evaluator("in_process", None, None))) as client:
        yield Api(client)


@pytest.fixture
def seen(browser: Browser, api: Api) -> Iterator[Seen]:
    context = browser.new_context(viewport={"width": 1300, "height": 900})
    seen = Seen.watched(context.new_page(), _base(api))
    yield seen
    context.close()
    assert seen.foreign == []


@pytest.fixture(scope="module")
def dataset(api: Api) -> dict[str, Any]:
    answer = api.client.post("/v1/datasets", files={"file": ("delfly.zip", force_data.archive())})
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


@pytest.fixture(scope="module")
def local(api: Api, dataset: dict[str, Any]) -> str:
    return _finished(api, dataset)


@pytest.fixture(scope="module")
def result(api: Api, local: str) -> dict[str, Any]:
    return api.get(f"/v1/runs/{local}/result")


def _base(api: Api) -> str:
    return str(api.client.base_url).rstrip("/")


def _submitted(api: Api, dataset: dict[str, Any], **body: Any) -> str:
    answer = api.client.post("/v1/runs", json={"dataset_id": dataset["id"]} | body)
    assert answer.status_code == 202, answer.text
    return str(answer.json()["id"])


def _finished(api: Api, dataset: dict[str, Any], **body: Any) -> str:
    run_id = _submitted(api, dataset, **body)
    run = api.finish(run_id, PATIENCE)
    assert run["state"] == "SUCCEEDED", run["error"]
    return run_id


def _forces(api: Api, run_id: str, recording: str, source: str) -> dict[str, Any]:
    return api.get(f"/v1/runs/{run_id}/forces?recording={recording}&source={source}")


def _agreement(entries: list[dict[str, Any]], recording: str, source: str, quantity: str) -> dict[str, Any]:
    wanted = (recording, source, quantity)
    return next(a for a in entries if (a["recording"], a["source"], a["quantity"]) == wanted)


def test_convergence_and_outcome_are_in_millinewtons(seen: Seen, api: Api, local: str, result: dict[str, Any]) -> None:
    seen.open(local)
    seen.wait(DRAWN.format("history", 1))
    history = api.history(local)
    drawn = [value for value in seen.data("history", 1, "y") if value is not None]
    assert drawn == pytest.approx([item["best"] for item in history])
    assert seen.data("history", 1, "y").count(None) == len(force_data.FITTED) - 1  # no line joins two recordings
    assert set(seen.data("history", 0, "y")) == {None}  # an iteration has no mean beside it
    assert f"RMS {with_unit(history[-1]['best_mn'] / 1e3)}" in seen.data("history", 1, "text")[-1]
    names = seen.page.evaluate("document.getElementById('history').layout.annotations.map((a) => a.text)")
    assert set(force_data.FITTED) <= set(names)
    seen.wait("document.getElementById('numbers').textContent.includes('held out')")
    assert kept(result["after_mn"]) in seen.page.inner_text("#numbers")
    about = seen.page.inner_text("#run-about")
    assert "fitted to x" in about
    assert "low-pass at 3.2 × flap frequency" in about
    assert "mm" not in about
    assert not seen.page.is_visible("#tracks-part")
    assert "mN" in seen.page.inner_text("#newest-runs")
    assert "6 recordings of forces, 1 held out" in seen.page.inner_text("#newest-datasets")
    assert seen.errors == []


def test_coefficients_stand_with_their_intervals_and_the_global_model(
    seen: Seen, local: str, result: dict[str, Any], dataset: dict[str, Any]
) -> None:
    seen.open(local)
    seen.wait(DRAWN.format("by-pitch", 8))
    rows = seen.rows("estimates")
    assert [row[0] for row in rows] == list(force_data.FITTED)
    for row, estimate in zip(rows, result["estimates"], strict=True):
        for cell, found in zip(row[3:6], estimate["coefficients"], strict=True):
            assert cell == f"{found['value']:.3f} {found['low_90']:.3f} to {found['high_90']:.3f}"
    conditions = {r["name"]: r for r in dataset["recordings"]}
    f = [conditions[name]["flap_frequency_hz"] for name in force_data.FITTED]
    pitch = [conditions[name]["angle_of_attack_deg"] for name in force_data.FITTED]
    for k, gene in enumerate(result["global_model"]["genes"]):
        law = [gene["constant"] + gene["per_hz"] * a + gene["per_deg"] * b for a, b in zip(f, pitch, strict=True)]
        for figure, x in (("by-frequency", f), ("by-pitch", pitch)):
            assert seen.data(figure, 3 * k + 1, "x") == pytest.approx(x)
            assert seen.data(figure, 3 * k + 1, "y") == pytest.approx(law)
            found = [e["coefficients"][k] for e in result["estimates"]]
            assert seen.data(figure, 3 * k + 2, "y") == pytest.approx([c["value"] for c in found])
            upper = seen.data(figure, 3 * k + 2, "error_y.array")
            assert upper == pytest.approx([c["high_90"] - c["value"] for c in found])
    # The line of each figure holds the other variable at its mean.
    first = result["global_model"]["genes"][0]
    middle = sum(pitch) / len(pitch)
    ends = [first["constant"] + first["per_hz"] * x + first["per_deg"] * middle for x in (min(f), max(f))]
    assert seen.data("by-frequency", 0, "y") == pytest.approx(ends)
    assert len(seen.rows("law")) == 3
    assert seen.errors == []


def test_the_correlation_of_the_chosen_estimate_can_be_read(seen: Seen, local: str, result: dict[str, Any]) -> None:
    seen.open(local)
    seen.wait("document.querySelectorAll('#correlation td').length > 9")
    for name in (force_data.FITTED[0], force_data.FITTED[-1]):
        seen.page.select_option("#estimate", name)
        estimate = next(e for e in result["estimates"] if e["name"] == name)
        expected = [[correlation(value) for value in row] for row in estimate["correlation"]]
        assert [row[1:] for row in seen.rows("correlation")] == expected
        noise = math.sqrt(estimate["noise_mn2"][0][0][0])
        assert f"{noise:.3g} mN" in seen.page.inner_text("#correlation-note")


def test_forces_over_the_beat_follow_recording_model_and_axes(seen: Seen, api: Api, local: str) -> None:
    seen.open(local)
    seen.wait(DRAWN.format("spectrum-1", 1))
    first = force_data.FITTED[0]
    answer = _forces(api, local, first, "local")
    assert seen.data("beat-0", 3, "y")[:-1] == pytest.approx(answer["recorded_n"]["lift"])
    assert seen.data("beat-0", 2, "y")[:-1] == pytest.approx(answer["modelled_n"]["lift"])
    band = [r + s for r, s in zip(answer["recorded_n"]["drag"], answer["standard_deviation_n"]["drag"], strict=True)]
    assert seen.data("beat-1", 1, "y")[:-1] == pytest.approx(band)
    assert seen.page.evaluate("document.getElementById('spectrum-0').layout.yaxis.type") == "log"
    tones = seen.data("spectrum-0", 1, "x")
    frequency = 12.5
    assert tones == pytest.approx([frequency * (k + 1) for k in range(len(tones))], rel=0.02)

    seen.page.check("input[name=source][value=nominal]", force=True)
    seen.wait("document.getElementById('beats-note').textContent.includes('nominal')")
    nominal = _forces(api, local, first, "nominal")["modelled_n"]
    assert seen.data("beat-0", 2, "y")[:-1] == pytest.approx(nominal["lift"])
    seen.page.check("input[name=quantities][value='x z']", force=True)
    seen.wait("document.getElementById('beat-1-title').textContent.includes('along z')")
    assert seen.data("beat-1", 2, "y")[:-1] == pytest.approx(nominal["z"])

    seen.page.check("input[name=source][value=local]", force=True)
    seen.page.select_option("#force-recording", force_data.HELD_OUT)
    seen.wait(f"document.getElementById('beats-note').textContent.includes('{force_data.HELD_OUT}')")
    offered = seen.page.evaluate("[...document.querySelectorAll('input[name=source]')].map((i) => i.value)")
    assert offered == ["global", "average", "nominal"]  # nothing was fitted to it
    unseen = _forces(api, local, force_data.HELD_OUT, "global")["modelled_n"]["x"]
    assert seen.data("beat-0", 2, "y")[:-1] == pytest.approx(unseen)
    seen.page.select_option("#force-recording", first)
    seen.wait("document.getElementById('beats-note').textContent.includes('local')")  # what was chosen comes back
    assert seen.errors == []


@pytest.mark.parametrize("quantity", ["lift", "x"])
def test_the_agreement_table_has_every_model(seen: Seen, local: str, result: dict[str, Any], quantity: str) -> None:
    seen.open(local)
    seen.wait("document.querySelectorAll('#agreement tbody tr').length > 1")
    seen.page.select_option("#agreement-quantity", quantity)
    rows = {row[0].removesuffix(" held out"): row[1:] for row in seen.rows("agreement")}
    assert set(rows) == {*force_data.FITTED, force_data.HELD_OUT, "Mean, fitted"}
    first = force_data.FITTED[0]
    entries = [_agreement(result["agreements"], first, source, quantity) for source in ("local", "global")]
    entries.append(_agreement(result["leave_one_out"], first, "global", quantity))
    entries += [_agreement(result["agreements"], first, source, quantity) for source in ("average", "nominal")]
    shown = seen.page.evaluate("[...document.querySelectorAll('#agreement thead th')].map((c) => c.textContent)")
    assert "mN" in shown
    expected = [(kept(1e3 * a["rmse_n"]), kept(a["rmse_percent"]), correlation(a["correlation"])) for a in entries]
    assert rows[first] == [cell for entry in expected for cell in entry]
    assert rows[force_data.HELD_OUT][:3] == ["–", "–", "–"]
    means = {row[0].removesuffix(" held out"): row[1:] for row in seen.rows("averages")}
    forces = [entries[0]["mean_recorded_n"], *(a["mean_modelled_n"] for a in entries)]
    assert means[first] == [kept(1e3 * force) for force in forces]
    assert seen.page.inner_text("#averages-title") == "Average over the beat, mN"


def test_forces_of_a_small_vehicle_keep_their_digits(seen: Seen, local: str) -> None:
    def shrink(route: Route) -> None:
        answer = route.fetch()
        body = answer.json()
        for one in [*body["agreements"], *body["leave_one_out"]]:
            for key in ("rmse_n", "mean_recorded_n", "mean_modelled_n"):
                one[key] = 1e-4 * one[key]
        for key in ("before_mn", "after_mn", "held_out_before_mn", "held_out_after_mn"):
            body[key] = 1e-4 * body[key]
        route.fulfill(response=answer, json=body)

    seen.page.route("**/result", shrink)
    seen.open(local)
    seen.wait("document.querySelectorAll('#agreement tbody tr').length > 1")
    assert "µN" in seen.page.inner_text("#agreement thead")
    assert "µN" in seen.page.inner_text("#averages-title")
    assert "µN" in seen.page.inner_text("#numbers")
    for row in seen.rows("agreement")[:-1]:
        assert all(len(cell.lstrip("0.").replace(".", "")) >= 3 for cell in row[1::3] if cell != "–"), row


def test_tables_are_seen_in_full_and_axes_have_ticks(browser: Browser, api: Api, local: str) -> None:
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    seen = Seen.watched(context.new_page(), _base(api))
    seen.open(local)
    seen.wait(DRAWN.format("by-pitch", 8))
    seen.wait(DRAWN.format("history", 1))
    for table in ("law", "agreement", "averages"):
        frame = f"document.getElementById('{table}').parentElement"
        needed, there = seen.page.evaluate(f"[{frame}.scrollWidth, {frame}.clientWidth]")
        assert needed <= there, table
    for axis, least in (("x", 2), ("y", 3)):
        layout = f"document.getElementById('history').layout.{axis}axis"
        ticks, (low, high) = seen.page.evaluate(f"{layout}.tickvals"), seen.page.evaluate(f"{layout}.range")
        inside = [t for t in ticks if low <= (t if axis == "x" else math.log10(t)) <= high]
        assert len(inside) >= least, axis
        shown = ".xtick" if axis == "x" else ".ytick"
        names = seen.page.evaluate(f"[...document.querySelectorAll('#history {shown} text')].map((t) => t.textContent)")
        assert len(set(names)) == len(names) >= least, names
    context.close()


def test_prediction_within_outside_and_far_outside(seen: Seen, api: Api, local: str) -> None:
    condition = {"flap_frequency_hz": 12.2, "body_pitch_deg": 66.0, "airspeed_m_s": 0.6}
    seen.open(local)
    seen.wait("!document.getElementById('prediction-section').hidden")
    for name, value in condition.items():
        seen.page.fill(f"[name={name}]", str(value))
    seen.page.press("[name=airspeed_m_s]", "Enter")
    seen.wait(DRAWN.format("prediction-x", 1))
    expected = api.client.post(f"/v1/runs/{local}/predictions", json=condition).json()
    assert expected["warnings"] == []
    assert not seen.page.is_visible("#prediction-warnings")
    assert seen.data("prediction-lift", 0, "y") == pytest.approx(expected["lift_n"])
    assert seen.data("prediction-x", 1, "y") == pytest.approx(expected["z_n"])
    assert kept(1e3 * expected["averages_n"]["lift"]) in seen.page.inner_text("#prediction-numbers")
    seen.page.fill("[name=flap_frequency_hz]", "13.6")
    seen.page.click("#prediction-form [type=submit]")
    seen.wait("document.getElementById('prediction-warnings').textContent.includes('extrapolation')")
    assert seen.page.is_visible("#prediction")
    seen.page.fill("[name=flap_frequency_hz]", "-1")
    seen.page.click("#prediction-form [type=submit]")
    seen.wait("!document.getElementById('prediction-errors').hidden")
    assert seen.page.get_attribute("[name=flap_frequency_hz]", "aria-invalid") == "true"
    assert "flap_frequency_hz" in seen.page.inner_text("#prediction-errors")
    assert not seen.page.is_visible("#prediction")
    assert not seen.page.is_visible("#prediction-warnings")


def test_a_joint_run_has_one_estimate_and_no_global_model(seen: Seen, api: Api, dataset: dict[str, Any]) -> None:
    seen.open(_finished(api, dataset, mode="joint", axes=["x", "z"]))
    seen.wait(DRAWN.format("beat-0", 1))
    assert [row[0] for row in seen.rows("estimates")] == ["joint"]
    assert not seen.page.is_visible("#coefficient-plots")
    assert not seen.page.is_visible("#law-part")
    assert not seen.page.is_visible("#prediction-form")
    assert "no global model" in seen.page.inner_text("#prediction-note")
    groups = seen.page.evaluate("[...document.querySelectorAll('#agreement .groups th')].map((c) => c.textContent)")
    assert groups == ["", "Joint", "Nominal"]
    assert "fitted to x and z" in seen.page.inner_text("#run-about")
    assert seen.errors == []


def test_a_live_run_on_forces_grows_and_is_cancelled(seen: Seen, api: Api, dataset: dict[str, Any]) -> None:
    run_id = _submitted(api, dataset, method="genetic", mode="joint", stall=1000, max_generations=10_000)
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
    assert modes == ["staged", "joint", "local"]
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


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_needs_no_sideways_scrolling(browser: Browser, api: Api, local: str, scheme: Any) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 800}, color_scheme=scheme)
    seen = Seen.watched(context.new_page(), _base(api))
    seen.open(local)
    seen.wait(DRAWN.format("spectrum-1", 1))
    seen.wait(DRAWN.format("by-pitch", 8))
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= 390
    ink = seen.page.evaluate("document.getElementById('beat-0').data[3].line.color")
    assert (int(ink[1:3], 16) > 128) == (scheme == "dark")
    assert (seen.errors, seen.foreign) == ([], [])
    context.close()


def test_figures_follow_a_change_of_colours(browser: Browser, api: Api, local: str) -> None:
    context = browser.new_context(color_scheme="light")
    seen = Seen.watched(context.new_page(), _base(api))
    seen.open(local)
    seen.wait(DRAWN.format("by-pitch", 8))
    seen.wait(DRAWN.format("beat-0", 3))
    beat = seen.page.evaluate("document.getElementById('beat-0').data[2].line.color")
    dots = seen.page.evaluate("document.getElementById('by-pitch').data[2].marker.color")
    seen.page.emulate_media(color_scheme="dark")
    seen.wait(f"document.getElementById('beat-0').data[2].line.color !== {json.dumps(beat)}")
    seen.wait(f"document.getElementById('by-pitch').data[2].marker.color !== {json.dumps(dots)}")
    context.close()
