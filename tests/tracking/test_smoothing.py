"""Fourier smoothing: known motions come back, and the errors that are reported are the errors that are made."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles.wing_kinematics import noise, split_cycle
from wingfit.tracking.smoothing import PeriodicFit, basis, fit_periodic

FREQUENCY = 12.5
PHASES = np.arange(720) / 720
COEFFICIENTS = np.array([0.3, -0.3, 0.05, 0.04, -0.03, 0.01, 0.02])


def band_limited(times: np.ndarray, derivative: int = 0) -> np.ndarray:
    return np.asarray(basis(times * FREQUENCY, 3, derivative, FREQUENCY) @ COEFFICIENTS)


def test_a_series_comes_back_exactly_from_uneven_samples_with_gaps() -> None:
    rng = np.random.default_rng(1)
    times = np.sort(rng.uniform(0, 5 / FREQUENCY, 200))
    values = band_limited(times)
    values[rng.random(200) < 0.2] = np.nan
    fit = fit_periodic(times, values, FREQUENCY, 3)
    np.testing.assert_allclose(fit.coefficients, COEFFICIENTS, atol=1e-10)
    for d in range(4):
        exact = band_limited(PHASES / FREQUENCY, d)
        np.testing.assert_allclose(fit.at(PHASES, d), exact, atol=1e-9 * np.abs(exact).max())


def test_derivatives_are_derivatives() -> None:
    fit = fit_periodic(np.arange(300) / 1000, band_limited(np.arange(300) / 1000), FREQUENCY, 3)
    step = 1e-5
    for d in range(3):
        slope = (fit.at(PHASES + step, d) - fit.at(PHASES - step, d)) * FREQUENCY / (2 * step)
        np.testing.assert_allclose(slope, fit.at(PHASES, d + 1), atol=1e-5 * np.abs(slope).max())


def test_shifting_the_start_moves_the_motion_and_keeps_its_errors() -> None:
    rng = np.random.default_rng(2)
    times = np.arange(300) / 1000
    fit = fit_periodic(times, band_limited(times) + noise(rng, (300,), 0.01, 0, 0), FREQUENCY, 3)
    moved = fit.shifted(0.3)
    for d in range(3):
        np.testing.assert_allclose(moved.at(PHASES - 0.3, d), fit.at(PHASES, d), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(moved.error_at(PHASES - 0.3, d), fit.error_at(PHASES, d), rtol=1e-9)
    assert moved.start == pytest.approx(fit.start + 0.3 / FREQUENCY)


@pytest.mark.parametrize(("white", "coloured", "decay"), [(0.01, 0.0, 0.0), (0.004, 0.006, 0.9)])
def test_standard_errors_cover_a_motion_within_the_band(white: float, coloured: float, decay: float) -> None:
    """Mean square of error over standard error, over draws and phases, is one: also where noise is correlated.

    With the correlation left out, the second case would be off by a factor of about ten.
    """
    times = np.arange(480) / 1200
    ratios = np.zeros(3)
    draws = 40
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        values = band_limited(times) + noise(rng, (480,), white, coloured, decay)
        fit = fit_periodic(times, values, FREQUENCY, 3)
        for d in range(3):
            exact = band_limited(PHASES / FREQUENCY, d)
            ratios[d] += np.mean(((fit.at(PHASES, d) - exact) / fit.error_at(PHASES, d)) ** 2) / draws
    assert np.all(ratios > 0.7), ratios
    assert np.all(ratios < 1.5), ratios


@pytest.mark.parametrize(("rate", "beats", "white", "coloured"), [(1200, 10, 0.005, 0.005), (1200, 30, 0.002, 0.002)])
def test_reported_errors_cover_a_split_cycle_that_no_series_ends(
    rate: int, beats: int, white: float, coloured: float
) -> None:
    """The acceleration of a split cycle jumps: what is cut off counts for more than noise, and is owned up to."""
    exact, ratios = split_cycle(PHASES, FREQUENCY), []
    times = np.arange(int(beats * rate / FREQUENCY)) / rate
    for seed in range(6):
        rng = np.random.default_rng(seed)
        values = split_cycle(times * FREQUENCY, FREQUENCY)[0] + noise(rng, times.shape, white, coloured, 0.85)
        fit = fit_periodic(times, values, FREQUENCY)
        made = [np.sqrt(np.mean((fit.at(PHASES, d) - exact[d]) ** 2)) for d in range(3)]
        ratios.append(made / fit.error[:3])
    assert np.max(ratios) < 1.6, ratios
    assert np.all(np.mean(ratios, axis=0) < 1.2), ratios
    assert np.all(np.mean(ratios, axis=0) > 0.2), ratios  # nor so large that they say nothing


def test_the_scores_are_those_of_fits_without_the_beat_predicted() -> None:
    rng = np.random.default_rng(7)
    times = np.arange(240) / 1200  # 2.5 beats, hence three groups
    values = band_limited(times) + noise(rng, times.shape, 0.02, 0, 0)
    beat = np.floor(times * FREQUENCY)
    for k, score in list(enumerate(fit_periodic(times, values, FREQUENCY).scores, 1))[:6]:
        X, square = basis(times * FREQUENCY, k), 0.0
        for b in range(3):
            found = np.linalg.lstsq(X[beat != b], values[beat != b] - values.mean(), rcond=None)[0]
            square += np.sum((values[beat == b] - values.mean() - X[beat == b] @ found) ** 2)
        assert score == pytest.approx(np.sqrt(square / 240), rel=1e-6)


def test_the_truncation_error_is_reported() -> None:
    """Harmonic 3 is cut: its amplitude is lost from the value, 3 omega times it from the rate."""
    rng = np.random.default_rng(3)
    times = np.arange(960) / 1200
    fit = fit_periodic(times, band_limited(times) + noise(rng, (960,), 1e-4, 0, 0), FREQUENCY, 2)
    gone = np.hypot(0.01, 0.02) / np.sqrt(2)
    assert fit.lost[0] == pytest.approx(gone, rel=0.05)
    assert fit.lost[1] == pytest.approx(gone * 6 * np.pi * FREQUENCY, rel=0.05)
    assert fit.noise.deviation == pytest.approx(1e-4, rel=0.1)  # what is cut off is not taken for noise


def test_harmonics_beyond_the_significant_ones_follow_their_envelope() -> None:
    """Harmonics k^-3, as of an acceleration that jumps: half of what the acceleration loses lies beyond sight."""
    k = np.arange(1, 201)
    times = np.arange(4000) / 5000
    values = np.cos(2 * np.pi * np.multiply.outer(times * FREQUENCY, k)) @ k**-3.0
    values += noise(np.random.default_rng(6), times.shape, 1e-6, 0, 0)
    fit = fit_periodic(times, values, FREQUENCY, 3)
    for d in range(3):
        lost = np.sqrt(np.sum(k[3:] ** (2.0 * d - 6)) / 2) * (2 * np.pi * FREQUENCY) ** d
        assert fit.lost[d] == pytest.approx(lost, rel=0.05)
    assert np.isinf(fit.lost[3])


def test_more_samples_bring_more_harmonics() -> None:
    def chosen(beats: int, white: float) -> PeriodicFit:
        rng = np.random.default_rng(4)
        times = np.arange(96 * beats) / 1200
        values = split_cycle(times * FREQUENCY, FREQUENCY)[0] + noise(rng, times.shape, white, 0, 0)
        return fit_periodic(times, values, FREQUENCY)

    rough, fine = chosen(4, 0.02), chosen(30, 0.001)
    assert fine.harmonics > rough.harmonics
    assert fine.lost[2] < rough.lost[2]


def test_beats_that_differ_raise_the_errors() -> None:
    rng = np.random.default_rng(5)
    times = np.arange(1920) / 1200
    steady = noise(rng, times.shape, 0.002, 0, 0)
    strength = 1 + 0.1 * rng.standard_normal(21)
    varying = band_limited(times) * strength[(times * FREQUENCY).astype(int)] + steady
    calm, restless = (fit_periodic(times, v, FREQUENCY, 3) for v in (band_limited(times) + steady, varying))
    assert not calm.remarks
    assert "beats differ" in restless.remarks[0]
    spread = 0.1 * np.hypot(0.3, 0.05) / np.sqrt(20)  # of the first harmonic's amplitude between means of 20 beats
    error = np.sqrt(restless.covariance[1, 1] + restless.covariance[2, 2])
    assert 0.5 * spread < error < 2 * spread


@pytest.mark.parametrize(
    ("samples", "gap", "harmonics", "words"),
    [
        (200, 0.0, 60, ("60 harmonics", "1 to 30")),
        (6, 0.0, None, ("6 samples", "at least 9")),
        (200, 0.6, None, ("gap 0.6", "half a beat")),
    ],
)
def test_samples_that_carry_no_series_are_refused(
    samples: int, gap: float, harmonics: int | None, words: tuple[str, ...]
) -> None:
    times = np.linspace(0, 3 / FREQUENCY, samples, endpoint=False)
    values = np.where((times * FREQUENCY) % 1 < gap, np.nan, 0.1)
    with pytest.raises(ValueError, match=words[0]) as error:
        fit_periodic(times, values, FREQUENCY, harmonics)
    assert all(word in str(error.value) for word in words)
