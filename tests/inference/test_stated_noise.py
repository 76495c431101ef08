"""Noise that a dataset states is used where it agrees with what differs between beats, and judged where it does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.pendulum_rig import recorded
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.noise_remarks import noise_remarks
from wingfit.inference.noise.harmonic import changes_and_noise, harmonic_fit
from wingfit.records import LowPass, Recording
from wingfit.sim.filtering import low_passed

NOISE = 2e-4


def stated(times_true: float, frames: int = 248) -> Recording:
    """A recording with white noise of which ``times_true`` times the true standard deviation is stated."""
    (one,) = recorded({}, noise=NOISE, lag1=0.0, frequencies=(1.7,), frames=frames)
    return replace(one, standard_deviation=np.full(one.values.shape[1], times_true * NOISE))


@pytest.mark.parametrize("times_true", [0.8, 1.3])
def test_a_stated_noise_that_agrees_is_used_in_every_channel(times_true: float) -> None:
    plain, fit = harmonic_fit(stated(1.0)), harmonic_fit(stated(times_true))
    assert fit.stated is not None
    assert fit.stated.used
    assert fit.stated.ratio == pytest.approx(times_true, rel=0.1)
    np.testing.assert_allclose(fit.noise[fit.used], times_true * NOISE)
    np.testing.assert_allclose(fit.variance[fit.used], times_true**2 * plain.variance[plain.used])
    assert changes_and_noise(stated(times_true))[2] == pytest.approx(times_true * NOISE)


def test_the_channels_keep_their_own_noise() -> None:
    one = stated(1.0)
    own = NOISE * np.linspace(0.8, 1.2, one.values.shape[1])
    fit = harmonic_fit(replace(one, standard_deviation=own))
    np.testing.assert_allclose(fit.noise[fit.used], own[fit.used])


@pytest.mark.parametrize(("times_true", "cause"), [(0.3, "changes from beat to beat"), (4.0, "check the unit")])
def test_one_that_does_not_agree_is_not_used_and_remarked_on(times_true: float, cause: str) -> None:
    one = stated(times_true)
    unstated = replace(one, standard_deviation=None)
    found, seen = harmonic_fit(one), harmonic_fit(unstated)
    assert found.stated is not None
    assert not found.stated.used
    np.testing.assert_array_equal(found.noise, seen.noise)
    np.testing.assert_array_equal(found.variance, seen.variance)
    (remark,) = noise_remarks(WhitenedData.of((one,)), "m")
    assert cause in remark
    assert f"times in {one.name}" in remark
    assert noise_remarks(WhitenedData.of((unstated,)), "m") == ()


def test_within_a_beat_a_larger_noise_is_believed_and_nothing_is_asked_for() -> None:
    whole = stated(4.0)
    one = replace(whole, times=whole.times[:48], values=whole.values[:48])  # 31 frames show a beat
    fit = harmonic_fit(one)
    assert not fit.between_beats
    assert fit.stated is not None
    assert fit.stated.used
    smaller = harmonic_fit(replace(one, standard_deviation=np.full(one.values.shape[1], 0.2 * NOISE))).stated
    assert smaller is not None
    assert not smaller.used
    assert noise_remarks(WhitenedData.of((one,)), "m") == ()
    (remark,) = noise_remarks(WhitenedData.of((replace(one, standard_deviation=None),)), "m")
    assert "fewer than two beats" in remark


def test_a_filter_reduces_the_stated_noise_as_white_noise() -> None:
    rng, count, rate = np.random.default_rng(2), 60_000, 500.0
    (one,) = recorded({}, noise=0.0, frequencies=(1.7,))
    noisy = replace(
        one,
        times=np.arange(count) / rate,
        values=rng.standard_normal((count, 3)),
        markers=("a",),
        standard_deviation=np.ones(3),
    )
    found = low_passed(noisy, LowPass(40.0))
    assert found.standard_deviation is not None
    np.testing.assert_allclose(np.nanstd(found.values, axis=0), found.standard_deviation, rtol=0.02)
