"""Noise of series: one variance per channel for all recordings, so that none of them can be sacrificed."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.inference.noise.white import Noise
from wingfit.records import Channel, Series
from wingfit.records.array_types import Array

TIMES = np.linspace(0.0, 1.0, 400)


def recorded(name: str, samples: int = 400) -> Series:
    channels = (Channel("angle", "rad"), Channel("force", "N"))
    return Series(name, TIMES[:samples], channels, np.ones((samples, 2)))


def residuals(size: float, samples: int = 400) -> Array:
    rng = np.random.default_rng(4)
    return np.asarray(size * rng.standard_normal((samples, 2)) * (1.0, 10.0))


def test_each_channel_has_one_variance_in_all_recordings() -> None:
    noise = Noise.of_each([recorded("good"), recorded("bad", 100)], [residuals(0.01), residuals(1.0, 100)])
    angle, force = (np.diag(noise[0].covariance)[k] for k in (0, 1))
    np.testing.assert_array_equal(noise[0].covariance, noise[1].covariance)
    assert angle == pytest.approx((400 * 0.01**2 + 100 * 1.0**2) / 500, rel=0.2)
    assert force == pytest.approx(100 * angle, rel=0.5)


def test_values_that_are_missing_do_not_count() -> None:
    v = residuals(1.0)
    v[::2] = np.nan
    v[:, 1] = np.nan
    (noise,) = Noise.of_each([recorded("one")], [v])
    assert np.diag(noise.covariance)[0] == pytest.approx(1.0, rel=0.2)
    assert np.diag(noise.covariance)[1] == 1.0
