"""Files and options that are made to take time or memory: they are refused, or read, within seconds."""

from __future__ import annotations

import gc
import sys
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from tests.importers.reading import read, refused, table
from wingfit.importers import Given, inspect_bytes, source
from wingfit.importers.rows import row_choices

MARKERS = ",".join(f"m{k}_{axis}_m" for k in range(1000) for axis in "xyz")
MANY = f"time_s,{MARKERS}\n" + "".join(f"{t / 100}" + ",1" * 3000 + "\n" for t in range(9))


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """The block takes less time of this process than ``seconds``."""
    before = time.process_time()
    yield
    assert time.process_time() - before < seconds


def test_a_file_that_is_refused_does_not_stay_in_memory() -> None:
    raw = b"x" * 1000
    gc.collect()
    gc.disable()
    try:
        before = sys.getrefcount(raw)
        assert inspect_bytes(raw, "file.dat", Given()).error
        assert sys.getrefcount(raw) == before
    finally:
        gc.enable()


@pytest.mark.parametrize(
    ("markers", "words"),
    [
        (",".join(f"zz{k:04d}" for k in range(6000)), "has 6000 names; at most 1000 names are read"),
        (",".join(f"zz{k:04d}" for k in range(900)), "no marker is called 'zz0019'"),
        ("*a" * 24_000, "no marker is called"),
    ],
)
def test_an_option_of_many_markers_is_refused_soon(markers: str, words: str) -> None:
    with within(3):
        assert words in refused(MANY, markers=markers)


def test_an_option_of_many_columns_is_refused_soon() -> None:
    header = "time_s," + ",".join(f"c{k}q" for k in range(19_000))
    columns = ";".join(f"t{k}=zm{k}a,b{k},c{k}" for k in range(1500))
    with within(3):
        assert "has no column 'zm0a'" in refused(f"{header}\n0{',1' * 19_000}\n", columns=columns)


@pytest.mark.parametrize(
    "names",
    [
        [f"c{k}_x" for k in range(19_000)],
        [f"c{k}_{axis}" for k in range(9500) for axis in "xy"],
        ["x_" * 95 + f"{k}_x mm" for k in range(5000)],
        ["_" * 190 + f"{k}" for k in range(5000)],
        ["x" + "_" * 185 + f"{k}_x" for k in range(5000)],
    ],
)
def test_many_columns_that_are_almost_markers_are_refused_soon(names: list[str]) -> None:
    with within(4):
        refused("time_s," + ",".join(names) + "\n")


def test_empty_lines_without_end_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "_MAX_BLANK", 1000)
    for line in ("\n", ",,,\n"):
        message = refused(table() + line * 1001)
        assert "ends 1001 empty lines; at most 1000 empty lines are read: remove them" in message
        assert len(read(table() + line * 1000).times) == 10


def test_cells_that_name_no_recording_are_not_kept() -> None:
    rows, columns = 20_000, 20
    order = [t // 2 for t in range(rows)]
    lines = [(t + 1, [f"{t * k + k}" for k in range(1, columns)] + [f"run{t * 4 // rows}"]) for t in range(rows)]
    header = [f"c{k}" for k in range(columns)]
    tracemalloc.start()
    try:
        args = (np.arange(1, rows + 1), header, header, np.array(order))
        assert row_choices(lines, *args) == []
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("times", ["{}e300", "{}e-300", "{}e9"])
def test_times_that_no_camera_has_are_refused(times: str) -> None:
    content = "time_s,tip_x_m,tip_y_m,tip_z_m\n" + "".join(f"{times.format(t)},0,1,{t % 3}\n" for t in range(10))
    message = refused(content)
    assert "s apart, which must lie in [1e-07, 1000] s; check the unit of the times" in message


@pytest.mark.parametrize(
    ("option", "words"), [("markers", "names no marker"), ("rows", "is empty"), ("columns", "is empty")]
)
def test_an_empty_option_is_refused(option: str, words: str) -> None:
    message = refused(table(), **{option: ""})
    assert message.startswith(f"--{option}: ")
    assert words in message
