"""What ``benchmarks.speed`` says of derivatives holds for the smallest wing too."""

from __future__ import annotations

import pytest

from benchmarks import speed


def test_derivatives_are_those_of_converged_motions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "BODIES", 4)
    monkeypatch.setattr(speed, "REPETITIONS", 1)
    found = speed.derivatives()
    assert found["sensitivity_error"] < 2e-5
