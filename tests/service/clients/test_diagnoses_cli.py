"""``wingfit diagnose`` against a server, as a user types it; the real tool in this process with ``--local``."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.service import toy, toy_diagnosis
from tests.service.processes import ServerProcess
from wingfit.cli import main as cli
from wingfit.client.client import Client, WingfitError

Wingfit = Callable[..., tuple[int, str, str]]
STEPS = toy_diagnosis.STEPS * len(toy_diagnosis.STAGES)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    data = tmp_path_factory.mktemp("diagnoses") / "data"
    with ServerProcess(data, ("tests.service.toy_server", "0.01")) as process:
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
def archive(tmp_path: Path) -> Path:
    path = tmp_path / "toy.zip"
    path.write_bytes(toy.archive())
    return path


def test_a_path_is_uploaded_and_what_was_found_is_printed(wingfit: Wingfit, archive: Path, tmp_path: Path) -> None:
    report = tmp_path / "found.html"
    code, out, err = wingfit("diagnose", str(archive), "--division", "4", "--report", str(report))
    assert code == 0, err
    lines = out.splitlines()
    assert lines[0] == "verdict: named (90 %): hinge_offset"
    assert lines[1].startswith("The hinge is off its place. Started from 0 genes")
    assert lines[2] == "location: outer 30 % of the span, along z"
    (heads,) = (line for line in lines if line.startswith("hypothesis"))
    assert "residual mm" in heads
    (row,) = (line for line in lines if line.startswith("hinge_offset  "))
    assert [part for part in row.split("  ") if part.strip()][1].strip() == "90 %"
    assert "0.500" in row
    assert any(line.startswith("nominal model alone") for line in lines)
    assert "not distinguishable by these recordings: hinge_offset; camera_shift" in lines
    assert any(line.startswith("hinge_offset.z") and "[0.0038, 0.0042]" in line for line in lines)
    assert "held-out recordings: held-out misfit falls to the floor" in lines
    assert "diagnosing" in err
    assert "left" in err
    assert report.read_text().startswith("<!DOCTYPE html>")


def test_the_residual_is_drawn_before_and_after(wingfit: Wingfit, archive: Path) -> None:
    _, _, err = wingfit("diagnose", str(archive), "--division", "4")
    diagnosis_id = next(word for word in err.split() if word.startswith("dx_"))
    code, out, err = wingfit("diagnoses", "residual", diagnosis_id)
    assert code == 0, err
    assert out.splitlines()[:2] == ["misfit over the beat, root mean square over all recordings", "misfit, mm"]
    assert "after: with the named effects" in out
    assert "before: nominal model, refitted" in out
    assert "noise" in out
    assert f"next: wingfit diagnoses watch {diagnosis_id}" in err
    code, _, err = wingfit("diagnoses", "residual", diagnosis_id, "--recording", "none")
    assert code == 1
    assert "there are no curves of the recording 'none'; there are those of " in err


def test_json_is_the_finding_alone(wingfit: Wingfit, server: ServerProcess) -> None:
    dataset = server.api.upload()["id"]
    code, out, _ = wingfit("diagnose", dataset, "--seed", "6", "--json")
    assert code == 0
    newest = server.api.get("/v1/diagnoses")["items"][0]
    assert (newest["dataset_id"], newest["spec"]["seed"]) == (dataset, 6)
    assert json.loads(out) == server.api.get(f"/v1/diagnoses/{newest['id']}/finding")


def test_options_reach_the_server(wingfit: Wingfit, server: ServerProcess) -> None:
    dataset = server.api.upload()["id"]
    run = server.api.submit(dataset, division="24")["id"]
    server.api.finish(run)
    words = ("--suspect", "hinge-offset,camera_shift", "--fixed", "damping=0.3", "--recording", "slow", "--no-refine")
    code, _, err = wingfit("diagnose", "--run", run, *words, "--refits", "3", "--accuracy-mm", "0.2", "--name", "mine")
    assert code == 0, err
    newest = server.api.get("/v1/diagnoses")["items"][0]
    spec = newest["spec"]
    assert (newest["run_id"], newest["dataset_id"], newest["name"]) == (run, dataset, "mine")
    assert (spec["suspects"], spec["fixed"], spec["recordings"]) == (
        ["hinge_offset", "camera_shift"],
        {"damping": 0.3},
        ["slow"],
    )
    assert (spec["refine"], spec["refits"], spec["accuracy_mm"], spec["division"]) == (False, 3, 0.2, "24")


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ((), 2, "name a dataset, or a run with --run"),
        (("ds_none",), 1, "GET /v1/datasets lists them"),
        (("ds_none", "--report", "found.pdf"), 2, "must end in .html"),
        (("ds_none", "--workers", "2"), 2, "give it with --local"),
        (("ds_none", "--suspect", "a,,b"), 2, "a name is empty"),
        (("ds_none", "--fixed", "damping=much"), 2, "--fixed"),
        (("nowhere", "--local"), 1, "does not exist; give a folder"),
        (("nowhere", "--local", "--workers", "0"), 2, "greater than or equal to 1"),
        (("nowhere", "--local", "--workers", "100000"), 2, "less than or equal to 256"),
        (("--local", "--run", "run_1"), 2, "leave --run or --local out"),
    ],
)
def test_wrong_use_is_said(wingfit: Wingfit, words: tuple[str, ...], code: int, said: str) -> None:
    got, out, err = wingfit("diagnose", *words)
    assert (got, out) == (code, "")
    assert said in " ".join(err.replace("│", " ").split())


def test_a_failure_is_an_error(wingfit: Wingfit, archive: Path) -> None:
    code, out, err = wingfit("diagnose", str(archive), "--seed", str(toy.UNLUCKY))
    assert (code, out) == (1, "")
    assert "the thirteenth seed breaks" in err


def test_one_comes_back_to_a_diagnosis(wingfit: Wingfit, server: ServerProcess) -> None:
    dataset = server.api.upload(name="come back")["id"]
    diagnosis = server.api.diagnose(dataset, name="later")["id"]
    code, out, _ = wingfit("diagnoses", "watch", diagnosis)
    assert (code, out.splitlines()[0]) == (0, "verdict: named (90 %): hinge_offset")
    _, out, _ = wingfit("diagnoses", "list", "--dataset", dataset)
    assert all(part in out for part in (diagnosis, "later", "SUCCEEDED", "100 %", "named"))
    assert wingfit("diagnoses", "cancel", diagnosis)[0] == 1
    assert wingfit("diagnoses", "delete", diagnosis)[:2] == (0, f"diagnosis {diagnosis} deleted\n")
    assert "no diagnoses" in wingfit("diagnoses", "list", "--dataset", dataset)[1]


def test_the_client_follows_over_lost_connections(server: ServerProcess) -> None:
    with Client(f"http://127.0.0.1:{server.port}") as client:
        dataset = server.api.upload()["id"]
        one = client.submit_diagnosis(dataset, seed=2)
        told: list[tuple[float, str | None]] = []
        done = client.wait_for_diagnosis(one["id"], lambda now: told.append((now["progress"], now["stage"])))
        assert (done["state"], done["verdict"], done["steps"]) == ("SUCCEEDED", "named", STEPS)
        assert [part for part, _ in told] == sorted(part for part, _ in told)
        assert {stage.rpartition(",")[0] for _, stage in told if stage and "," in stage} == set(toy_diagnosis.STAGES)
        rest = list(client.diagnosis_events(one["id"], last_event_id=str(STEPS - 2)))
        assert [event["event"] for event in rest] == ["step", "step", "state"]
        assert client.finding(one["id"])["verdict"] == "named"
        assert "<svg" in client.report(one["id"])
        assert [d["id"] for d in client.diagnoses(dataset_id=dataset)] == [one["id"]]
        client.delete_diagnosis(one["id"])
        with pytest.raises(WingfitError, match="there is no diagnosis"):
            client.diagnosis(one["id"])
