"""``wingfit align`` as a user types it, and what reads its files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import Wingfit, in_process
from tests.tracking.alignment.recorded import ROBIRD, filmed
from wingfit.cli.main import app
from wingfit.records.files.table import write_table
from wingfit.records.files.tracks import read_tracks


@pytest.fixture
def wingfit() -> Wingfit:
    return in_process(app)


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    film = filmed(left=True)
    columns = [f"{name}_{axis}_m" for name in film.tracks.names for axis in "xyz"]
    path = tmp_path_factory.mktemp("trial") / "trial.csv"
    path.write_text(write_table(columns, film.tracks.times, film.tracks.positions.reshape(len(film.true), -1)))
    return path


def test_datasets_and_kinematics_read_what_import_and_align_write(wingfit: Wingfit, trial: Path) -> None:
    folder, film = trial.parent, filmed(left=True)
    imported, aligned, body, motion = (folder / name for name in ("i.csv", "a.csv", "b.csv", "motion.yaml"))
    assert wingfit("import", trial, "-o", imported)[0] == 0
    code, out, err = wingfit("align", imported, "--wing", ROBIRD, "-o", aligned)
    assert code == 0, err
    for words in ("left wing, 62 frames, 40 markers", "ln of the odds", "rest x mm", "m49"):
        assert words in out
    samples = read_tracks(aligned.read_bytes(), "a.csv", film.markers)
    assert samples.markers == film.markers
    away = samples.values.reshape(film.true.shape) - film.true
    assert np.nanmax(np.abs(away)) < 6e-3
    code, _, err = wingfit(
        "align", imported, "--wing", ROBIRD / "dataset.yaml", "--side", "left", "--axes", "body", "-o", body
    )
    assert code == 0, err
    edges = ("--leading-edge", "m08,m15,m22", "--chord", "m15,m20", "--wing", "upper-left", "--flap-hz", "0.0645")
    code, out, err = wingfit("kinematics", body, *edges, "-o", motion)
    assert code == 0, err
    assert "mean_deg" in motion.read_text()


def test_json_and_refusals(wingfit: Wingfit, trial: Path) -> None:
    target = trial.parent / "out.csv"
    code, out, _ = wingfit("align", trial, "--wing", ROBIRD, "--side", "left", "--json", "-o", target)
    found = json.loads(out[out.index("{") :])
    assert code == 0
    assert (found["side"], found["side_evidence"], len(found["markers"])) == ("left", None, 40)
    assert found["written"] == str(target)
    code, _, err = wingfit("align", trial, "--wing", ROBIRD, "-o", target)
    assert code == 2
    assert "--force" in err
    code, _, err = wingfit("align", trial, "--wing", ROBIRD, "--force", "-o", trial)
    assert code == 2
    assert wingfit("align", trial, "--wing", ROBIRD, "--label", "t1")[0] == 2
    assert wingfit("align", trial, "--wing", ROBIRD, "--label", "t1=m01", "--label", "t1=m05")[0] == 2
    code, _, message = wingfit("align", trial, "--wing", trial.parent / "gone.yaml", "--up", "z")
    assert code == 1
    assert "cannot be read" in message
    code, _, message = wingfit("align", trial, "--wing", ROBIRD, "--body", "x,y,z")
    assert code == 1
    assert "there is no track 'x'" in message
