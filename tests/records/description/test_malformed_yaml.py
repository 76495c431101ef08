"""Every broken description gets an error that says where, what and what to do."""

from __future__ import annotations

import pickle
import random
from pathlib import Path

import pytest

from tests.records.malformed import YAML, error_of, error_of_zip, good_files, with_yaml, zipped
from wingfit.records import DatasetError
from wingfit.records.description.yaml_text import read_yaml
from wingfit.records.limits import MAX_DESCRIPTION_BYTES, MAX_ERRORS, MIB

FREQUENCY = "flap_frequency_hz: 2.0"
STATION = "{y_m: 0.2, leading_edge_m: -0.075, chord_m: 0.21, thickness_m: 0.011}"
MARKER = "{name: m2, x_m: 0.044, y_m: 0.06, z_m: 0.00585, mass_kg: 0.0002}"
FOUR_BAR = (
    "kind: four_bar\n    ground_m: 0.06\n    crank_m: {}\n    coupler_m: {}\n    rocker_m: 0.03\n    offset_deg: 0"
)

CASES = {
    # what: (old, new, in where, in message)
    "syntax": ("wing:\n", "wing: [\n", ["dataset.yaml, line "], ["not valid YAML"]),
    "tab": ("  name: falcon", "\tname: falcon", ["dataset.yaml, line 5"], ["not valid YAML"]),
    "control character": ("name: falcon", 'name: "fal\x01con"', ["dataset.yaml"], ["control characters"]),
    "repeated key": ("name: falcon", "name: a\nname: b", ["dataset.yaml, line 3"], ["'name'", "line 2", "keep one"]),
    "alias": ("hinge: {", "hinge: &h {", ["dataset.yaml, line"], ["anchors and aliases", "write the values out"]),
    "tag": ("name: falcon", "name: !!python/name:os.system falcon", ["line 2"], ["tag", "plain value"]),
    "two documents": ("held_out:", "---\nheld_out:", ["dataset.yaml, line"], ["second YAML document"]),
    "deep": ("cosine_deg: [0.0", "cosine_deg: [" + "[" * 3000, ["line"], ["nested deeper than 12"]),
    "unknown key": ("wing:\n", "wng: 3\nwing:\n", ["line 4", ": wng"], ["unknown key 'wng'", "'wing'"]),
    "unknown inner key": (
        "chord_m: 0.21,",
        "chord_m: 0.21, thicknes: 2,",
        ["line 8", "wing.stations[1].thicknes"],
        ["unknown key", "'thickness_m'"],
    ),
    "wrong unit": (
        FREQUENCY,
        "flap_frequency_rad_s: 12.6",
        ["recordings[0].flap_frequency_rad_s"],
        ["unknown key 'flap_frequency_rad_s'", "'flap_frequency_hz'"],
    ),
    "no unit": (FREQUENCY, "flap_frequency: 2", ["recordings[0].flap_frequency"], ["'flap_frequency_hz'"]),
    "kelvin": ("temperature_c: 20.0", "temperature_k: 293", ["temperature_k"], ["'temperature_c'"]),
    "missing": (", " + FREQUENCY, "", ["line", "recordings[0].flap_frequency_hz"], ["missing", "add it"]),
    "text for a number": (FREQUENCY, "flap_frequency_hz: fast", ["flap_frequency_hz"], ["'fast'", "number"]),
    "unit in the value": (FREQUENCY, "flap_frequency_hz: 2 Hz", ["flap_frequency_hz"], ["'2 Hz'", "without"]),
    "quoted": (FREQUENCY, 'flap_frequency_hz: "2"', ["flap_frequency_hz"], ["quotes"]),
    "decimal comma": ("y_m: 0.2,", 'y_m: "0,2",', ["wing.stations[1].y_m"], ["decimal point"]),
    "nan": (FREQUENCY, "flap_frequency_hz: .nan", ["flap_frequency_hz"], [".nan", "finite"]),
    "inf": (FREQUENCY, "flap_frequency_hz: inf", ["flap_frequency_hz"], ["inf", "finite"]),
    "huge": (FREQUENCY, "flap_frequency_hz: 1e999999", ["flap_frequency_hz"], ["[0.01, 1000] Hz"]),
    "many digits": (FREQUENCY, "flap_frequency_hz: " + "9" * 5000, ["line"], ["5000", "round it"]),
    "boolean": (FREQUENCY, "flap_frequency_hz: true", ["flap_frequency_hz"], ["true", "number"]),
    "empty value": (FREQUENCY, "flap_frequency_hz: ", ["flap_frequency_hz"], ["is empty"]),
    "pascal": ("pressure_mbar: 10.0", "pressure_mbar: 101325", ["pressure_mbar"], ["20000] mbar", "1 mbar = 100 Pa"]),
    "kelvin value": ("temperature_c: 20.0", "temperature_c: 293.15", ["temperature_c"], ["293.15 °C", "Celsius"]),
    "millimetres": ("chord_m: 0.21", "chord_m: 210", ["chord_m"], ["is 210.0 m", "[0.0001, 5] m", "metres"]),
    "zero thickness": ("thickness_m: 0.011", "thickness_m: 0", ["thickness_m"], ["(0, 0.5] m"]),
    "number as a name": ("name: m2,", "name: 2,", ["wing.markers[1].name"], ["quotes"]),
    "path as a name": ("name: vacuum-2hz", "name: ../../etc", ["recordings[0].name"], ["letters, digits"]),
    "list for a mapping": ("hinge: {y_m: -0.04, z_m: 0.0}", "hinge: [1, 2]", ["wing.hinge"], ["a mapping"]),
    "text for a list": ("held_out: [vacuum-3hz, tunnel-4hz-8]", "held_out: all", ["held_out"], ["a list"]),
    "rig": ("rig: vacuum_chamber", "rig: bath", ["recordings[0].rig"], ["'bath'", "'vacuum_chamber'"]),
    "version": ("format_version: 1", "format_version: 2", ["format_version"], ["number 2", "must be 1"]),
    "drive kind": ("kind: fourier", "kind: cam", ["wing.drive"], ["'cam'", "'fourier', 'four_bar'"]),
    "drive kind missing": ("kind: fourier", "mode: 1", ["wing.drive"], ["'kind' is missing"]),
    "harmonics": ("\n    sine_deg: [", "\n    sine_deg: [1.0, ", ["wing.drive"], ["sine_deg 3", "fill up with 0"]),
    "drive unit": ("mean_deg: 5.0", "mean_rad: 0.1", ["wing.drive.mean_rad"], ["'mean_deg'"]),
    "one station": ("stations:", "stations: []\n  was:", ["wing.stations"], ["at least 2"]),
    "stations": (STATION, STATION.replace("0.2,", "0.4,"), ["wing.stations[2].y_m"], ["0.35 m after 0.4 m"]),
    "marker outside": (MARKER, MARKER.replace("0.044", "0.20"), ["wing.markers[1]"], ["mm outside", "10 mm"]),
    "marker twice": ("name: m2,", "name: m1,", ["wing.markers[1].name"], ["'m1'", "second time"]),
    "rod twice": ("name: rear,", "name: front,", ["wing.rods[1].name"], ["'front'", "second time"]),
    "rod point": ("x_tip_m: 0.04, y_tip_m: 0.44", "x_tip_m: 0.07, y_tip_m: 0", ["wing.rods[1]"], ["same point"]),
    "driven rod": ("driven_rods: [front, rear]", "driven_rods: [front, back]", ["driven_rods[1]"], ["'back'"]),
    "driven twice": ("driven_rods: [front, rear]", "driven_rods: [rear, rear]", ["driven_rods[1]"], ["second time"]),
    "three driven": ("[front, rear]", "[front, rear, front]", ["driven_rods"], ["more than 2"]),
    "reference": ("reference_markers: [m1,", "reference_markers: [m99,", ["reference_markers[0]"], ["'m99'"]),
    "held out": ("held_out: [vacuum-3hz", "held_out: [vacuum-3h", ["held_out[0]"], ["'vacuum-3hz'"]),
    "recording twice": ("name: vacuum-3hz", "name: vacuum-2hz", ["recordings[1].name"], ["second time"]),
    "recording case": ("name: vacuum-3hz", "name: Vacuum-2hz", ["recordings[1].name"], ["only by case"]),
    "gene name": ("E_f:", "E f:", ["wing.estimates"], ["gene name"]),
    "noise": (FREQUENCY, FREQUENCY + ", standard_deviation_m: 0.5", ["standard_deviation_m"], ["(0, 0.1] m"]),
    "noise, two axes": (
        FREQUENCY,
        FREQUENCY + ", standard_deviation_m: {m1: [0.001, 0.001]}",
        ["standard_deviation_m.m1"],
        ["2 entries"],
    ),
    "correlations without noise": (
        FREQUENCY,
        FREQUENCY + ", noise_correlation: {m1: [0.1, 0.1, 0.1]}",
        ["recordings[0]"],
        ["needs standard_deviation_m"],
    ),
    "correlations, one of two": (
        FREQUENCY,
        FREQUENCY + ", standard_deviation_m: 0.001, noise_correlation: {m1: [0.1, 0.1, 0.1]}",
        ["recordings[0].noise_correlation"],
        ["'m2' has no entry", "[xy, xz, yz]"],
    ),
    "correlation of one": (
        FREQUENCY,
        FREQUENCY + ", standard_deviation_m: 0.001, noise_correlation: {m1: [1.0, 0, 0], m2: [0, 0, 0]}",
        ["recordings[0].noise_correlation.m1[0]"],
        ["[-0.9999, 0.9999]"],
    ),
    "correlations that contradict each other": (
        FREQUENCY,
        FREQUENCY + ", standard_deviation_m: 0.001, noise_correlation: {m1: [0.9, 0.9, -0.9], m2: [0, 0, 0]}",
        ["recordings[0]"],
        ["'m1'", "no noise can have", "least eigenvalue"],
    ),
    "noise, marker missing": (
        FREQUENCY,
        FREQUENCY + ", standard_deviation_m: {m1: [0.001, 0.001, 0.001]}",
        ["recordings[0].standard_deviation_m"],
        ["'m2' has no entry"],
    ),
    "noise, unknown marker": (
        FREQUENCY,
        FREQUENCY + ", standard_deviation_m: {m111: [0.001, 0.001, 0.001]}",
        ["recordings[0].standard_deviation_m.m111"],
        ["'m111'", "'m11'"],
    ),
}


@pytest.mark.parametrize("what", CASES)
def test_each_mistake_is_named(what: str, tmp_path: Path) -> None:
    old, new, places, words = CASES[what]
    error = error_of(with_yaml(old, new), tmp_path)
    for place in places:
        assert any(place in fault.where for fault in error.errors), str(error)
    for word in words:
        assert any(word in fault.message for fault in error.errors), str(error)
    assert all(fault.where and fault.message for fault in error.errors)


def test_a_wrong_unit_is_one_mistake(tmp_path: Path) -> None:
    assert error_of(with_yaml(FREQUENCY, "flap_frequency_rad_s: 12.6"), tmp_path).count == 1


def test_line_and_column_point_at_the_key(tmp_path: Path) -> None:
    error = error_of(with_yaml("chord_m: 0.21", "chord_m: 210"), tmp_path)
    line, column = 8, good_files()[YAML].decode().splitlines()[7].index("chord_m") + 1
    assert error.where == f"dataset.yaml, line {line}, column {column}: wing.stations[1].chord_m"
    assert error.value == "210"


@pytest.mark.parametrize(
    ("crank", "coupler", "word"), [(0.04, 0.055, "crank_m is 0.04 m"), (0.02, 0.04, "0.08 m"), (0.02, 0.05, "0.08 m")]
)
def test_a_crank_that_cannot_turn_is_refused(crank: float, coupler: float, word: str, tmp_path: Path) -> None:
    text = good_files()[YAML].decode()
    start, end = text.index("    kind: fourier"), text.index("  estimates:")
    drive = "    " + FOUR_BAR.format(crank, coupler) + "\n"
    error = error_of({**good_files(), YAML: (text[:start] + drive + text[end:]).encode()}, tmp_path)
    assert word in error.message
    assert "Grashof" in error.message
    assert error.where.endswith("wing.drive")


def test_several_mistakes_come_at_once(tmp_path: Path) -> None:
    files = with_yaml("chord_m: 0.21", "chord_m: 210")
    files[YAML] = files[YAML].replace(b"temperature_c: 20.0", b"temperature_c: 293.15")
    error = error_of(files, tmp_path)
    assert [fault.where.rpartition(": ")[2] for fault in error.errors] == [
        "wing.stations[1].chord_m",
        "recordings[0].temperature_c",
        "recordings[1].temperature_c",
    ]
    assert str(error).count("\n") == 2


def test_the_number_of_mistakes_shown_is_bounded(tmp_path: Path) -> None:
    files = dict(good_files())
    files[YAML] = files[YAML].replace(b"_m:", b"_mm:")
    error = error_of(files, tmp_path)
    assert len(error.errors) == MAX_ERRORS
    assert str(error).endswith(f"and {error.count - MAX_ERRORS} more")


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (b"", ["empty"]),
        (b"# nothing\n", ["empty"]),
        (b"just text\n", ["a mapping"]),
        (b"- a\n- b\n", ["a mapping"]),
        (b"name: f\xe9\n", ["0xe9", "UTF-8"]),
        ("name: é\n".encode("utf-16"), ["UTF-8"]),
        (b"a: &a [1]\nb: [*a, *a]\n", ["anchors and aliases"]),
        (b"? [1, 2]\n: 3\n", ["plain name"]),
        (b"a: " + random.Random(1).randbytes(MAX_DESCRIPTION_BYTES), ["16 MiB"]),  # noqa: S311
    ],
)
def test_files_that_are_no_description(raw: bytes, words: list[str], tmp_path: Path) -> None:
    error = error_of({**good_files(), YAML: raw}, tmp_path)
    assert error.where.startswith(YAML)
    assert all(word in error.message for word in words), str(error)


def test_aliases_do_not_blow_up() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12)]
    error = error_of_zip(zipped({YAML: "\n".join(lines).encode()}))
    assert "aliases" in error.message


def test_the_error_survives_a_process_boundary() -> None:
    error = error_of_zip(zipped({YAML: b""}))
    again = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert isinstance(again, DatasetError)
    assert (again.errors, str(again)) == (error.errors, str(error))


def test_very_many_items_are_refused_before_they_take_memory() -> None:
    raw = b"a: [" + b"1," * (7 * MIB) + b"]"
    with pytest.raises(DatasetError, match="more than 250000 keys, items and values; put samples in CSV"):
        read_yaml(raw, YAML)
