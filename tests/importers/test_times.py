"""Times come from a rate, from printed times, or from both, which must agree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.importers.reading import read, refused, table
from tests.oracles.track_files import flapping, text_writers


def test_printed_times_that_are_rounded_follow_the_rate() -> None:
    found = read(text_writers.trc(flapping(rate=240.0), decimals=2))
    assert np.abs(np.diff(found.times) - 1 / 240).max() < 1e-12
    assert any("rounded by up to 5 ms" in remark or "rounded by up to 4." in remark for remark in found.remarks)


def test_rounded_times_without_a_rate_are_as_printed() -> None:
    found = read(table().replace("0.01,", "0.012,"))
    assert found.times[1] == 0.012
    assert "times are not evenly spaced: 8 to 12 ms apart" in found.remarks
    assert not any("evenly" in remark for remark in read(table()).remarks)


def test_a_rate_that_contradicts_the_times_of_the_file_is_refused_from_either_side() -> None:
    content = text_writers.trc(flapping(rate=240.0)).replace("240.0", "250.0")
    assert "states 250 Hz" in refused(content)
    assert "column 'Time' has 240 Hz" in refused(content)
    assert "--rate-hz" in refused(content, rate_hz=100)
    by_times, by_rate = read(content, rate_hz=240), read(content, rate_hz=250)
    assert by_times.times[-1] == pytest.approx(59 / 240)
    assert by_rate.times[-1] == pytest.approx(59 / 250)
    assert any("is not used" in remark for remark in by_rate.remarks)


def test_a_multiple_of_the_rate_contradicts_times_without_numbers_of_frames() -> None:
    assert "--rate-hz" in refused(table(), rate_hz=500)
    assert read(table(), rate_hz=100).rate_hz == pytest.approx(100)


@pytest.mark.parametrize("rate", [33.0, 333.0, 70.0])
def test_a_rate_does_not_fit_times_only_because_these_are_printed_coarsely(rate: float) -> None:
    tenths = "".join(f"{t / 10},{t},1,2\n" for t in range(12))
    message = refused("time_s,tip_x_mm,tip_y_mm,tip_z_mm\n" + tenths, rate_hz=rate)
    assert f"is {rate:g} Hz, but file.dat states 10 Hz" in message


def test_dropped_frames_are_found_in_rounded_times() -> None:
    frames = [t for t in range(30) if t != 7]
    rows = "".join(f"{t / 240:.3f},{t},1,2\n" for t in frames)
    found = read("time_s,tip_x_mm,tip_y_mm,tip_z_mm\n" + rows, rate_hz=240)
    assert found.times[-1] == pytest.approx(29 / 240, abs=1e-12)


def test_frames_that_were_dropped_leave_a_step_in_time() -> None:
    lines = text_writers.vicon(flapping(rate=100.0), devices=False).splitlines(keepends=True)
    found = read("".join(lines[:10] + lines[13:]))
    assert np.diff(found.times).max() == pytest.approx(0.04)
    assert any("3 frames" in remark for remark in found.remarks)


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ({"r5c0": "0.02"}, ("line 7", "0.02 s follows 0.04 s")),
        ({"r5c0": "0.04"}, ("line 7", "in lines 6 and 7; these differ in the positions of tip", "--repeated gaps")),
        ({"r5c0": ""}, ("line 7", "every frame needs a time")),
        ({"r5c0": "NaN"}, ("line 7", "every frame needs a time")),
    ],
)
def test_times_must_be_complete_and_increase(cells: dict[str, Any], words: tuple[str, ...]) -> None:
    message = refused(table(**cells))
    assert all(word in message for word in words), message


def test_numbers_of_frames_must_increase_and_be_whole() -> None:
    lines = text_writers.vicon(flapping(), devices=False).splitlines(keepends=True)
    assert "the first (5) in lines 10 and 11, with the same positions" in refused(
        "".join([*lines[:10], lines[9], *lines[10:]])
    )
    assert "frame 5 follows 6" in refused("".join([*lines[:9], lines[10], lines[9], *lines[11:]]))
    assert "must be a whole number" in refused("".join(lines).replace("\n7,0,", "\n6.5,0,"))


def test_an_external_clock_is_named_when_the_rate_is_missing() -> None:
    message = refused(text_writers.qualisys(flapping(), rate="EXT"), unit="mm")
    assert "external clock" in message
    assert "--rate-hz" in message


@pytest.mark.parametrize("rate", [0.0, -3.0, float("nan"), float("inf"), 1e9])
def test_a_rate_of_the_user_must_be_possible(rate: float) -> None:
    assert "--rate-hz" in refused(table(), rate_hz=rate)


@pytest.mark.parametrize("rate", ["0", "-1", "abc", "1e12", "NaN"])
def test_a_rate_of_the_file_must_be_possible(rate: str) -> None:
    message = refused(text_writers.qualisys(flapping(), rate=rate), unit="mm")
    assert "line 4" in message


def test_times_in_milliseconds() -> None:
    content = table(header="t (ms),tip_x_mm,tip_y_mm,tip_z_mm").replace("0.0", "")
    assert read(content).times.tolist() == pytest.approx([t / 1000 for t in range(10)])
    assert "leave it out" in refused(content, time_unit="s")
