"""Misfits to held-out recordings and their intervals."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from wingfit.diagnosis.finding import Interval, RecordingMisfit
from wingfit.diagnosis.verdict.build_finding import _worsened
from wingfit.diagnosis.verdict.proof import ResidualPair, _misfits, proof


def data(kind: str, recordings: int, channels: int) -> Any:
    """Recordings of a kind whose channels are all used."""
    beat_fit = SimpleNamespace(used=np.ones(channels, bool))
    recorded = [SimpleNamespace(kind=kind)] * recordings
    return SimpleNamespace(kind=kind, recordings=recorded, reduced=[beat_fit] * recordings)


def test_forces_are_bootstrapped_in_blocks_of_time() -> None:
    """Both axes have equal errors that vary in time: a bootstrap over axes would give no interval."""
    off = np.repeat(np.linspace(1.0, 3.0, 48)[:, None], 2, axis=1)
    before, after, better = _misfits(ResidualPair(data("forces", 2, 2), (off, off), (0.5 * off, 0.5 * off)))
    assert before.value == 2.0 * after.value
    assert better
    assert before.low is not None
    assert before.high is not None
    assert before.low < 0.97 * before.value
    assert before.high > 1.03 * before.value


def test_tracks_are_bootstrapped_by_marker() -> None:
    rng = np.random.default_rng(1)
    off = np.repeat(rng.uniform(1.0, 3.0, 20), 3) * np.ones((30, 60))
    before, _, _ = _misfits(ResidualPair(data("tracks", 1, 60), (off,), (off,)))
    assert before.low is not None
    assert before.high is not None
    assert before.low < before.value < before.high


def test_a_recording_that_fits_worse_gets_a_remark() -> None:
    def row(name: str, before: float, after: float) -> RecordingMisfit:
        return RecordingMisfit(
            name, False, 3.0, 0.0, 10.0, 0.0, Interval(before, None, None), Interval(after, None, None), 1e-3
        )

    rows = [row("good", 5e-3, 1e-3), row("bad", 2e-3, 3e-3)]
    added, nothing = (cast("Any", SimpleNamespace(names=names)) for names in (("mass",), ()))
    assert _worsened(rows, added, "m") == ("with the added effects the misfit increases in bad from 2 to 3 mm",)
    assert _worsened(rows, nothing, "m") == ()


def test_an_accepted_error_is_part_of_the_misfit_to_be_expected() -> None:
    """Noise 1, accepted error 3, discretisation error 2: a right model misses by the root of their squares."""
    off = np.full((8, 1), 7.0)
    two = data("forces", 1, 1)
    two.noise, two.accepted_of_samples = 1.0, 3.0
    found = proof(ResidualPair(two, (off,), (off,)), 2.0, "noise", effects_added=False)
    assert found.floor == np.sqrt(1.0 + 9.0 + 4.0)
    assert found.before.value == 7.0 / found.floor
