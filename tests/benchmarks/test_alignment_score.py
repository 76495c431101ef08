"""What the benchmark of alignment counts as falsely sure."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.alignment.__main__ import Score


def test_an_error_beyond_the_tolerance_and_five_stated_errors_is_falsely_sure() -> None:
    fine = Score(0.4, 0.5, 1.0, 1.0, (6.0, 0.0, 0.0, 0.0, 0.0, 0.0), side=True, span=0.8)
    assert not fine.false
    assert replace(fine, rotation=1.0).false
    assert not replace(fine, rotation=1.0, z=(4.0, 0.0, 0.0, 0.0, 0.0, 0.0)).false
    assert replace(fine, rotation=2.1, z=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)).false
    assert replace(fine, side=False).false
