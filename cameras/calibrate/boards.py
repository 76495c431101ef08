"""Detect the corners of a chessboard in images, in an order that does not depend on the camera."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from wingfit.cameras.calibrate.board import Board, Rejection, Sightings
from wingfit.cameras.calibrate.images import Match, read_grey, views_of_images
from wingfit.cameras.opencv import opencv
from wingfit.records.array_types import Array
from wingfit.records.errors import fail

Finder = Literal["sector", "adaptive"]
LARGER_CHECKED = 5  # images in each camera in which a larger board is looked for
REFINED_SHARE = 0.35  # half the side of the window in which a corner is refined, over the distance of corners
LEAST_REFINED_PX, MOST_REFINED_PX = 2, 11
NO_BOARD = "no board of {columns} x {rows} inner corners was detected"


def find_boards(
    images: Mapping[str, Sequence[Path]],
    board: Board,
    *,
    match: Match | None = None,
    finder: Finder = "sector",
    report: Callable[[float], object] = lambda _: None,
) -> Sightings:
    """Detect ``board`` in the images of each camera, and say which images show it at the same time.

    Args:
        images: files of each camera by its name.
        board: the chessboard. It must be seen from its front in all images.
        match: how images of different cameras are matched (see ``views_of_images``).
        finder: ``sector`` is OpenCV's findChessboardCornersSB (Duda and Frese 2018), with ``adaptive`` where it fails;
            ``adaptive`` is findChessboardCorners alone. Both are refined by cornerSubPix.
        report: called with the part of the images that is done, from 0 to 1.

    Raises:
        DatasetError: for images that cannot be read or have different sizes in one camera, for a camera in which no
            board was detected, and if the board has more corners than stated.
    """
    if not images:
        raise fail("calibration, images", 0, "there are no cameras; give the images of each camera")
    views = views_of_images(images, match)
    cameras = tuple(images)
    corners: dict[tuple[int, int], Array] = {}
    sizes: dict[int, tuple[int, int]] = {}
    unseen, larger = [], Counter[tuple[int, int]]()
    for number, view in enumerate(views):
        report(number / len(views))
        for camera, path in views[view].items():
            c = cameras.index(camera)
            grey = read_grey(path)
            _check_size(camera, path, grey, sizes.setdefault(c, (grey.shape[1], grey.shape[0])))
            found = _find(grey, board, finder)
            if found is None:
                reason = NO_BOARD.format(columns=board.columns, rows=board.rows)
                unseen.append(Rejection(camera, path.name, None, reason))
                continue
            corners[c, number] = oriented(found, board, grey)
            if sum(larger.values()) < LARGER_CHECKED:
                larger[_larger(grey, board)] += 1
    _check_counts(board, larger)
    _check_seen(cameras, corners, board)
    return Sightings(board, cameras, tuple(sizes[c] for c in range(len(cameras))), tuple(views), corners, tuple(unseen))


def oriented(pixels: Array, board: Board, grey: Array) -> Array:
    """Return corners ``pixels`` [K, 2] renumbered so that the board is not mirrored and its first square is dark.

    For a board of which columns and rows are both odd or both even, the colours allow more than one order.
    """
    grid = pixels.reshape(board.rows, board.columns, 2)
    across, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if across[0] * down[1] - across[1] * down[0] < 0:
        grid = grid[:, ::-1]
    quarters = range(4) if board.columns == board.rows else range(0, 4, 2)
    turned = [np.rot90(grid, quarter) for quarter in quarters]
    contrast = [_first_square_contrast(one, grey) for one in turned]
    # Where all turns have the same colours, differences are noise: the first dark one is as good as the others.
    first = next((i for i, value in enumerate(contrast) if value < 0), 0)
    return turned[first].reshape(-1, 2)


def _first_square_contrast(grid: Array, grey: Array) -> float:
    """Return the brightness of the first square between four corners less that of its two neighbours."""
    first, right, below = (_brightness(grid[r : r + 2, c : c + 2], grey) for r, c in ((0, 0), (0, 1), (1, 0)))
    return first - (right + below) / 2


def _brightness(square: Array, grey: Array) -> float:
    """Return the mean brightness in the inner part of a ``square`` of corners [2, 2, 2]."""
    share = np.linspace(0.35, 0.65, 5)
    v, u = (one[..., None] for one in np.meshgrid(share, share, indexing="ij"))
    places = (1 - v) * ((1 - u) * square[0, 0] + u * square[0, 1]) + v * ((1 - u) * square[1, 0] + u * square[1, 1])
    x, y = np.round(places).astype(int).reshape(-1, 2).T
    height, width = grey.shape
    return float(np.mean(grey[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]))


def _find(grey: Array, board: Board, finder: Finder) -> Array | None:
    """Return the corners [K, 2] of the board in an image, or None.

    The corners of both detectors are refined: on drawn boards that reduces errors of findChessboardCornersSB from 0.09
    to 0.02 px. The window must be smaller than the squares, also where the board is seen from the side.
    """
    cv2 = opencv()
    size, found, corners = (board.columns, board.rows), False, None
    if finder == "sector":
        found, corners = cv2.findChessboardCornersSB(grey, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        found, corners = cv2.findChessboardCorners(grey, size, flags=flags)
    if not found:
        return None
    start = np.asarray(corners, dtype=np.float32).reshape(-1, 1, 2)
    half = int(np.clip(REFINED_SHARE * _spacing(start, board) - 1, LEAST_REFINED_PX, MOST_REFINED_PX))
    exact = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-3)
    return _finite(cv2.cornerSubPix(grey, start, (half, half), (-1, -1), exact), board)


def _spacing(corners: Any, board: Board) -> float:
    """Return the smallest distance (pixels) between neighbours along a row or a column."""
    grid = np.asarray(corners, dtype=float).reshape(board.rows, board.columns, 2)
    return float(min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1)))


def _finite(corners: Any, board: Board) -> Array | None:
    pixels = np.asarray(corners, dtype=float).reshape(-1, 2)
    return pixels if len(pixels) == board.count and np.isfinite(pixels).all() else None


def _larger(grey: Array, board: Board) -> tuple[int, int]:
    """Return the long and the short side of the largest board in an image, at least that of ``board``."""
    cv2 = opencv()
    stated = (max(board.columns, board.rows), min(board.columns, board.rows))
    found, _, meta = cv2.findChessboardCornersSBWithMeta(grey, (board.columns, board.rows), cv2.CALIB_CB_LARGER)
    if not found or meta is None:
        return stated
    sides = np.asarray(meta).shape[:2]
    return (max(sides), min(sides))


def _check_counts(board: Board, larger: Counter[tuple[int, int]]) -> None:
    """Refuse a board of which most images show more corners: a part of it would be taken for the whole."""
    stated = (max(board.columns, board.rows), min(board.columns, board.rows))
    more = {sides: count for sides, count in larger.items() if sides != stated}
    if 2 * sum(more.values()) > sum(larger.values()):
        long, short = max(more, key=lambda sides: more[sides])
        message = (
            f"{board.columns} x {board.rows} inner corners are stated, but images show {long} x {short}; "
            "count the inner corners, where four squares meet, of the whole board"
        )
        raise fail("board, corners", f"{board.columns} x {board.rows}", message)


def _check_size(camera: str, path: Path, grey: Array, size: tuple[int, int]) -> None:
    height, width = grey.shape
    if (width, height) != size:
        message = f"{width} x {height} px, but the first image of camera {camera} has {size[0]} x {size[1]} px"
        raise fail(str(path), f"{width} x {height}", f"{message}; give images of one size, neither cropped nor turned")


def _check_seen(cameras: Sequence[str], corners: Mapping[tuple[int, int], Array], board: Board) -> None:
    missing = [name for c, name in enumerate(cameras) if not any(one == c for one, _ in corners)]
    if missing:
        text = NO_BOARD.format(columns=board.columns, rows=board.rows)
        message = (
            f"{text} in any image; count inner corners (a board of 10 x 7 squares has 9 x 6), and show all of them"
        )
        raise fail(f"camera {', '.join(missing)}", f"{board.columns} x {board.rows}", message)
