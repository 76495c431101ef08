"""What cannot be read back is not written."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import jaxtyping
import numpy as np
import pytest

from tests.records.samples import falcon_dataset
from wingfit.records import Dataset, DatasetError, Recording, save_dataset


@pytest.fixture(autouse=True)
def _shapes_unchecked() -> Iterator[None]:
    """As in production, where a recording of wrong shapes can be made."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def _first(dataset: Dataset, recording: Recording) -> Dataset:
    return replace(dataset, recordings=(recording, *dataset.recordings[1:]))


def _spoilt(what: str) -> Dataset:
    dataset = falcon_dataset(12)
    first = dataset.recordings[0]
    values = first.values.copy()
    values[3, 4] = math.inf
    return {
        "pressure_mbar: is NaN": _first(dataset, replace(first, condition=replace(first.condition, pressure=math.nan))),
        "infinite": _first(dataset, replace(first, values=values)),
        "float64 \\[12, 36\\]": _first(dataset, replace(first, values=first.values[:, :-1])),
        "float64 \\[36\\]": _first(dataset, replace(first, standard_deviation=np.ones(2))),
        "float32": _first(dataset, replace(first, values=first.values.astype(np.float32))),
        "'m99'": _first(dataset, replace(first, markers=("m99", *first.markers[1:]))),
        "appears twice": _first(dataset, replace(first, markers=("m2", *first.markers[1:]))),
        "times must increase": _first(dataset, replace(first, times=first.times[::-1].copy())),
        "millimetres": _first(dataset, replace(first, values=first.values * 1000)),
        "letters, digits": _first(dataset, replace(first, name="../x")),
    }[what]


@pytest.mark.parametrize("suffix", ["", ".zip", ".nc"])
@pytest.mark.parametrize(
    "what",
    [
        "pressure_mbar: is NaN",
        "infinite",
        "float64 \\[12, 36\\]",
        "float64 \\[36\\]",
        "float32",
        "'m99'",
        "appears twice",
        "times must increase",
        "millimetres",
        "letters, digits",
    ],
)
def test_a_bad_dataset_is_refused_and_nothing_is_written(what: str, suffix: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=what):
        save_dataset(_spoilt(what), tmp_path / f"d{suffix}")
    assert list(tmp_path.iterdir()) == []
