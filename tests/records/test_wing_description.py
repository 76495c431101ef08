"""A description of a wing in a file of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wingfit import DatasetError, load_dataset, save_dataset
from wingfit.records import FourierDrive, load_archive, wing_or_vehicle
from wingfit.records.description.wing_description import read_wing

ROBIRD = Path(__file__).parents[2] / "examples" / "robird"


def test_a_wing_is_read_from_a_dataset_or_from_a_file_with_its_keys(tmp_path: Path) -> None:
    whole = load_dataset(ROBIRD).rig
    assert read_wing(ROBIRD) == whole
    assert read_wing(ROBIRD / "dataset.yaml") == whole
    text = (ROBIRD / "dataset.yaml").read_text()
    wing = text[text.index("\nwing:\n") + 1 : text.index("\nrecordings:\n")]
    alone = tmp_path / "wing.yaml"
    alone.write_text(wing)
    assert read_wing(alone) == whole
    alone.write_text("\n".join(line[2:] for line in wing.splitlines()[1:]))
    assert read_wing(alone) == whole


def test_errors_have_line_value_and_remedy(tmp_path: Path) -> None:
    text = (ROBIRD / "dataset.yaml").read_text()
    wing = text[text.index("\nwing:\n") + 1 : text.index("\nrecordings:\n")]
    keys = "\n".join(line[2:] for line in wing.splitlines()[1:])
    path = tmp_path / "wing.yaml"
    path.write_text(keys.replace("hinge:", "hinges:"))
    with pytest.raises(DatasetError, match=r"wing.yaml, line \d+, column \d+: wing.hinges"):
        read_wing(path)
    for content, words in (("- 1\n", "describes no wing"), ("vehicle: {}\n", "describes a vehicle")):
        path.write_text(content)
        with pytest.raises(DatasetError, match=words):
            read_wing(path)
    with pytest.raises(DatasetError, match="cannot be read"):
        read_wing(tmp_path / "none.yaml")


def test_a_drive_of_arrays_is_written(tmp_path: Path) -> None:
    """A wing that is made in Python may have arrays of harmonics."""
    whole = wing_or_vehicle(load_dataset(ROBIRD))
    drive = FourierDrive(0.1, np.array([-0.5, 0.02]), np.array([0.0, 0.1]))  # type: ignore[arg-type]
    save_dataset(replace(whole, rig=replace(whole.wing, drive=drive)), tmp_path / "arrays.zip")
    found = wing_or_vehicle(load_archive((tmp_path / "arrays.zip").read_bytes(), "arrays.zip")).wing.drive
    assert isinstance(found, FourierDrive)
    np.testing.assert_allclose(found.cosine, (-0.5, 0.02))
