"""Every broken description, CSV and NetCDF of a series gets an error that says where, what and what to do."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import h5py
import jaxtyping
import numpy as np
import pytest

from tests.records.malformed import error_of, error_of_zip, good_files, zipped
from tests.records.series_samples import SAMPLES, YAML, arm_dataset, good_series, series_csv, series_yaml
from tests.records.vehicles import good_vehicle
from wingfit.records import Channel, DatasetError, Series, SeriesDataset, load_archive, save_dataset
from wingfit.records.files.netcdf import write_netcdf
from wingfit.records.limits import MAX_QUANTITIES

Files = dict[str, bytes]
ANGLE = "{name: angle, unit: rad, standard_deviation: 0.002,"
LIGHT = "  settings: {mass: 0.1, gear: 20.0}\n"
RIG = "rig: motor arm\n"

DESCRIPTIONS = {
    # what: (old, new, in where, in message)
    "rig and wing": (RIG, RIG + "wing: {name: a}\n", [": rig"], ["both 'wing' and 'rig'", "split it"]),
    "rig and vehicle": (RIG, RIG + "vehicle: {}\n", [": rig"], ["both 'vehicle' and 'rig'"]),
    "rig misspelt": (RIG, "rigg: arm\n", [": rigg", ": rig"], ["did you mean 'rig'?", "missing; add it"]),
    "no rig": (RIG, "", [": rig"], ["missing; add it"]),
    "rig described": (RIG, "rig: {name: arm}\n", [": rig"], ["a mapping of 1", "must be text"]),
    "channels misspelt": ("channels:", "chanels:", [": chanels"], ["did you mean 'channels'?"]),
    "no channel": ("channels:\n", "channels: []\nwas:\n", [": channels"], ["at least 1 are needed"]),
    "key of a wing": (
        "  repeats: light",
        "  flap_frequency_hz: 3",
        ["[0].flap_frequency_hz"],
        ["is for a wing or a vehicle, this"],
    ),
    "key of both": (RIG, RIG + "verified: [unsteady]\n", [": verified"], ["is for a wing or a vehicle, this"]),
    "key of a vehicle": ("  repeats: light", "  body_pitch_deg: 3", ["[0].body_pitch_deg"], ["is for a vehicle"]),
    "no unit": (", unit: rad", "", ["channels[0].unit"], ["missing; add it"]),
    "empty unit": ("unit: rad", "unit: ", ["channels[0].unit"], ["is empty", "1 for a quantity without unit"]),
    "empty text as unit": ("unit: V", 'unit: ""', ["inputs[0].unit"], ["is empty", "1 for a quantity"]),
    "blank unit": ("unit: kg", 'unit: " "', ["settings[0].unit"], ["printable", "1 for a quantity"]),
    "number as unit": ("unit: kg", "unit: 2", ["settings[0].unit"], ["the number 2", "in quotes"]),
    "long unit": ("unit: kg", f"unit: {'k' * 51}", ["settings[0].unit"], ["51 characters", "at most 50"]),
    "zero deviation": ("deviation: 0.002", "deviation: 0", ["standard_deviation"], ["is 0.0", "leave it out"]),
    "negative deviation": ("deviation: 0.002", "deviation: -1", ["standard_deviation"], ["is -1", "must lie in"]),
    "infinite deviation": ("deviation: 0.002", "deviation: .inf", ["standard_deviation"], ["finite number"]),
    "deviation with unit": (
        "standard_deviation:",
        "standard_deviation_rad:",
        [],
        ["did you mean 'standard_deviation'"],
    ),
    "place of two lines": ("place: axis", 'place: "a\\nb"', ["channels[0].place"], ["one line"]),
    "channel twice": ("name: acceleration", "name: angle", ["channels[1].name"], ["'angle'", "channels[0]", "rename"]),
    "channel and input": ("name: voltage", "name: angle", ["inputs[0].name"], ["the name of channels[0]"]),
    "input and setting": ("name: mass", "name: voltage", ["settings[0].name"], ["the name of inputs[0]"]),
    "channel and setting": ("name: gear", "name: contact", ["settings[1].name"], ["the name of channels[2]"]),
    "name of the times": ("name: voltage", "name: Time_S", ["inputs[0].name"], ["column of times"]),
    "name with a comma": ("name: voltage", 'name: "a,b"', ["inputs[0].name"], ["letters, digits"]),
    "setting missing": (
        "{mass: 0.1, gear: 20.0}",
        "{mass: 0.1}",
        ["recordings[0].settings"],
        ["'gear'", "add its value"],
    ),
    "no settings": (LIGHT, "", ["recordings[0].settings"], ["'light-1' does not state the setting 'mass'"]),
    "unknown setting": ("gear: 20.0}", "gear: 20.0, mas: 1}", ["settings.mas"], ["'mas'", "did you mean 'mass'?"]),
    "setting as text": ("gear: 20.0}", "gear: high}", ["settings.gear"], ["'high'", "finite number"]),
    "infinite setting": ("gear: 20.0}", "gear: .inf}", ["settings.gear"], ["finite"]),
    "huge setting": ("gear: 20.0}", "gear: 1e301}", ["settings.gear"], ["must lie in"]),
    "gene name": ("angle0: 0.5", "angle-0: 0.5", ["recordings[2].estimates"], ["gene name"]),
    "infinite estimate": ("angle0: 0.5", "angle0: inf", ["estimates.angle0"], ["finite"]),
    "zero period": ("period_s: 0.25", "period_s: 0", ["recordings[2].period_s"], ["is 0.0 s", "not periodic"]),
    "negative period": ("period_s: 0.25", "period_s: -1", ["recordings[2].period_s"], ["must lie in"]),
    "period in ms": ("period_s: 0.25", "period_ms: 250", ["recordings[2].period_ms"], ["write 'period_s'"]),
    "period too long": (
        "period_s: 0.25",
        "period_s: 3",
        ["heavy.csv"],
        ["period_s is 3 s", "lasts 0.288", "leave it out"],
    ),
    "empty repeats": ("repeats: light", 'repeats: ""', ["recordings[0].repeats"], ["letters, digits"]),
    "repeats differ": (
        "- name: light-2\n  settings: {mass: 0.1,",
        "- name: light-2\n  settings: {mass: 0.2,",
        ["recordings[1].repeats"],
        ["'light-2' repeats 'light' as 'light-1' does", "different settings", "remove 'repeats'"],
    ),
    "recording twice": ("name: light-2", "name: light-1", ["recordings[1].name"], ["second time"]),
    "held out": ("held_out: [heaviest]", "held_out: [heavyest]", ["held_out[0]"], ["did you mean 'heaviest'?"]),
    "many inputs": (
        "inputs:\n",
        "inputs:\n" + "- {name: a, unit: V}\n" * 1001,
        [": inputs"],
        [f"more than {MAX_QUANTITIES}"],
    ),
}


@pytest.mark.parametrize("what", DESCRIPTIONS)
def test_each_mistake_of_the_description_is_named(what: str, tmp_path: Path) -> None:
    old, new, places, words = DESCRIPTIONS[what]
    _named(error_of(series_yaml(old, new), tmp_path), places, words)


def _named(error: DatasetError, places: list[str], words: list[str]) -> None:
    for place in places:
        assert any(place in fault.where for fault in error.errors), str(error)
    for word in words:
        assert any(word in fault.message for fault in error.errors), str(error)


def _column(index: int, cell: str) -> dict[tuple[int, int], str]:
    return {(line, index): cell for line in range(2, 14)}


def _everywhere(column: int, cell: str) -> Files:
    """Good files, with one column (from 1) the same in all rows of all recordings."""
    files = dict(good_series())
    for name in [name for name in files if name != YAML]:
        header, *rows = (line.split(",") for line in files[name].decode().splitlines())
        for row in rows:
            row[column - 1] = cell
        files[name] = "\n".join([*(",".join(row) for row in (header, *rows)), ""]).encode()
    return files


TABLES: dict[str, tuple[Callable[[], Files], list[str], list[str]]] = {
    "word": (lambda: series_csv({(4, 2): "oops"}), ["line 4, column 'angle'"], ["'oops'", "number"]),
    "nan": (lambda: series_csv({(4, 2): "NaN"}), ["line 4, column 'angle'"], ["leave the cell empty where a channel"]),
    "inf": (lambda: series_csv({(4, 2): "inf"}), ["line 4, column 'angle'"], ["finite"]),
    "overflow": (lambda: series_csv({(4, 2): "1e999"}), ["line 4, column 'angle'"], ["too large"]),
    "no input": (lambda: series_csv({(4, 5): ""}), [f"{SAMPLES}, line 4"], ["'voltage'", "every row", "interpolate"]),
    "no time": (lambda: series_csv({(4, 1): ""}), [f"{SAMPLES}, line 4"], ["time_s is missing"]),
    "time backwards": (lambda: series_csv({(4, 1): "-9"}), [f"{SAMPLES}, line 4"], ["times must increase"]),
    "column missing": (
        lambda: {**good_series(), SAMPLES: b"time_s,angle,contact,voltage\n" + b"1,2,3,4\n" * 9},
        [f"{SAMPLES}, line 1"],
        ["column 'acceleration' is missing; add it in m/s^2", "may be empty"],
    ),
    "input missing": (
        lambda: {**good_series(), SAMPLES: b"time_s,angle,contact,acceleration\n" + b"1,2,3,4\n" * 9},
        ["line 1"],
        ["column 'voltage' is missing", "a value in every row"],
    ),
    "column misspelt": (
        lambda: series_csv(old="voltage", new="voltge"),
        ["line 1, column 5"],
        ["did you mean 'voltage'"],
    ),
    "column without unit": (
        lambda: series_csv(old="contact", new="contact_m"),
        ["column 4"],
        ["'contact', with values without unit"],
    ),
    "other unit": (
        lambda: series_csv(old="angle", new="angle_deg"),
        ["line 1, column 2"],
        ["write 'angle', with values in rad"],
    ),
    "column of a setting": (
        lambda: series_csv(old="contact", new="mass"),
        ["line 1, column 4"],
        ["a setting", "dataset.yaml"],
    ),
    "column twice": (
        lambda: series_csv(old="contact", new="angle_rad"),
        ["line 1, column 4"],
        ["also column 2", "keep one"],
    ),
    "time in ms": (lambda: series_csv(old="time_s", new="time_ms"), ["line 1, column 1"], ["write 'time_s'"]),
    "empty": (lambda: {**good_series(), SAMPLES: b""}, [SAMPLES], ["the file is empty"]),
    "few samples": (
        lambda: {**good_series(), SAMPLES: b"\n".join(good_series()[SAMPLES].splitlines()[:8])},
        [SAMPLES],
        ["7 samples; it must be 8 to 200000"],
    ),
    "no value": (
        lambda: series_csv(_column(2, "") | _column(3, "") | _column(4, "")),
        [SAMPLES],
        ["no channel has a value", "leave the recording out"],
    ),
    "channel without values": (
        lambda: _everywhere(3, ""),
        ["dataset.yaml, line 7", "channels[1]"],
        ["'acceleration' has no value in any recording", "remove it"],
    ),
    "channel that never changes": (
        lambda: _everywhere(3, "9.81"),
        ["channels[1]"],
        ["'acceleration' never changes: it is 9.81 m/s^2 throughout", "check the sensor", "a setting"],
    ),
    "channel without unit that never changes": (lambda: _everywhere(4, "1"), ["channels[2]"], ["it is 1 throughout"]),
    "other times of a repeat": (
        lambda: series_csv({(2, 1): "-0.08"}),
        ["recordings[1].repeats"],
        ["different sample times", "resample"],
    ),
    "other input of a repeat": (lambda: series_csv({(2, 5): "0.9"}), ["recordings[1].repeats"], ["different inputs"]),
    "file missing": (
        lambda: {name: data for name, data in good_series().items() if name != SAMPLES},
        ["recordings[0].name"],
        [f"file '{SAMPLES}' is missing"],
    ),
    "file not listed": (
        lambda: {**good_series(), "recordings/more.csv": b"time_s\n"},
        ["recordings/more.csv"],
        ["is not listed in dataset.yaml"],
    ),
}


@pytest.mark.parametrize("what", TABLES)
def test_each_mistake_of_a_table_is_named(what: str, tmp_path: Path) -> None:
    make, places, words = TABLES[what]
    _named(error_of(make(), tmp_path), places, words)


def test_a_channel_with_another_value_in_each_recording_is_a_setting(tmp_path: Path) -> None:
    files = _everywhere(4, "1")
    files[SAMPLES] = files[SAMPLES].replace(b",1,", b",2,")
    error = error_of(files, tmp_path)
    assert "'contact' never changes during a recording" in error.message


def test_several_mistakes_come_at_once(tmp_path: Path) -> None:
    files = series_csv({(4, 2): "oops", (6, 5): "x"})
    files["recordings/heavy.csv"] = files["recordings/heavy.csv"].replace(b"angle", b"angel")
    assert error_of(files, tmp_path).count == 3


@pytest.mark.parametrize(("files", "kind"), [(good_files, "a wing"), (good_vehicle, "a vehicle")])
def test_a_key_of_a_series_in_another_dataset(files: Callable[[], Files], kind: str, tmp_path: Path) -> None:
    text = files()[YAML].replace(b"format_version: 1\n", b"format_version: 1\nsettings: []\n")
    error = error_of({**files(), YAML: text}, tmp_path)
    assert f"key 'settings' is for a rig with channels, this is {kind}" in error.message


@contextmanager
def shapes_unchecked() -> Iterator[None]:
    """As in production, where a recording of wrong shapes can be made."""
    jaxtyping.config.update("jaxtyping_disable", True)
    try:
        yield
    finally:
        jaxtyping.config.update("jaxtyping_disable", False)


def _first(**changes: object) -> SeriesDataset:
    dataset = arm_dataset(12)
    first = replace(dataset.recordings[0], **changes)  # type: ignore[arg-type]
    return replace(dataset, recordings=(first, *dataset.recordings[1:]))


def _with_value(value: float) -> SeriesDataset:
    values = arm_dataset(12).recordings[0].values.copy()
    values[3, 1] = value
    return _first(values=values)


VOLTAGE = arm_dataset(12).recordings[0].inputs["voltage"]
UNSAVED: dict[str, Callable[[], SeriesDataset]] = {
    "not the channels of the dataset": lambda: _first(quantities=(Channel("angle", "deg"),) * 3),
    "no input of the dataset is called 'volts'; did you mean": lambda: _first(inputs={"volts": VOLTAGE}),
    "input 'voltage' of the dataset is missing": lambda: _first(inputs={}),
    r"values: is float64 \[12, 2\]; it must be float64 \[12, 3\]": lambda: _first(values=np.zeros((12, 2))),
    r"inputs\['voltage'\]: is float64 \[11\]": lambda: _first(inputs={"voltage": VOLTAGE[1:]}),
    "float32": lambda: _first(times=arm_dataset(12).recordings[0].times.astype(np.float32)),
    "sample 3: a channel is infinite": lambda: _with_value(np.inf),
    "sample 0: input 'voltage' has no finite value": lambda: _first(inputs={"voltage": VOLTAGE * np.nan}),
    "settings.gear: is NaN": lambda: _first(settings={"mass": 0.1, "gear": np.nan}),
    "does not state the setting 'gear'": lambda: _first(settings={"mass": 0.1}),
    "period: is -1 s": lambda: _first(period=-1.0),
    "repeats: is 'a b'": lambda: _first(repeats="a b"),
    "letters, digits": lambda: _first(name="../x"),
    r"channels\[0\].unit: is empty": lambda: replace(
        _first(), channels=(Channel("a", ""),), recordings=(), held_out=()
    ),
    "at least 1 are needed": lambda: replace(_first(), recordings=(), held_out=()),
    "never changes": lambda: replace(arm_dataset(12), recordings=(_still(),), held_out=()),
}


def _still() -> Series:
    one = arm_dataset(12).recordings[2]
    return replace(one, values=np.ones_like(one.values))


@pytest.mark.parametrize("suffix", ["", ".zip", ".nc"])
@pytest.mark.parametrize("what", UNSAVED)
def test_what_cannot_be_read_back_is_not_written(what: str, suffix: str, tmp_path: Path) -> None:
    with shapes_unchecked(), pytest.raises(DatasetError, match=what):
        save_dataset(UNSAVED[what](), tmp_path / f"d{suffix}")
    assert list(tmp_path.iterdir()) == []


GROUP = "recordings/light-1"


def _put(name: str, data: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[f"{GROUP}/{name}"]
        file[f"{GROUP}/{name}"] = data

    return change


def _labels(*names: str) -> Callable[[h5py.File], None]:
    return _put("quantity", np.array([name.encode() for name in names], dtype=h5py.string_dtype()))


def _huge(file: h5py.File) -> None:
    del file[f"{GROUP}/value"], file[f"{GROUP}/time_s"]
    file[GROUP].create_dataset("time_s", (10**9,), "f8", chunks=(1000,))
    file[GROUP].create_dataset("value", (10**9, 4), "f8", chunks=(1000, 4))


NETCDF: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "no values": (lambda f: f.__delitem__(f"{GROUP}/value"), "'value' is missing"),
    "shape": (_put("value", np.zeros((12, 3))), "they must be [T], [C] and [T, C]"),
    "integers": (_put("value", np.zeros((12, 4), int)), "floating-point"),
    "unknown": (_labels("angle", "acceleration", "contact", "volt"), "'volt'; did you mean 'voltage'?"),
    "missing": (_labels("angle", "acceleration", "contact", "volt"), "quantity 'voltage' is missing; add it"),
    "twice": (_labels("angle", "angle", "contact", "voltage"), "'angle' appears twice; keep one"),
    "numbers for names": (_put("quantity", np.arange(4.0)), "must hold text"),
    "huge": (_huge, "1000000000 times"),
    "link": (_put("value", h5py.ExternalLink("/etc/passwd", "/x")), "is a link"),
}


def _edited(change: Callable[[h5py.File], None]) -> bytes:
    buffer = io.BytesIO(write_netcdf(arm_dataset(12)))
    with h5py.File(buffer, "r+") as file:
        change(file)
    return buffer.getvalue()


@pytest.mark.parametrize("what", NETCDF)
def test_each_mistake_of_netcdf_is_named(what: str) -> None:
    change, word = NETCDF[what]
    error = error_of_zip(_edited(change), "a.nc")
    assert error.where == f"a.nc: {GROUP}", str(error)
    assert any(word in fault.message for fault in error.errors), str(error)


def test_quantities_of_netcdf_come_in_any_order() -> None:
    def change(file: h5py.File) -> None:
        values = file[f"{GROUP}/value"][:]
        _put("value", values[:, ::-1])(file)
        _labels("voltage", "contact", "acceleration", "angle")(file)

    loaded = load_archive(_edited(change), "a.nc")
    assert np.array_equal(loaded.recordings[0].values, arm_dataset(12).recordings[0].values, equal_nan=True)


def test_the_good_files_are_good() -> None:
    assert load_archive(zipped(good_series()), "a.zip").kind == "series"
