"""Wing angles from markers, and the motion of the wing from angles."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest

from tests.oracles.wing_kinematics import noise, passive_pitch, split_cycle, wing_markers
from wingfit.records import FourierPitch, PassivePitch
from wingfit.tracking.smoothing import fit_periodic
from wingfit.tracking.wing_kinematics import (
    Angles,
    WingPlace,
    beats_of,
    flap_frequency,
    from_markers,
    pitch_law,
    wing_motion,
)

FREQUENCY, START = 12.37, 0.0311
TABLE_5 = (0.3139, -1.1382, -0.0179, -0.0002)


def angles(seed: int = 1, size: float = 0.003, samples: int = 960) -> Angles:
    rng = np.random.default_rng(seed)
    times = np.arange(samples) / 1200
    zeta, rate, _ = split_cycle((times - START) * FREQUENCY, FREQUENCY)
    pitch = passive_pitch(zeta, rate)
    return Angles(times, zeta + noise(rng, zeta.shape, size, 0, 0), pitch + noise(rng, zeta.shape, size, 0, 0))


@pytest.mark.parametrize("upper", [True, False])
@pytest.mark.parametrize("right", [True, False])
@pytest.mark.parametrize("dihedral", [0.0, 0.15])
def test_angles_come_back_from_markers(upper: bool, right: bool, dihedral: float) -> None:
    times = np.arange(200) / 1200
    zeta, rate, _ = split_cycle(times * FREQUENCY, FREQUENCY)
    pitch = passive_pitch(zeta, rate)
    edge, chord = wing_markers(zeta, pitch, upper, right, dihedral)
    found = from_markers(times, edge, chord, WingPlace(upper, right, dihedral))
    np.testing.assert_allclose(found.flap, zeta, atol=1e-9)
    assert found.pitch is not None
    np.testing.assert_allclose(found.pitch, pitch, atol=1e-9)
    side = 1.0 if right else -1.0
    alone = from_markers(times, edge[:, 2:], None, WingPlace(upper, right, dihedral), (side * 0.01, 0.005))
    np.testing.assert_allclose(alone.flap, zeta, atol=1e-9)


def test_opening_is_down_for_a_lower_wing_and_up_for_an_upper_one() -> None:
    flat = np.array([[[0.0, 0.05, 0.0], [0.0, 0.13, 0.0]], [[0.0, 0.05, 0.01], [0.0, 0.13, 0.03]]])
    for upper, sign in ((False, 1), (True, -1)):
        found = from_markers(np.arange(2.0), flat, None, WingPlace(upper, True, 0.0))
        assert np.sign(found.flap[1] - found.flap[0]) == sign


def test_a_frame_without_all_its_markers_counts_as_a_gap() -> None:
    times = np.arange(50) / 1200
    zeta = split_cycle(times * FREQUENCY, FREQUENCY)[0]
    edge, chord = wing_markers(zeta, np.full(50, 1.2), True, True, 0.0)
    edge[7, 1], chord[9, 0] = np.nan, np.nan
    found = from_markers(times, edge, chord, WingPlace(True, True, 0.0))
    assert found.pitch is not None
    assert np.flatnonzero(np.isnan(found.flap)).tolist() == [7]
    assert np.flatnonzero(np.isnan(found.pitch)).tolist() == [7, 9]


def test_frequency_and_start_are_estimated_within_their_errors() -> None:
    offs = []
    for seed in range(12):
        found = wing_motion(angles(seed))
        assert found.frequency.error is not None
        late = ((found.start - START) * FREQUENCY + 0.5) % 1 - 0.5
        offs.append(((found.frequency.hertz - FREQUENCY) / found.frequency.error, late / FREQUENCY / found.start_error))
    scatter = np.sqrt(np.mean(np.square(offs), axis=0))
    assert 0.5 < scatter[0] < 1.6, scatter
    assert scatter[1] < 1.5, scatter  # holds what the series cuts off: larger than the scatter


def test_the_law_of_equation_17_comes_back_within_its_errors() -> None:
    offs = []
    for seed in range(12):
        found = wing_motion(angles(seed), pitch="passive", start=START)
        assert found.law is not None
        assert isinstance(found.motion.pitch, PassivePitch)
        law = found.law.pitch
        values = np.array([law.constant, law.flap, law.flap_rate, law.flap_rate_squared])
        np.testing.assert_allclose(values, TABLE_5, rtol=0.05)
        offs.append((values - TABLE_5) / found.law.errors)
    scatter = np.sqrt(np.mean(np.square(offs), axis=0))
    assert np.all(scatter < 2.0), scatter
    assert np.all(scatter > 0.4), scatter


def test_the_errors_of_equation_17_hold_the_noise_of_the_flap_angle() -> None:
    offs = []
    for seed in range(12):
        seen = angles(seed, 0.02, 300)
        zeta, rate, _ = split_cycle((seen.times - START) * FREQUENCY, FREQUENCY)
        flap = fit_periodic(seen.times, seen.flap, FREQUENCY, 2, START)
        law = pitch_law(seen.times, passive_pitch(zeta, rate), flap)
        offs.append((law.pitch.constant - TABLE_5[0]) / law.errors[0])
    assert np.sqrt(np.mean(np.square(offs))) < 2.0, offs


def test_a_pitch_that_lags_has_a_misfit_to_equation_17() -> None:
    seen = angles()
    zeta, rate, _ = split_cycle((seen.times - START) * FREQUENCY - 0.08, FREQUENCY)
    late = Angles(seen.times, seen.flap, passive_pitch(zeta, rate))
    assert any("misfit of Eq. 17" in remark for remark in wing_motion(late, pitch="passive").remarks)
    assert not any("Eq. 17" in remark for remark in wing_motion(seen, pitch="passive", start=START).remarks)


def test_the_series_of_the_pitch_starts_with_the_beat() -> None:
    found = wing_motion(angles())
    assert isinstance(found.motion.pitch, FourierPitch)
    phase = np.arange(100) / 100
    zeta, rate, _ = split_cycle(phase, FREQUENCY)
    difference = found.pitch.at(phase) - passive_pitch(zeta, rate)
    assert np.sqrt(np.mean(difference**2)) < 1.5 * found.pitch.error[0] + 0.01


def test_without_a_dihedral_the_closed_wing_is_zero() -> None:
    seen = angles()
    found = wing_motion(Angles(seen.times, seen.flap + 0.4, seen.pitch), closed=None)
    phase = np.arange(1000) / 1000
    assert found.flap.at(phase).min() == pytest.approx(0.0, abs=1e-4)
    assert found.motion.flap.kind == "fourier"
    assert any("zero of the flap angle" in remark for remark in found.remarks)


def test_a_wrong_start_is_remarked_on() -> None:
    found = wing_motion(angles(), start=START + 0.2 / FREQUENCY)
    assert any("not at the start given" in remark for remark in found.remarks)


def test_phases_that_restart_in_every_beat_are_unwrapped() -> None:
    np.testing.assert_allclose(beats_of(np.array([0.1, 0.6, 0.05, 0.9, 0.0])), [0.1, 0.6, 1.05, 1.9, 2.0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"samples": 100}, ("spans 1.", "beats", "give it")),
        ({"samples": 8}, ("8 samples", "at least 9")),
    ],
)
def test_too_little_for_a_frequency_is_refused(change: dict[str, Any], words: tuple[str, ...]) -> None:
    seen = angles(**change)
    with pytest.raises(ValueError, match=words[0]) as error:
        flap_frequency(seen.times, seen.flap)
    assert all(word in str(error.value) for word in words)


@pytest.mark.parametrize("decay", [0.0, 0.9])
@pytest.mark.parametrize("samples", [40, 600])
def test_noise_gives_no_frequency(decay: float, samples: int) -> None:
    believed = 0
    for seed in range(20):
        draw = noise(np.random.default_rng(seed), (samples,), 0.005, 0.02 * (decay > 0), decay)
        with contextlib.suppress(ValueError):
            flap_frequency(np.arange(samples) / 1200, draw)
            believed += 1
    assert believed <= 1
    with pytest.raises(ValueError, match=r"no significant flap frequency: .* Hz, is explained by noise"):
        flap_frequency(np.arange(samples) / 1200, np.random.default_rng(7).normal(0, 0.005, samples))


def test_the_frequency_of_a_weak_motion_is_detected_in_noise() -> None:
    t = np.arange(1200) / 1200
    for seed in range(5):
        y = 0.02 * np.sin(2 * np.pi * FREQUENCY * t) + noise(np.random.default_rng(seed), t.shape, 0.03, 0, 0)
        assert flap_frequency(t, y).hertz == pytest.approx(FREQUENCY, abs=0.2)


@pytest.mark.parametrize("frequency", [None, 12.5])
def test_constant_angles_are_no_motion(frequency: float | None) -> None:
    still = Angles(np.arange(600) / 1200, np.full(600, 0.5), np.full(600, 1.2))
    with pytest.raises(ValueError, match=r"28\.65 deg throughout: there is no motion"):
        wing_motion(still, frequency)


def test_a_constant_pitch_is_one() -> None:
    given = angles()
    found = wing_motion(Angles(given.times, given.flap, np.full_like(given.flap, 1.2)), FREQUENCY)
    assert isinstance(found.motion.pitch, FourierPitch)
    assert found.motion.pitch.mean == pytest.approx(1.2)


def test_a_given_frequency_that_explains_little_is_remarked_on() -> None:
    assert not any("explains" in remark for remark in wing_motion(angles(), FREQUENCY).remarks)
    (remark,) = (r for r in wing_motion(angles(), 17.0).remarks if "explains" in r)
    share = int(remark.partition("explains ")[2].split()[0])
    assert share < 10
    assert "given, 17 Hz" in remark
    assert "flap angle is 12.3" in remark
    flat = noise(np.random.default_rng(3), (960,), 0.02, 0, 0)
    (remark,) = (r for r in wing_motion(Angles(angles().times, flat, flat), 17.0).remarks if "explains" in r)
    assert "no frequency can be estimated" in remark
