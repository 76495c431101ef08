"""A slow change of the beat is found, is not taken for noise, and is not seen in noise of any colour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from tests.inference.test_harmonic import CONDITION, noise, recording
from wingfit.inference.noise.harmonic import harmonic_fit
from wingfit.records import Recording

Array = npt.NDArray[np.float64]
SIGMA = 5e-4  # m


def line(time: Array) -> Array:
    """A change by 1 over the ``time`` [T] from -1 to 1."""
    return 0.5 * time


def parabola(time: Array) -> Array:
    """A change by 1 that goes and comes back over the ``time`` [T] from -1 to 1."""
    return time**2 - 1.0 / 3.0


def cosine(time: Array) -> Array:
    """A change by 1 that goes and comes back over the ``time`` [T] from -1 to 1, and ends levelly."""
    return 0.5 * np.cos(np.pi * time)


def resonance(frames: int, width: float, seed: int, channels: int, *, harmonic: int = 1) -> Array:
    """Noise [T, C] of unit variance around ``harmonic``, of half the ``width`` in flap frequencies on either side."""
    size, turn = np.exp(-np.pi * width / 30.0), 2.0 * np.pi * harmonic / 30.0
    white = np.random.default_rng(seed).standard_normal((frames + 500, channels))
    found = lfilter([1.0], [1.0, -2.0 * size * np.cos(turn), size**2], white, axis=0)[500:]
    return np.asarray(found / found.std(axis=0))


def waving(
    beats: int,
    change: float,
    seed: int,
    *,
    memory: float = 0.6,
    channels: int = 30,
    course: Callable[[Array], Array] = line,
) -> Recording:
    """Tracks whose amplitude, 10 to 20 mm in each channel, changes by the fraction ``change`` along a ``course``."""
    frames = 31 * beats
    psi = 2 * np.pi * CONDITION.flap_frequency * recording(np.zeros((frames, 3))).times
    size = np.linspace(0.01, 0.02, channels)
    growing = 1.0 + change * course(np.linspace(-1.0, 1.0, frames))
    wave = (growing * np.cos(psi))[:, None] * size + 0.2 * size * np.sin(2 * psi)[:, None]
    return recording(wave + SIGMA * noise(frames, memory, seed, channels))


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("beats", [3, 4, 8])
def test_noise_of_any_colour_is_no_drift(memory: float, beats: int) -> None:
    seen = [harmonic_fit(waving(beats, 0.0, seed, memory=memory)).drift for seed in range(30)]
    assert not [one for one in seen if one is None or one.found]


@pytest.mark.parametrize("beats", [4, 8, 20])
def test_noise_that_all_markers_share_is_no_drift(beats: int) -> None:
    """Its channels are not independent, so chance produces larger ratios."""
    for seed in range(40):
        common = waving(beats, 0.0, seed, channels=3)
        values = np.repeat(common.values, 10, axis=1) + 1e-6 * noise(len(common.values), 0.0, seed)[:, :30]
        drift = harmonic_fit(recording(values)).drift
        assert drift is not None
        assert not drift.found


def found(values: Array) -> bool:
    drift = harmonic_fit(recording(values)).drift
    assert drift is not None
    return drift.found


def test_a_resonance_at_a_harmonic_is_no_drift() -> None:
    """Its noise falls with the distance from the harmonic."""
    steady = [waving(8, 0.0, seed).values for seed in range(15)]
    assert not any(found(one + SIGMA * resonance(248, 0.5, k, 30)) for k, one in enumerate(steady))


def test_a_resonance_in_one_of_the_harmonics_is_no_drift() -> None:
    """Of three harmonics, one has nearly all of the noise, so that chance produces larger ratios."""
    seeds = range(30)
    waves = [waving(20, 0.0, seed, channels=3).values for seed in seeds]
    shaken = [
        one + 10 * SIGMA * resonance(620, 0.4, seed, 3, harmonic=2) for one, seed in zip(waves, seeds, strict=True)
    ]
    assert not any(found(one) for one in shaken)


def test_shared_noise_within_white_noise_is_no_drift() -> None:
    """Markers are independent in all frequencies but those of the flapping, where they shake together."""
    seeds = range(60)
    waves = [waving(8, 0.0, seed, memory=0.0).values for seed in seeds]
    shaken = [one + 0.5 * SIGMA * resonance(248, 1.0, seed + 99, 1) for one, seed in zip(waves, seeds, strict=True)]
    assert not any(found(one) for one in shaken)


@pytest.mark.parametrize("memory", [0.0, 0.6])
@pytest.mark.parametrize(("beats", "lost"), [(3, 20), (3, 24), (4, 24)])
def test_noise_with_long_gaps_is_no_drift(beats: int, lost: int, memory: float) -> None:
    """All markers are lost for most of a beat."""
    ratios = []
    for seed in range(10):
        gappy, start = waving(beats, 0.0, seed, memory=memory).values.copy(), 6 * seed
        gappy[start : start + lost] = np.nan
        drift = harmonic_fit(recording(gappy)).drift
        assert drift is not None
        assert not drift.found
        ratios += [drift.beat.ratio]
    if memory == 0.0:
        assert np.median(ratios) == pytest.approx(1.0, abs=0.2)


def scattered(seed: int, beats: int = 12) -> Recording:
    """Tracks of a marker in beats whose size scatters by 2 %, with a memory of 0.3 from beat to beat."""
    frames = 31 * beats
    psi = 2 * np.pi * CONDITION.flap_frequency * recording(np.zeros((frames, 3))).times
    size = lfilter([1.0], [1.0, -0.3], np.random.default_rng(seed).standard_normal(beats + 8))[4:]
    growing = 1.0 + 0.02 * CubicSpline(np.arange(len(size)) - 1.5, size)(np.arange(frames) / 31)
    waves = (0.02 * np.cos(psi) + 0.01 * np.sin(2 * psi), 0.01 * np.sin(psi), 0.005 * np.cos(3 * psi + 1.0))
    return recording(growing[:, None] * np.stack(waves, axis=1) + 2e-6 * noise(frames, 0.0, seed, 3))


def test_beats_that_scatter_in_size_do_not_drift() -> None:
    # All harmonics of both channels scatter alike: one source of noise, not six.
    drifts = [harmonic_fit(scattered(seed)).drift for seed in range(100)]
    assert sum(drift is not None and drift.found for drift in drifts) == 0


@pytest.mark.parametrize("course", [parabola, cosine])
@pytest.mark.parametrize("beats", [4, 8, 20])
def test_a_change_that_goes_and_comes_back_is_found(beats: int, course: Callable[[Array], Array]) -> None:
    drift = harmonic_fit(waving(beats, 0.15, 1, memory=0.0, course=course)).drift
    assert drift is not None
    assert drift.found


@pytest.mark.parametrize("beats", [4, 8])
def test_a_change_of_amplitude_is_found_with_its_size(beats: int) -> None:
    drift = harmonic_fit(waving(beats, 0.2, 1)).drift
    assert drift is not None
    assert drift.found
    expected = 0.2 * np.sqrt(np.mean(np.linspace(0.01, 0.02, 30) ** 2) / 24.0)  # rms of a ramp times a cosine
    assert drift.size == pytest.approx(expected, rel=0.3)


def test_it_is_found_with_gaps_and_in_three_channels() -> None:
    given = waving(8, 0.2, 1, channels=3)
    gappy = given.values.copy()
    gappy[np.random.default_rng(0).random(len(gappy)) < 0.1] = np.nan
    drift = harmonic_fit(recording(gappy)).drift
    assert drift is not None
    assert drift.found


@pytest.mark.parametrize("course", [line, parabola])
@pytest.mark.parametrize("beats", [4, 8])
def test_it_is_not_taken_for_noise(beats: int, course: Callable[[Array], Array]) -> None:
    """Nor is the noise overstated at other harmonics."""
    steady, drifting = (harmonic_fit(waving(beats, change, 1, course=course)) for change in (0.0, 0.3))
    assert np.median(drifting.noise / steady.noise) == pytest.approx(1.0, abs=0.1)
    far = drifting.order > 3
    assert np.median(drifting.variance[:, far] / steady.variance[:, far]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("beats", [4, 8])
def test_trends_show_it_beside_small_noise(beats: int) -> None:
    drifting = harmonic_fit(waving(beats, 0.3, 1))
    first = (drifting.order == 1) & drifting.trend
    excess = drifting.coefficients[:, first] ** 2 / drifting.variance[:, first]
    assert excess.sum(axis=1).mean() > 15.0


def test_it_follows_the_time_where_frames_are_absent() -> None:
    """Half of the frames of the second half are absent, so that the change is bent over the number of the frame."""
    steady, drifting = (waving(3, change, 1, memory=0.0) for change in (0.0, 0.6))
    kept = (np.arange(93) < 46) | (np.arange(93) % 2 == 0)
    levels = [
        harmonic_fit(replace(one, times=one.times[kept], values=one.values[kept])).noise for one in (steady, drifting)
    ]
    assert np.median(levels[1] / levels[0]) == pytest.approx(1.0, abs=0.1)


def test_two_beats_do_not_show_it() -> None:
    assert harmonic_fit(waving(2, 0.2, 1)).drift is None


@pytest.mark.parametrize("still", [0, 1])
def test_a_recording_without_noise_has_no_drift(still: int) -> None:
    """Also where the scatter is exactly zero."""
    given = waving(4, 0.0, 1, channels=3)
    quiet = given.values - SIGMA * noise(len(given.values), 0.6, 1, 3)
    if still:
        quiet[:, 3 - 2 * still :] = 0.0
    drift = harmonic_fit(recording(quiet)).drift
    assert drift is not None
    assert drift.size < 1e-12


def moving(move: Callable[[Array], Array], seed: int, *, beats: int = 28, channels: int = 2) -> Recording:
    """Steady waves with white noise, whose mean moves by ``move`` of the time -1 to 1, in SIGMA."""
    steady = waving(beats, 0.0, seed, memory=0.0, channels=channels).values[:, :channels]
    return recording(steady + SIGMA * move(np.linspace(-1.0, 1.0, len(steady)))[:, None])


def walk(frames: int, memory: float, seed: int) -> Array:
    """Slow noise [T, 3] of unit variance; with ``memory`` 1 a random walk."""
    white = np.random.default_rng(seed).standard_normal((frames + 500, 3))
    found = lfilter([1.0], [1.0, -memory], white, axis=0)[500:]
    return np.asarray(found / found.std(axis=0))


@pytest.mark.parametrize("beats", [8, 28])
def test_a_mean_that_moves_is_found_and_not_taken_for_noise(beats: int) -> None:
    one = harmonic_fit(moving(lambda time: 4.0 * time, 1, beats=beats, channels=3))
    drift, steady = one.drift, harmonic_fit(moving(np.zeros_like, 1, beats=beats, channels=3))
    assert drift is not None
    assert drift.mean.found
    assert not drift.beat.found
    assert drift.size == pytest.approx(4.0 * SIGMA / np.sqrt(3.0), rel=0.1)
    assert one.noise == pytest.approx(steady.noise, rel=0.1)


def test_a_mean_that_goes_and_comes_back_is_found() -> None:
    drift = harmonic_fit(moving(lambda time: 8.0 * time**2, 1, channels=3)).drift
    assert drift is not None
    assert drift.mean.found


@pytest.mark.parametrize("memory", [0.95, 0.998, 1.0])
@pytest.mark.parametrize("beats", [4, 8])
def test_slow_noise_is_no_change_of_the_mean(beats: int, memory: float) -> None:
    waves = [waving(beats, 0.0, seed, channels=3).values for seed in range(60)]
    slow = (10.0 * SIGMA * walk(31 * beats, memory, seed) for seed in range(60))
    assert sum(found(one + noise) for one, noise in zip(waves, slow, strict=True)) <= 1


def test_changes_of_mean_and_beat_do_not_hide_each_other() -> None:
    """Nor does one of them appear in the other."""
    growing = waving(8, 0.3, 1, memory=0.0, channels=3).values
    ramp = 40.0 * SIGMA * np.linspace(-1.0, 1.0, len(growing))[:, None]
    both, beat, mean = (
        harmonic_fit(recording(values)).drift
        for values in (growing + ramp, growing, waving(8, 0.0, 1, memory=0.0, channels=3).values + ramp)
    )
    assert both is not None
    assert beat is not None
    assert mean is not None
    assert [(one.beat.found, one.mean.found) for one in (both, beat, mean)] == [
        (True, True),
        (True, False),
        (False, True),
    ]
    assert both.beat.ratio == pytest.approx(beat.beat.ratio, rel=1e-6)


def test_a_change_within_interpolation_errors_is_none() -> None:
    """Amplitudes that change by a thousandth count as steady, however small the noise."""
    steady = waving(8, 0.0, 1, channels=3).values - SIGMA * noise(248, 0.6, 1, 3)
    time = np.linspace(-1.0, 1.0, 248)[:, None]
    tiny = 1e-7 * noise(248, 0.0, 1, 3)
    assert not found(steady * (1.0 + 5e-4 * time) + tiny)
    assert found(steady * (1.0 + 1e-2 * time) + tiny)
