"""Checks meet datasets that nobody foresaw: none raises, and none refuses a good dataset."""

from __future__ import annotations

import functools
import importlib
import logging
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from tests.checks.samples import good_vehicle, good_wing
from wingfit.checks import examine, load_dataset
from wingfit.checks.guard import NOT_CARRIED_OUT, guarded
from wingfit.checks.load import DatasetWarning
from wingfit.records import Dataset, DatasetError, Recording, save_dataset
from wingfit.records.array_types import Array

EXAMPLES = 40
Change = Callable[[Recording, np.random.Generator], Recording]


@functools.cache
def bases() -> tuple[Dataset, Dataset]:
    return good_wing(), good_vehicle()


LARGEST = 1e300  # a dataset holds no infinite values


def with_values(recording: Recording, values: Array) -> Recording:
    return replace(recording, values=np.clip(values, -LARGEST, LARGEST))


def with_times(recording: Recording, times: Array) -> Recording:
    """Return ``recording`` at ``times`` unless these, rounded, do not increase: no dataset holds such times."""
    return replace(recording, times=times) if (np.diff(times) > 0).all() else recording


def rows(count: int) -> Change:
    return lambda one, _: replace(one, times=one.times[:count], values=one.values[:count])


def one_marker(one: Recording, _: np.random.Generator) -> Recording:
    return replace(one, markers=one.markers[:1], values=one.values[:, :3]) if one.markers else one


def empty(part: float) -> Change:
    return lambda one, rng: with_values(one, np.where(rng.random(one.values.shape) < part, np.nan, one.values))


ODD: dict[str, Change] = {
    "one frame": rows(1),
    "two frames": rows(2),
    "eight frames": rows(8),
    "one marker": one_marker,
    "constant": lambda one, _: with_values(one, np.full_like(one.values, 0.01)),
    "zero": lambda one, _: with_values(one, np.zeros_like(one.values)),
    "tiny": lambda one, _: with_values(one, one.values * 1e-300),
    "huge": lambda one, _: with_values(one, one.values * 1e150),
    "one huge": lambda one, rng: with_values(one, np.where(rng.random(one.values.shape) < 0.01, 1e300, one.values)),
    "noise": lambda one, rng: with_values(one, rng.normal(size=one.values.shape)),
    "mostly empty": empty(0.97),
    "half empty": empty(0.5),
    "all empty": empty(1.1),
    "an empty channel": lambda one, _: with_values(
        one, np.where(np.arange(one.values.shape[1]) == 1, np.nan, one.values)
    ),
    "times far away": lambda one, _: with_times(one, one.times + 1e9),
    "times close": lambda one, _: with_times(one, one.times * 1e-9),
    "times apart": lambda one, _: with_times(one, one.times * 1e9),
    "uneven times": lambda one, rng: with_times(one, np.cumsum(rng.exponential(size=len(one.times)) + 1e-12)),
    "rounded": lambda one, _: with_values(one, np.round(one.values, 1)),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("kind", [0, 1])
def test_no_dataset_makes_a_check_fail(kind: int) -> None:
    """Each oddity alone, twice, then up to three of them at random, in one recording or in all."""
    rng = np.random.default_rng(kind)
    some = [rng.choice(sorted(ODD), size=rng.integers(1, 4)).tolist() for _ in range(EXAMPLES)]
    for which in [*([name] for name in ODD), *([name, name] for name in ODD), *some]:
        recordings = list(bases()[kind].recordings)
        for at in range(len(recordings) if rng.random() < 0.5 else 1):
            for name in which:
                recordings[at] = ODD[name](recordings[at], rng)
        found = examine(replace(bases()[kind], recordings=tuple(recordings)))
        assert [one.value for one in found if one.kind == NOT_CARRIED_OUT] == [], which


GOOD: dict[str, Change] = {
    "as it is": lambda one, _: one,
    "two beats": lambda one, _: rows(
        int(np.searchsorted(one.times, one.times[0] + 2.2 / one.condition.flap_frequency))
    )(one, _),
    "gaps": lambda one, rng: empty(0.1)(one, rng) if one.markers else one,
    "rounded": lambda one, _: with_values(one, np.round(one.values, 5)),
    "a little noise": lambda one, rng: with_values(one, one.values + rng.normal(0, 1e-4, one.values.shape)),
    "a scale of 1 %": lambda one, _: with_values(one, 1.01 * one.values),
}


@pytest.mark.parametrize("kind", [0, 1])
def test_no_good_dataset_is_refused(kind: int) -> None:
    base, rng = bases()[kind], np.random.default_rng(kind)
    for which in combinations(GOOD, 2):
        recordings = []
        for recording in base.recordings:
            for name in which:
                recording = GOOD[name](recording, rng)
            recordings.append(recording)
        found = examine(replace(base, recordings=tuple(recordings)))
        assert [str(one) for one in found if one.certain] == [], which


def test_an_error_in_a_check_is_logged_and_becomes_a_warning(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("float division by zero")

    monkeypatch.setattr(importlib.import_module("wingfit.checks.examine"), "check_frequency", broken)
    save_dataset(bases()[0], tmp_path / "wing")
    with (
        caplog.at_level(logging.ERROR),
        pytest.warns(DatasetWarning, match="check of the frequency could not be carried"),
    ):
        assert load_dataset(tmp_path / "wing").kind == "tracks"
    assert "the check of the frequency could not be carried out on recording" in caplog.text
    assert "float division by zero" in caplog.text
    damaged = (tmp_path / "wing" / "dataset.yaml").read_text().replace("chord_m: ", "chord_m: 1000", 1)
    (tmp_path / "wing" / "dataset.yaml").write_text(damaged)
    with pytest.raises(DatasetError, match="chord_m"):
        load_dataset(tmp_path / "wing")


def test_what_a_guarded_check_finds_is_kept() -> None:
    assert guarded("nothing", "here", lambda: None) == []
    assert guarded("nothing", "here", lambda: [None]) == []


def test_a_constant_force_is_removed_and_that_of_a_marker_may_be_emptied() -> None:
    """A dataset refuses an axis of the force that has no value at all."""
    for dataset, remedy in zip(bases(), ("empty or remove this column", "remove this column"), strict=True):
        first, *others = dataset.recordings
        values = first.values.copy()
        values[:, 0] = 0.01
        found = examine(replace(dataset, recordings=(replace(first, values=values), *others)))
        (constant,) = (one for one in found if one.kind == "constant channel")
        assert constant.change.endswith(f".csv: {remedy}")
