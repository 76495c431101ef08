"""Checks of an upload: a certain mistake is refused, a doubtful one is a warning; reloading checks nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.checks.samples import good_wing
from wingfit.records import Dataset, DatasetError, save_dataset
from wingfit.records.files.storage import load_archive
from wingfit.service.datasets.parsed_datasets import Datasets
from wingfit.service.runs import views
from wingfit.service.runs.engine import Engine

GOOD = good_wing()


def stored(dataset: Dataset, path: Path) -> bytes:
    save_dataset(dataset, path)
    return path.read_bytes()


def left() -> Dataset:
    mirrored = ((one.positions * [1.0, -1.0, 1.0]).reshape(one.values.shape) for one in GOOD.recordings)
    made = (replace(one, values=values) for one, values in zip(GOOD.recordings, mirrored, strict=True))
    return replace(GOOD, recordings=tuple(made))


def thin() -> Dataset:
    condition = replace(GOOD.recordings[2].condition, pressure=10_132.5)
    return replace(GOOD, recordings=(*GOOD.recordings[:2], replace(GOOD.recordings[2], condition=condition)))


@pytest.mark.parametrize("name", ["wing.zip", "wing.nc"])
def test_a_left_wing_is_refused_and_a_wrong_pressure_is_a_warning(name: str, tmp_path: Path) -> None:
    datasets = Datasets(None, Engine())  # type: ignore[arg-type]  # nothing is stored here
    with pytest.raises(DatasetError, match="a left wing, which must be mirrored"):
        datasets.accept(stored(left(), tmp_path / f"left-{name}"), name)
    opened = datasets.accept(stored(thin(), tmp_path / f"thin-{name}"), name)
    (warning,) = views.warnings(opened.mistakes)
    assert warning["kind"] == "air pressure"
    assert warning["cause"] == "the pressure is in kPa"
    assert warning["change"] == "dataset.yaml, recordings[2].pressure_mbar: 101.325 -> 1013.25"
    assert datasets.accept(stored(GOOD, tmp_path / name), name).mistakes == ()


def test_what_was_accepted_stays_accepted(tmp_path: Path) -> None:
    """A dataset that is stored is loaded without the checks of an upload."""
    data = stored(left(), tmp_path / "left.zip")
    assert Engine().load(data, "left.zip").name == load_archive(data, "left.zip").name
