"""Every file format stores a series of any rig exactly: folder, zip, NetCDF, and the stored form of uploads."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.contract.test_dataset_files import NAMES, names, prose, titles
from tests.records.compare import assert_same
from tests.records.malformed import zipped
from tests.records.series_samples import SAMPLES, YAML, arm_dataset, good_series
from wingfit.records import Channel, Quantity, Series, SeriesDataset, load_archive, load_dataset, save_dataset
from wingfit.records.files.archive import write_zip
from wingfit.records.files.confined import convert_netcdf
from wingfit.records.files.netcdf import write_netcdf
from wingfit.records.files.parsed import load_parsed
from wingfit.records.files.series_table import Columns, read_series
from wingfit.records.limits import LARGEST, SMALLEST


@pytest.mark.parametrize("name", NAMES)
def test_sample_returns_exactly(tmp_path: Path, name: str) -> None:
    dataset = arm_dataset()
    save_dataset(dataset, tmp_path / name)
    assert_same(load_dataset(tmp_path / name), dataset)


@pytest.mark.parametrize("name", NAMES)
def test_saving_what_was_loaded_gives_the_same_files(tmp_path: Path, name: str) -> None:
    save_dataset(arm_dataset(12), tmp_path / name)
    save_dataset(load_dataset(tmp_path / name), tmp_path / "again")
    again = {
        p.relative_to(tmp_path / "again").as_posix(): p.read_bytes()
        for p in (tmp_path / "again").rglob("*")
        if p.is_file()
    }
    assert again == dict(good_series())


def test_the_same_dataset_gives_the_same_zip() -> None:
    assert write_zip(arm_dataset()) == write_zip(arm_dataset())


def test_the_stored_form_of_an_upload_returns_exactly() -> None:
    data = write_netcdf(arm_dataset())
    form = convert_netcdf(data, "arm.nc")
    stored = load_parsed(form, "arm.nc")
    assert_same(stored, arm_dataset())
    assert convert_netcdf(data, "other.nc") == form
    for recording in stored.recordings:
        assert recording.values.flags.writeable
        assert recording.values.flags.c_contiguous


def test_columns_come_in_any_order_and_with_their_units() -> None:
    text = "voltage_V,time_s,T,angle_rad\n" + "".join(f"2,{k},{k + 1},\n" for k in range(8))
    samples = read_series(text.encode(), SAMPLES, Columns({"angle": "rad", "T": "K"}, {"voltage": "V"}))
    assert samples.quantities == ("angle", "T", "voltage")
    assert samples.times.tolist() == list(range(8))
    assert samples.values[0, 1:].tolist() == [1.0, 2.0]
    assert np.isnan(samples.values[:, 0]).all()


def test_a_recording_needs_neither_settings_nor_inputs_and_a_unit_may_be_the_number_1() -> None:
    description = "format_version: 1\nname: a\nrig: b\nchannels: [{name: t, unit: 1}]\nrecordings: [{name: c}]\n"
    table = "time_s,t\n" + "".join(f"{k},{k * k}\n" for k in range(8))
    dataset = load_archive(zipped({YAML: description.encode(), "recordings/c.csv": table.encode()}), "a.zip")
    assert isinstance(dataset, SeriesDataset)
    assert dataset.channels == (Channel("t", "1"),)
    (recording,) = dataset.recordings
    assert recording.values[:, 0].tolist() == [k * k for k in range(8)]
    assert (recording.settings, recording.inputs, recording.estimates) == ({}, {}, {})
    assert (recording.repeats, recording.period) == ("", None)


def test_a_channel_may_be_missing_in_one_recording(tmp_path: Path) -> None:
    dataset = arm_dataset()
    values = dataset.recordings[2].values.copy()
    values[:, 1] = np.nan
    recordings = (*dataset.recordings[:2], replace(dataset.recordings[2], values=values), *dataset.recordings[3:])
    dataset = replace(dataset, recordings=recordings)
    save_dataset(dataset, tmp_path / "a")
    assert_same(load_dataset(tmp_path / "a"), dataset)


units = st.text(
    st.characters(min_codepoint=0x21, max_codepoint=0x2FF, exclude_categories=["Cc", "Cf", "Zs"]),
    min_size=1,
    max_size=9,
)
numbers = st.floats(-LARGEST, LARGEST) | st.just(-0.0) | st.just(5e-324)
sizes = st.floats(SMALLEST, LARGEST)
instants = st.floats(-1e3, 1e6).filter(lambda t: t == 0.0 or abs(t) > 1e-30)  # so that they differ by SMALLEST


@st.composite
def recordings(draw: st.DrawFn, name: str, dataset: SeriesDataset) -> Series:
    times = np.array(sorted(draw(st.lists(instants, min_size=8, max_size=10, unique=True))))
    shape = len(times), len(dataset.channels)
    cells = st.lists(numbers | st.just(math.nan), min_size=shape[0] * shape[1], max_size=shape[0] * shape[1])
    values = np.array(draw(cells)).reshape(shape)
    values[:2] = [[1.0], [2.0]]
    own = st.lists(numbers, min_size=len(times), max_size=len(times)).map(np.array)
    genes = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,5}", fullmatch=True)
    period = draw(st.none() | st.floats(0.5, 1.0))  # at least two samples
    return Series(
        name,
        times,
        dataset.channels,
        values,
        inputs={one.name: draw(own) for one in dataset.inputs},
        settings={one.name: draw(numbers) for one in dataset.settings},
        estimates=draw(st.dictionaries(genes, numbers, max_size=3)),
        repeats=draw(st.just("") | names.map(lambda group: f"{group}-{name}"[:100].rstrip("."))),
        period=None if period is None else max(period * float(np.ptp(times)), 1e-9),
    )


@st.composite
def datasets(draw: st.DrawFn) -> SeriesDataset:
    taken = draw(st.lists(names.filter(lambda n: n.lower() != "time_s"), min_size=3, max_size=7, unique=True))
    count = draw(st.integers(1, len(taken) - 2))
    channels = tuple(
        Channel(name, draw(units), draw(st.none() | sizes), draw(st.just("") | titles), draw(prose))
        for name in taken[:count]
    )
    rest = [Quantity(name, draw(units), draw(prose)) for name in taken[count:]]
    split = draw(st.integers(0, len(rest)))
    empty = SeriesDataset(
        draw(titles), draw(titles), (), channels, tuple(rest[:split]), tuple(rest[split:]), (), draw(prose)
    )
    keys = draw(st.lists(names, min_size=1, max_size=3, unique_by=str.lower))
    parts = tuple(draw(recordings(name, empty)) for name in keys)
    return replace(empty, recordings=parts, held_out=tuple(keys[1:]))


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(datasets())
def test_any_dataset_returns_exactly(dataset: SeriesDataset) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES:
            save_dataset(dataset, Path(folder) / name)
            assert_same(load_dataset(Path(folder) / name), dataset)
