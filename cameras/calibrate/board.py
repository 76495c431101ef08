"""A chessboard: its corners, the turns that map it onto itself, and its corners in the images of several cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wingfit.cameras.calibrate.graph import Pose
from wingfit.records.array_types import Array, Float, Index
from wingfit.records.errors import fail

LEAST_CORNERS = 3  # along one side
LARGEST_M = 10.0  # a board that is longer is one whose squares were given in millimetres


@dataclass(frozen=True)
class Board:
    """A chessboard of ``columns`` times ``rows`` inner corners, with squares of ``square_m`` (m).

    Corners are numbered along the rows: x along the columns, y along the rows, z away from a camera that sees them.
    """

    columns: int
    rows: int
    square_m: float

    def __post_init__(self) -> None:
        for what, count in (("columns", self.columns), ("rows", self.rows)):
            if count < LEAST_CORNERS:
                message = f"{count} {what} of inner corners; at least {LEAST_CORNERS}: count where four squares meet"
                raise fail(f"board, {what}", count, message)
        if not (np.isfinite(self.square_m) and self.square_m > 0):
            raise fail(
                "board, square",
                self.square_m,
                f"{self.square_m} m is no size of a square; give a positive number of metres",
            )
        length = max(self.columns, self.rows) * self.square_m
        if length > LARGEST_M:
            raise fail(
                "board, square",
                self.square_m,
                f"squares of {self.square_m:g} m make a board of {length:g} m; at most {LARGEST_M:g} m: give metres, "
                f"{self.square_m:g} mm is {self.square_m / 1000:g}",
            )

    @property
    def count(self) -> int:
        """Return the number of inner corners."""
        return self.columns * self.rows

    @cached_property
    def corners(self) -> Float[Array, "K 3"]:
        """Return the corners (m) in the axes of the board; the first corner is the origin."""
        y, x = np.mgrid[0 : self.rows, 0 : self.columns]
        return np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3) * self.square_m

    @cached_property
    def turns(self) -> tuple[Index, ...]:
        """Return for each turn that maps the corners and the colours of the squares onto themselves their new numbers.

        Corner k comes to lie where the corner with the k-th number was. The first turn moves nothing. A board of which
        one of columns and rows is odd and the other even has no other.
        """
        grid = np.arange(self.count).reshape(self.rows, self.columns)
        quarters = range(4) if self.columns == self.rows else range(0, 4, 2)
        turned = [(quarter, np.rot90(grid, quarter).ravel()) for quarter in quarters]
        dark = [self._first_is_dark(quarter) for quarter, _ in turned]
        return tuple(numbers for (_, numbers), same in zip(turned, dark, strict=True) if same)

    def motions(self) -> Pose:
        """Return the rigid motions that move each corner k to that with the k-th number in ``turns``."""
        centre = self.corners.mean(axis=0)
        rotations = []
        for numbers in self.turns:
            # Corners 0 and 1 lie along x of the board; a turn moves that edge.
            x = (self.corners[numbers[1]] - self.corners[numbers[0]]) / self.square_m
            rotations.append([[x[0], -x[1], 0.0], [x[1], x[0], 0.0], [0.0, 0.0, 1.0]])
        rotation = np.array(rotations)
        return Pose(rotation, centre - rotation @ centre)

    def _first_is_dark(self, quarter: int) -> bool:
        """Return whether the first square between four corners has the colour that it had before the turn."""
        columns, rows = self.columns - 2, self.rows - 2
        moves = {0: 0, 1: columns, 2: columns + rows, 3: rows}
        return moves[quarter] % 2 == 0


@dataclass(frozen=True)
class Rejection:
    """Something that the calibration did not use: ``points`` of the ``image`` of a ``camera``, all if None."""

    camera: str
    image: str
    points: int | None
    reason: str


@dataclass(frozen=True, eq=False)
class Sightings:
    """The corners of a board in the images of several cameras.

    Attributes:
        board: the chessboard.
        cameras: their names.
        sizes_px: width and height of the images of each camera.
        views: name of each position of the board, in time.
        corners: for each pair of numbers of camera and view where the board was seen, its corners [K, 2] (pixels), NaN
            where one was not seen. Their order may be turned as ``Board.turns`` say, but not mirrored.
        unseen: images in which no board was detected.
    """

    board: Board
    cameras: tuple[str, ...]
    sizes_px: tuple[tuple[int, int], ...]
    views: tuple[str, ...]
    corners: Mapping[tuple[int, int], Float[Array, "K 2"]]
    unseen: tuple[Rejection, ...] = ()

    def of_camera(self, camera: int) -> list[int]:
        """Return the numbers of the views in which ``camera`` sees the board."""
        return sorted(view for one, view in self.corners if one == camera)
