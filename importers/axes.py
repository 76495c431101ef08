"""How the axes of a file lie in the wing: a signed permutation, as the user states it in words.

The wing's frame is x aft along the chord, y outboard along the span, z up (docs/formats.md). The user names, for each
axis of the file, the direction of the wing in which it points: "x fore, y up, z out".
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail

EXAMPLE = "x aft, y out, z up"
# Direction -> axis of the wing, and its sign.
_DIRECTIONS = {
    ("aft", "back", "backward", "rear"): (0, 1),
    ("fore", "forward", "front", "ahead"): (0, -1),
    ("out", "outboard", "outward"): (1, 1),
    ("in", "inboard", "inward"): (1, -1),
    ("up", "upward"): (2, 1),
    ("down", "downward"): (2, -1),
}
_OF = {word: place for words, place in _DIRECTIONS.items() for word in words}
_PART = re.compile(r"([xyz])\s*(?:=|:|\s)\s*([a-z]+)")


@dataclass(frozen=True)
class Axes:
    """Coordinate i of the wing is ``signs[i]`` times coordinate ``order[i]`` of the file."""

    order: tuple[int, int, int]
    signs: tuple[int, int, int]

    def apply(self, positions: Float[Array, "T M 3"]) -> Float[Array, "T M 3"]:
        """Return the ``positions`` of the file in the axes of the wing."""
        turned: Array = positions[..., list(self.order)] * np.array(self.signs, dtype=np.float64)
        return turned

    @property
    def mirrors(self) -> bool:
        """Return whether a right-handed frame becomes left-handed, as it does for a left wing."""
        even = self.order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        return (1 if even else -1) * int(np.prod(self.signs)) < 0

    def direction_of(self, axis: int) -> str:
        """Return the direction of the wing in which the ``axis`` (0 to 2) of the file points, such as "up"."""
        i = self.order.index(axis)
        return next(words[0] for words, place in _DIRECTIONS.items() if place == (i, self.signs[i]))


def read_axes(text: str) -> Axes:
    """Return the axes that ``text`` states, such as "x aft, y out, z up"; DatasetError if it is no permutation."""
    rule = f"name each axis of the file once, with its direction in the wing, like {EXAMPLE!r}"
    places: dict[int, tuple[int, int]] = {}
    for part in filter(None, (piece.strip() for piece in re.split(r"[,;\n]", text.lower()))):
        match = _PART.fullmatch(part)
        if not match or match[2] not in _OF:
            words = ", ".join(words[0] for words in _DIRECTIONS)
            raise fail("--axes", part, f"{part[:40]!r} is not an axis and a direction; {rule} (directions: {words})")
        axis = "xyz".index(match[1])
        if axis in places:
            raise fail("--axes", text, f"names the axis {match[1]} twice; {rule}")
        places[axis] = _OF[match[2]]
    if len(places) < 3 or len({wing for wing, _ in places.values()}) < 3:
        raise fail("--axes", text, f"{text[:60]!r} does not give three directions at right angles; {rule}")
    file_axis = {wing: (axis, sign) for axis, (wing, sign) in places.items()}
    (a, i), (b, j), (c, k) = (file_axis[wing] for wing in range(3))
    return Axes((a, b, c), (i, j, k))
