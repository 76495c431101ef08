"""The noise of aligned markers, from the covariances of their tracks in the axes of the cameras."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tests.command_line import in_process
from tests.tracking.alignment.recorded import ROBIRD, TURN, filmed
from wingfit import DatasetError, align_tracks, load_dataset, marker_noise
from wingfit.cli.main import app
from wingfit.inference.noise.stated import correlation_matrices
from wingfit.records import Dataset
from wingfit.records.array_types import Array
from wingfit.records.files.table import write_table
from wingfit.tracking.alignment import AlignedTracks, align
from wingfit.tracking.alignment.request import Known

IN_WING = np.array([[4.0, 1.5, -1.0], [1.5, 2.0, 0.3], [-1.0, 0.3, 1.0]]) * 1e-8
NAMES = tuple(f"t{k}" for k in range(40))


@pytest.fixture(scope="module", params=[False, True])
def aligned(request: pytest.FixtureRequest) -> tuple[AlignedTracks, bool]:
    one = filmed(left=request.param)
    return align(one.tracks, one.wing, Known()), request.param


def written(path: Path, **arrays: Any) -> Path:
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)
    return path


def covariances(in_cameras: Array, frames: int = 5) -> Array:
    found = np.tile(in_cameras, (frames, len(NAMES), 1, 1))
    found[0] = np.nan
    found[1, :] *= 0.5
    found[2, :] *= 1.5
    return found


def test_the_covariance_turns_with_the_axes_and_mirrors_with_a_left_wing(
    aligned: tuple[AlignedTracks, bool], tmp_path: Path
) -> None:
    found, left = aligned
    mirror = np.diag([1.0, -1.0 if left else 1.0, 1.0])
    to_cameras = TURN @ mirror
    stored = written(tmp_path / "t.npz", names=NAMES, covariance=covariances(to_cameras @ IN_WING @ to_cameras.T))
    noise = marker_noise(found, stored)
    assert noise.markers == found.markers
    np.testing.assert_allclose(noise.standard_deviation, np.tile(np.sqrt(np.diag(IN_WING)), (40, 1)), rtol=0.02)
    sizes = np.sqrt(np.diag(IN_WING))
    expected = (IN_WING / np.outer(sizes, sizes))[[0, 0, 1], [1, 2, 2]]
    np.testing.assert_allclose(noise.correlation, np.tile(expected, (40, 1)), atol=0.03)
    parsed = yaml.safe_load(noise.yaml())
    assert set(parsed) == {"standard_deviation_m", "noise_correlation"}
    np.testing.assert_allclose(list(parsed["noise_correlation"].values()), noise.correlation, atol=1e-6)
    numbered = replace(noise, markers=tuple(str(number) for number in range(40)))
    assert list(yaml.safe_load(numbered.yaml())["standard_deviation_m"]) == list(numbered.markers), "names stay text"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"names": NAMES[:-1], "covariance": np.tile(IN_WING, (5, 39, 1, 1))}, "no covariance of track"),
        ({"covariance": np.full((5, 40, 3, 3), np.nan)}, "no finite covariance"),
        ({"covariance": np.tile(IN_WING - 2e-8 * np.eye(3), (5, 40, 1, 1))}, "least eigenvalue"),
        ({"covariance": np.zeros((5, 40, 3, 3))}, "least eigenvalue"),
        ({"covariance": np.tile(IN_WING, (40, 1, 1))}, "must be [T, 40, 3, 3]"),
        ({"names": np.array([object()])}, "is no file of covariances"),
    ],
)
def test_files_that_hold_no_such_covariances_are_refused(
    aligned: tuple[AlignedTracks, bool], tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    arrays = {"names": NAMES, "covariance": np.tile(IN_WING, (5, 40, 1, 1))} | change
    with pytest.raises(DatasetError) as caught:
        marker_noise(aligned[0], written(tmp_path / "t.npz", **arrays))
    assert words in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"time_s,a\n", b"PK\x03\x04 cut"])
def test_other_files_are_refused(aligned: tuple[AlignedTracks, bool], tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "tracks.csv"
    path.write_bytes(content)
    for file, words in ((path, "is no file of covariances"), (tmp_path / "gone.npz", "cannot be read")):
        with pytest.raises(DatasetError) as caught:
            marker_noise(aligned[0], file)
        assert words in str(caught.value)
        assert "wingfit track --covariance" in str(caught.value)


def test_noise_that_is_nearly_all_along_the_line_of_sight_can_be_stated(
    aligned: tuple[AlignedTracks, bool], tmp_path: Path
) -> None:
    sight = np.array([0.6, 0.0, 0.8])
    extreme = 1e-10 * (np.eye(3) + 1e8 * np.outer(sight, sight))
    stored = written(tmp_path / "t.npz", names=NAMES, covariance=np.tile(extreme, (5, 40, 1, 1)))
    noise = marker_noise(aligned[0], stored)
    found = correlation_matrices(np.round(noise.correlation, 6))
    assert np.abs(noise.correlation).max() <= 0.9999
    assert np.linalg.eigvalsh(found).min() > 1e-6, "as a dataset takes it"


def test_what_the_command_writes_is_read_in_a_dataset(tmp_path: Path) -> None:
    wingfit, one = in_process(app), filmed()
    columns = [f"{name}_{axis}_m" for name in one.tracks.names for axis in "xyz"]
    trial, target = tmp_path / "trial.csv", tmp_path / "aligned.csv"
    trial.write_text(write_table(columns, one.tracks.times, one.tracks.positions.reshape(len(one.true), -1)))
    stored = written(tmp_path / "t.npz", names=NAMES, covariance=covariances(TURN @ IN_WING @ TURN.T))
    command = ("align", trial, "--wing", ROBIRD, "--covariance", stored)
    assert wingfit(*command)[0] == 2, "nothing is written without --output"
    assert wingfit(*command, "--covariance", stored, "-o", target)[0] == 2
    assert wingfit(*command, "--axes", "body", "-o", target)[0] == 2
    assert wingfit(*command, "--body", "t1,t2,t3", "-o", target)[0] == 2
    code, _, err = wingfit(*command, "-o", target)
    assert code == 0, err
    assert wingfit(*command, "-o", tmp_path / "other.csv")[0] == 0
    target.unlink()
    code, _, err = wingfit(*command, "-o", target)
    assert (code, "--force" in err) == (2, True)
    described = yaml.safe_load((ROBIRD / "dataset.yaml").read_text())
    entry = described["recordings"][0] | yaml.safe_load((tmp_path / "aligned.noise.yaml").read_text())
    described |= {"recordings": [entry], "held_out": []}
    folder = tmp_path / "robird"
    (folder / "recordings").mkdir(parents=True)
    (folder / "dataset.yaml").write_text(yaml.safe_dump(described))
    (folder / "recordings" / f"{entry['name']}.csv").write_bytes((tmp_path / "other.csv").read_bytes())
    dataset = load_dataset(folder)
    assert isinstance(dataset, Dataset)
    noise = marker_noise(align_tracks(trial, ROBIRD), stored)
    assert dataset.recordings[0].noise_correlation is not None
    np.testing.assert_allclose(dataset.recordings[0].noise_correlation, noise.correlation, atol=2e-5)
