"""Stationary noise of any colour passes; what grows with the motion, or differs between recordings, does not."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.inference.noise.steadiness import steady_probability
from wingfit.records.array_types import Array

WHITE = 0.5  # standard deviation of the visible part
TIMES = np.linspace(0.0, 1.0, 400)


def noise(seed: int, lag1: float, count: int = 400) -> Array:
    """First-order noise of variance one, and white noise."""
    rng = np.random.default_rng(seed)
    slow = rng.standard_normal(count)
    for k in range(1, count):
        slow[k] = lag1 * slow[k - 1] + np.sqrt(1.0 - lag1**2) * slow[k]
    return np.asarray(slow + WHITE * rng.standard_normal(count))


def probability(residuals: list[Array]) -> float:
    return steady_probability([one[:, None] for one in residuals], [np.array([WHITE])] * len(residuals), 1.5)


@pytest.mark.parametrize("lag1", [0.5, 0.9, 0.97])
def test_stationary_noise_passes(lag1: float) -> None:
    found = [probability([noise(10 * k + r, lag1) for r in range(4)]) for k in range(40)]
    assert min(found) > 1e-3


def test_an_error_that_decays_with_the_motion_does_not() -> None:
    error = 2.0 * np.exp(-4.0 * TIMES) * np.sin(80.0 * TIMES)
    found = [probability([noise(r, 0.0)[:400] * WHITE + error for r in range(4)]) for _ in range(1)]
    assert max(found) < 1e-6


def test_an_error_in_one_recording_does_not() -> None:
    error = 1.5 * np.sin(60.0 * TIMES)
    white = [WHITE * np.random.default_rng(r).standard_normal(400) for r in range(4)]
    assert probability([white[0] + error, *white[1:]]) < 1e-6


def test_nothing_is_said_where_nothing_exceeds_the_noise_or_too_little_was_recorded() -> None:
    white = [WHITE * np.random.default_rng(r).standard_normal(400) for r in range(4)]
    assert probability(white) == 1.0
    assert probability([noise(r, 0.9, 30) for r in range(3)]) == 1.0


def test_gaps_count_as_no_residual() -> None:
    found = [noise(r, 0.9) for r in range(4)]
    found[1][50:60] = np.nan
    found[2][:] = np.nan
    assert probability(found) > 1e-3
