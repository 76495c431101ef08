"""The axes that a user states are a signed permutation."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.importers.axes import read_axes
from wingfit.records import DatasetError


@pytest.mark.parametrize(
    ("text", "expected", "mirrors"),
    [
        ("x aft, y out, z up", [1, 2, 3], False),
        ("X=aft; Y=outboard; Z=up", [1, 2, 3], False),
        ("x fore, y in, z up", [-1, -2, 3], False),
        ("x aft, y in, z up", [1, -2, 3], True),
        ("z out, x up, y aft", [2, 3, 1], False),
        ("x down, y fore, z out", [-2, 3, -1], False),
    ],
)
def test_axes_in_words(text: str, expected: list[float], mirrors: bool) -> None:
    axes = read_axes(text)
    assert axes.apply(np.array([[[1.0, 2.0, 3.0]]]))[0, 0].tolist() == expected
    assert axes.mirrors == mirrors


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x aft",
        "x aft, y aft, z up",
        "x aft, x out, z up",
        "x aft, y fore, z up",
        "x left, y out, z up",
        "x near, y out, z up",
        "a b c",
    ],
)
def test_what_is_no_permutation_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(DatasetError, match="x aft, y out, z up"):
        read_axes(text)


@pytest.mark.parametrize(
    ("text", "expected", "mirrors"),
    [
        ("x nose, y right, z down", [1, 2, 3], False),
        ("x nose, y left, z up", [1, -2, -3], False),
        ("x right, y fore, z up", [2, 1, -3], False),
        ("x right, y fore, z down", [2, 1, 3], True),
    ],
)
def test_left_and_right_give_body_axes(text: str, expected: list[float], mirrors: bool) -> None:
    axes = read_axes(text)
    assert axes.frame == "body"
    assert axes.apply(np.array([[[1.0, 2.0, 3.0]]]))[0, 0].tolist() == expected
    assert axes.mirrors == mirrors


def test_every_permutation_keeps_lengths() -> None:
    words = {"aft", "fore"}, {"out", "in"}, {"up", "down"}
    place = np.array([[[1.0, 20.0, 300.0]]])
    for a in words[0]:
        for b in words[1]:
            for c in words[2]:
                for order in ((a, b, c), (b, c, a), (c, b, a)):
                    turned = read_axes(", ".join(f"{axis} {word}" for axis, word in zip("xyz", order, strict=True)))
                    assert np.linalg.norm(turned.apply(place)) == pytest.approx(np.linalg.norm(place))
