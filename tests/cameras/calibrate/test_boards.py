"""Calibration from a chessboard: recovered parameters, their covariance, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from tests.cameras.calibrate.simulated import DISTANCE, board_poses, parameter_errors, ring, sightings
from wingfit.cameras.calibrate.board import Board, Sightings
from wingfit.cameras.calibrate.from_boards import calibrate_boards
from wingfit.cameras.calibrate.result import Calibration
from wingfit.cameras.camera import Camera, LensModel
from wingfit.records.errors import DatasetError

BOARD = Board(9, 6, 0.02)
NOISE = 0.2


def seen(
    cameras: tuple[Camera, ...], seed: int, views: int = 14, board: Board = BOARD, near: float = 0.05
) -> Sightings:
    rng = np.random.default_rng(seed)
    return sightings(cameras, board, board_poses(rng, views, board, near=near), rng, NOISE)


def normalised(result: Calibration, true: tuple[Camera, ...]) -> tuple[np.ndarray, float]:
    """Errors over standard errors of what was estimated, and their chi-squared with the covariance."""
    free = np.array(result.free)
    errors, covariance = parameter_errors(result.cameras, true)[free], result.covariance[np.ix_(free, free)]
    return errors / np.sqrt(np.diag(covariance)), float(errors @ np.linalg.solve(covariance, errors))


def test_without_noise_the_cameras_come_back_exactly() -> None:
    true = ring((0.0, 30.0))
    rng = np.random.default_rng(0)
    result = calibrate_boards(sightings(true, BOARD, board_poses(rng, 8, BOARD), rng, noise=0.0))
    errors = parameter_errors(result.cameras, true)
    assert np.abs(errors / np.maximum(1, np.abs(errors))).max() < 1e-5
    assert result.rms_px < 1e-6
    assert not result.rejected


def test_errors_are_those_that_the_covariance_states() -> None:
    """Chi-squared of all parameters over 20 draws: standard errors that are wrong by 15 % would fail."""
    true = ring((0.0, 25.0))
    total, count, largest, sigma = 0.0, 0, 0.0, []
    for seed in range(20):
        result = calibrate_boards(seen(true, seed, 8))
        ratios, squares = normalised(result, true)
        total, count, largest = total + squares, count + len(ratios), max(largest, float(np.abs(ratios).max()))
        sigma.append(result.sigma0_px)
    assert chi2.cdf(total, count) == pytest.approx(0.5, abs=0.4995)
    assert largest < 4
    assert np.mean(sigma) == pytest.approx(NOISE, rel=0.01)


@pytest.mark.parametrize(
    ("lens", "focal", "near", "fixed"),
    [
        ("pinhole", 1100.0, 0.05, ()),
        ("fisheye", 500.0, 0.15, ()),
        ("rational", 1100.0, 0.05, ("k4", "k5", "k6")),
        ("brown", 1100.0, 0.05, ("k3",)),
    ],
)
def test_lenses_are_recovered_within_four_standard_errors(
    lens: LensModel, focal: float, near: float, fixed: tuple[str, ...]
) -> None:
    true = tuple(_without(camera, fixed) for camera in ring((0.0, 25.0), lens, focal))
    result = calibrate_boards(seen(true, 1, 8, near=near), lens=lens, fixed=fixed)
    ratios, _ = normalised(result, true)
    assert np.abs(ratios).max() < 4
    held = [name.rpartition(".")[2] in fixed for name in result.parameters]
    np.testing.assert_array_equal(result.covariance[held], 0)
    assert all(error == 0 for error, one in zip(parameter_errors(result.cameras, true), held, strict=True) if one)


def _without(camera: Camera, fixed: tuple[str, ...]) -> Camera:
    names = camera.parameter_names[4:]
    values = tuple(0.0 if n in fixed else v for n, v in zip(names, camera.lens.coefficients, strict=False))
    return replace(camera, lens=replace(camera.lens, coefficients=values))


def test_cameras_that_never_see_the_board_together_are_joined_by_others() -> None:
    true = ring((0.0, 40.0, 80.0, 120.0))
    rng = np.random.default_rng(3)
    poses = board_poses(rng, 24, BOARD)
    pairs: dict[int, tuple[int, ...]] = {view: ((0, 1), (1, 2), (2, 3))[view % 3] for view in range(24)}
    result = calibrate_boards(sightings(true, BOARD, poses, rng, NOISE, pairs))
    assert np.abs(normalised(result, true)[0]).max() < 4


def test_groups_of_cameras_without_a_shared_view_are_named() -> None:
    rng = np.random.default_rng(3)
    poses = board_poses(rng, 24, BOARD)
    pairs: dict[int, tuple[int, ...]] = {view: ((0, 1), (2, 3))[view % 2] for view in range(24)}
    apart = sightings(ring((0.0, 40.0, 80.0, 120.0)), BOARD, poses, rng, NOISE, pairs)
    with pytest.raises(DatasetError, match="cameras c, d and the cameras a, b"):
        calibrate_boards(apart)


def test_the_board_of_a_view_can_be_the_space() -> None:
    true = ring((0.0, 25.0))
    rng = np.random.default_rng(4)
    poses = board_poses(rng, 10, BOARD)
    given = sightings(true, BOARD, poses, rng, NOISE)
    result = calibrate_boards(given, world="03")
    rotation, translation = poses[0][3], poses[1][3]
    moved = tuple(
        replace(one, rotation=one.rotation @ rotation, translation=one.rotation @ translation + one.translation)
        for one in true
    )
    assert np.abs(normalised(result, moved)[0]).max() < 4
    assert sum(result.free) == 2 * 15
    assert result.rms_px == pytest.approx(calibrate_boards(given).rms_px, rel=1e-9)


def test_a_view_that_is_rejected_cannot_be_the_space() -> None:
    given = seen(ring((0.0, 25.0)), 8)
    corners = {key: one.copy() for key, one in given.corners.items()}
    for camera in (0, 1):
        corners[camera, 5] += np.random.default_rng(camera).normal(0, 3.0, corners[camera, 5].shape)
    with pytest.raises(DatasetError, match="all images of view 05 disagree with the others"):
        calibrate_boards(replace(given, corners=corners), world="05")


@pytest.mark.parametrize(("columns", "rows"), [(7, 5), (7, 7), (8, 8)])
def test_a_board_that_looks_the_same_when_turned(columns: int, rows: int) -> None:
    """Each camera may number the corners of such a board from another end; the poses decide which are the same."""
    board, true = Board(columns, rows, 0.02), ring((0.0, 25.0, 50.0))
    assert len(board.turns) > 1
    given, rng = seen(true, 5, 12, board), np.random.default_rng(6)
    turned = {key: one[board.turns[rng.integers(len(board.turns))]] for key, one in given.corners.items()}
    result = calibrate_boards(replace(given, corners=turned))
    assert result.rms_px < 2 * NOISE
    assert np.abs(normalised(result, true)[0]).max() < 4


def test_one_shared_view_of_a_board_that_looks_the_same_when_turned_joins_no_cameras() -> None:
    board = Board(7, 5, 0.02)
    given = seen(ring((0.0, 25.0)), 7, 14, board)
    apart = {key: one for key, one in given.corners.items() if key[1] == 0 or key[1] % 2 == key[0]}
    with pytest.raises(DatasetError, match="cameras b and the cameras a"):
        calibrate_boards(replace(given, corners=apart))


def test_turns_of_a_board_move_its_corners_to_corners() -> None:
    for columns, rows, count in ((9, 6, 1), (7, 5, 2), (8, 4, 2), (7, 7, 2), (8, 8, 4)):
        board = Board(columns, rows, 0.03)
        motions = board.motions()
        assert len(board.turns) == count
        for i, numbers in enumerate(board.turns):
            moved = board.corners @ motions.rotation[i].T + motions.translation[i]
            np.testing.assert_allclose(moved, board.corners[numbers], atol=1e-12)


def test_bad_corners_and_images_are_rejected_and_listed() -> None:
    true = ring((0.0, 25.0))
    given = seen(true, 8)
    corners = {key: one.copy() for key, one in given.corners.items()}
    corners[0, 2][10] += (30.0, -20.0)
    corners[1, 5] += np.random.default_rng(1).normal(0, 3.0, corners[1, 5].shape)
    result = calibrate_boards(replace(given, corners=corners))
    listed = {(one.camera, one.image, one.points) for one in result.rejected}
    assert listed == {("a", "02", 1), ("b", "05", None)}
    assert np.abs(normalised(result, true)[0]).max() < 4
    spoilt = calibrate_boards(replace(given, corners=corners), reject=False)
    assert not spoilt.rejected
    assert spoilt.sigma0_px > 2 * result.sigma0_px


def test_corners_that_are_not_seen_are_omitted() -> None:
    true = ring((0.0, 25.0))
    given = seen(true, 9)
    corners = {key: one.copy() for key, one in given.corners.items()}
    for one in corners.values():
        one[::7] = np.nan
    result = calibrate_boards(replace(given, corners=corners))
    assert np.abs(normalised(result, true)[0]).max() < 4
    assert result.degrees_of_freedom == 2 * 46 * len(corners) - 24 - 6 * 14


def test_coverage_and_its_warning() -> None:
    narrow = calibrate_boards(seen(ring((0.0, 25.0)), 10))
    assert all("extrapolated" in warning for warning in narrow.warnings)
    assert len(narrow.warnings) == 2
    assert "upper left" in narrow.coverage[0].unseen
    assert 0.2 < narrow.coverage[0].fraction < 0.8
    assert not calibrate_boards(seen(ring((0.0, 25.0), "pinhole"), 10), lens="pinhole").warnings


@pytest.mark.parametrize(
    ("turn", "lens"), [((0, 0), "pinhole"), ((0, 0), "brown"), ((30, 10), "pinhole"), ((30, 10), "brown")]
)
def test_parallel_boards_do_not_determine_the_focal_length(turn: tuple[float, float], lens: LensModel) -> None:
    rng = np.random.default_rng(1)
    rotation = Rotation.from_euler("xy", turn, degrees=True).as_matrix()
    middles = np.array([0, 0, DISTANCE]) + rng.uniform(-0.05, 0.05, (10, 3))
    poses = np.broadcast_to(rotation, (10, 3, 3)), middles - rotation @ BOARD.corners.mean(axis=0)
    given = sightings(ring((0.0,), lens), BOARD, poses, rng, NOISE)
    with pytest.raises(DatasetError, match=r"do not determine the focal length of camera a .*tilted by 30 to 45"):
        calibrate_boards(given, lens=lens)


def test_refusals_name_value_limit_and_remedy() -> None:
    given = seen(ring((0.0, 25.0)), 11, 6)
    few = {key: one for key, one in given.corners.items() if key != (1, 0) and key != (1, 3)}
    with pytest.raises(DatasetError, match="camera b: 4 images with a board; at least 5"):
        calibrate_boards(replace(given, corners=few))
    with pytest.raises(DatasetError, match="camera a, view 02: 53 corners, but the board has 9 x 6 = 54"):
        calibrate_boards(replace(given, corners={**given.corners, (0, 2): given.corners[0, 2][:-1]}))
    infinite = given.corners[0, 2].copy()
    infinite[3, 0] = np.inf
    with pytest.raises(DatasetError, match="a corner has an infinite pixel, or only one"):
        calibrate_boards(replace(given, corners={**given.corners, (0, 2): infinite}))
    empty = np.full_like(infinite, np.nan)
    empty[:3] = 1.0
    with pytest.raises(DatasetError, match="3 corners; at least 6"):
        calibrate_boards(replace(given, corners={**given.corners, (0, 2): empty}))
    with pytest.raises(DatasetError, match="'k4' cannot be held with the lens brown"):
        calibrate_boards(given, fixed=("k4",))
    with pytest.raises(DatasetError, match="no view '99'"):
        calibrate_boards(given, world="99")
    with pytest.raises(DatasetError, match="9 cameras; from 1 to 8"):
        calibrate_boards(replace(given, cameras=tuple("abcdefghi")))


@pytest.mark.parametrize(
    ("columns", "rows", "square", "message"),
    [
        (9, 6, 25.0, "squares of 25 m make a board of 225 m; at most 10 m: give metres, 25 mm is 0.025"),
        (9, 6, 0.0, "positive number of metres"),
        (9, 6, float("nan"), "positive number of metres"),
        (9, 2, 0.02, "2 rows of inner corners; at least 3"),
    ],
)
def test_a_board_that_cannot_be_is_refused(columns: int, rows: int, square: float, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        Board(columns, rows, square)
