"""Faults of channels and inputs against closed forms, and that zero switches them off."""

from __future__ import annotations

import numpy as np
import pytest

from tests.rigs.oscillator import blank, run_of
from wingfit.records.array_types import Array
from wingfit.rigs.faults import Fault, Scales, channel_faults, input_faults

UNITS = {"position": "m", "speed": "m/s", "push": "N"}
TIMES = blank().times
SMOOTH = np.sin(3.0 * TIMES)
OTHER = 2.0 * np.cos(3.0 * TIMES)


def scales() -> Scales:
    recorded = blank(values=np.stack([SMOOTH, OTHER], axis=1), inputs={"push": 0.5 * TIMES})
    return Scales.of([recorded], UNITS)


CHANNEL = channel_faults(["position", "speed"], scales())
INPUT = input_faults(["push"], scales())


def seen(name: str, size: float) -> Array:
    """The position with the fault ``name`` of a size."""
    fault, recording = CHANNEL[name], blank()
    assert fault.after is not None
    values = {fault.suspect.genes[0].name: size}
    return fault.after({"position": SMOOTH, "speed": OTHER}, run_of(recording), values)["position"]


def commanded(name: str, size: float) -> Array:
    fault = INPUT[name]
    assert fault.before is not None
    run = run_of(blank(inputs={"push": SMOOTH}))
    return np.asarray(fault.before(run, {fault.suspect.genes[0].name: size}).inputs["push"])


@pytest.mark.parametrize("name", sorted(CHANNEL))
def test_zero_is_exactly_off_in_channels(name: str) -> None:
    fault = CHANNEL[name]
    values = {gene.name: 0.0 for gene in fault.suspect.genes}
    run = run_of(blank())
    channels = {"position": SMOOTH, "speed": OTHER}
    if fault.before:
        np.testing.assert_array_equal(fault.before(run, values).times, run.times)
    if fault.after:
        for name_, before in channels.items():
            np.testing.assert_array_equal(fault.after(channels, run, values)[name_], before)


@pytest.mark.parametrize("name", sorted(INPUT))
def test_zero_is_exactly_off_in_inputs(name: str) -> None:
    np.testing.assert_array_equal(commanded(name, 0.0), SMOOTH)


def test_gain_offset_and_drift() -> None:
    np.testing.assert_allclose(seen("gain.position", 0.1), 1.1 * SMOOTH)
    np.testing.assert_allclose(seen("offset.position", 0.1), SMOOTH + 0.1)
    np.testing.assert_allclose(seen("drift.position", 0.1), SMOOTH + 0.1 * TIMES / TIMES[-1])


def test_a_delay_shows_what_was_earlier() -> None:
    late = seen("delay.position", 0.03)
    np.testing.assert_allclose(late[5:-5], np.sin(3.0 * (TIMES - 0.03))[5:-5], atol=1e-5)


def test_a_low_pass_lags_a_ramp_by_its_time_constant() -> None:
    fault, recording = CHANNEL["low_pass.position"], blank()
    assert fault.after is not None
    ramp = {"position": 2.0 * TIMES, "speed": OTHER}
    after = fault.after(ramp, run_of(recording), {"low_pass.position.constant": 0.2})["position"]
    np.testing.assert_allclose(after, 2.0 * (TIMES - 0.2 * (1.0 - np.exp(-TIMES / 0.2))), atol=1e-9)


def test_a_low_pass_weakens_and_delays_a_wave() -> None:
    after, constant = seen("low_pass.position", 0.1), 0.1
    late = TIMES > 1.5
    response = 1.0 / (1.0 + 3.0j * constant)
    expected = np.imag(response * np.exp(3.0j * TIMES))
    np.testing.assert_allclose(after[late], expected[late], atol=6e-4)  # linear between samples


def test_saturation_cuts_the_largest_values() -> None:
    after = seen("saturation.position", 0.25)
    assert np.abs(after).max() == pytest.approx(0.75 * np.abs(SMOOTH).max())
    inside = np.abs(SMOOTH) < 0.7
    np.testing.assert_array_equal(after[inside], SMOOTH[inside])


def test_crosstalk_is_relative_to_the_ranges() -> None:
    np.testing.assert_allclose(seen("crosstalk.position.speed", 0.1), SMOOTH + 0.1 * OTHER / 2.0, atol=1e-4)


def test_a_clock_stretches_time_for_channels_and_inputs() -> None:
    fault = CHANNEL["clock"]
    assert fault.before is not None
    run = fault.before(run_of(blank(inputs={"push": SMOOTH})), {"clock.rate": 0.01})
    np.testing.assert_allclose(run.times, 1.01 * TIMES)
    np.testing.assert_allclose(run.input("push", 1.01 * TIMES), SMOOTH)


def test_faults_of_inputs() -> None:
    np.testing.assert_allclose(commanded("gain.push", -0.2), 0.8 * SMOOTH)
    np.testing.assert_allclose(commanded("offset.push", 0.2), SMOOTH + 0.2)
    late = commanded("delay.push", 0.1)
    np.testing.assert_allclose(late[10:], np.sin(3.0 * (TIMES - 0.1))[10:], atol=1e-3)


def test_families_tell_faults_from_physics() -> None:
    assert {fault.suspect.family for fault in CHANNEL.values()} == {"measurement"}
    assert {fault.suspect.family for fault in INPUT.values()} == {"input"}


def test_many_channels_have_no_crosstalk_for_every_pair() -> None:
    units = {f"c{k}": "m" for k in range(6)}
    ones = dict.fromkeys(units, 1.0)
    found = channel_faults(list(units), Scales(ones, ones, units, 0.01))
    assert not any(name.startswith("crosstalk") for name in found)
    assert all(isinstance(one, Fault) for one in found.values())


def test_the_limit_of_a_recorder_is_the_same_in_every_recording() -> None:
    fault, run = CHANNEL["saturation.position"], run_of(blank())
    assert fault.after is not None
    limits = []
    for size in (1.0, 3.0):
        seen_ = fault.after({"position": size * SMOOTH, "speed": OTHER}, run, {"saturation.position.part": 0.4})
        limits.append(float(np.abs(seen_["position"]).max()))
    assert limits[0] == pytest.approx(limits[1]) == pytest.approx(0.6 * np.abs(SMOOTH).max())


def test_an_input_that_never_changes_may_have_an_offset() -> None:
    recorded = blank(values=np.stack([SMOOTH, OTHER], axis=1), inputs={"push": np.full(len(TIMES), 12.0)})
    offset = input_faults(["push"], Scales.of([recorded], UNITS))["offset.push"].suspect.genes[0]
    assert offset.upper == pytest.approx(12.0)
