"""A description of a wing in a file of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from wingfit import DatasetError, load_dataset
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
