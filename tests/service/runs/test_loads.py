"""Loads over HTTP, in the client, on the command line: one beat, with units in the names, in the order of its phase."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tests.service.conftest import Api, Gate
from tests.service.shapes import valid
from wingfit.calibration.search import CalibrationSpec
from wingfit.cli import main as cli
from wingfit.client.answers import CONDITION
from wingfit.client.client import Client, WingfitError
from wingfit.client.load_answers import Loads, Outputs
from wingfit.records import Condition, Dataset
from wingfit.service.outcomes import load_views
from wingfit.service.outcomes.requests import OUTPUT_NAMES, ConditionIn
from wingfit.service.runs.engine import Engine
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel

Json = dict[str, Any]
GROUPS = {
    "motors": {"motor_angle_deg", "motor_rate_rad_s", "motor_torque_n_m", "motor_power_w"},
    "air": {"lift_n", "thrust_n", "side_n"},
    "strips": {"strips"},
    "sections": {"sections"},
    "connectors": {"connectors"},
    "power": {"power_w"},
    "energy": {"energy_j"},
    "averages": {"averages"},
}


def simulate(shared: tuple[Api, str], **body: Any) -> httpx.Response:
    api, dataset = shared
    return api.client.post("/v1/simulations", json={"dataset_id": dataset, "recording": "slow"} | body)


def test_loads_come_only_when_asked_for(shared: tuple[Api, str]) -> None:
    assert "outputs" not in simulate(shared).json()
    assert "outputs" not in simulate(shared, outputs=False).json()
    assert "outputs" not in simulate(shared, outputs=[]).json()
    whole = simulate(shared, outputs=True).json()["outputs"]
    assert set(whole) == {"phase", "drive_phase", "numerics"}.union(*GROUPS.values())
    assert whole["numerics"] == {"steps_per_beat": 96, "beats": 5, "estimated_error_mm": 0.02}
    valid(Outputs, whole)


@pytest.mark.parametrize("name", OUTPUT_NAMES)
def test_each_name_brings_its_own(shared: tuple[Api, str], name: str) -> None:
    found = simulate(shared, outputs=[name, name]).json()["outputs"]
    assert set(found) == {"phase", "drive_phase", "numerics"} | GROUPS[name]


def test_the_beat_begins_at_the_upstroke_crossing(shared: tuple[Api, str]) -> None:
    """The toy's crossing is a quarter of the drive's beat: there its torque, a cosine of the drive, zero."""
    outputs = simulate(shared, outputs=["motors"], genome={"stiffness": 2.0}).json()["outputs"]
    assert outputs["phase"] == sorted(outputs["phase"])
    assert outputs["phase"][0] == 0
    assert outputs["drive_phase"][0] == 0.25
    torque = outputs["motor_torque_n_m"]["front"]
    assert torque == pytest.approx(2.0 * np.cos(2 * np.pi * np.array(outputs["drive_phase"])), abs=1e-6)
    assert outputs["motor_angle_deg"]["rear"] == pytest.approx(np.degrees(0.25 * np.array(torque)), abs=1e-4)


def test_averages_and_units(shared: tuple[Api, str]) -> None:
    answer = simulate(shared, outputs=["averages", "strips", "connectors"], genome={"stiffness": 2.0}).json()["outputs"]
    means = answer["averages"]
    assert means["lift_n"] == pytest.approx(2.0)
    assert means["thrust_n"] == pytest.approx(0.2)
    assert means["supplied_w"] == pytest.approx(6.0)
    assert means["to_air_w"] == pytest.approx(1.0)
    assert means["dissipated_w"] == pytest.approx(0.5)
    assert means["closing_error_w"] == pytest.approx(4.5)
    assert means["closing_error_percent"] == pytest.approx(75.0)
    assert means["dissipated_by_connector_w"] == {"front rod": pytest.approx(0.5)}
    assert answer["strips"][0]["span_mm"] == [30.0, 200.0]
    assert answer["connectors"][0]["point_mm"] == [0.0, 30.0, 0.0]
    assert answer["connectors"][0]["between"] == ["front rod", "1.1"]


@pytest.mark.parametrize("outputs", ["motors", ["torque"], [1], 1, None, ["motors"] * 9])
def test_unknown_outputs_are_refused_and_the_known_ones_named(shared: tuple[Api, str], outputs: Any) -> None:
    answer = simulate(shared, outputs=outputs)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["where"] == "body.outputs"
    assert all(name in error["message"] for name in OUTPUT_NAMES)


def test_loads_of_a_run(api: Api) -> None:
    dataset = api.upload()["id"]
    run_id = api.submit(dataset)["id"]
    assert api.finish(run_id)["state"] == "SUCCEEDED"
    best = valid(Loads, api.get(f"/v1/runs/{run_id}/loads"))
    assert best.recording == "slow"
    nominal = api.get(f"/v1/runs/{run_id}/loads?recording=fast&genome=nominal&outputs=averages&outputs=air")
    assert nominal["recording"] == "fast"
    assert set(nominal["outputs"]) == {"phase", "drive_phase", "numerics", "averages"} | GROUPS["air"]
    assert best.outputs.averages is not None
    assert best.outputs.averages.supplied_w > nominal["outputs"]["averages"]["supplied_w"]
    for query, where in (("outputs=torque", "query.outputs.0"), ("recording=nope", "query.recording")):
        refused = api.client.get(f"/v1/runs/{run_id}/loads?{query}")
        assert (refused.status_code, refused.json()["errors"][0]["where"]) == (422, where)
    assert api.client.get("/v1/runs/run_0/loads").status_code == 404


def test_before_the_first_generation_only_the_nominal_wing_has_loads(api: Api, gate: Gate) -> None:
    run_id = api.submit(api.upload()["id"])["id"]
    assert api.client.get(f"/v1/runs/{run_id}/loads").status_code == 409
    assert api.client.get(f"/v1/runs/{run_id}/loads?genome=nominal").status_code == 200
    api.control(run_id, "cancel")
    gate.let(1)


def test_a_failed_simulation_is_a_conflict(shared: tuple[Api, str]) -> None:
    answer = simulate(shared, outputs=True, genome={"stiffness": 9.5})
    assert answer.status_code == 409
    assert "diverged" in answer.json()["detail"]


def under(shared: tuple[Api, str], **body: Any) -> httpx.Response:
    api, dataset = shared
    return api.client.post("/v1/loads", json={"dataset_id": dataset, "recording": "slow"} | body)


def test_loads_under_another_condition(shared: tuple[Api, str]) -> None:
    """The toy's torque grows with the flap frequency, which is 3 Hz in its recordings."""
    answer = valid(Loads, under(shared).json())
    faster = valid(Loads, under(shared, condition={"flap_frequency_hz": 6.0}, outputs=["averages"]).json())
    assert answer.outputs.averages is not None
    assert faster.outputs.averages is not None
    assert "connectors" not in faster.outputs
    assert faster.outputs.averages.supplied_w == pytest.approx(2 * answer.outputs.averages.supplied_w)


def test_a_changed_condition_is_the_recorded_one_in_all_that_is_not_named() -> None:
    recorded = tunnel(0.05, 3.0, 6.0)
    named = {"flap_frequency_hz": 2, "phase_lag_deg": 90, "pressure_mbar": 500, "temperature_c": 0, "airspeed_m_s": 1}
    changed = load_views.condition(recorded, ConditionIn.model_validate(named))
    assert changed == Condition(2.0, np.pi / 2, 5e4, 273.15, 1.0, recorded.angle_of_attack)
    turned = load_views.condition(recorded, ConditionIn(angle_of_attack_deg=-90.0))
    assert turned == replace(recorded, angle_of_attack=-np.pi / 2)


@pytest.mark.parametrize(
    ("body", "where"),
    [
        ({"condition": {"airspeed_m_s": -1}}, "body.condition.airspeed_m_s"),
        ({"condition": {"airspeed_km_h": 20}}, "body.condition.airspeed_km_h"),
        ({"condition": {"temperature_c": 293.15}}, "body.condition.temperature_c"),
        ({"recording": "nope"}, "body.recording"),
        ({"genome": {"stiffness": 11.0}}, "body.genome"),
        ({"outputs": ["nope"]}, "body.outputs"),
    ],
)
def test_loads_that_cannot_be(shared: tuple[Api, str], body: Json, where: str) -> None:
    answer = under(shared, **body)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["where"].startswith(where)


def test_the_client(client: httpx.Client, api: Api) -> None:
    dataset = api.upload()["id"]
    run_id = api.submit(dataset)["id"]
    api.finish(run_id)
    with Client(str(client.base_url)) as mine:
        outputs = mine.simulate(dataset, "slow", outputs=["motors"])["outputs"]
        assert set(outputs) == {"phase", "drive_phase", "numerics"} | GROUPS["motors"]
        loads = mine.loads(run_id, "fast", "nominal", ["air", "energy"])
        assert (loads["recording"], len(loads["outputs"]["energy_j"])) == ("fast", 3)
        assert "connectors" in mine.loads(run_id)["outputs"]
        faster = mine.loads_under(dataset, "slow", condition={"flap_frequency_hz": 6.0}, outputs=["averages"])
        assert faster["outputs"]["averages"]["peak_motor_torque_n_m"]["front"] == pytest.approx(2.0)
        with pytest.raises(WingfitError, match="motors"):
            mine.simulate(dataset, "slow", outputs=["motor"])


Wingfit = Callable[..., tuple[int, str, str]]


@pytest.fixture
def wingfit(client: httpx.Client, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Wingfit:
    monkeypatch.setenv("WINGFIT_URL", str(client.base_url))

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["wingfit", *words])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out, shown.err

    return run


def test_the_command_line_writes_them(wingfit: Wingfit, api: Api, tmp_path: Path) -> None:
    words = ("simulate", "--dataset", api.upload()["id"], "--genome", "stiffness=2")
    table, plot, plain = (tmp_path / name for name in ("loads.csv", "loads.html", "loads.JSON"))
    code, out, err = wingfit(*words, "--loads", str(table), "--plot", str(plot))
    assert code == 0, err
    assert "closing error" in out
    assert "4.5 W, 75 %" in out
    rows = list(csv.DictReader(table.open()))
    assert len(rows) == 16
    header = table.read_text().splitlines()[0].split(",")
    assert len(header) == len(set(header)) == 2 + 4 * 2 + 3 + 2 * 4 + 2 * 6 + 14 + 2 + 3, "one column for each series"
    assert all(np.isfinite(float(value)) for row in rows for value in row.values())
    assert float(rows[4]["front_motor_torque_n_m"]) == pytest.approx(-2.0)
    assert float(rows[4]["section_strips_1-2_moment_x_n_m"]) == pytest.approx(-1.0)
    assert float(rows[4]["front_rod_force_z_n"]) == pytest.approx(-4.0)
    page = plot.read_text(encoding="utf-8")
    assert "Bending moment: root" in page
    assert page.count("<figure>") == 5
    assert "<script" not in page
    assert wingfit(*words, "--outputs", str(plain))[0] == 0
    valid(Outputs, json.loads(plain.read_text()))


def test_the_command_line_under_another_condition(wingfit: Wingfit, api: Api, tmp_path: Path) -> None:
    words = ("simulate", "--dataset", api.upload()["id"], "--at", "flap_frequency_hz=6")
    table = tmp_path / "loads.csv"
    code, out, err = wingfit(*words, "--at", "airspeed_m_s=2", "--loads", str(table))
    assert code == 0, err
    assert "peak torque 2 N m" in out
    assert "marker" not in out
    assert table.exists()
    assert set(json.loads(wingfit(*words, "--json")[1])) == {"recording", "outputs"}
    for wrong, code, said in (
        ("airspeed_m_s=-1", 1, "airspeed_m_s"),
        ("airspeed_m_s", 2, "NAME=VALUE"),
        ("speed=1", 2, "airspeed_m_s"),
    ):
        ended, out, err = wingfit(*words, "--at", wrong)
        assert (ended, out) == (code, "")
        assert said in err
    assert set(CONDITION) == set(ConditionIn.model_fields)
    assert wingfit(*words, "-o", str(tmp_path / "tracks.csv"))[0] == 2


@pytest.mark.parametrize(
    ("option", "name", "code", "said"),
    [
        ("--loads", "x.txt", 2, ".csv or .json"),
        ("--plot", "x.svg", 2, ".html"),
        ("--loads", "no/x.csv", 2, "there is no folder"),
        ("--loads", "folder.csv", 2, "is a folder"),
        ("-o", "no/x.csv", 2, "there is no folder"),
    ],
)
def test_a_file_that_cannot_be_written_is_told(
    wingfit: Wingfit, api: Api, tmp_path: Path, option: str, name: str, code: int, said: str
) -> None:
    (tmp_path / "folder.csv").mkdir()
    ended, out, err = wingfit("simulate", "--dataset", api.upload()["id"], option, str(tmp_path / name))
    assert (ended, out) == (code, "")
    assert said.replace(" ", "") in err.replace(" ", "").replace("│", "").replace("\n", "")


def test_the_real_engine() -> None:
    """The Robird wing of four strips through the seam: every name, valid, and a balance that closes."""
    wing = robird_wing()
    recording = blank_recording(wing, tunnel(0.05, 3.0, 6.0), "windy")
    dataset = Dataset("robird", wing, (recording,))
    engine, spec = Engine(), CalibrationSpec(division="4", bounds_factor=100.0)
    found = engine.loads(spec, dataset, engine.genome(spec, dataset, {}), recording)
    answer = load_views.outputs(found, load_views.wanted(True))
    checked = valid(Outputs, json.loads(json.dumps(answer)))
    assert checked.averages is not None
    assert checked.averages.lift_n > 0.5
    assert abs(checked.averages.closing_error_percent) < 1
    assert checked.connectors is not None
    assert {c.kind for c in checked.connectors} == {"root", "spanwise"}
    torque = checked.motor_torque_n_m
    assert torque is not None
    np.testing.assert_allclose(sorted(torque.front), sorted(found.motors[0].torque), atol=1e-6)
    vacuum = replace(recording, condition=replace(recording.condition, pressure=0.0, airspeed=0.0))
    still = load_views.outputs(engine.loads(spec, dataset, engine.genome(spec, dataset, {}), vacuum), ["averages"])
    means = [still["averages"][name] for name in ("lift_n", "thrust_n", "side_n", "to_air_w")]
    assert [str(mean) for mean in means] == ["0.0"] * 4
    with pytest.raises(ValueError, match="cannot be simulated under 'windy'"):
        engine.loads(
            spec, dataset, engine.genome(spec, dataset, {"L_a": 400.0, "E_f": 1e5, "E_r": 2e9, "G_f": 3e4}), recording
        )
