"""The page about a calibration holds its numbers, draws each camera, and loads nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.cameras.calibrate.simulated import ring, wand_tracks
from tests.cameras.calibrate.test_wand import WANDS, roughly
from wingfit.cameras.calibrate.board import Rejection
from wingfit.cameras.calibrate.report import calibration_report, magnification
from wingfit.cameras.calibrate.wand import calibrate_wand


def test_the_page_is_complete() -> None:
    true = ring((0.0, 40.0))
    result = calibrate_wand(wand_tracks(true, WANDS[0].shape, 40, np.random.default_rng(1)), roughly(true), WANDS[0])
    listed = (Rejection("a", "<b>7", 2, "far & wide"),)
    page = calibration_report(replace(result, rejected=listed, warnings=("corner <unseen>",)))
    assert f"{result.rms_px:.4f} px" in page
    assert result.wand is not None
    assert f"{result.wand.held_out_rms_percent:.3g} %" in page
    assert "&lt;b&gt;7" in page
    assert "far &amp; wide" in page
    assert "corner &lt;unseen&gt;" in page
    assert page.count("predicted less observed") == 2
    assert "Camera a: errors, magnified" in page
    assert "<script src" not in page
    assert "Nothing was rejected" in calibration_report(replace(result, rejected=()))


def test_vectors_are_magnified_by_round_numbers() -> None:
    errors = np.array([[0.3, 0.4]])
    assert magnification(errors, 1000.0) == pytest.approx(100.0)
    assert magnification(errors, 500.0) == pytest.approx(50.0)
    assert magnification(errors, 640.0) == pytest.approx(50.0)
    assert magnification(np.zeros((3, 2)), 640.0) == 1.0
