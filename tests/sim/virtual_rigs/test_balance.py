from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wingfit.records import load_dataset, wing_or_vehicle
from wingfit.records.dataset import STANDARD_GRAVITY
from wingfit.sim.vehicle.lift_drag import lift_drag
from wingfit.sim.virtual_rigs import save_with_truth
from wingfit.sim.virtual_rigs.balance import (
    EXAMPLE,
    HELD_OUT,
    TRIALS,
    Balance,
    campaign,
    delfly,
    read_truth,
    record,
    true_beat,
    write_campaign,
)

QUIET = Balance(sensor=0.0, participation=0.0, rattle=0.0, drift=0.0, scatter=0.0, timing=0.0, beats=10, decimals=12)
TRIAL = TRIALS[1]  # 12.5 Hz: 1000 samples a beat


@pytest.fixture(scope="module")
def beat() -> np.typing.NDArray[np.float64]:
    return true_beat(delfly(), TRIAL)


def taken(beat: np.typing.NDArray[np.float64], balance: Balance, seed: int = 0) -> np.typing.NDArray[np.float64]:
    return record(beat, TRIAL, balance, np.random.default_rng(seed)).values


def test_vehicle_is_that_of_table_3() -> None:
    vehicle = delfly()
    at, chord = [s.r for s in vehicle.stations], [s.chord for s in vehicle.stations]
    assert 2 * vehicle.span == pytest.approx(0.274)
    assert 2 * np.trapezoid(chord, at) == pytest.approx(2.11e-2, rel=1e-3)
    assert (chord[0], chord[-1]) == (0.085, 0.056)


def test_conditions_are_those_of_table_4() -> None:
    assert [t.condition.flap_frequency for t in TRIALS] == [13.3, 12.5, 12.5, 12.5, 11.7, 13.3, 11.7, 10.3]
    assert [t.condition.airspeed for t in TRIALS] == [0.30, 0.50, 0.55, 0.65, 0.70, 0.80, 1.00, 2.00]
    assert [round(math.degrees(t.condition.angle_of_attack)) for t in TRIALS] == [83, 74, 70, 71, 62, 65, 45, 31]


def test_lift_carries_the_vehicle_and_drag_is_small() -> None:
    """Level flight in trim: what the tables' coefficients give is not far from the weight."""
    for trial in TRIALS:
        lift, drag = lift_drag(true_beat(delfly(), trial).mean(axis=0), trial.condition.angle_of_attack)
        assert lift == pytest.approx(STANDARD_GRAVITY * trial.mass, rel=0.3)
        assert abs(drag) < 0.4 * lift


def test_a_perfect_balance_records_the_forces(beat: np.typing.NDArray[np.float64]) -> None:
    values = taken(beat, QUIET).reshape(10, 1000, 2)
    np.testing.assert_array_equal(values[0], values[7])
    np.testing.assert_allclose(values[0, ::5, 0], np.interp(np.arange(200) / 200, np.arange(1600) / 1600, beat[:, 0]))


def test_sensor_noise_is_white_and_as_large_as_stated(beat: np.typing.NDArray[np.float64]) -> None:
    noise = taken(beat, replace(QUIET, sensor=1.5e-3)) - taken(beat, QUIET)
    assert noise.std(axis=0) == pytest.approx([1.5e-3] * 2, rel=0.03)
    assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.03


def test_rattle_is_at_the_resonance(beat: np.typing.NDArray[np.float64]) -> None:
    noise = taken(beat, replace(QUIET, rattle=8e-3, beats=40)) - taken(beat, replace(QUIET, beats=40))
    power = np.abs(np.fft.rfft(noise, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(noise), 1 / 12_500.0)
    assert frequency[power.argmax(axis=0)] == pytest.approx(Balance().resonance, abs=6)
    assert noise.std(axis=0) == pytest.approx([8e-3] * 2, rel=0.3)


def test_resonance_amplifies_a_harmonic_as_an_oscillator_does() -> None:
    """A steady wave at 37.5 Hz through an oscillator of 120 Hz: gain 1 / (1 - r^2) on the part that takes part."""
    phase = np.arange(1600) / 1600
    wave = np.stack([np.cos(6 * np.pi * phase)] * 2, axis=1)
    found = taken(wave, replace(QUIET, participation=0.1))[:, 0]
    plain = taken(wave, QUIET)[:, 0]
    assert found @ plain / (plain @ plain) == pytest.approx(1 + 0.1 * (1 / (1 - (37.5 / 120) ** 2) - 1), rel=2e-3)


def test_beats_scatter_and_drift_as_stated(beat: np.typing.NDArray[np.float64]) -> None:
    many = replace(QUIET, beats=400, every=10)
    level = np.ones_like(beat)
    scatter = taken(level, replace(many, scatter=0.02, memory=0.0)).reshape(400, 100, 2)[:, 50, 0]
    assert scatter.std() == pytest.approx(0.02, rel=0.15)
    drifts = [taken(0 * beat, replace(QUIET, drift=1e-3, beats=2), seed)[-1, 0] for seed in range(60)]
    assert np.std(drifts) == pytest.approx(1e-3, rel=0.3)


def test_the_beat_begins_late_or_early() -> None:
    ramp = np.repeat(np.abs(np.arange(1600) / 800 - 1)[:, None], 2, axis=1)  # falls by 2 a beat in its first half
    moved = (taken(ramp, replace(QUIET, beats=200, timing=0.002)) - taken(ramp, replace(QUIET, beats=200)))[:, 0]
    at_middle_of_fall = moved.reshape(200, 1000)[:, 250]
    assert at_middle_of_fall.std() == pytest.approx(2 * 0.002 * math.sqrt(0.75**2 + 0.25**2), rel=0.2)


def test_thinning_keeps_the_forces_and_no_more(beat: np.typing.NDArray[np.float64]) -> None:
    thin = record(beat, TRIAL, replace(QUIET, every=10), np.random.default_rng(0))
    assert thin.values.shape == (1000, 2)
    assert np.diff(thin.times) == pytest.approx(np.full(999, 8e-4))
    assert thin.values.mean(axis=0) == pytest.approx(beat.mean(axis=0), rel=1e-3)
    noise = taken(0 * beat, replace(QUIET, sensor=1.5e-3, every=10))
    assert noise.std() < 0.4 * 1.5e-3  # white noise above the new half rate is gone, not folded back


def test_same_seed_same_noise() -> None:
    one, other = campaign(3, EXAMPLE, TRIALS[:1]), campaign(4, EXAMPLE, TRIALS[:1])
    np.testing.assert_array_equal(one.recordings[0].values, campaign(3, EXAMPLE, TRIALS[:1]).recordings[0].values)
    assert np.abs(one.recordings[0].values - other.recordings[0].values).max() > 1e-3


@pytest.mark.parametrize(
    ("written", "name"), [("my-balance", "my-balance"), ("tests.2.zip", "tests.2"), ("v1.5", "v1.5")]
)
def test_a_written_dataset_has_the_name_of_its_folder_or_file(tmp_path: Path, written: str, name: str) -> None:
    dataset = campaign(1, QUIET, TRIALS[:2])
    save_with_truth(dataset, {}, tmp_path / written)
    assert load_dataset(tmp_path / written).name == name


def test_campaign_is_written_with_its_truth(tmp_path: Path) -> None:
    truth = read_truth(write_campaign(tmp_path / "delfly"))
    dataset = wing_or_vehicle(load_dataset(tmp_path / "delfly"))
    assert truth["test-8"] == {"C_D0": 0.0, "C_Dpi2": 2.0, "C_l": 2.02, "C_r": 1.57, "C_F": 0.67}
    assert dataset.held_out == HELD_OUT
    assert dataset.vehicle == delfly()
    written = campaign(1, EXAMPLE, held_out=HELD_OUT)
    for read, made in zip(dataset.recordings, written.recordings, strict=True):
        np.testing.assert_allclose(read.values, made.values, atol=1e-12)
        assert read.mass == made.mass
    assert sum(f.stat().st_size for f in (tmp_path / "delfly").rglob("*") if f.is_file()) < 1.5e6
