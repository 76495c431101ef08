"""Convergence, coefficients, correlation and agreement of a run on forces."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pytest

from tests.service.conftest import Api
from tests.service.pages.browsing import DRAWN, Seen
from tests.service.pages.forces.conftest import finished
from tests.service.runs import force_data
from wingfit.cli.base.rounding import correlation, rounded, with_unit

if TYPE_CHECKING:
    from playwright.sync_api import Route


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
    assert rounded(result["after_mn"]) in seen.page.inner_text("#numbers")
    about = seen.page.inner_text("#run-about")
    assert "fitted to x" in about
    assert "low-pass at 3.2 × flap frequency" in about
    assert "mm" not in about
    assert not seen.page.is_visible("#tracks-part")
    seen.page.click("h1 a")
    seen.wait("document.getElementById('newest-runs').textContent.includes('mN')")
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
    expected = [
        (rounded(1e3 * a["rmse_n"]), rounded(a["rmse_percent"]), correlation(a["correlation"])) for a in entries
    ]
    assert rows[first] == [cell for entry in expected for cell in entry]
    assert rows[force_data.HELD_OUT][:3] == ["–", "–", "–"]
    means = {row[0].removesuffix(" held out"): row[1:] for row in seen.rows("averages")}
    forces = [entries[0]["mean_recorded_n"], *(a["mean_modelled_n"] for a in entries)]
    assert means[first] == [rounded(1e3 * force) for force in forces]
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


def test_a_joint_run_has_one_estimate_and_no_global_model(seen: Seen, api: Api, dataset: dict[str, Any]) -> None:
    seen.open(finished(api, dataset, mode="joint", axes=["x", "z"]))
    seen.wait(DRAWN.format("beat-0", 1))
    assert [row[0] for row in seen.rows("estimates")] == ["joint"]
    assert not seen.page.is_visible("#coefficient-plots")
    assert not seen.page.is_visible("#law-part")
    assert not seen.page.is_visible("#prediction-form")
    assert "no global model" in seen.page.inner_text("#prediction-note")
    groups = seen.page.evaluate(
        "[...document.querySelectorAll('#agreement .groups :is(td, th)')].map((c) => c.textContent)"
    )
    assert groups == ["", "Joint", "Nominal"]
    assert "fitted to x and z" in seen.page.inner_text("#run-about")
    assert seen.errors == []
