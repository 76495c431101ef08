"""The flap frequency that a dataset states, against that of its samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

import wingfit
from wingfit.records import Dataset, DatasetError, Recording
from wingfit.records.errors import Faults
from wingfit.records.files.flap_frequency import check_frequency, other_frequency
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS, Balance, campaign
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum

FORCES = campaign(3, replace(EXAMPLE, beats=12), TRIALS[1:2]).recordings[0]
NOISY = replace(EXAMPLE, beats=12, sensor=0.05)  # N: a third of the force that varies


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


@pytest.mark.parametrize("factor", [0.7, 0.95, 1.05, 1.3, 2.0])
@pytest.mark.parametrize("recording", [FORCES, tracks(), tracks(gaps=5)], ids=["forces", "tracks", "gaps"])
def test_a_wrong_frequency_is_found_with_the_right_one(recording: Recording, factor: float) -> None:
    found = other_frequency(stated(recording, factor))
    assert found is not None
    assert found[0] == pytest.approx(recording.condition.flap_frequency, rel=0.005)


@pytest.mark.parametrize(
    "recording",
    [FORCES, campaign(3, NOISY, TRIALS[1:2]).recordings[0], tracks(), tracks(drift=0.05), tracks(gaps=300)],
    ids=["forces", "noise", "tracks", "drift", "many gaps"],
)
def test_a_right_frequency_is_right(recording: Recording) -> None:
    assert other_frequency(recording) is None
    assert other_frequency(stated(recording, 1.002)) is None, "within the resolution"


def test_what_cannot_be_known_is_not_said() -> None:
    """Few beats, and a camera that is too slow for the harmonics."""
    assert other_frequency(stated(tracks(beats=2.0), 1.3)) is None
    assert other_frequency(stated(tracks(rate=14.0, beats=30.0), 1.3)) is None


def test_the_message_says_what_to_correct() -> None:
    faults = Faults()
    check_frequency(stated(FORCES, 1.05), "recording 'test-2'", faults)
    (fault,) = faults.faults
    assert "flap_frequency_hz is 13.125 Hz, but the samples repeat at 12.5 Hz" in fault.message
    assert "correct flap_frequency_hz or time_s" in fault.message


@pytest.mark.parametrize("use", [wingfit.calibrate, wingfit.diagnose])
def test_a_dataset_that_is_made_in_python_is_checked_too(use: object) -> None:
    wrong: Dataset = campaign(3, Balance(every=10, beats=12), TRIALS[:2])
    wrong = replace(wrong, recordings=(wrong.recordings[0], stated(wrong.recordings[1], 1.05)))
    with pytest.raises(DatasetError, match=r"recording 'test-2': flap_frequency_hz is 13.125 Hz, but"):
        use(wrong)  # type: ignore[operator]
