"""Every broken track file gets an error that names line, column, value and remedy."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.records.malformed import TRACKS, cells, edited, error_of, good_files, with_csv, with_yaml
from wingfit.records.errors import DatasetError
from wingfit.records.files.tracks import read_tracks
from wingfit.records.limits import MAX_ERRORS, MAX_ROWS

Files = dict[str, bytes]
GOOD = good_files()[TRACKS]
HEADER = GOOD.decode().splitlines()[0]


def _scaled(factor: float, columns: tuple[int, ...] = tuple(range(1, 37))) -> Files:
    header, *rows = GOOD.decode().splitlines()
    scaled = [
        [repr(float(c) * factor) if k in columns and c else c for k, c in enumerate(row.split(","))] for row in rows
    ]
    return {**good_files(), TRACKS: "\n".join([header, *(",".join(r) for r in scaled), ""]).encode()}


CASES: dict[str, tuple[Callable[[], Files], list[str], list[str]]] = {
    "word": (lambda: edited(4, 3, "oops"), ["line 4, column 'm1_y_m'"], ["'oops'", "number"]),
    "nan": (lambda: edited(5, 2, "NaN"), ["line 5, column 'm1_x_m'"], ["'NaN'", "leave the cell empty"]),
    "spaced nan": (lambda: edited(5, 2, " nan "), ["line 5, column 'm1_x_m'"], ["leave the cell empty"]),
    "inf": (lambda: edited(5, 2, "-inf"), ["line 5, column 'm1_x_m'"], ["'-inf'", "finite"]),
    "overflow": (lambda: edited(5, 2, "1e999"), ["line 5, column 'm1_x_m'"], ["too large"]),
    "underscore": (lambda: edited(5, 2, "1_0"), ["line 5, column 'm1_x_m'"], ["'1_0'"]),
    "digits of another script": (lambda: edited(5, 2, "٣"), ["line 5, column 'm1_x_m'"], ["number"]),
    "hex": (lambda: edited(5, 2, "0x1p3"), ["line 5, column 'm1_x_m'"], ["number"]),
    "two points": (lambda: edited(5, 2, "0.1.2"), ["line 5, column 'm1_x_m'"], ["'0.1.2'"]),
    "no time": (lambda: edited(6, 1, ""), [f"{TRACKS}, line 6"], ["time_s is missing"]),
    "time repeated": (lambda: edited(6, 1, cells(5)[0]), [f"{TRACKS}, line 6"], ["the same as", "increase"]),
    "time backwards": (lambda: edited(6, 1, "-1.0"), [f"{TRACKS}, line 6"], ["before the one above", "sort"]),
    "short row": (lambda: with_csv({7: "0.5,0.1"}), [f"{TRACKS}, line 7"], ["has 2 cells where the header has 37"]),
    "long row": (lambda: with_csv({7: ",".join([*cells(7), "1"])}), [f"{TRACKS}, line 7"], ["has 38 cells"]),
    "truncated": (lambda: {**good_files(), TRACKS: GOOD[:-200]}, [f"{TRACKS}, line 13"], ["cut off"]),
    "empty": (lambda: {**good_files(), TRACKS: b""}, [TRACKS], ["empty", "8 rows"]),
    "blank": (lambda: {**good_files(), TRACKS: b"\n \n"}, [TRACKS], ["empty"]),
    "empty first line": (lambda: {**good_files(), TRACKS: b"\n" + GOOD}, ["line 1"], ["is empty", "'time_s' first"]),
    "header only": (lambda: {**good_files(), TRACKS: HEADER.encode()}, [TRACKS], ["0 frames", "8 to 200000"]),
    "few frames": (lambda: {**good_files(), TRACKS: b"\n".join(GOOD.splitlines()[:8])}, [TRACKS], ["7 frames"]),
    "column twice": (lambda: with_csv(old="m2_x_m", new="m1_x_m"), ["line 1, column 5"], ["column 2", "keep one"]),
    "column missing": (lambda: with_csv(old="m2_x_m", new="m99_x_m"), ["line 1, column 5"], ["'m99'"]),
    "axis missing": (
        lambda: {**good_files(), TRACKS: b"\n".join(b",".join(r.split(b",")[:-1]) for r in GOOD.splitlines())},
        ["line 1"],
        ["'m12_z_m' is missing"],
    ),
    "no time column": (lambda: with_csv(old="time_s,", new="m1_q_m,"), ["line 1, column 1"], ["unknown column"]),
    "time in ms": (lambda: with_csv(old="time_s,", new="time_ms,"), ["line 1, column 1"], ["'time_s'", "seconds"]),
    "no time at all": (
        lambda: {**good_files(), TRACKS: b"\n".join(b",".join(r.split(b",")[1:]) for r in GOOD.splitlines())},
        ["line 1"],
        ["'time_s' is missing"],
    ),
    "no marker": (lambda: {**good_files(), TRACKS: b"time_s\n" + b"1\n" * 9}, ["line 1"], ["no column of", "m1_x_m"]),
    "millimetre column": (lambda: with_csv(old="m2_x_m", new="m2_x_mm"), ["line 1, column 5"], ["'m2_x_m'", "metres"]),
    "unknown marker": (lambda: with_csv(old="m12_", new="m112_"), ["line 1, column 35"], ["'m112'", "'m12'"]),
    "unknown column": (lambda: with_csv(old="m2_x_m", new="force"), ["line 1, column 5"], ["'force'", "remove"]),
    "nameless column": (lambda: with_csv(old="m12_z_m", new=""), ["line 1, column 37"], ["no name"]),
    "semicolons": (lambda: with_csv(old=",", new=";"), ["line 1"], ["semicolons", "commas"]),
    "tabs": (lambda: with_csv(old=",", new="\t"), ["line 1"], ["tabs"]),
    "latin-1": (lambda: {**good_files(), TRACKS: GOOD.replace(b"m2_x", b"m\xe9_x")}, ["line 1"], ["UTF-8"]),
    "utf-16": (lambda: {**good_files(), TRACKS: GOOD.decode().encode("utf-16")}, ["line 1"], ["UTF-8"]),
    "nul": (lambda: edited(5, 2, "\0"), ["line 5"], []),
    "stray quote": (lambda: edited(5, 2, '"1'), [TRACKS], []),
    "millimetres": (lambda: _scaled(1000.0), [TRACKS], ["millimetres", "span", "convert to metres"]),
    "one marker in millimetres": (
        lambda: _scaled(1000.0, (4, 5, 6)),
        [TRACKS],
        ["marker m2 is typically", "m from the hinge, the others 0.", "leave it out"],
    ),
    "centimetres": (lambda: _scaled(100.0), [TRACKS], ["looks like centimetres"]),
    "feet": (lambda: _scaled(3.28084), [TRACKS], ["looks like feet"]),
    "all empty": (
        lambda: {**good_files(), TRACKS: "\n".join([HEADER, *(f"{k}" + "," * 36 for k in range(9))]).encode()},
        [TRACKS],
        ["no position at all"],
    ),
    "not there": (
        lambda: {k: v for k, v in good_files().items() if k != TRACKS},
        ["dataset.yaml, line", "recordings[0].name"],
        [f"file '{TRACKS}' is missing"],
    ),
    "elsewhere": (
        lambda: {("Vacuum-2Hz.csv" if k == TRACKS else k): v for k, v in good_files().items()},
        ["recordings[0].name"],
        ["found 'Vacuum-2Hz.csv'"],
    ),
    "not listed": (lambda: {**good_files(), "recordings/new.csv": GOOD}, ["recordings/new.csv"], ["'- name: new'"]),
    "renamed": (
        lambda: with_yaml("name: vacuum-2hz", "name: vacuum-2-hz"),
        ["recordings[0].name", TRACKS],
        ["found 'recordings/vacuum-2hz.csv'", "is not listed"],
    ),
}


@pytest.mark.parametrize("what", CASES)
def test_each_mistake_is_named(what: str, tmp_path: Path) -> None:
    make, places, words = CASES[what]
    error = error_of(make(), tmp_path)
    for place in places:
        assert any(place in fault.where for fault in error.errors), str(error)
    for word in words:
        assert any(word in fault.message for fault in error.errors), str(error)


def test_several_cells_and_files_are_reported_at_once(tmp_path: Path) -> None:
    files = edited(4, 3, "oops")
    other = "recordings/vacuum-3hz.csv"
    files[other] = files[other].replace(b"m2_x_m", b"m2_x_cm")
    error = error_of(files, tmp_path)
    assert [fault.where.partition(",")[0] for fault in error.errors] == [TRACKS, other]
    assert error.value == "oops"


def test_the_number_of_mistakes_shown_is_bounded(tmp_path: Path) -> None:
    error = error_of({**good_files(), TRACKS: GOOD.replace(b".", b"x")}, tmp_path)
    assert len(error.errors) == MAX_ERRORS


def test_too_many_rows() -> None:
    text = b"time_s,m1_x_m,m1_y_m,m1_z_m\n" + b"".join(b"%d,0,0,0\n" % k for k in range(MAX_ROWS + 1))
    with pytest.raises(ValueError, match="more than 200000 rows"):
        read_tracks(text, "f.csv", ["m1"])


def test_too_many_numbers() -> None:
    text = b"time_s,m1_x_m,m1_y_m,m1_z_m\n" + b"".join(b"%d,0,0,0\n" % k for k in range(20))
    with pytest.raises(ValueError, match="split it or thin it out"):
        read_tracks(text, "f.csv", ["m1"], room=40)


def test_a_header_of_100_000_columns_is_refused_before_its_names_are_compared() -> None:
    header = ",".join(["time_s", *(f"n{k}_x_m" for k in range(100_000))])
    began = time.process_time()
    with pytest.raises(DatasetError) as refused:
        read_tracks(f"{header}\n".encode(), "f.csv", [f"m{k}" for k in range(50)])
    assert time.process_time() - began < 1.0, "comparing each name with those of the markers takes seconds"
    assert refused.value.count == 1
    assert "f.csv, line 1: has 100001 columns; at most 3001 columns are read: remove" in str(refused.value)


def test_many_wrong_names_of_columns_are_compared_until_the_report_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[str] = []

    def nearest(name: str, _: object) -> str:
        compared.append(name)
        return "known: m1"

    monkeypatch.setattr("wingfit.records.files.tracks.nearest", nearest)
    header = ",".join(["time_s", *(f"n{k}_x_m" for k in range(2000))])
    with pytest.raises(DatasetError):
        read_tracks(f"{header}\n".encode(), "f.csv", ["m1"])
    assert len(compared) == MAX_ERRORS


@pytest.mark.parametrize("change", [("\n", "\r\n"), (",", " , "), ("time_s", "\ufefftime_s")])
def test_harmless_differences_change_nothing(change: tuple[str, str]) -> None:
    markers = [f"m{k}" for k in range(1, 13)]
    plain = read_tracks(GOOD, "f.csv", markers)
    other = read_tracks(GOOD.decode().replace(*change).encode(), "f.csv", markers)
    assert plain.values.tobytes() == other.values.tobytes()
    assert plain.times.tobytes() == other.times.tobytes()


def test_columns_may_come_in_any_order_and_blank_lines_are_skipped() -> None:
    text = "b_z_m,time_s,b_x_m,a_y_m,b_y_m,a_x_m,a_z_m\n\n" + "".join(f"6,{k},4,2,5,1,3\n\n" for k in range(8))
    tracks = read_tracks(text.encode(), "f.csv", ["a", "b"])
    assert tracks.markers == ("b", "a")
    assert tracks.values[0].tolist() == [4, 5, 6, 1, 2, 3]
    assert tracks.times.tolist() == list(range(8))
    assert tracks.lines.tolist() == [3, 5, 7, 9, 11, 13, 15, 17]
