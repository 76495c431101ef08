"""C3D: against another library, and files that lie about themselves."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from tests.importers.reading import read, refused
from tests.oracles.track_files import binary_writers, flapping

WHOLE = binary_writers.by_hand(flapping())


def patched(at: int, value: bytes) -> bytes:
    return WHOLE[:at] + value + WHOLE[at + len(value) :]


@pytest.mark.parametrize("integers", [0.0, 0.01])
def test_it_reads_the_numbers_that_another_library_reads(integers: float, tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    raw = binary_writers.by_hand(flapping(3), integers=integers)
    (tmp_path / "a.c3d").write_bytes(raw)
    theirs = ezc3d.c3d(str(tmp_path / "a.c3d"))["data"]["points"][:3].transpose(2, 1, 0)
    assert np.allclose(read(raw).positions * 1e3, theirs, atol=1e-9, rtol=0, equal_nan=True)


def test_up_and_the_first_frame_are_stated() -> None:
    found = read(binary_writers.by_hand(flapping(), first=241))
    assert found.times[0] == 1.0
    facts = {one.fact: one.value for one in found.statements}
    assert (facts["up"], facts["first frame"], facts["unit"]) == ("+Z", "241", "mm")
    turned = read(WHOLE, axes="x aft, y up, z in")
    assert any("calls +Z up" in remark for remark in turned.remarks)


@pytest.mark.parametrize("cut", [1, 300, 600, 1300, 1600, len(WHOLE) // 2, len(WHOLE) - 600])
def test_a_file_that_is_cut_off_is_refused(cut: int) -> None:
    assert "cut off" in refused(WHOLE[:cut]) or cut == 1


@pytest.mark.parametrize(
    ("at", "value", "words"),
    [
        (2, struct.pack("<H", 60_000), "POINT:USED"),
        (4, struct.pack("<H", 60_000), "cut off"),
        (8, struct.pack("<H", 65_535), "cut off"),
        (16, struct.pack("<H", 0), "beyond the end"),
        (16, struct.pack("<H", 40_000), "beyond the end"),
        (512 + 3, b"\x07", "84, 85 or 86"),
        (0, b"\x7f", "cut off"),
    ],
)
def test_a_header_that_lies_is_refused_before_memory_is_taken(at: int, value: bytes, words: str) -> None:
    assert words in refused(patched(at, value))


def test_infinite_numbers_are_refused() -> None:
    start = 512 * (1 + 1 + WHOLE[512 + 2])
    assert "is inf m from the origin" in refused(patched(start, struct.pack("<f", np.inf)))


def test_not_a_number_is_a_gap() -> None:
    start = 512 * (1 + 1 + WHOLE[512 + 2])
    found = read(patched(start, struct.pack("<f", np.nan)))
    assert (found.gaps.partial, found.gaps.nan) == (1, 0)
    assert found.gaps.residual == read(WHOLE).gaps.residual


def test_a_file_that_is_known_to_be_incomplete_is_read_as_far_as_it_goes() -> None:
    data = 512 * (1 + WHOLE[512 + 2])
    found = read(WHOLE[: data + 40 * 64 + 7], incomplete=True)
    assert len(found.times) == 40
    assert any("states the header 60 frames, but has data for 40" in remark for remark in found.remarks)
    shorter = patched(8, struct.pack("<H", 45))
    assert "states the header 45 frames, but has data for 64" in refused(shorter)
    assert len(read(shorter, incomplete=True).times) == 45
