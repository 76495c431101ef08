"""Forces over the beat: recorded and modelled, and predicted for another condition."""

from __future__ import annotations

from typing import Any

import pytest

from tests.service.conftest import Api
from tests.service.pages.browsing import DRAWN, Seen
from tests.service.runs import force_data
from wingfit.cli.base.rounding import rounded


def _forces(api: Api, run_id: str, recording: str, source: str) -> dict[str, Any]:
    return api.get(f"/v1/runs/{run_id}/forces?recording={recording}&source={source}")


def test_forces_over_the_beat_follow_recording_model_and_axes(seen: Seen, api: Api, local: str) -> None:
    seen.open(local)
    seen.wait(DRAWN.format("spectrum-1", 1))
    first = force_data.FITTED[0]
    answer = _forces(api, local, first, "local")
    assert seen.data("beat-0", 2, "y")[:-1] == pytest.approx(answer["recorded_n"]["lift"])
    assert seen.data("beat-0", 3, "y")[:-1] == pytest.approx(answer["modelled_n"]["lift"])
    left = [r - m for r, m in zip(answer["recorded_n"]["lift"], answer["modelled_n"]["lift"], strict=True)]
    assert seen.data("beat-0", 6, "y")[:-1] == pytest.approx(left)
    band = [r + s for r, s in zip(answer["recorded_n"]["drag"], answer["standard_deviation_n"]["drag"], strict=True)]
    assert seen.data("beat-1", 1, "y")[:-1] == pytest.approx(band)
    assert seen.page.evaluate("document.getElementById('spectrum-0').layout.yaxis.type") == "log"
    tones = seen.data("spectrum-0", 1, "x")
    frequency = 12.5
    assert tones == pytest.approx([frequency * (k + 1) for k in range(len(tones))], rel=0.02)

    seen.page.check("input[name=source][value=nominal]", force=True)
    seen.wait("document.getElementById('beats-note').textContent.includes('nominal')")
    nominal = _forces(api, local, first, "nominal")["modelled_n"]
    assert seen.data("beat-0", 3, "y")[:-1] == pytest.approx(nominal["lift"])
    seen.page.check("input[name=quantities][value='x z']", force=True)
    seen.wait("document.getElementById('beat-1-title').textContent.includes('along z')")
    assert seen.data("beat-1", 3, "y")[:-1] == pytest.approx(nominal["z"])

    seen.page.check("input[name=source][value=local]", force=True)
    seen.page.select_option("#force-recording", force_data.HELD_OUT)
    seen.wait(f"document.getElementById('beats-note').textContent.includes('{force_data.HELD_OUT}')")
    offered = seen.page.evaluate("[...document.querySelectorAll('input[name=source]')].map((i) => i.value)")
    assert offered == ["global", "average", "nominal"]  # nothing was fitted to it
    unseen = _forces(api, local, force_data.HELD_OUT, "global")["modelled_n"]["x"]
    assert seen.data("beat-0", 3, "y")[:-1] == pytest.approx(unseen)
    seen.page.select_option("#force-recording", first)
    seen.wait("document.getElementById('beats-note').textContent.includes('local')")  # what was chosen comes back
    assert seen.errors == []


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
    assert rounded(1e3 * expected["averages_n"]["lift"]) in seen.page.inner_text("#prediction-numbers")
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
