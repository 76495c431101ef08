"""``wingfit import`` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer

import wingfit as package
from tests.command_line import Wingfit, in_process
from tests.importers.start.test_start import wing_table
from tests.oracles.track_files import flapping, text_writers
from wingfit.cli.importing.command import import_
from wingfit.records.files.number_table import read_table
from wingfit.records.files.tracks import read_tracks


@pytest.fixture
def wingfit() -> Wingfit:
    app = typer.Typer()
    app.command()(import_)

    return in_process(app)


@pytest.fixture
def trial(tmp_path: Path) -> Path:
    path = tmp_path / "Flight 1.trc"
    path.write_text(text_writers.trc(flapping()))
    return path


def test_it_shows_what_was_understood_and_writes_nothing_without_output(wingfit: Wingfit, trial: Path) -> None:
    code, out, err = wingfit(trial)
    assert code == 0
    assert "Flight 1.trc: TRC, 4 markers, 60 frames" in out
    assert "file: line 3, Units" in out
    assert "nobody" in out
    assert "--output" in err
    assert [path.name for path in trial.parent.iterdir()] == ["Flight 1.trc"]


def test_the_tracks_that_it_writes_are_read_by_datasets_and_kinematics(wingfit: Wingfit, trial: Path) -> None:
    code, _, err = wingfit(trial, "--axes", "x aft, y out, z up", "-o", trial.parent / "tracks")
    assert code == 0, err
    raw = (trial.parent / "tracks" / "Flight_1.csv").read_bytes()
    truth = flapping()
    samples = read_tracks(raw, "Flight_1.csv", truth.names)
    assert np.allclose(samples.values.reshape(truth.mm.shape) * 1e3, truth.mm, atol=1e-9, equal_nan=True)
    kinematics = read_table(raw, "Flight_1.csv")
    assert np.array_equal(kinematics.track("tip-2"), samples.values[:, 6:9], equal_nan=True)
    assert np.abs(kinematics.times() - np.arange(60) / 240).max() < 1e-12


def test_it_overwrites_only_with_force(wingfit: Wingfit, trial: Path) -> None:
    target = trial.parent / "out.csv"
    assert wingfit(trial, "-o", target)[0] == 0
    code, _, err = wingfit(trial, "-o", target)
    assert code == 2
    assert "--force" in err
    assert wingfit(trial, "-o", target, "--force")[0] == 0
    assert wingfit(target, "-o", target, "--force")[0] == 2
    assert wingfit(trial, trial, "-o", target, "--force")[0] == 2


def test_json_has_every_marker_and_who_stated_what(wingfit: Wingfit, trial: Path) -> None:
    code, out, _ = wingfit(trial, "--json", "-o", trial.parent / "out.csv")
    (found,) = json.loads(out)
    assert code == 0
    assert found["written"] == str(trial.parent / "out.csv")
    assert [marker["name"] for marker in found["markers"]] == list(flapping().names)
    assert {"fact": "unit", "value": "mm", "by": "file", "where": "line 3, Units"} in found["statements"]
    assert found["markers"][0]["largest_jump_m"] > 0
    assert 0 < found["markers"][0]["seen"] <= 1


def test_the_faults_of_all_files_are_listed_and_nothing_is_written(wingfit: Wingfit, trial: Path) -> None:
    points = trial.parent / "a_xyzpts.csv"
    points.write_text(text_writers.dltdv(flapping()))
    code, _, message = wingfit(trial, points, trial.parent / "gone.c3d", "-o", trial.parent / "tracks")
    assert code == 1
    for words in ("a_xyzpts.csv: states no unit", "--rate-hz", "gone.c3d: cannot be read: No such file"):
        assert words in message
    assert not (trial.parent / "tracks").exists()


def test_a_whole_dataset_is_written(wingfit: Wingfit, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(wing_table(both=True))
    words = (tmp_path / "a.csv", "--axes", "x aft, y out, z up", "--dataset", tmp_path / "wing")
    code, _, err = wingfit(*words)
    assert code == 1
    assert "--markers in,mid,tip" in err
    assert not (tmp_path / "wing").exists()
    code, out, err = wingfit(*words, "--markers", "in,mid,tip", "--airspeed-m-s", 4)
    assert code == 0, err
    assert "assumed: a rectangle around the markers" in out
    assert f"next: wingfit datasets check {tmp_path / 'wing'}" in " ".join(err.split())
    assert "replace what is assumed" in err
    dataset = package.load_dataset(tmp_path / "wing")
    assert isinstance(dataset, package.Dataset)
    assert dataset.recordings[0].condition.airspeed == 4
    code, _, err = wingfit(*words)
    assert (code, "exists; name a new folder" in " ".join(err.replace("│", " ").split())) == (2, True)
    code, _, err = wingfit(tmp_path / "a.csv", "--airspeed-m-s", 4)
    assert (code, "is for --dataset" in " ".join(err.replace("│", " ").split())) == (2, True)
    code, out, err = wingfit(tmp_path / "a.csv", "--dataset", tmp_path / "positions", "--markers", "tip")
    assert code == 0
    assert "series of positions, without a wing" in out
    assert "--axes" in err
    assert package.load_dataset(tmp_path / "positions").kind == "series"
    body = ("--axes", "x nose, y right, z down", "--dataset", tmp_path / "body", "--markers", "tip")
    code, out, err = wingfit(tmp_path / "a.csv", *body)
    assert (code, "--axes" in err) == (0, False), "they are given"
    assert "in body axes" in err
    assert "1 marker, 120 frames" in out
    code, _, err = wingfit(tmp_path / "a.csv", "--markers", "")
    assert (code, "'', which names no marker" in err) == (1, True)
    code, _, err = wingfit(*words[:-1], tmp_path / "body")
    assert (code, "body' exists; name" in " ".join(err.replace("│", " ").split()).replace(" ' ", "' ")) == (2, True)
