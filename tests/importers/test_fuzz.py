"""Files that are damaged at random end in tracks or in an error with a remedy; ``benchmarks.data_in`` tries more."""

from __future__ import annotations

from tests.oracles.track_files import fuzz


def test_damaged_files_never_crash() -> None:
    outcomes, crashes = fuzz(150, 11, None)
    assert not crashes, crashes[0]
    assert outcomes["read"] > 10
    assert outcomes["refused"] > 100
