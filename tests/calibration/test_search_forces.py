"""Calibrations of vehicles on forces: stages, filtering, what is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.calibration.conftest import FORCE_TRUTHS
from tests.calibration.test_search import Here, refused
from wingfit.calibration.preparation import as_fitted
from wingfit.calibration.search import CalibrationSpec, calibrate, prepare
from wingfit.records import Dataset, LowPass, Recording


def test_each_recording_of_forces_is_a_stage_of_its_own(forces: Dataset) -> None:
    whole = list(calibrate(CalibrationSpec(), forces, Here()))
    stages = [r.name for r in forces.fitted]
    assert list(dict.fromkeys(g.stage for g in whole)) == [f"{name}, Gauss-Newton" for name in stages]
    last = {g.stage: g for g in whole}
    assert list(whole[-1].checkpoint["found"]) == stages
    for recording, truth in zip(forces.fitted, FORCE_TRUTHS, strict=False):
        end = last[f"{recording.name}, Gauss-Newton"]
        assert whole[-1].checkpoint["found"][recording.name] == end.genome
        for name, value in truth.items():
            assert end.genome[name] == pytest.approx(value, rel=0.05), name
        fitted = as_fitted(CalibrationSpec(), recording)
        assert end.distance == pytest.approx(np.sqrt(end.best / fitted.valid[:, 0].sum()))
    assert whole[-1].progress == 1
    cut = len([g for g in whole if g.stage.startswith(stages[0])])
    for k in (1, cut, cut + 1):
        checkpoint = json.loads(json.dumps(whole[k - 1].checkpoint, allow_nan=False))
        assert list(calibrate(CalibrationSpec(), forces, Here(), checkpoint)) == whole[k:]


def test_forces_together_have_one_genome(forces: Dataset) -> None:
    *_, last = calibrate(CalibrationSpec(mode="joint", axes=("x", "z")), forces, Here())
    assert last.stage == "joint, Gauss-Newton"
    low, high = sorted(truth["C_l"] for truth in FORCE_TRUTHS)
    assert low - 0.05 < last.genome["C_l"] < high + 0.05
    assert last.checkpoint["found"] == {"joint": last.genome}


def test_forces_are_low_passed_before_they_are_fitted(forces: Dataset) -> None:
    (first, _) = prepare(CalibrationSpec(), forces).stages
    (record,) = first.recordings
    assert isinstance(record, Recording)
    assert record.low_pass == LowPass(3.2 * 12.5)
    assert (
        np.nanmax(np.abs(np.diff(record.values, axis=0))) < np.abs(np.diff(forces.recordings[0].values, axis=0)).max()
    )
    (wide, _) = prepare(CalibrationSpec(low_pass=67.0), forces).stages
    (record_wide, *_) = wide.recordings
    assert isinstance(record_wide, Recording)
    assert record_wide.low_pass == LowPass(67.0)
    (raw, _) = prepare(CalibrationSpec(low_pass=0.0), forces).stages
    assert raw.recordings[0] is forces.recordings[0]
    assert prepare(CalibrationSpec(low_pass=67.0), replace(forces, recordings=(record, forces.recordings[1]))).stages[
        0
    ].recordings == (record,)


def test_what_a_vehicle_searches_and_what_is_refused(forces: Dataset) -> None:
    assert prepare(CalibrationSpec(), forces).stages[0].free == ("C_l", "C_r", "C_F")
    assert prepare(CalibrationSpec(without=("clap_and_peel",)), forces).stages[0].free == ("C_l", "C_r")
    assert prepare(CalibrationSpec(genes=("C_D0", "C_l")), forces).stages[0].free == ("C_l", "C_D0")
    refused(CalibrationSpec(preset="best"), forces, "unknown model 'best'")
    refused(CalibrationSpec(without=("lift",)), forces, "no term 'lift' to leave out")
    refused(CalibrationSpec(axes=("y",)), forces, "'y' is to be fitted, but recording")
    blind = [replace(r, values=np.full_like(r.values, np.nan)) for r in forces.recordings]
    refused(CalibrationSpec(low_pass=0.0), replace(forces, recordings=tuple(blind)), "nothing to compare")
