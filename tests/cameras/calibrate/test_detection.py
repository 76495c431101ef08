"""Corners in images: their order does not depend on the camera, images are matched, bad ones are refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.cameras.calibrate.simulated import board_poses, ring
from wingfit.cameras.calibrate.board import Board
from wingfit.cameras.calibrate.boards import find_boards, oriented
from wingfit.cameras.calibrate.images import read_grey, views_of_images
from wingfit.cameras.camera import Camera
from wingfit.records.errors import DatasetError

BOARD = Board(7, 4, 0.02)
SQUARE = 40  # pixels of the drawing


def drawing(board: Board) -> np.ndarray:
    """A chessboard with a white margin of one square; the first square between four corners is dark."""
    rows, columns = np.mgrid[0 : board.rows + 1, 0 : board.columns + 1]
    squares = np.where((rows + columns) % 2 == 0, 30, 225).astype(np.uint8)
    return np.pad(np.kron(squares, np.ones((SQUARE, SQUARE), np.uint8)), SQUARE, constant_values=225)


def photograph(camera: Camera, board: Board, rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """The image of a board in a pinhole camera, by warping the drawing."""
    # The first corner lies at the end of the margin and of the first square.
    corners = 2 * SQUARE - 0.5 + board.corners[:, :2] * (SQUARE / board.square_m)
    pixels = camera.project(board.corners @ rotation.T + translation)
    # Drawn three times as large and averaged, because a warp of sharp edges moves them by parts of a pixel.
    matrix, _ = cv2.findHomography(corners, 3 * pixels + 1)
    width, height = camera.size_px
    large = cv2.warpPerspective(drawing(board), matrix, (3 * width, 3 * height), borderValue=120.0)
    grey = cv2.resize(large, camera.size_px, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), 0.8))


@pytest.fixture(scope="module")
def shots() -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Images of a board in one camera, and its true corners."""
    camera = ring((0.0,), "pinhole")[0]
    poses = list(zip(*board_poses(np.random.default_rng(0), 2, BOARD), strict=True))
    truth = [camera.project(BOARD.corners @ rotation.T + translation) for rotation, translation in poses]
    return [photograph(camera, BOARD, *pose) for pose in poses], truth


def saved(folder: Path, names: list[str], images: list[np.ndarray]) -> list[Path]:
    folder.mkdir(exist_ok=True)
    for name, image in zip(names, images, strict=True):
        assert cv2.imwrite(str(folder / name), image)
    return [folder / name for name in names]


def test_corners_are_detected_and_unseen_boards_are_listed(
    shots: tuple[list[np.ndarray], list[np.ndarray]], tmp_path: Path
) -> None:
    images, truth = shots
    paths = saved(tmp_path, ["1.png", "2.png", "3.png"], [*images, np.full_like(images[0], 90)])
    found = find_boards({"a": paths}, BOARD)
    assert found.of_camera(0) == [0, 1]
    assert [(one.camera, one.image) for one in found.unseen] == [("a", "3.png")]
    for view, true in enumerate(truth):
        assert np.abs(found.corners[0, view] - true).max() < 0.1


def test_a_camera_upside_down_numbers_the_corners_alike(
    shots: tuple[list[np.ndarray], list[np.ndarray]], tmp_path: Path
) -> None:
    images, truth = shots
    paths = saved(tmp_path, ["1.png", "2.png"], [one[::-1, ::-1] for one in images])
    found = find_boards({"a": paths}, BOARD)
    for view, true in enumerate(truth):
        height, width = images[view].shape
        turned = np.array([width - 1, height - 1]) - found.corners[0, view]
        assert np.abs(turned - true).max() < 0.1


def test_the_order_of_the_detector_does_not_matter(shots: tuple[list[np.ndarray], list[np.ndarray]]) -> None:
    images, truth = shots
    grid = truth[0].reshape(BOARD.rows, BOARD.columns, 2)
    for order in (grid, grid[::-1, ::-1], grid[:, ::-1], grid[::-1]):
        np.testing.assert_array_equal(oriented(order.reshape(-1, 2), BOARD, images[0]), truth[0])


def test_sixteen_bits_with_a_dark_image_are_read(
    shots: tuple[list[np.ndarray], list[np.ndarray]], tmp_path: Path
) -> None:
    dark = shots[0][0].astype(np.uint16) * 3
    (path,) = saved(tmp_path, ["dark.png"], [dark])
    grey = read_grey(path)
    assert (grey.min(), grey.max()) == (0, 255)
    assert grey.dtype == np.uint8


def test_images_that_cannot_be_used_are_refused(
    shots: tuple[list[np.ndarray], list[np.ndarray]], tmp_path: Path
) -> None:
    paths = saved(tmp_path, ["1.png", "2.png"], [shots[0][0], shots[0][1][:-8]])
    with pytest.raises(DatasetError, match=r"2.png: 1024 x 792 px, but the first image of camera a has 1024 x 800 px"):
        find_boards({"a": paths}, BOARD)
    (tmp_path / "3.png").write_bytes(b"no image")
    (tmp_path / "4.png").write_bytes(b"")
    for name, message in (("3.png", "no image that OpenCV reads"), ("4.png", "no image"), ("5.png", "no such file")):
        with pytest.raises(DatasetError, match=message):
            find_boards({"a": [tmp_path / name]}, BOARD)
    with pytest.raises(DatasetError, match="there are no cameras"):
        find_boards({}, BOARD)


def test_a_wrong_number_of_corners_is_refused(shots: tuple[list[np.ndarray], list[np.ndarray]], tmp_path: Path) -> None:
    paths = saved(tmp_path, ["1.png"], shots[0][:1])
    with pytest.raises(DatasetError, match="no board of 8 x 5 inner corners was detected in any image"):
        find_boards({"a": paths}, Board(8, 5, 0.02))


def test_a_part_of_a_larger_board_is_not_taken_for_the_board(tmp_path: Path) -> None:
    """OpenCV's sector detector accepts a part of a board, in some images."""
    camera = ring((0.0,), "pinhole")[0]
    rotation, translation = np.eye(3), np.array([-0.06, -0.04, 0.5])
    paths = saved(tmp_path, ["1.png"], [photograph(camera, BOARD, rotation, translation)])
    with pytest.raises(DatasetError, match="5 x 3 inner corners are stated, but images show 7 x 4"):
        find_boards({"a": paths}, Board(5, 3, 0.02))


def test_images_are_matched_by_stem_number_or_position() -> None:
    stems = views_of_images({"a": [Path("a/x1.png"), Path("a/x2.png")], "b": [Path("b/x2.png")]})
    assert stems == {"x1": {"a": Path("a/x1.png")}, "x2": {"a": Path("a/x2.png"), "b": Path("b/x2.png")}}
    numbers = views_of_images({"a": [Path("left10.jpg"), Path("left9.jpg")], "b": [Path("right09.jpg")]})
    assert list(numbers) == ["9", "10"]
    assert set(numbers["9"]) == {"a", "b"}
    places = views_of_images({"a": [Path("p.png"), Path("q.png")], "b": [Path("r.png"), Path("s.png")]})
    assert places == {"0": {"a": Path("p.png"), "b": Path("r.png")}, "1": {"a": Path("q.png"), "b": Path("s.png")}}
    with pytest.raises(DatasetError, match=r"which images belong together is not clear \(a: 1, b: 2\)"):
        views_of_images({"a": [Path("p.png")], "b": [Path("r.png"), Path("s.png")]})
    with pytest.raises(DatasetError, match="not clear"):
        views_of_images({"a": [Path("p1.png"), Path("q1.png")], "b": [Path("r1.png"), Path("s1.png")]}, "index")
