"""The noise of recordings without a beat: its size and colour, from each source, and where it is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wingfit.inference.noise.series import BORROWED_ERROR, UnknownNoiseError, known_noise, noise_of, quantum
from wingfit.inference.noise.series_fit import SeriesReduction, band
from wingfit.inference.noise.visible_noise import visible_noise
from wingfit.records import Channel, Series
from wingfit.records.array_types import Array

COUNT, SIGMA = 400, 0.01
TIMES = np.linspace(0.0, 8.0, COUNT)
MOTIONS = {
    "rest": 0.0 * TIMES,
    "fall": 4.9 * TIMES**2,
    "decay": np.exp(-0.3 * TIMES) * np.cos(5.5 * TIMES),
    "chirp": np.sin(2.0 * TIMES**2),
}


def coloured(seed: int, lag1: float, count: int = COUNT) -> Array:
    error = np.random.default_rng(seed).standard_normal(count)
    for k in range(1, count):
        error[k] = lag1 * error[k - 1] + np.sqrt(1.0 - lag1**2) * error[k]
    return SIGMA * error


def series(values: Array, *, stated: float | None = None, name: str = "one", **changes: object) -> Series:
    times = np.linspace(0.0, 8.0, len(values))
    return Series(name, times, (Channel("y", "m", stated),), values[:, None], **changes)  # type: ignore[arg-type]


def first_order(lag1: float, frequency: Array) -> Array:
    return np.asarray((1 - lag1**2) / (1 + lag1**2 - 2 * lag1 * np.cos(2 * np.pi * frequency)))


@pytest.mark.parametrize("motion", sorted(MOTIONS))
def test_white_noise_is_estimated_beside_any_slow_motion(motion: str) -> None:
    found = [noise_of([series(MOTIONS[motion] + coloured(k, 0.0))])["one"] for k in range(10)]
    ratio = [float(one.standard_deviation[0]) / SIGMA for one in found]
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.06)
    assert np.std(ratio) < 0.12
    assert {one.source for one in found} == {"highest frequencies"}


def test_times_that_are_not_quite_even_do_not_look_like_noise() -> None:
    """Here the speed times the differences from even times is as large as the noise."""
    ratio = []
    for seed in range(10):
        step = TIMES[1]
        times = TIMES + 0.045 * step * np.random.default_rng(seed).uniform(-1.0, 1.0, COUNT)
        values = 2.0 * np.sin(13.0 * times) + coloured(seed, 0.0)
        one = Series("one", times, (Channel("y", "m"),), values[:, None])
        ratio.append(float(noise_of([one])["one"].standard_deviation[0]) / SIGMA)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.1)


def test_the_colour_of_noise_is_estimated_where_it_is_visible() -> None:
    """At rest, noise is visible at all frequencies: its density is that of the first-order process."""
    frequency = np.array([0.01, 0.05, 0.2, 0.45])
    found = [visible_noise(coloured(k, 0.6, 4000)) for k in range(5)]
    density = np.median([one.density(frequency) for one in found if one], axis=0) / SIGMA**2
    np.testing.assert_allclose(density, first_order(0.6, frequency), rtol=0.25)


def test_ignorance_of_slow_noise_is_part_of_the_error() -> None:
    """Few samples cannot tell white noise from a moderate colour, many can."""
    short, long = (visible_noise(coloured(3, 0.0, count)) for count in (45, 4000))
    assert short is not None
    assert long is not None
    assert short.error > 1.0
    assert long.error < 0.3


def test_a_stated_deviation_sets_the_size_and_the_visible_part_the_colour() -> None:
    noise = noise_of([series(MOTIONS["decay"] + coloured(1, 0.8), stated=SIGMA)])["one"]
    assert noise.source == "stated"
    assert noise.standard_deviation[0] == SIGMA
    assert noise.density[0].mean() == pytest.approx(1.0)
    assert noise.density[0, 1] > 4.0 * noise.density[0, -1]
    white = noise_of([series(MOTIONS["decay"] + coloured(1, 0.0), stated=SIGMA)])["one"]
    assert white.density[0, 1] < 2.0 * white.density[0, -1]


@pytest.mark.parametrize("lag1", [0.0, 0.8, 0.95])
def test_repeats_show_noise_of_any_colour(lag1: float) -> None:
    group = [series(MOTIONS["decay"] + coloured(k, lag1), name=f"r{k}", repeats="a") for k in range(6)]
    noise = noise_of(group)["r3"]
    assert noise.source == "repeats"
    assert noise.standard_deviation[0] == pytest.approx(SIGMA, rel=0.2)
    middle = noise.density[0, 20:60].mean()
    frequency = np.arange(20, 60) / (2.0 * COUNT)
    assert middle == pytest.approx(first_order(lag1, frequency).mean(), rel=0.4)


def test_repeats_that_do_not_repeat_are_refused() -> None:
    one, other = (series(coloured(k, 0.0), name=f"r{k}", repeats="a", settings={"mass": 1.0 + k}) for k in range(2))
    with pytest.raises(ValueError, match="repeat 'a', but"):
        noise_of([one, other])


def test_what_the_harmonics_of_a_period_leave_is_noise() -> None:
    motion = np.cos(2 * np.pi * TIMES / 0.8) + 0.3 * np.sin(6 * np.pi * TIMES / 0.8)
    noise = noise_of([series(motion + coloured(4, 0.7), period=0.8)])["one"]
    assert noise.source == "period"
    assert noise.standard_deviation[0] == pytest.approx(SIGMA, rel=0.15)
    assert noise.density[0, :30].mean() > 3.0 * noise.density[0, 300:].mean()


def test_a_coarse_recorder_has_the_noise_of_its_steps() -> None:
    step = 0.02
    values = np.round(MOTIONS["chirp"] / step) * step
    assert quantum(values) == pytest.approx(step)
    noise = noise_of([series(values)])["one"]
    assert noise.standard_deviation[0] == pytest.approx(step / np.sqrt(12.0), rel=0.25)


def test_values_that_are_all_different_are_not_coarse() -> None:
    assert quantum(MOTIONS["decay"] + coloured(1, 0.0)) == 0.0


def test_a_motion_without_noise_is_refused_with_a_remedy() -> None:
    with pytest.raises(UnknownNoiseError, match=r"'one': the noise of channel 'y' is not known.*\(m\).*under repeats"):
        noise_of([series(MOTIONS["decay"])])


def test_few_samples_are_refused_by_number() -> None:
    with pytest.raises(UnknownNoiseError, match="it has 10 samples, and an estimate needs 24"):
        noise_of([series(coloured(1, 0.0, 10))])


def test_a_recording_that_hides_its_noise_borrows_that_of_the_others() -> None:
    both = [series(MOTIONS["decay"] + coloured(1, 0.0), name="a"), series(MOTIONS["decay"], name="b")]
    noise = noise_of(both)
    assert noise["b"].source == "other recordings"
    assert noise["b"].standard_deviation == noise["a"].standard_deviation
    assert noise["b"].relative_error >= 1.0


def test_what_follows_a_step_of_an_input_is_no_noise() -> None:
    """A current that follows a voltage at once has its steps, whose power is not noise."""
    steps = np.sign(np.sin(3.0 * TIMES))
    values = steps + coloured(2, 0.0)
    without, known = visible_noise(values), visible_noise(values, None, [steps])
    assert known is not None
    assert np.sqrt(known.variance) == pytest.approx(SIGMA, rel=0.15)
    assert without is None or without.variance > 4.0 * known.variance


def test_coefficients_keep_the_mean_square_and_leave_out_gaps() -> None:
    values = MOTIONS["decay"] + coloured(5, 0.0)
    recording = series(values, stated=SIGMA)
    fit = SeriesReduction.of([recording])(recording)
    residual = coloured(6, 0.0)[:, None]
    whole = fit.of(residual)
    assert whole.shape == (1, len(fit.weight))
    assert band(recording, noise_of([recording])["one"]) == len(fit.weight) < COUNT
    everything = SeriesReduction.of([recording]).noises["one"]
    assert everything.density.shape == (1, COUNT)
    slow = (np.cos(np.pi * (np.arange(COUNT) + 0.5) * 3 / COUNT) * SIGMA)[:, None]
    assert np.sum(fit.of(slow) ** 2 * fit.weight) * len(fit.weight) == pytest.approx(0.5 * COUNT, rel=1e-9)
    gaps = slow.copy()
    gaps[100:300] = np.nan
    assert np.isfinite(fit.of(gaps)).all()


@pytest.mark.parametrize("lost", [0.02, 0.05])
def test_gaps_do_not_look_like_noise(lost: float) -> None:
    values = MOTIONS["decay"] + coloured(7, 0.0)
    kept = np.random.default_rng(1).random(COUNT) > lost
    recording = series(np.where(kept, values, np.nan))
    noise = noise_of([recording])["one"]
    assert noise.standard_deviation[0] == pytest.approx(SIGMA, rel=0.4)


def test_uneven_times_are_refused_or_stated() -> None:
    times = np.sort(np.random.default_rng(2).uniform(0.0, 8.0, COUNT))
    values = (np.exp(-0.3 * times) * np.cos(5.5 * times) + coloured(8, 0.0))[:, None]
    with pytest.raises(UnknownNoiseError, match="not known"):
        noise_of([Series("one", times, (Channel("y", "m"),), values)])
    stated = noise_of([Series("one", times, (Channel("y", "m", SIGMA),), values)])["one"]
    assert stated.standard_deviation[0] == SIGMA
    np.testing.assert_array_equal(stated.density, np.ones((1, COUNT)))


@pytest.mark.parametrize("repeats", ["", "a"])
def test_a_channel_that_one_recording_lacks_is_not_used_there(repeats: str) -> None:
    def two(seed: int, name: str, *, lacks: bool) -> Series:
        values = np.stack([MOTIONS["decay"] + coloured(seed, 0.0), MOTIONS["chirp"] + coloured(seed + 9, 0.0)], axis=1)
        if lacks:
            values[:, 1] = np.nan
        channels = (Channel("y", "m"), Channel("z", "m"))
        return Series(name, TIMES, channels, values, repeats=repeats)

    recordings = [two(1, "a", lacks=False), two(2, "b", lacks=True)]
    reduction = SeriesReduction.of(recordings)
    whole, part = (reduction(one) for one in recordings)
    assert part.used.tolist() == [True, False]
    assert whole.noise[0] == pytest.approx(1.0, rel=0.3)
    assert np.isfinite(part.variance).all()
    assert np.isfinite(part.of(np.full((COUNT, 2), 0.01))).all()


@pytest.mark.parametrize("name", ["standard_deviation", "accepted_error"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_deviations_are_positive(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"channel 'y': {name} is .* m; give a positive number"):
        replace(Channel("y", "m"), **{name: value})  # type: ignore[arg-type]


def test_noise_is_known_channel_by_channel() -> None:
    """Where all of it is known, it is that of noise_of; what one recording does not show, others may."""
    stated = Series(
        "stated",
        TIMES,
        (Channel("y", "m", 0.02), Channel("z", "m")),
        np.stack([coloured(1, 0.0), MOTIONS["decay"] + coloured(2, 0.0)], axis=1),
    )
    (found,) = known_noise([stated]).values()
    np.testing.assert_array_equal(found.standard_deviation, noise_of([stated])["stated"].standard_deviation)
    few = replace(stated, name="few", times=TIMES[:12], values=stated.values[:12])
    (alone,) = known_noise([few]).values()
    assert alone.standard_deviation[0] == 0.02
    assert np.isnan(alone.standard_deviation[1])
    assert np.isnan(alone.relative_error[1])
    beside = known_noise([stated, few])["few"]
    assert beside.standard_deviation[1] == found.standard_deviation[1]
    assert beside.relative_error[1] == BORROWED_ERROR


def test_noise_of_a_period_and_of_repeats_is_known() -> None:
    swing = np.sin(2 * np.pi * TIMES)
    periodic = series(swing + coloured(1, 0.0), period=1.0)
    again = [series(swing + coloured(k, 0.0), name=f"r{k}", repeats="r") for k in (2, 3)]
    known, whole = known_noise([periodic, *again]), noise_of([periodic, *again])
    for name, one in known.items():
        np.testing.assert_array_equal(one.standard_deviation, whole[name].standard_deviation)
        assert one.relative_error[0] == whole[name].relative_error


@pytest.mark.parametrize("stretch", [0.002, 0.005])
def test_a_clock_that_drifts_does_not_look_like_noise(stretch: float) -> None:
    count, ratio = 1500, []
    for seed in range(5):
        interval = np.where(np.arange(count) < count / 2, 1.0 - stretch, 1.0 + stretch)
        times = 0.01 * np.cumsum(interval)
        values = np.sin(30.0 * times) + coloured(seed, 0.0, count)
        one = Series("one", times, (Channel("y", "m"),), values[:, None])
        ratio.append(float(noise_of([one])["one"].standard_deviation[0]) / SIGMA)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.1)
