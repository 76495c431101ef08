"""Every file format stores a dataset of tracks exactly: folder, zip and NetCDF."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.records.compare import assert_same
from tests.records.samples import FOUR_BAR, falcon_dataset
from wingfit.records import (
    Condition,
    Dataset,
    DatasetError,
    FourBarDrive,
    FourierDrive,
    Recording,
    load_archive,
    load_dataset,
    save_dataset,
)
from wingfit.records.dataset import Rig
from wingfit.records.files.archive import write_zip
from wingfit.records.files.netcdf import write_netcdf

NAMES = ["folder", "a.zip", "a.nc"]


@pytest.mark.parametrize("name", NAMES)
def test_sample_returns_exactly(tmp_path: Path, name: str) -> None:
    dataset = falcon_dataset()
    save_dataset(dataset, tmp_path / name)
    assert_same(load_dataset(tmp_path / name), dataset)


@pytest.mark.parametrize("name", NAMES)
def test_saving_what_was_loaded_gives_the_same_description(tmp_path: Path, name: str) -> None:
    save_dataset(falcon_dataset(), tmp_path / name)
    save_dataset(load_dataset(tmp_path / name), tmp_path / "again")
    save_dataset(falcon_dataset(), tmp_path / "direct")
    for file in sorted(p for p in (tmp_path / "direct").rglob("*") if p.is_file()):
        again = tmp_path / "again" / file.relative_to(tmp_path / "direct")
        assert again.read_bytes() == file.read_bytes()


def test_zip_bytes_are_deterministic_and_preserve_the_order() -> None:
    dataset = falcon_dataset()
    shuffled = replace(dataset, recordings=dataset.recordings[::-1])
    assert write_zip(dataset) == write_zip(dataset)
    loaded = load_archive(write_zip(shuffled), "a.zip")
    assert [r.name for r in loaded.recordings] == [r.name for r in shuffled.recordings]


def test_content_decides_not_the_name() -> None:
    dataset = falcon_dataset()
    assert_same(load_archive(write_zip(dataset), "wrong.nc"), dataset)
    assert_same(load_archive(write_netcdf(dataset), "no-suffix"), dataset)


@pytest.mark.parametrize("name", ["a.zip", "a.nc"])
def test_an_existing_file_is_replaced(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("old")
    save_dataset(falcon_dataset(), tmp_path / name)
    assert_same(load_dataset(tmp_path / name), falcon_dataset())
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_a_folder_that_is_not_empty_is_not_changed(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("mine")
    with pytest.raises(DatasetError, match="not an empty folder"):
        save_dataset(falcon_dataset(), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["precious.txt"]


def test_the_description_itself_may_be_named(tmp_path: Path) -> None:
    save_dataset(falcon_dataset(), tmp_path / "d")
    assert_same(load_dataset(tmp_path / "d" / "dataset.yaml"), falcon_dataset())


angles = st.floats(-math.pi, math.pi)
right_angles = st.floats(-math.pi / 2, math.pi / 2)
coordinates = st.floats(-0.7, 0.7) | st.just(-0.0) | st.just(5e-324) | st.just(math.nan)
names = st.from_regex(r"[A-Za-z0-9]([A-Za-z0-9._-]{0,8}[A-Za-z0-9_-])?", fullmatch=True)
titles = st.text(
    st.characters(exclude_categories=["Cc", "Cs"], exclude_characters="\ufeff\ufffe\uffff"),
    min_size=1,
    max_size=30,
)
prose = st.text(
    st.characters(exclude_categories=["Cc", "Cs"], exclude_characters="\ufeff\ufffe\uffff")
    | st.sampled_from("\n\t:#'\"-"),
    max_size=60,
)

conditions = st.builds(
    Condition,
    flap_frequency=st.floats(0.01, 1000.0),
    phase_lag=angles,
    pressure=st.floats(0.0, 2e6),
    temperature=st.floats(174.0, 373.0),
    airspeed=st.floats(0.0, 100.0),
    angle_of_attack=right_angles,
    gravity=st.floats(0.0, 30.0),
)


@st.composite
def drives(draw: st.DrawFn) -> FourierDrive | FourBarDrive:
    if draw(st.booleans()):
        return replace(FOUR_BAR, offset=draw(angles))
    count = draw(st.integers(1, 4))
    terms = st.lists(angles, min_size=count, max_size=count).map(tuple)
    return FourierDrive(draw(angles), draw(terms), draw(terms))


@st.composite
def recordings(draw: st.DrawFn, name: str, known: list[str]) -> Recording:
    markers = tuple(draw(st.lists(st.sampled_from(known), min_size=1, max_size=3, unique=True)))
    times = np.array(sorted(draw(st.lists(st.floats(-1e3, 1e6), min_size=8, max_size=10, unique=True))))
    channels = 3 * len(markers)
    values = np.array(draw(st.lists(coordinates, min_size=len(times) * channels, max_size=len(times) * channels)))
    values[0] = 0.125
    noise = draw(
        st.none()
        | st.floats(1e-9, 0.1).map(lambda one: np.full(channels, one))
        | st.lists(st.floats(1e-9, 0.1), min_size=channels, max_size=channels).map(np.array)
    )
    rig: Rig = draw(st.sampled_from(["vacuum_chamber", "wind_tunnel"]))
    return Recording(name, rig, draw(conditions), times, markers, values.reshape(len(times), channels), noise)


@st.composite
def datasets(draw: st.DrawFn) -> Dataset:
    wing = falcon_dataset().wing
    renamed = draw(st.lists(names, min_size=len(wing.markers), max_size=len(wing.markers), unique=True))
    markers = tuple(replace(m, name=name) for m, name in zip(wing.markers, renamed, strict=True))
    estimates = draw(st.dictionaries(st.from_regex(r"[A-Z]_[a-z0-9]{1,4}", fullmatch=True), st.floats(-1e300, 1e300)))
    wing = replace(
        wing,
        name=draw(titles),
        markers=markers,
        reference_markers=(renamed[0], renamed[5]),
        drive=draw(drives()),
        estimates=estimates,
    )
    keys = draw(st.lists(names, min_size=1, max_size=3, unique_by=str.lower))
    parts = tuple(draw(recordings(name, renamed)) for name in keys)
    return Dataset(draw(titles), wing, parts, tuple(keys[1:]), draw(prose))


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(datasets())
def test_any_dataset_returns_exactly(dataset: Dataset) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES:
            save_dataset(dataset, Path(folder) / name)
            assert_same(load_dataset(Path(folder) / name), dataset)
