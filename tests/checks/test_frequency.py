"""The flap frequency and the unit of time that a dataset states, against those of its samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.checks.frequency import check_frequency
from wingfit.checks.mistake import KeyEdit
from wingfit.records import Recording
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS, Balance, campaign
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum

FORCES = campaign(3, replace(EXAMPLE, beats=12), TRIALS[1:2]).recordings[0]
NOISY: Balance = replace(EXAMPLE, beats=12, sensor=0.05)  # N: a third of the force that varies


def stated(recording: Recording, factor: float) -> Recording:
    condition = recording.condition
    return replace(recording, condition=replace(condition, flap_frequency=factor * condition.flap_frequency))


def tracks(*, beats: float = 6.0, rate: float = 90.0, drift: float = 0.0, gaps: int = 0) -> Recording:
    """Markers that move as two harmonics of 3 Hz, with noise."""
    rng, blank = np.random.default_rng(2), blank_recording(robird_wing(), vacuum(10.0, 0.0, 3.0))
    times: npt.NDArray[np.float64] = np.arange(int(beats * rate / 3.0)) / rate
    phase = 2 * np.pi * 3.0 * times[:, None]
    size, shift = rng.uniform(0.01, 0.1, (2, blank.values.shape[1]))
    values = size * np.sin(phase + shift) + 0.3 * size * np.cos(2 * phase) + drift * times[:, None]
    values = values + 3e-4 * rng.standard_normal(values.shape)
    values[rng.integers(0, len(times), gaps), rng.integers(0, values.shape[1], gaps)] = np.nan
    return replace(blank, times=times, values=values)


@pytest.mark.parametrize("factor", [0.7, 0.95, 1.05, 1.3, 2.0, 0.5, 2 * np.pi, 60.0])
@pytest.mark.parametrize("recording", [FORCES, tracks(), tracks(gaps=5)], ids=["forces", "tracks", "gaps"])
def test_a_wrong_frequency_is_found_with_the_right_one(recording: Recording, factor: float) -> None:
    found = check_frequency(stated(recording, factor), 0)
    assert found is not None
    assert found.kind == "frequency"
    (edit,) = found.edits
    assert isinstance(edit, KeyEdit)
    assert edit.path == ("recordings", 0, "flap_frequency_hz")
    assert float(edit.new) == pytest.approx(recording.condition.flap_frequency, rel=0.005)


@pytest.mark.parametrize(
    "recording",
    [FORCES, campaign(3, NOISY, TRIALS[1:2]).recordings[0], tracks(), tracks(drift=0.05), tracks(gaps=100)],
    ids=["forces", "noise", "tracks", "drift", "many gaps"],
)
def test_a_right_frequency_is_right(recording: Recording) -> None:
    assert check_frequency(recording, 0) is None
    assert check_frequency(stated(recording, 1.002), 0) is None, "within what clocks and motors differ by"


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1 / 60.0, "minutes")])
@pytest.mark.parametrize("recording", [FORCES, tracks()], ids=["forces", "tracks"])
def test_another_unit_of_time_is_certain(recording: Recording, factor: float, unit: str) -> None:
    found = check_frequency(replace(recording, times=factor * recording.times), 0)
    assert found is not None
    assert (found.kind, found.certain) == ("time unit", True)
    assert unit in found.cause


def test_numbers_of_frames_are_no_times() -> None:
    recording = tracks()
    found = check_frequency(replace(recording, times=np.arange(len(recording.times), dtype=float)), 0)
    assert found is not None
    assert found.kind == "time unit"
    assert "about 90 Hz" in found.change


def test_what_cannot_be_known_is_not_said() -> None:
    assert check_frequency(stated(tracks(beats=1.0), 1.05), 0) is None, "one beat"
    nothing = replace(tracks(), values=np.full_like(tracks().values, np.nan))
    assert check_frequency(nothing, 0) is None
