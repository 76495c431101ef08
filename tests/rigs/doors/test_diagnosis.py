"""A diagnosis whose simulations go through a door, in worker processes too."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import wingfit
from tests.rigs.doors.oscillator import CHANNELS, dataset, rig
from wingfit.records import SeriesDataset
from wingfit.rigs.doors.command import command
from wingfit.rigs.doors.door import DoorError

PROGRAM = Path(__file__).parent / "programs" / "oscillator.py"


def repeated() -> SeriesDataset:
    """Two recordings with noise."""
    random = np.random.default_rng(1)
    whole = dataset()
    one = whole.recordings[0]
    noisy = [
        replace(one, name=name, values=one.values + 1e-3 * random.standard_normal(one.values.shape))
        for name in ("a", "b")
    ]
    return replace(whole, recordings=tuple(noisy))


def test_a_rig_behind_a_door_is_diagnosed_in_worker_processes() -> None:
    simulate = command([sys.executable, PROGRAM, "well", "lines"], list(CHANNELS), persistent=True)
    finding = wingfit.diagnose(repeated(), rig=replace(rig(simulate), faults=False), workers=2)
    assert finding.verdict == "adequate"


@pytest.mark.parametrize("workers", [1, 2])
def test_a_broken_door_ends_the_diagnosis(workers: int) -> None:
    simulate = command(["no-such-program"], list(CHANNELS))
    with pytest.raises(DoorError, match="give the path of a program"):
        wingfit.diagnose(repeated(), rig=replace(rig(simulate), faults=False), workers=workers)
