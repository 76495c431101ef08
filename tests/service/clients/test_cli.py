"""The command line against a running server, as a user types it."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from tests.docs.existing_commands import mistake
from tests.records.series_samples import arm_dataset
from tests.service import toy
from tests.service.processes import ROOT, ServerProcess, free_port, heed_interrupts
from wingfit.cli import main as cli
from wingfit.records import Dataset, save_dataset
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum

Wingfit = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("cli") / "data"
    with ServerProcess(data, ("tests.service.toy_server", "0.02")) as process:
        yield process


@pytest.fixture
def wingfit(server: ServerProcess, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Wingfit:
    monkeypatch.setenv("WINGFIT_URL", f"http://127.0.0.1:{server.port}")

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["wingfit", *words])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        shown = capsys.readouterr()
        assert "Traceback" not in shown.err
        return int(ended.value.code or 0), shown.out, shown.err

    return run


@pytest.fixture
def dataset_id(wingfit: Wingfit, tmp_path: Path) -> str:
    path = tmp_path / "toy.zip"
    path.write_bytes(toy.archive())
    code, out, _ = wingfit("datasets", "upload", str(path), "--json")
    assert code == 0
    return str(json.loads(out)["id"])


def _commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, (*path, name))
        else:
            yield " ".join((*path, name)), command


COMMANDS = dict(_commands(typer.main.get_command(cli.app)))


def test_the_commands_are_those_promised() -> None:
    steer = [
        "list",
        "submit",
        "show",
        "edit",
        "watch",
        "cancel",
        "pause",
        "resume",
        "delete",
        "genome",
        "result",
        "forces",
        "predict",
        "export",
        "history",
        "residual",
    ]
    data = ["list", "upload", "show", "edit", "download", "delete", "check"]
    expected = (
        {"serve", "campaign", "balance", "kinematics", "forces", "simulate", "models", "effects", "diagnose", "drive"}
        | {"plan", "export"}
        | {"import", "import-forces", "align", "wing-template", "wing-drawing"}
        | {f"diagnoses {c}" for c in ("list", "watch", "edit", "cancel", "delete", "export", "residual")}
        | {f"runs {c}" for c in steer}
        | {f"datasets {c}" for c in data}
        | {"backup", "restore", "rig check", "rig list"}
        | {"track", "cameras boards", "cameras wand", "cameras convert"}
        | {f"keys {c}" for c in ("create", "list", "revoke")}
    )
    assert set(COMMANDS) == expected


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_an_example_and_options_with_help(name: str) -> None:
    command = COMMANDS[name]
    assert f"Example: wingfit {name}" in command.help
    assert all(getattr(p, "help", None) for p in command.params if p.name != "help"), name


def test_effects_are_listed_described_and_included(wingfit: Wingfit, dataset_id: str) -> None:
    listed = wingfit("effects")[1]
    assert all(name in listed for name in EFFECTS)
    assert [one["name"] for one in json.loads(wingfit("effects", "--json")[1])] == list(EFFECTS)
    shown = wingfit("effects", "camera_shift")[1]
    assert EFFECTS["camera_shift"].signature in shown
    row = next(line for line in shown.splitlines() if line.startswith("camera_shift.y"))
    assert "[-0.2, 0.2]" in row
    assert "x chord" in row
    code, _, err = wingfit("effects", "added_moss")
    assert (code, "there are" in err) == (1, True)
    words = ["runs", "submit", dataset_id, "--max-generations", "1", "--with", "camera_shift, clock_offset"]
    run = json.loads(wingfit(*words, "--with", "scale_error", "--json")[1])
    assert run["spec"]["effects"] == ["camera_shift", "clock_offset", "scale_error"]
    settings = " ".join(wingfit("runs", "show", run["id"])[1].split())
    assert "effects camera_shift clock_offset scale_error" in settings
    for empty in ("camera_shift,", ""):
        code, _, err = wingfit(*words[:-1], empty)
        assert (code, "leave the option out" in " ".join(err.replace("│", " ").split())) == (2, True)
    assert "multiples of the mean chord; in genomes and results the gene is in m" in shown
    code, _, err = wingfit("simulate", "--dataset", dataset_id, "--with", "balance_offset")
    assert (code, "does not apply to a wing" in err) == (1, True)


def test_effects_need_no_server(wingfit: Wingfit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WINGFIT_URL", f"http://127.0.0.1:{free_port()}")
    code, out, err = wingfit("effects", "clap-and-peel")
    assert (code, "clap_and_peel: Clap and peel" in out) == (0, True)
    assert "next: wingfit runs submit DATASET --with clap_and_peel" in err


def test_a_run_is_searched_with_a_coarser_division(wingfit: Wingfit, dataset_id: str) -> None:
    words = ["runs", "submit", dataset_id, "--max-generations", "1", "--search-division", "4"]
    assert "add finish (Gauss-Newton afterwards)" in " ".join(wingfit(*words)[2].split())
    run = json.loads(wingfit(*words, "--finish", "--json")[1])
    assert run["spec"]["search_division"] == "4"
    assert "search_division 4" in " ".join(wingfit("runs", "show", run["id"])[1].split())


def test_upload_submit_watch_fetch(wingfit: Wingfit, dataset_id: str, tmp_path: Path) -> None:
    words = ["runs", "submit", dataset_id, "--max-generations", "3", "--accuracy-mm", "0.05"]
    code, out, err = wingfit(*words, "--watch", "--name", "mine")
    assert code == 0
    assert "SUCCEEDED" in out
    assert "calibrating  100 %" in err
    run_id = out.split()[1]
    assert run_id in wingfit("runs", "list")[1]
    spec = json.loads(wingfit("runs", "show", run_id, "--json")[1])["spec"]
    assert (spec["max_generations"], spec["accuracy_mm"]) == (3, 0.05)
    shown = wingfit("runs", "show", run_id)[1]
    assert "mine" in shown
    assert "accuracy_mm 0.05" in shown
    code, out, _ = wingfit("runs", "result", run_id)
    assert "all held out" in out
    assert "stiffness" in out
    best = tmp_path / "best.json"
    assert wingfit("runs", "genome", run_id, "-o", str(best))[0] == 0
    assert set(json.loads(best.read_text())) == set(toy.TARGET)
    tracks = tmp_path / "tracks.csv"
    words = ["simulate", "--dataset", dataset_id, "--genome", str(best), "--genome", "damping=0.3"]
    code, out, _ = wingfit(*words, "-o", str(tracks))
    assert code == 0
    assert "recording slow: mean distance" in out
    assert "solved with 144 steps per beat, estimated error 0.02 mm" in out
    assert "estimated error 0.1 mm" in wingfit(*words, "--accuracy-mm", "0.5")[1]
    rows = list(csv.DictReader(tracks.open()))
    assert len(rows) == 4 * 2
    assert rows[3]["recorded_x_mm"] == ""
    assert float(rows[3]["simulated_x_mm"]) > 0


def test_history_and_residual_are_drawn_and_saved(wingfit: Wingfit, dataset_id: str, tmp_path: Path) -> None:
    run_id = json.loads(wingfit("runs", "submit", dataset_id, "--max-generations", "3", "--json")[1])["id"]
    wingfit("runs", "watch", run_id)
    figure = tmp_path / "figure.html"
    code, out, err = wingfit("runs", "history", run_id, "--plot", str(figure))
    assert code == 0, err
    assert out.startswith("fitness by generation: best ")
    assert "* best   o mean" in out
    assert [line.split()[:2] for line in out.splitlines()[-2:]] == [["structural", "3"], ["aerodynamic", "3"]]
    assert "plotly" in figure.read_text()
    assert f"next: open {figure}" in err
    assert len(json.loads(wingfit("runs", "history", run_id, "--json")[1])) == 6
    code, out, _ = wingfit("runs", "residual", run_id, "--genome", "nominal", "--recording", "fast")
    assert (code, out.splitlines()[0]) == (0, "distance between recorded and simulated markers, fast")
    (misfit,) = json.loads(wingfit("runs", "residual", run_id, "--json")[1])
    assert (misfit["unit"], len(misfit["x"])) == ("mm", len(misfit["lines"]["largest"]))


def test_reading_commands_speak_json(wingfit: Wingfit, dataset_id: str) -> None:
    run_id = json.loads(wingfit("runs", "submit", dataset_id, "--max-generations", "1", "--json")[1])["id"]
    assert json.loads(wingfit("runs", "watch", run_id, "--json")[1])["state"] == "SUCCEEDED"
    for words in (
        ("datasets", "list"),
        ("datasets", "show", dataset_id),
        ("runs", "list", "--state", "succeeded"),
        ("runs", "show", run_id),
        ("runs", "genome", run_id),
        ("runs", "result", run_id),
        ("simulate", "--dataset", dataset_id),
    ):
        code, out, err = wingfit(*words, "--json")
        assert (code, "next: " in err) == (0, False)
        assert json.loads(out)


def test_a_command_ends_with_the_next_step(wingfit: Wingfit, dataset_id: str, tmp_path: Path) -> None:
    run_id = json.loads(wingfit("runs", "submit", dataset_id, "--max-generations", "1", "--json")[1])["id"]
    wingfit("runs", "watch", run_id)
    archive, best = str(tmp_path / "toy.zip"), str(tmp_path / "best.json")
    for words in (
        ("datasets", "list"),
        ("datasets", "upload", archive),
        ("datasets", "show", dataset_id),
        ("datasets", "download", dataset_id, "-o", str(tmp_path / "again.zip")),
        ("runs", "list"),
        ("runs", "list", "--state", "failed"),
        ("runs", "watch", run_id),
        ("runs", "show", run_id),
        ("runs", "genome", run_id),
        ("runs", "genome", run_id, "-o", best),
        ("runs", "result", run_id),
        ("runs", "history", run_id),
        ("runs", "residual", run_id),
        ("runs", "export", run_id, "--format", "csv", "-o", str(tmp_path / "run.csv")),
        ("simulate", "--dataset", dataset_id),
        ("diagnoses", "list"),
        ("models",),
        ("effects",),
        ("rig", "list"),
        ("runs", "delete", run_id),
    ):
        code, out, err = wingfit(*words)
        assert code == 0, err
        assert "next: " not in out
        last = err.splitlines()[-1]
        assert last.startswith("next: wingfit "), words
        assert mistake(re.split(r"[,;]| \(", last.removeprefix("next: "))[0]) == "", last


def test_an_accuracy_out_of_reach_is_told_with_its_limit(wingfit: Wingfit, dataset_id: str) -> None:
    for words in (("runs", "submit", dataset_id), ("simulate", "--dataset", dataset_id)):
        code, out, err = wingfit(*words, "--accuracy-mm", "0.001")
        assert (code, out) == (1, "")
        assert "at least 0.02 mm" in err
        assert "0.001" in err


def test_steering(wingfit: Wingfit, dataset_id: str) -> None:
    run_id = json.loads(wingfit("runs", "submit", dataset_id, "--max-generations", "500", "--json")[1])["id"]
    code, out, err = wingfit("runs", "pause", run_id)
    assert (code, out.split()) == (0, ["run", run_id, "PAUSED"])
    assert err.startswith("pausing")
    assert f"next: wingfit runs resume {run_id}" in err
    assert wingfit("runs", "resume", run_id)[0] == 0
    assert wingfit("runs", "delete", run_id)[0] == 1
    assert wingfit("runs", "cancel", run_id)[0] == 0
    code, _, err = wingfit("runs", "watch", run_id)
    assert code == 1
    assert "cancelled" in err
    assert wingfit("runs", "delete", run_id)[0] == 0
    assert wingfit("datasets", "delete", dataset_id)[0] == 0


def test_a_failed_run_is_an_error_with_its_reason(wingfit: Wingfit, dataset_id: str) -> None:
    code, _, err = wingfit("runs", "submit", dataset_id, "--seed", "13", "--watch")
    assert code == 1
    assert "the thirteenth seed breaks" in err


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("runs", "show", "run_none"), 1, "there is no run 'run_none'"),
        (("runs", "submit", "ds_none"), 1, "ds_none"),
        (("datasets", "upload", "no-such-folder"), 1, "does not exist"),
        (("runs", "submit"), 2, "Missing argument"),
        (("runs", "submit", "x", "--seed", "one"), 2, "--seed"),
        (("simulate", "--dataset", "x", "--genome", "E_f=stiff"), 2, "E_f=stiff"),
        (("simulate", "--dataset", "x", "--genome", "missing.json"), 2, "missing.json"),
        (("runs", "list", "--url", "nonsense"), 1, "http://127.0.0.1:8321"),
        (("serve", "--port", "70000"), 2, "WINGFIT_PORT"),
        (("nothing",), 2, "nothing"),
    ],
)
def test_wrong_use_is_told_in_a_line(wingfit: Wingfit, words: tuple[str, ...], code: int, said: str) -> None:
    ended, out, err = wingfit(*words)
    assert ended == code
    # Usage errors come in a box that may break a word over lines.
    assert said.replace(" ", "") in err.replace(" ", "").replace("│", "").replace("\n", "")
    assert out == ""


def test_no_server_is_told_with_the_remedy(wingfit: Wingfit) -> None:
    code, _, err = wingfit("runs", "list", "--url", f"http://127.0.0.1:{free_port()}")
    assert code == 1
    assert "wingfit serve" in err
    assert len(err.strip().splitlines()) == 1


def test_check_reads_a_dataset_without_a_server(wingfit: Wingfit, tmp_path: Path) -> None:
    folder = tmp_path / "toy"
    wing = robird_wing()
    recordings = [blank_recording(wing, vacuum(10.0, 0.0, 3.0), name) for name in ("seen", "unseen")]
    at_rest = np.array([marker.position for marker in wing.markers]).ravel()
    filled = tuple(replace(r, values=np.tile(at_rest, (len(r.times), 1))) for r in recordings)
    save_dataset(Dataset("still", wing, filled, ("unseen",)), folder)
    code, out, _ = wingfit("datasets", "check", str(folder))
    assert code == 0
    assert "held out" in out
    csv_file = next((folder / "recordings").iterdir())
    header, first, *rest = csv_file.read_text().splitlines()
    csv_file.write_text("\n".join([header, first.replace("0.", "zero", 1), *rest]))
    code, out, err = wingfit("datasets", "check", str(folder))
    assert code == 1
    assert csv_file.name in err
    assert "line 2" in err


def test_check_reads_a_series(wingfit: Wingfit, tmp_path: Path) -> None:
    save_dataset(arm_dataset(), tmp_path / "arm.nc")
    code, out, _ = wingfit("datasets", "check", str(tmp_path / "arm.nc"))
    assert code == 0
    assert "is valid: 'arm', rig 'motor arm'" in out
    assert [line.split()[:4] for line in out.splitlines()[2:4]] == [
        ["light-1", "fitted", "light", "40"],
        ["light-2", "fitted", "light", "40"],
    ]


def test_campaign_passes_its_options_on(wingfit: Wingfit, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    given: dict[str, Any] = {}

    def write_campaign(path: Path, **options: Any) -> Path:
        options["progress"](1.0)
        given.update(options, path=path)
        return path

    monkeypatch.setattr("wingfit.sim.virtual_rigs.campaign.write_campaign", write_campaign)
    code, out, _ = wingfit("campaign", str(tmp_path / "c"), "--division", "4", "--small", "--seed", "7")
    assert code == 0
    assert str(tmp_path / "c") in out
    given.pop("progress")
    assert given == {"path": tmp_path / "c", "division": "4", "small": True, "seed": 7}


def test_ctrl_c_while_watching_leaves_the_run_going(server: ServerProcess, wingfit: Wingfit, dataset_id: str) -> None:
    run_id = json.loads(wingfit("runs", "submit", dataset_id, "--max-generations", "2000", "--json")[1])["id"]
    watching = subprocess.Popen(
        [sys.executable, "-m", "wingfit.cli.main", "runs", "watch", run_id],
        cwd=ROOT,
        env=dict(os.environ),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_interrupts,
    )
    assert watching.stderr is not None
    first = watching.stderr.readline()
    time.sleep(0.3)
    watching.send_signal(signal.SIGINT)
    _, err = watching.communicate(timeout=60)
    assert "calibrating" in first
    assert watching.returncode == 130
    assert "continues on the server" in err
    assert "Traceback" not in err
    before = server.api.run(run_id)["generations"]
    server.api.until(run_id, lambda run: run["generations"] > before)
    server.api.client.post(f"/v1/runs/{run_id}/cancel")
