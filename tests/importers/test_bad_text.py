"""Text that is no table of tracks: each error has line, column, value and remedy."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.importers.reading import read, refused, table
from tests.oracles.track_files import flapping, text_writers
from wingfit import DatasetError, import_tracks
from wingfit.importers import numbers


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("abc", "must be a number"),
        ("inf", "must be a finite number"),
        ("-Infinity", "must be a finite number"),
        ("1e999", "too large"),
        ("1'234.5", "separator of thousands"),
        ("1 234.5", "separator of thousands"),
        ("1_000", "must be a number"),
        ("0x1F", "must be a number"),
        ("٣", "must be a number"),
        ("9" * 500, "500 characters"),
    ],
)
def test_a_cell_that_is_no_number_is_named_with_its_place(cell: str, words: str) -> None:
    message = refused(table(r3c2=cell))
    assert "file.dat, line 5, column 'tip_y_mm'" in message
    assert words in message


@pytest.mark.parametrize(
    "word", ["NaN", "nan", " NaN ", "NA", "n/a", "NULL", "None", "-", "--", "#N/A", "-nan(ind)", "1.#QNAN0", "-1.#IND"]
)
def test_not_a_number_has_many_spellings(word: str) -> None:
    gaps = read(table(r3c1=word, r3c2=word, r3c3=word)).gaps
    assert (gaps.nan, gaps.total) == (1, 1)


def test_several_errors_are_reported_at_once() -> None:
    message = refused(table(r1c1="a", r4c2="b", r6c3="1e999"))
    assert [f"line {n}" in message for n in (3, 6, 8)] == [True] * 3


@pytest.mark.parametrize(("separator", "name"), [(";", "semicolons"), ("\t", "tabs")])
def test_decimal_commas_are_read_if_they_are_stated(separator: str, name: str) -> None:
    del name
    content = table().replace(",", separator).replace(".", ",")
    message = refused(content)
    assert "--decimal comma" in message
    assert "line 2, column 'tip_x_mm'" in message
    assert read(content, decimal="comma").positions[2, 0, 0] == 0.0025
    mixed = content.replace("2,5", "2.5")
    assert "with a decimal point" in refused(mixed, decimal="comma")
    assert "separator of thousands" in refused(content.replace("2,5", "1.234,5"), decimal="comma")


def test_decimal_commas_in_a_comma_separated_file_are_explained() -> None:
    content = table().replace("-3", "-3,0")
    assert "has 5 cells where the header has 4; decimal commas" in refused(content)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(encoding: str, end: str) -> None:
    assert read(table().replace("\n", end).encode(encoding)).positions[4, 0, 0] == 0.0045


def test_another_encoding_is_named_with_its_line() -> None:
    message = refused(table(header="time_s,spitze_flügel_x_m,b,c").encode("latin-1"))
    assert "line 1" in message
    assert "UTF-8" in message


def test_a_file_that_is_cut_off_is_refused() -> None:
    assert "line 11: has 2 cells where the header has 4; the line is cut off" in refused(table()[:-12])
    whole = text_writers.trc(flapping())
    lines = whole.splitlines(keepends=True)
    message = refused("".join(lines[:-5]))
    assert "has 55 frames, but states 60 (line 3, NumFrames), so it is cut off" in message
    assert len(read("".join(lines[:-5]), incomplete=True).times) == 55
    sparse = text_writers.dltdv_sparse(flapping()).splitlines(keepends=True)
    options = {"unit": "m", "rate_hz": 240.0, "format": "dltdv-sparse"}
    assert "cut off" in refused("".join(sparse[:-5]), **options)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty (0 bytes)"),
        (b"\n\n", "empty"),
        (b"time_s,a_x_m,a_y_m,a_z_m\n", "no frames"),
        (b"time_s,a_x_m,a_y_m,a_z_m\n0,1,2,3\n", "has 1 frame; at least 8"),
        (b"0,1,2,3\n1,1,2,3\n", "numbers instead of names"),
        (b"hello world\nthis is text\n", "has one column"),
        (b"time_s,a_x_m,a_x_m,a_z_m\n0,1,2,3\n", "is also column 2"),
        (b"time_s,a_x_m,a_y_m\n0,1,2\n", "triangulate"),
        (b"time_s,a_x_m,a_y_m,a_z_m,b_x_m,b_y_m\n0,1,2,3,4,5\n", "has no column for z"),
        (b"time_s,t_ms,a_x_m,a_y_m,a_z_m\n0,0,1,2,3\n", "second column of times"),
        (
            b"time_s,a_x_m,a_y_m,a_z_m,b_x_mm,b_y_mm,b_z_mm\n" + b"0,1,2,3,4,5,6\n",
            "m, mm (as in 'a_x_m', 'b_x_mm'); write all in one unit",
        ),
        (b"time_s,a_x_px,a_y_px,a_z_px\n" + b"".join(b"%d,1,2,3\n" % t for t in range(9)), "triangulate"),
        (b'time_s,a_x_m,a_y_m,a_z_m\n0,"1,2,3\n1,2,3,4\n', "stray quotes"),
        (bytes(range(256)) * 8, "binary"),
        (b"\0" * 4000, "binary"),
        (b"PK\x03\x04" + b"\0" * 99, "Excel workbook"),
        (b"MATLAB 5.0 MAT-file" + b"\0" * 99, "MATLAB"),
        (b"\x89HDF\r\n\x1a\n" + b"\0" * 99, "not a readable HDF5 file"),
    ],
)
def test_what_is_no_table_of_tracks_is_refused(content: bytes, words: str) -> None:
    assert words in refused(content)


def test_an_empty_line_between_numbers_is_refused_where_it_would_shift_frames() -> None:
    lines = text_writers.dltdv(flapping()).splitlines(keepends=True)
    message = refused("".join([*lines[:9], "\n", *lines[9:]]), unit="m", rate_hz=240)
    assert "line 10: is empty" in message
    assert len(read("".join([*lines, "\n\n"]), unit="m", rate_hz=240).times) == 60


def test_a_position_that_is_too_far_away_is_refused() -> None:
    message = refused(table(r4c1="2e10"))
    assert "line 6, marker 'tip', x" in message
    assert "at most 10000 m" in message


def test_options_with_wrong_values_are_listed_at_once() -> None:
    message = refused(table(), unit="furlong", time_unit="h", format="xls", decimal="dot", axes="up")
    assert all(option in message for option in ("--unit", "--time-unit", "--format", "--decimal", "--axes"))


def test_a_file_that_is_too_large_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "large.csv"
    with path.open("wb") as file:
        file.truncate(300 * 2**20)
    with pytest.raises(DatasetError, match=r"has 300 MiB; at most 256 MiB"):
        import_tracks(path)
    with pytest.raises(DatasetError, match="is a folder"):
        import_tracks(tmp_path)
    with pytest.raises(DatasetError, match="cannot be read: No such file"):
        import_tracks(tmp_path / "none.csv")


def test_what_a_hostile_text_can_cost_is_limited() -> None:
    started = time.process_time()
    assert "at most 20000 cells" in refused("a," * 400_000)
    assert "characters" in refused(table() + " " * 2_000_000 + ",1\n")
    assert "no columns of markers" in refused("_" * 100_000 + "x," + "-" * 100_000 + "\n1,2\n")
    assert "stray quotes" in refused(table() + '"' + "1\n" * 200_000)
    assert time.process_time() - started < 5


def test_sizes_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as lower:
        lower.setattr(numbers, "MAX_ROWS", 1000)
        assert "at most 1000 frames" in refused("x,y,z\n" + "1,2,3\n" * 1001, unit="m", rate_hz=1)
        assert len(read("x,y,z\n" + "1,2,3\n" * 1000, unit="m", rate_hz=1).times) == 1000
    wide = ",".join(f"m{k}_{axis}_m" for k in range(1001) for axis in "xyz")
    assert "at most 1000 markers" in refused(f"{wide}\n1,2,3\n", rate_hz=1)
    assert "at most 20000" in refused(table() + "1," * 20_001 + "\n")
    sizes = "title\n200000\t3000\t1\n1\t1\t0.5\n"
    assert "at most 16000000 numbers" in refused(sizes, format="dltdv-sparse", unit="m", rate_hz=1)
