"""Limits of the rig in a dataset: stored in the units of the file, and refused the wrong way round."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.records.samples import falcon_dataset
from tests.records.vehicles import delfly_dataset
from wingfit.records import Dataset, DatasetError, RigLimits, load_dataset, save_dataset
from wingfit.records.files.assemble import describe

LIMITS = RigLimits((1.0, 5.0), angle_of_attack=(0.0, math.radians(10.0)), pressure=(1e3, 101325.0))


@pytest.mark.parametrize("suffix", [".zip", ".nc"])
def test_limits_of_a_rig_are_stored_in_the_units_of_the_file(tmp_path: Path, suffix: str) -> None:
    for dataset in (falcon_dataset(12), delfly_dataset()):
        path = tmp_path / f"{dataset.name}{suffix}"
        save_dataset(replace(dataset, rig_limits=LIMITS), path)
        found = load_dataset(path)
        assert isinstance(found, Dataset)
        assert found.rig_limits is not None
        assert found.rig_limits.angle_of_attack == pytest.approx(LIMITS.angle_of_attack)
        assert (found.rig_limits.flap_frequency, found.rig_limits.phase_lag) == (LIMITS.flap_frequency, None)
    assert "body_pitch_deg" in str(describe(replace(delfly_dataset(), rig_limits=LIMITS))["rig_limits"])


def test_limits_the_wrong_way_round_are_refused(tmp_path: Path) -> None:
    limits = RigLimits(flap_frequency=(5.0, 1.0))
    with pytest.raises(DatasetError, match=r"flap_frequency_hz.*\[5.*, 1.*\].*less than the second: exchange them"):
        save_dataset(replace(falcon_dataset(12), rig_limits=limits), tmp_path / "falcon.zip")
