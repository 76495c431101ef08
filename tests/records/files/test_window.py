"""A window keeps the part of a recording that is used; one that cannot be meant is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.records.malformed import error_of, good_files, with_yaml, zipped
from wingfit.records import load_archive, load_dataset, save_dataset
from wingfit.records.dataset import Dataset

FREQUENCY = "flap_frequency_hz: 2.0"  # of the first recording: 12 frames, 1/12 s apart


def loaded(window: str) -> Dataset:
    files = with_yaml(FREQUENCY, f"{FREQUENCY}, {window}") if window else good_files()
    dataset = load_archive(zipped(files), "upload.zip")
    assert isinstance(dataset, Dataset)
    return dataset


@pytest.mark.parametrize("window", ["window_s: [0.25, 0.85]", "window_beats: [0.5, 1.7]"])
def test_the_rows_of_the_window_are_kept_with_their_times_and_nothing_else_changes(window: str) -> None:
    whole, cut = loaded(""), loaded(window)
    np.testing.assert_array_equal(cut.recordings[0].times, whole.recordings[0].times[3:11])
    np.testing.assert_array_equal(cut.recordings[0].values, whole.recordings[0].values[3:11])
    for before, after in zip(whole.recordings[1:], cut.recordings[1:], strict=True):
        np.testing.assert_array_equal(before.values, after.values)


def test_a_window_over_all_changes_nothing_and_is_not_stored(tmp_path: Path) -> None:
    whole, cut = loaded(""), loaded("window_s: [0, 1]")
    np.testing.assert_array_equal(cut.recordings[0].values, whole.recordings[0].values)
    save_dataset(loaded("window_s: [0.25, 0.85]"), tmp_path / "cut")
    assert "window" not in (tmp_path / "cut" / "dataset.yaml").read_text()
    again = load_dataset(tmp_path / "cut")
    np.testing.assert_array_equal(again.recordings[0].times, whole.recordings[0].times[3:11])


@pytest.mark.parametrize(
    ("window", "message"),
    [
        ("window_s: [0.5, 0.25]", "ends before it starts"),
        ("window_s: [0.26, 0.3]", "with 0 samples, and needs 2; samples are from 0 to 0.916667 s"),
        ("window_s: [0.5, 5]", "is 0.5 to 5 s, and samples are from 0 to 0.916667 s"),
        ("window_beats: [4, 9]", "is 2 to 4.5 s, with 0 samples"),
        ("window_s: [0.5]", "window_s"),
        ("window_s: [0, 0.5], window_beats: [0, 1]", "keep one of them"),
        ("window_s: [0, later]", "'later'"),
    ],
)
def test_a_window_that_cannot_be_meant_is_refused(window: str, message: str, tmp_path: Path) -> None:
    error = error_of(with_yaml(FREQUENCY, f"{FREQUENCY}, {window}"), tmp_path)
    assert message in str(error)
