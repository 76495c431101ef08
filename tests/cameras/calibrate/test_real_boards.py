"""The stereo chessboards that come with OpenCV (package opencv-doc): 13 pairs, 9 x 6 inner corners."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from wingfit.cameras.calibrate.board import Board, Sightings
from wingfit.cameras.calibrate.boards import find_boards
from wingfit.cameras.calibrate.from_boards import calibrate_boards

DATA = Path(os.environ.get("OPENCV_DOC_DATA", "/usr/share/doc/opencv-doc/examples/data"))
SQUARE_M = 0.025
pytestmark = pytest.mark.skipif(
    not (DATA / "left01.jpg").is_file(),
    reason=f"no left01.jpg in {DATA}: install opencv-doc, or set OPENCV_DOC_DATA to its folder of examples",
)


@pytest.fixture(scope="module")
def pairs() -> Sightings:
    images = {side: sorted(DATA.glob(f"{side}[0-9][0-9].jpg")) for side in ("left", "right")}
    return find_boards(images, Board(9, 6, SQUARE_M))


def test_all_boards_are_detected_and_matched(pairs: Sightings) -> None:
    assert len(pairs.corners) == 26
    assert not pairs.unseen
    assert pairs.views == tuple(str(i) for i in range(1, 15) if i != 10)


def test_the_errors_are_those_of_opencv(pairs: Sightings) -> None:
    """The same corners and lens have the same least squares: RMS and parameters agree with ``cv2.stereoCalibrate``."""
    result = calibrate_boards(pairs, reject=False)
    assert result.rms_px < 0.25
    objects = [pairs.board.corners.astype(np.float32)] * 13
    left, right = ([pairs.corners[c, view].astype(np.float32) for view in range(13)] for c in (0, 1))
    size = pairs.sizes_px[0]
    first, second = (cv2.calibrateCamera(objects, one, size, None, None)[1:3] for one in (left, right))
    flags, criteria = cv2.CALIB_USE_INTRINSIC_GUESS, (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-10)
    found = cv2.stereoCalibrate(objects, left, right, *first, *second, size, flags=flags, criteria=criteria)
    assert result.rms_px == pytest.approx(found[0], rel=1e-4)
    errors = dict(zip(result.parameters, result.standard_errors, strict=True))
    for camera, matrix in zip(result.cameras, (found[1], found[3]), strict=True):
        assert camera.matrix[0, 0] == pytest.approx(matrix[0, 0], abs=0.2 * errors[f"{camera.name}.f_x"])
        assert camera.matrix[1, 2] == pytest.approx(matrix[1, 2], abs=0.2 * errors[f"{camera.name}.c_y"])
    np.testing.assert_allclose(result.cameras[1].translation, np.ravel(found[6]), atol=2e-5)
    np.testing.assert_allclose(result.cameras[1].rotation, found[5], atol=2e-4)


def test_outliers_are_few_and_the_rest_is_better(pairs: Sightings) -> None:
    result = calibrate_boards(pairs)
    used = sum(len(one.pixels) for one in result.errors)
    assert 0.99 * 26 * 54 < used < 26 * 54
    assert result.sigma0_px < 0.15
    assert np.linalg.norm(result.cameras[1].centre) == pytest.approx(0.0831, abs=0.0003)
    assert any("upper right" in one for one in result.warnings)
