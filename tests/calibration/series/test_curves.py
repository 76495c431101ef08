"""Curves of a result: which channels, which samples, and what is simulated there."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.calibration.series.curves import MOST_CURVES, MOST_POINTS, curves
from wingfit.calibration.series.misfits import Compared
from wingfit.inference.noise.series import KnownNoise
from wingfit.records import Channel, Series
from wingfit.records.array_types import Array

CHANNELS = Channel("angle", "rad"), Channel("force", "N")


def compared(name: str, off: Array, samples: int = 50, *reasons: str | None) -> Compared:
    """A recording of two channels; ``off`` [2 genomes, 2 channels]: by how much the simulation lies above it."""
    times: Array = np.arange(samples) / 10.0
    values = np.stack([np.sin(times), 100.0 * np.cos(times)], axis=1)
    noise = KnownNoise(np.array([0.01, 1.0]), np.zeros(2))
    residuals = np.repeat(off[:, None], samples, axis=1)
    return Compared(Series(name, times, CHANNELS, values), residuals, reasons or (None, None), noise)


def test_the_worst_come_first_relative_to_their_noise() -> None:
    """Channel force of a: 2 N, twice its noise; channel angle of b: 0.1 rad, ten times; before counts for nothing."""
    a = compared("a", np.array([[9.0, 900.0], [0.005, 2.0]]))
    b = compared("b", np.array([[0.0, 0.0], [0.1, 0.5]]))
    found = curves([a, b], [b], "noise")
    assert [(one.recording, one.channel) for one in found] == [
        ("b", "angle"),
        ("a", "force"),
        ("a", "angle"),
        ("b", "force"),
    ]
    assert [one.held_out for one in found] == [True, False, False, True]
    worst = found[0]
    assert (worst.unit, worst.stride) == ("rad", 1)
    assert worst.recorded == tuple(b.recording.values[:, 0])
    assert worst.best == pytest.approx(b.recording.values[:, 0] + 0.1)
    assert worst.nominal == pytest.approx(b.recording.values[:, 0])
    assert worst.time == tuple(b.recording.times)


def test_samples_that_are_missing_are_left_out_and_long_recordings_thinned() -> None:
    long = compared("long", np.ones((2, 2)), 2 * MOST_POINTS + 1)
    values = long.recording.values.copy()
    values[3, 0], values[:, 1] = np.nan, np.nan
    gappy = Compared(Series("long", long.recording.times, CHANNELS, values), long.residuals, long.reasons, long.noise)
    (only,) = curves([gappy], [], "noise")
    assert (only.channel, only.stride) == ("angle", 2)
    assert len(only.time) <= MOST_POINTS
    assert 0.3 not in only.time
    assert only.best is not None
    assert np.isfinite([only.recorded, only.best]).all()


def test_a_genome_that_cannot_be_simulated_has_no_curve() -> None:
    (first, _) = curves([compared("a", np.ones((2, 2)), 50, None, "it diverged")], [], "noise")
    assert first.best is None
    assert first.nominal is not None


def test_their_number_is_limited() -> None:
    many = [compared(f"r{k}", np.ones((2, 2))) for k in range(MOST_CURVES)]
    assert len(curves(many, [], "range")) == MOST_CURVES
