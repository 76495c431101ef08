"""How the axes of a file lie in the wing or the body: a signed permutation, as the user states it in words.

The user names, for each axis of the file, the direction in which it points: "x fore, y up, z out". With out and in, the
result is in the wing's frame of a dataset: x aft along the chord, y outboard along the span, z up (docs/formats.md).
With right and left, it is in body axes, as for ``wingfit kinematics``: x to the nose, y right, z down.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail

EXAMPLE = "x aft, y out, z up"
_WORDS = {
    "aft": ("aft", "back", "backward", "rear", "tail"),
    "fore": ("fore", "forward", "front", "nose"),
    "out": ("out", "outboard", "outward"),
    "in": ("in", "inboard", "inward"),
    "right": ("right",),
    "left": ("left",),
    "up": ("up", "upward"),
    "down": ("down", "downward"),
}
_DIRECTION_OF = {word: direction for direction, words in _WORDS.items() for word in words}
# Direction -> axis of the frame, and its sign.
_FRAMES: dict[Literal["wing", "body"], dict[str, tuple[int, int]]] = {
    "wing": {"aft": (0, 1), "fore": (0, -1), "out": (1, 1), "in": (1, -1), "up": (2, 1), "down": (2, -1)},
    "body": {"fore": (0, 1), "aft": (0, -1), "right": (1, 1), "left": (1, -1), "down": (2, 1), "up": (2, -1)},
}
_PART = re.compile(r"([xyz])\s*(?:=|:|\s)\s*([a-z]+)")


@dataclass(frozen=True)
class Axes:
    """Coordinate i of the ``frame`` is ``signs[i]`` times coordinate ``order[i]`` of the file."""

    frame: Literal["wing", "body"]
    order: tuple[int, int, int]
    signs: tuple[int, int, int]

    def apply(self, positions: Float[Array, "T M 3"]) -> Float[Array, "T M 3"]:
        """Return the ``positions`` of the file in the axes of the frame."""
        turned: Array = positions[..., list(self.order)] * np.array(self.signs, dtype=np.float64)
        return turned

    @property
    def mirrors(self) -> bool:
        """Return whether a right-handed frame becomes left-handed, as it does for a left wing."""
        even = self.order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        return (1 if even else -1) * int(np.prod(self.signs)) < 0

    def direction_of(self, axis: int) -> str:
        """Return the direction in which the ``axis`` (0 to 2) of the file points, such as "up"."""
        i = self.order.index(axis)
        return next(word for word, place in _FRAMES[self.frame].items() if place == (i, self.signs[i]))


def read_axes(text: str) -> Axes:
    """Return the axes that ``text`` states, such as "x aft, y out, z up"; DatasetError if it is no permutation."""
    rule = f"name each axis of the file once, with its direction, like {EXAMPLE!r}"
    directions: dict[int, str] = {}
    for part in filter(None, (piece.strip() for piece in re.split(r"[,;\n]", text.lower()))):
        match = _PART.fullmatch(part)
        if not match or match[2] not in _DIRECTION_OF:
            listed = ", ".join(_WORDS)
            raise fail("--axes", part, f"{part[:40]!r} is not an axis and a direction; {rule} (directions: {listed})")
        axis = "xyz".index(match[1])
        if axis in directions:
            raise fail("--axes", text, f"names the axis {match[1]} twice; {rule}")
        directions[axis] = _DIRECTION_OF[match[2]]
    frame: Literal["wing", "body"] = "body" if {"left", "right"}.intersection(directions.values()) else "wing"
    places = {axis: _FRAMES[frame][word] for axis, word in directions.items() if word in _FRAMES[frame]}
    file_axis = {wing: (axis, sign) for axis, (wing, sign) in places.items()}
    if len(file_axis) < 3:
        raise fail("--axes", text, f"{text[:60]!r} does not give three directions at right angles; {rule}")
    (a, i), (b, j), (c, k) = (file_axis[number] for number in range(3))
    return Axes(frame, (a, b, c), (i, j, k))
