"""Every broken description, CSV and NetCDF of a vehicle gets an error that says where, what and what to do."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.records.malformed import error_of, error_of_zip, good_files, zipped
from tests.records.samples import falcon_dataset
from tests.records.vehicles import (
    FORCES,
    YAML,
    delfly,
    delfly_dataset,
    good_vehicle,
    measured_motion,
    vehicle_csv,
    vehicle_yaml,
)
from wingfit.records import Dataset, DatasetError, LowPass, Recording, load_archive, save_dataset, wing_or_vehicle
from wingfit.records.errors import Faults
from wingfit.records.files.netcdf import write_netcdf
from wingfit.records.files.plausibility import check_numbers

Files = dict[str, bytes]
PITCH = "body_pitch_deg: 83.0"
SPLIT = "split_rad_per_beat: 0.35"
MEASURED = "cosine_deg: [-18.907607239317167, -0.5729577951308232]"
HEADER, *ROWS = good_vehicle()[FORCES].decode().splitlines()

DESCRIPTIONS = {
    # what: (old, new, in where, in message)
    "both": ("vehicle:\n", "wing: {name: a}\nvehicle:\n", [": vehicle"], ["both 'wing' and 'vehicle'", "split it"]),
    "neither": ("vehicle:\n", "aircraft:\n", [": aircraft", ": wing"], ["neither 'wing' nor 'vehicle'"]),
    "misspelt": ("vehicle:\n", "vehicel:\n", [": vehicel"], ["unknown key 'vehicel'", "'vehicle'"]),
    "lag": (PITCH, PITCH + ", phase_lag_deg: 3", ["phase_lag_deg"], ["is for a wing, this is a vehicle"]),
    "angle of attack": (PITCH, "angle_of_attack_deg: 83.0", ["angle_of_attack_deg"], ["is for a wing"]),
    "pitch": (PITCH, "body_pitch_deg: 130", ["recordings[0].body_pitch_deg"], ["[-90, 90] deg"]),
    "pitch unit": (PITCH, "body_pitch_rad: 1", ["body_pitch_rad"], ["'body_pitch_deg'"]),
    "pitch missing": (PITCH + ", ", "", ["recordings[0].body_pitch_deg"], ["missing", "add it"]),
    "markers": ("  claps: true\n", "  claps: true\n  markers: []\n", ["vehicle.markers"], ["is for a wing"]),
    "noise unit": (
        "standard_deviation_n: {x: 0.002",
        "standard_deviation_m: {x: 0.002",
        [""],
        ["'standard_deviation_n'"],
    ),
    "noise": ("{x: 0.003}", "300", ["standard_deviation_n"], ["(0, 100] N", "newtons"]),
    "noise, axis unknown": ("{x: 0.003}", "{y: 0.003}", ["standard_deviation_n.y"], ["unknown key 'y'", "x, z"]),
    "noise, axis missing": (", z: 0.005}", "}", ["recordings[2].standard_deviation_n"], ["'z' has no entry"]),
    "noise, axis not there": ("{x: 0.003}", "{x: 0.003, z: 1}", ["standard_deviation_n.z"], ["'z' is not in the"]),
    "layout": ("layout: x4", "layout: x", ["vehicle.layout"], ["'x'", "'x4', 'pair' or 'single'"]),
    "claps": ("claps: true", "claps: yes", ["vehicle.claps"], ["'yes'", "true or false"]),
    "grams": ("mass_kg: 0.0174", "mass_kg: 174", ["vehicle.mass_kg"], ["(0, 100] kg", "kilograms"]),
    "grams of a wing": ("wing_mass_kg: 0.00029", "wing_mass_kg: 0.29", ["mass_kg"], ["mass of all wings, 1.16 kg"]),
    "mass of a recording": ("mass_kg: 0.0184", "mass_kg: 0.001", ["recordings[2].mass_kg"], ["0.00116 kg"]),
    "axis": ("r_m: 0.0,", "r_m: 0.01,", ["vehicle.stations[0].r_m"], ["flapping axis", "must be 0"]),
    "stations": ("r_m: 0.0685", "r_m: 0.2", ["vehicle.stations[2].r_m"], ["0.137 m after 0.2 m", "sort"]),
    "chord": ("chord_m: 0.085", "chord_m: 0", ["vehicle.stations[0].chord_m"], ["0.0001"]),
    "pitch axis": ("pitch_axis: 0.0", "pitch_axis: 25", ["vehicle.pitch_axis"], ["[0, 1] chords", "fraction"]),
    "split": (SPLIT, "split_rad_per_beat: 3.2", ["flap.split_rad_per_beat"], ["[-12, 2.5] rad/beat", "17 % to 83 %"]),
    "split unit": (SPLIT, "split_deg_per_beat: 20", ["split_deg_per_beat"], ["'split_rad_per_beat'"]),
    "flap kind": ("kind: split_cycle", "kind: sine", ["vehicle.motion.flap"], ["'sine'", "'split_cycle', 'fourier'"]),
    "flap without kind": ("kind: split_cycle, ", "", ["vehicle.motion.flap"], ["must be split_cycle or fourier"]),
    "pitch without kind": ("kind: passive, ", "", ["vehicle.motion.pitch"], ["must be passive or fourier"]),
    "rate": ("flap_rate_s:", "flap_rate:", ["vehicle.motion.pitch.flap_rate"], ["'flap_rate_s'"]),
    "root pitch": ("    root_pitch_deg: 90.0\n", "", ["vehicle.motion.root_pitch_deg"], ["missing"]),
    "peel": ("peel_end_beats: 0.17", "peel_end_beats: 17", ["peel_end_beats"], ["(0, 0.5] beats"]),
    "shifted": (MEASURED, "cosine_deg: [18.0, 0.0]", ["recordings[2].motion.flap"], ["closest at 0.50", "100 % open"]),
    "harmonics": (MEASURED, "cosine_deg: [-18.0]", ["recordings[2].motion.flap"], ["sine_deg 2", "fill up"]),
    "order": ("order: 2", "order: 2.5", ["low_pass.order"], ["number 2.5", "1, 2, 3"]),
    "cutoff unit": ("cutoff_hz: 40.0", "cutoff_rad_s: 250", ["low_pass.cutoff_rad_s"], ["'cutoff_hz'"]),
    "cutoff below the beat": (
        "cutoff_hz: 40.0",
        "cutoff_hz: 12",
        ["recordings/slow.csv"],
        ["is 12 Hz, below the flap frequency, 12.5 Hz", "omit low_pass"],
    ),
    "cutoff": ("cutoff_hz: 40.0", "cutoff_hz: 125", ["recordings/slow.csv"], ["is 125 Hz", "sampling rate, 125 Hz"]),
    "rig": ("rig: free_flight", "rig: bath", ["recordings[2].rig"], ["'free_flight'"]),
    "velocities": ("velocities: mirrored", "velocities: other", ["vehicle.velocities"], ["'mirrored' or 'printed'"]),
    "held out": ("held_out: [fast]", "held_out: [fats]", ["held_out[0]"], ["'fast'"]),
    "beat": ("flap_frequency_hz: 13.3", "flap_frequency_hz: 3", [FORCES], ["0.68 beats", "one whole beat"]),
}


def _rows(change: Callable[[list[str]], list[str]]) -> Files:
    rows = [",".join(change(row.split(","))) for row in ROWS]
    return {**good_vehicle(), FORCES: "\n".join([HEADER, *rows, ""]).encode()}


def _scaled(factor: float) -> Files:
    return _rows(lambda row: [row[0], *(repr(factor * float(cell)) for cell in row[1:])])


def _axis(factor: float) -> Files:
    """Force z alone in another unit."""
    return _rows(lambda row: [row[0], row[1], repr(factor * float(row[2]))])


def _cell(line: int, column: int, cell: str) -> Files:
    row = ROWS[line - 2].split(",")
    row[column - 1] = cell
    return vehicle_csv(ROWS[line - 2], ",".join(row))


FILES: dict[str, tuple[Callable[[], Files], list[str], list[str]]] = {
    "word": (lambda: _cell(4, 2, "oops"), ["line 4, column 'force_x_n'"], ["'oops'", "where nothing was measured"]),
    "nan": (lambda: _cell(4, 3, "NaN"), ["line 4, column 'force_z_n'"], ["leave the cell empty where nothing"]),
    "overflow": (lambda: _cell(4, 2, "1e999"), ["line 4, column 'force_x_n'"], ["too large", "unit"]),
    "millinewtons": (lambda: vehicle_csv("force_x_n", "force_x_mn"), ["column 2"], ["'force_x_n'", "1 mN = 0.001 N"]),
    "gram-force": (lambda: vehicle_csv("force_x_n", "force_x_g"), ["column 2"], ["'force_x_n'", "0.00980665 N"]),
    "short name": (lambda: vehicle_csv("force_x_n", "Fx"), ["column 2"], ["'Fx'", "'force_x_n'", "newtons"]),
    "bare axis": (lambda: vehicle_csv("force_z_n", "Z [N]"), ["column 3"], ["'Z [N]'", "force_x_n, force_z_n"]),
    "capital": (lambda: vehicle_csv("force_z_n", "Z_N"), ["column 3"], ["'force_z_n'"]),
    "side force": (lambda: vehicle_csv("force_z_n", "force_y_n"), ["column 3"], ["side force", "remove"]),
    "lift": (lambda: vehicle_csv("force_z_n", "lift_n"), ["column 3"], ["body axes", "X = lift sin(theta)"]),
    "marker": (lambda: vehicle_csv("force_z_n", "m1_x_m"), ["column 3"], ["remove"]),
    "twice": (lambda: vehicle_csv("force_z_n", "force_x_n"), ["column 3"], ["column 2", "keep one"]),
    "time": (lambda: vehicle_csv("time_s", "time_ms"), ["column 1"], ["'time_s'", "seconds"]),
    "no force": (lambda: {**good_vehicle(), FORCES: b"time_s\n" + b"1\n" * 9}, ["line 1"], ["no column of forces"]),
    "decimal commas": (lambda: vehicle_csv("0.0,0.1", "0,0,0,1"), ["line 2"], ["5 cells", "decimal commas"]),
    "semicolons": (lambda: vehicle_csv(",", ";"), ["line 1"], ["semicolons"]),
    "values in mN": (lambda: _scaled(1e3), [FORCES], ["looks like millinewtons", "[1.706e-07, 1.706] N", "convert"]),
    "values in gf": (lambda: _scaled(101.97), [FORCES], ["force_x_n is typically", "looks like gram-force"]),
    "weak values in gf": (lambda: _scaled(0.2 * 101.97), [FORCES], ["looks like gram-force"]),
    "one axis in gf": (lambda: _axis(101.97), [FORCES], ["force_z_n is typically 3.", "looks like gram-force"]),
    "huge values": (lambda: _scaled(1e200), [FORCES], ["e+199 N (root mean square)", "looks like no unit of force"]),
    "values in MN": (lambda: _scaled(1e-7), [FORCES], ["a much larger unit", "weighs 0.1706 N"]),
    "zero": (
        lambda: _scaled(0.0),
        [FORCES],
        ["force_x_n and force_z_n are zero throughout", "leave the recording out"],
    ),
    "empty column": (lambda: _rows(lambda row: [row[0], row[1], ""]), [FORCES], ["force_z_n has no value", "remove"]),
    "nothing": (lambda: _rows(lambda row: [row[0], "", ""]), [FORCES], ["no force at all"]),
    "milliseconds": (lambda: _rows(lambda row: [repr(float(row[0]) / 1e3), *row[1:]]), [FORCES], ["0.00 beats"]),
    "lost sample": (
        lambda: vehicle_csv(ROWS[7] + "\n", ""),
        [f"{FORCES}, line 9"],
        ["0.0075188 s after", "typically 0.0037594 s", "a row with empty cells"],
    ),
    "times in ms": (lambda: _rows(lambda row: [repr(float(row[0]) * 1e3), *row[1:]]), [FORCES], ["not milliseconds"]),
    "few digits": (lambda: _rows(lambda row: [f"{float(row[0]):.3f}", *row[1:]]), [FORCES], ["more digits"]),
    "few frames": (lambda: {**good_vehicle(), FORCES: "\n".join([HEADER, *ROWS[:7]]).encode()}, [FORCES], ["7 frames"]),
}


def _assert_named(error: DatasetError, places: list[str], words: list[str]) -> None:
    for place in places:
        assert any(place in fault.where for fault in error.errors), str(error)
    for word in words:
        assert any(word in fault.message for fault in error.errors), str(error)
    assert all(fault.where and fault.message for fault in error.errors)


@pytest.mark.parametrize("what", DESCRIPTIONS)
def test_each_mistake_of_the_description_is_named(what: str, tmp_path: Path) -> None:
    old, new, places, words = DESCRIPTIONS[what]
    _assert_named(error_of(vehicle_yaml(old, new), tmp_path), places, words)


@pytest.mark.parametrize("what", FILES)
def test_each_mistake_of_the_numbers_is_named(what: str, tmp_path: Path) -> None:
    make, places, words = FILES[what]
    _assert_named(error_of(make(), tmp_path), places, words)


def test_one_force_axis_may_be_zero_if_the_other_is_not() -> None:
    read = load_archive(zipped(_axis(0.0)), "a.zip").recording("hover")
    assert not read.values[:, 1].any()
    assert read.values[:, 0].all()


@pytest.mark.parametrize(("rate_hz", "fine"), [(4.0, True), (3.8, False)])
def test_four_samples_show_a_beat(rate_hz: float, fine: bool) -> None:
    faults, recording = Faults(), delfly_dataset().recordings[0]
    slow = replace(recording, times=np.arange(60) / (rate_hz * recording.condition.flap_frequency))
    check_numbers(slow, delfly(), "hover", str, faults)
    assert [fault.message.partition(" of ")[0] for fault in faults.faults] == (
        [] if fine else ["the sampling rate is 50.54 Hz, 3.8 samples in a beat"]
    )


def test_a_single_wing_may_clap_with_a_mirror() -> None:
    files = vehicle_yaml("layout: x4", "layout: single")
    assert wing_or_vehicle(load_archive(zipped(files), "a.zip")).vehicle.claps


def test_a_wrong_unit_is_one_mistake(tmp_path: Path) -> None:
    assert error_of(vehicle_yaml(SPLIT, "split_deg_per_beat: 20"), tmp_path).count == 1


def test_a_wing_has_no_keys_of_a_vehicle(tmp_path: Path) -> None:
    text = good_files()[YAML].replace(b"phase_lag_deg:", b"body_pitch_deg: 3, phase_lag_deg:", 1)
    error = error_of({**good_files(), YAML: text}, tmp_path)
    assert error.count == 1
    assert "key 'body_pitch_deg' is for a vehicle, this is a wing" in error.message


def test_a_vehicle_that_does_not_clap_may_start_its_beat_anywhere(tmp_path: Path) -> None:
    files = vehicle_yaml(MEASURED, "cosine_deg: [18.0, 0.0]")
    files[YAML] = files[YAML].replace(b"claps: true", b"claps: false").replace(b"held_out: [fast]", b"held_out: [x]")
    assert error_of(files, tmp_path).count == 1


def _first(**changes: object) -> Dataset:
    dataset = delfly_dataset()
    first = replace(dataset.recordings[0], **changes)  # type: ignore[arg-type]
    return replace(dataset, recordings=(first, *dataset.recordings[1:]))


def _wing_with(**changes: object) -> Dataset:
    dataset = falcon_dataset(12)
    return replace(dataset, recordings=(replace(dataset.recordings[0], **changes),))  # type: ignore[arg-type]


def _condition(recording: Recording, **changes: float) -> Dataset:
    return _first(condition=replace(recording.condition, **changes))


UNSAVED: dict[str, Callable[[], Dataset]] = {
    "phase_lag: has no place": lambda: _condition(delfly_dataset().recordings[0], phase_lag=0.1),
    "body_pitch_deg: is 114": lambda: _condition(delfly_dataset().recordings[0], angle_of_attack=2.0),
    "markers: has no place": lambda: _first(markers=("m1",)),
    "must be one of": lambda: _first(forces=("z", "x")),
    r"float64 \[60, 1\]": lambda: _first(forces=("x",)),
    "forces: has no place": lambda: _wing_with(forces=("x",)),
    "low_pass: has no place": lambda: _wing_with(low_pass=LowPass(10.0)),
    "motion: has no place": lambda: _wing_with(motion=measured_motion()),
    "mass: has no place": lambda: _wing_with(mass=1.0),
    "neither|forces": lambda: replace(falcon_dataset(12), recordings=delfly_dataset().recordings, held_out=()),
}


@pytest.mark.parametrize("what", UNSAVED)
def test_what_would_be_lost_is_not_written(what: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=what):
        save_dataset(UNSAVED[what](), tmp_path / "d.zip")
    assert list(tmp_path.iterdir()) == []


GROUP = "recordings/hover"


def _put(name: str, data: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[f"{GROUP}/{name}"]
        file[f"{GROUP}/{name}"] = data

    return change


def _huge(file: h5py.File) -> None:
    del file[f"{GROUP}/force_n"], file[f"{GROUP}/time_s"]
    file[GROUP].create_dataset("time_s", (10**9,), "f8", chunks=(1000,))
    file[GROUP].create_dataset("force_n", (10**9, 2), "f8", chunks=(1000, 2))


NETCDF: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "no forces": (lambda f: f.__delitem__(f"{GROUP}/force_n"), "'force_n' is missing"),
    "shape": (_put("force_n", np.zeros((60, 3))), "they must be [T], [C] and [T, C]"),
    "integers": (_put("force_n", np.zeros((60, 2), int)), "floating-point"),
    "axis": (_put("axis", np.array([b"x", b"y"], dtype=h5py.string_dtype())), "must hold x, z, or both"),
    "axis twice": (_put("axis", np.array([b"x", b"x"], dtype=h5py.string_dtype())), "must hold x, z, or both"),
    "axes as numbers": (_put("axis", np.arange(2.0)), "must hold text"),
    "huge": (_huge, "1000000000 times"),
    "link": (_put("force_n", h5py.ExternalLink("/etc/passwd", "/x")), "is a link"),
}


@pytest.mark.parametrize("what", NETCDF)
def test_each_mistake_of_netcdf_is_named(what: str) -> None:
    change, word = NETCDF[what]
    buffer = io.BytesIO(write_netcdf(delfly_dataset()))
    with h5py.File(buffer, "r+") as file:
        change(file)
    error = error_of_zip(buffer.getvalue(), "a.nc")
    assert error.where == f"a.nc: {GROUP}", str(error)
    assert word in error.message, str(error)
