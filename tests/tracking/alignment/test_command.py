"""``wingfit align`` as a user types it, and what reads its files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.command_line import Wingfit, in_process
from tests.tracking.alignment.recorded import ROBIRD, filmed
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.project import write_cameras
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


def test_cameras_are_printed_in_the_frame_of_the_wing(wingfit: Wingfit, trial: Path) -> None:
    """Of a left wing, which is mirrored: a camera sees the aligned markers where it saw the tracks."""
    calibration, aligned = trial.parent / "cameras.yaml", trial.parent / "seen.csv"
    turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    matrix = np.array([[1500.0, 0.0, 640.0], [0.0, 1500.0, 512.0], [0.0, 0.0, 1.0]])
    cameras = tuple(
        Camera(name, (1280, 1024), matrix, Lens(), turn, np.array([x, 0.1, 2.0]))
        for name, x in (("one", 0.0), ("two", -0.4))
    )
    write_cameras(calibration, CameraSet(cameras))
    options = ("align", trial, "--wing", ROBIRD, "--side", "left", "--cameras", calibration)
    code, out, err = wingfit(*options, "--json", "-o", aligned)
    assert code == 0, err
    printed = json.loads(out[out.index("{") :])["cameras"]
    film = filmed(left=True)
    positions = read_tracks(aligned.read_bytes(), "seen.csv", film.markers).values.reshape(film.true.shape)
    found = json.loads(out[out.index("{") :])
    before = positions @ np.array(found["rotation"]) + found["origin_m"]
    for camera, one in zip(cameras, printed, strict=True):
        assert one["name"] == camera.name
        assert one["focal_px"] == 1500.0
        own = before @ camera.rotation.T + camera.translation
        np.testing.assert_allclose((positions - one["centre_m"]) @ np.array(one["rotation"]).T, own, atol=2e-6)
    code, out, err = wingfit(*options)
    assert code == 0, err
    said = out[out.index("for the dataset: cameras:") :].splitlines()[1:3]
    assert yaml.safe_load("\n".join(said)) == printed
    code, _, message = wingfit(*options[:-1], trial.parent / "gone.yaml")
    assert code == 1
    assert "cannot be read" in message
