"""Forces on the command line and in the Python client, against a running server, as a user types it."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.service.clients.test_cli import wingfit
from tests.service.processes import ServerProcess
from tests.service.runs import force_data
from wingfit.cli.base.rounding import correlation, force_unit, rounded, with_unit
from wingfit.cli.forces.results import charts, write_forces
from wingfit.client.client import Client, WingfitError
from wingfit.records import load_dataset
from wingfit.sim.virtual_rigs.balance import TRIALS, read_truth

Wingfit = Callable[..., tuple[int, str, str]]

__all__ = ["wingfit"]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("cli") / "data"
    with ServerProcess(data, ("wingfit.service.server",), {"WINGFIT_EVALUATOR": "in_process"}, forked=True) as process:
        yield process


@pytest.fixture(scope="module")
def client(server: ServerProcess) -> Iterator[Client]:
    with Client(f"http://127.0.0.1:{server.port}") as client:
        yield client


@pytest.fixture(scope="module")
def dataset_id(client: Client, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("data") / "delfly.zip"
    path.write_bytes(force_data.archive())
    return client.upload_dataset(path)["id"]


@pytest.fixture(scope="module")
def run_id(client: Client, dataset_id: str) -> str:
    run = client.submit_run(dataset_id)
    assert client.wait(run["id"])["state"] == "SUCCEEDED"
    return run["id"]


def test_submit_with_every_option(wingfit: Wingfit, client: Client, dataset_id: str) -> None:
    words = ["--method", "cma_es", "--mode", "joint", "--finish", "--preset", "berman_wang", "--without", "inertial"]
    words += [
        "--axis",
        "x",
        "--axis",
        "z",
        "--low-pass-hz",
        "0",
        "--peel-width-beats",
        "0.02",
        "--max-generations",
        "3",
    ]
    code, out, err = wingfit("runs", "submit", dataset_id, *words, "--population", "4", "--watch", "--json")
    assert code == 0, err
    assert " mN" in err
    spec = client.run(json.loads(out)["id"])["spec"]
    assert (spec["method"], spec["mode"], spec["finish"], spec["preset"]) == ("cma_es", "joint", True, "berman_wang")
    assert (spec["without"], spec["axes"], spec["low_pass_hz"]) == (["inertial"], ["x", "z"], 0)
    assert spec["peel_width_beats"] == 0.02


def test_what_is_left_out_is_decided_by_the_server(wingfit: Wingfit, run_id: str, dataset_id: str) -> None:
    shown = wingfit("runs", "show", run_id)[1]
    assert "method gauss_newton" in shown
    assert "preset proposed, peel_width_beats 0.0, axes x, max_generations 200, mode local" in " ".join(shown.split())
    for foreign in ("division", "bounds_factor", "accuracy_mm", "population", "stall", "tolerance", "seed", "finish"):
        assert f" {foreign} " not in shown, foreign
    assert " mN RMS" in shown
    assert " mN" in wingfit("runs", "list", "--dataset", dataset_id)[1]
    assert "body pitch" in wingfit("datasets", "show", dataset_id)[1]


def test_the_result_as_tables(wingfit: Wingfit, client: Client, run_id: str) -> None:
    code, out, err = wingfit("runs", "result", run_id)
    assert code == 0
    result = client.result(run_id)
    assert result["kind"] == "forces"
    one = result["estimates"][0]["coefficients"][0]
    assert f"[{one['low_90']:.4g}, {one['high_90']:.4g}]" in out
    lines = out.splitlines()
    (head,) = (line for line in lines if line.startswith("RMS difference, mN"))
    assert head.split()[-6:] == ["global", "average", "nominal", "global,", "left", "out"]
    held = next(line for line in lines if line.startswith("test-7 (held out)"))
    said = {
        a["source"]: a["rmse_n"]
        for a in result["agreements"]
        if (a["recording"], a["quantity"]) == (force_data.HELD_OUT, "lift")
    }
    assert held.split()[4] == "–", "nothing was estimated on a recording that was held out"
    assert held.split()[5] == f"{1e3 * (said['global'] or 0):.3g}"
    lift = next(a for a in result["agreements"] if (a["quantity"], a["source"]) == ("lift", "local"))
    means = lines[next(k for k, line in enumerate(lines) if line.startswith("mean lift over a beat")) :]
    row = next(line for line in means if line.startswith(lift["recording"]))
    assert row.split()[1] == f"{1e3 * (lift['mean_recorded_n'] or 0):.3g}"
    assert f"{1e3 * (lift['mean_modelled_n'] or 0):.3g} ({correlation(lift['correlation'])})" in row
    assert "fitted from 10.3 to 13.3 Hz" in out
    assert err.count("scatter is not known") == 1
    assert json.loads(wingfit("runs", "result", run_id, "--json")[1]) == result


def test_forces_as_table_csv_and_page(wingfit: Wingfit, client: Client, run_id: str, tmp_path: Path) -> None:
    beat, page = tmp_path / "beat.csv", tmp_path / "beat.html"
    words = ["runs", "forces", run_id, "--recording", "test-4", "--source", "average", "-o", str(beat)]
    code, out, _ = wingfit(*words, "--plot", str(page))
    assert code == 0
    assert "recording test-4, coefficients: average" in out
    answer = client.forces(run_id, "test-4", "average")
    rows = list(csv.DictReader(beat.open()))
    assert [float(row["modelled_lift_n"]) for row in rows] == answer["modelled_n"]["lift"]
    assert [float(row["phase"]) for row in rows] == answer["phase"]
    assert {"recorded_x_n", "standard_deviation_z_n"} <= set(rows[0])
    text = page.read_text()
    assert "lift, spectrum" in text
    assert "<script" not in text
    assert "between beats" in text
    assert json.loads(wingfit("runs", "forces", run_id, "--json")[1]) == client.forces(run_id)
    assert wingfit("runs", "forces", run_id, "--source", "best")[0] == 2
    assert wingfit("runs", "forces", run_id, "--plot", "x.png")[0] == 2
    code, _, err = wingfit("runs", "forces", run_id, "--source", "joint")
    assert (code, "it has: local, global" in err) == (1, True)


def test_predict(wingfit: Wingfit, client: Client, run_id: str, tmp_path: Path) -> None:
    beat = tmp_path / "beat.csv"
    words = ["--flap-frequency-hz", "14", "--body-pitch-deg", "72", "--airspeed-m-s", "0.6", "--pressure-mbar", "900"]
    code, out, err = wingfit("runs", "predict", run_id, *words, "-o", str(beat))
    assert code == 0
    found = client.predict(run_id, flap_frequency_hz=14.0, body_pitch_deg=72.0, airspeed_m_s=0.6, pressure_mbar=900.0)
    assert f"warning: {found['warnings'][0]}" in err
    assert f"{1e3 * found['averages_n']['lift']:.3g}" in out
    assert [float(row["drag_n"]) for row in csv.DictReader(beat.open())] == found["drag_n"]
    thinner = client.predict(
        run_id, flap_frequency_hz=14.0, body_pitch_deg=72.0, airspeed_m_s=0.6, pressure_mbar=900.0, temperature_c=60.0
    )
    assert abs(thinner["averages_n"]["lift"]) < abs(found["averages_n"]["lift"])


def test_models(wingfit: Wingfit, client: Client) -> None:
    out = wingfit("models")[1]
    assert "proposed: with clap-and-peel" in out
    assert "Eqs. 2, 3, 8" in out
    assert json.loads(wingfit("models", "--json")[1]) == client.models()


def test_simulate_a_vehicle(wingfit: Wingfit, client: Client, dataset_id: str, tmp_path: Path) -> None:
    truth, beat = tmp_path / "truth.json", tmp_path / "beat.csv"
    truth.write_text(json.dumps(next(t.coefficients for t in TRIALS if t.name == "test-4")))
    words = ["simulate", "--dataset", dataset_id, "--recording", "test-4", "--genome", str(truth)]
    code, out, _ = wingfit(*words, "-o", str(beat))
    assert code == 0
    assert "X (forward)" in out
    true = client.simulate_forces(dataset_id, "test-4", genome=json.loads(truth.read_text()))
    assert [float(row["modelled_x_n"]) for row in csv.DictReader(beat.open())] == true["modelled_n"]["x"]
    words = ["simulate", "--dataset", dataset_id, "--recording", "test-4", "--genome", "C_l=1.24", "--json"]
    words += ["--low-pass-hz", "60", "--without", "clap_and_peel", "--peel-width-beats", "0.01"]
    bare = json.loads(wingfit(*words)[1])
    assert bare == client.simulate_forces(
        dataset_id, "test-4", genome={"C_l": 1.24}, without=["clap_and_peel"], low_pass_hz=60.0, peel_width_beats=0.01
    )
    assert bare["modelled_n"] != true["modelled_n"]


@pytest.mark.parametrize("words", [("--division", "4"), ("--loads", "x.csv"), ("--at", "airspeed_m_s=6")])
def test_options_of_a_wing_are_refused_for_a_vehicle(wingfit: Wingfit, dataset_id: str, words: tuple[str, ...]) -> None:
    code, _, err = wingfit("simulate", "--dataset", dataset_id, *words)
    assert (code, "vehicle" in err, words[0] in err) == (2, True, True)


def test_the_client_passes_on_what_the_server_says(client: Client, dataset_id: str) -> None:
    with pytest.raises(WingfitError) as error:
        client.submit_run(dataset_id, genes=["C_x"])
    assert error.value.errors[0]["where"] == "body.genes.0"
    assert "known are C_l, C_r, C_F" in error.value.errors[0]["message"]


def test_a_balance_campaign_is_written_with_its_truth(wingfit: Wingfit, tmp_path: Path) -> None:
    code, _, err = wingfit("balance", str(tmp_path / "mine"), "--seed", "4")
    assert code == 0
    assert "next: wingfit datasets upload" in err
    assert "seed 4" in load_dataset(tmp_path / "mine").description
    assert read_truth(tmp_path / "mine.truth.json")["test-1"]["C_l"] == 0.89
    code, out, _ = wingfit("datasets", "check", str(tmp_path / "mine"))
    assert (code, "vehicle 'delfly'" in out) == (0, True)
    assert wingfit("balance", str(tmp_path / "mine"))[0] == 1


def test_forces_of_any_size_keep_three_digits() -> None:
    assert [rounded(v) for v in (None, 0.0, -0.0, 0.05, 12.0, 9.996, 385051.8)] == [
        "–", "0", "0", "0.0500", "12.0", "10.0", "385052",
    ]  # fmt: skip
    assert [with_unit(v) for v in (5e-5, 0.0312, -0.9, 385051.8, 0.0)] == [
        "50.0 µN", "31.2 mN", "-900 mN", "385052 N", "0 mN",
    ]  # fmt: skip
    small = force_unit([3.1e-5, None, 4.4e-4])
    assert (small.name, small.show(3.1e-5), small.show(4.4e-4), small.show(None)) == ("µN", "31.0", "440", "–")
    assert [correlation(v) for v in (1 - 1e-15, 0.99997, 0.99968, -0.00001, None)] == [
        "1.0000", ">0.9999", "0.9997", "0.0000", "–",
    ]  # fmt: skip


def test_the_plot_has_the_band_between_beats_and_no_rounding_noise(tmp_path: Path) -> None:
    phase, recorded, spread = [0.0, 0.5], {"x": [1.0, 3.0]}, {"x": [0.1, 0.2]}
    spectra = {"frequency_hz": [0.0, 1.0, 2.0], "recorded_spectrum_n2_hz": {"x": [9.0, 1e-2, 1e-5]}}
    answer: Any = {
        "recording": "r",
        "source": "local",
        "phase": phase,
        "recorded_n": recorded,
        "standard_deviation_n": spread,
    }
    answer |= {"modelled_n": {"x": [1.0, 2.0]}, "modelled_spectrum_n2_hz": {"x": [9.0, 1e-3, 1e-36]}, **spectra}
    beat, spectrum = charts(answer)
    assert [list(edge) for edge in beat.curves[0].band] == [pytest.approx([0.9, 2.8]), pytest.approx([1.1, 3.2])]
    assert [one.name for one in charts(answer | {"standard_deviation_n": {}})[0].curves] == ["recorded", "modelled"]
    assert [list(one.y) for one in spectrum.curves] == [[1e-2, 1e-5], [1e-3, 1e-36]], "without the mean"
    write_forces(answer, None, tmp_path / "plot.html")
    text = (tmp_path / "plot.html").read_text()
    ticks = [float(tick.replace("\u2212", "-")) for tick in re.findall(r">(1e\u2212\d+|0\.\d+)</text>", text)]
    assert min(ticks) == 1e-10, "eight decades are shown"
