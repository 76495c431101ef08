"""Checks the axes of recorded tracks against the described rest positions: swapped axes, wrong signs, a left wing.

A wing that flaps about an axis parallel to x leaves a marker's x and its distance from that axis nearly as they are at
rest, and its y positive. Of the 48 ways to assign three recorded axes with signs, the one that fits best should be the
one that was given. The sign of z cannot be seen in this way.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.dataset import Recording
from wingfit.records.errors import Faults
from wingfit.records.wing import Wing

FRAMES = 300  # most that are compared
LEAST_MARKERS = 4
WRONG = 0.06  # spans, root mean square: a wing bends and twists by as much
RIGHT = 0.4  # of the misfit of the axes as given, that of the right ones at most

Axes = tuple[tuple[int, int, int], tuple[int, int, int]]
"""For x, y, z of the wing: the number of the recorded axis, and its sign."""
AS_GIVEN: Axes = ((0, 1, 2), (1, 1, 1))
EVERY: tuple[Axes, ...] = tuple(
    ((a, b, c), (i, j, k)) for (a, b, c), (i, j, k) in product(permutations(range(3)), product((1, -1), repeat=3))
)


def check_axes(recording: Recording, wing: Wing, where: str, faults: Faults) -> None:
    """Add a fault if the tracks of ``recording`` clearly fit the rest positions of ``wing`` with other axes."""
    found = other_axes(recording, wing)
    if found is None:
        return
    axes, after, before = found
    message = (
        f"the tracks differ from the described rest positions, turned about the hinge, by {before:.3g} m (root mean "
        f"square), and by {after:.3g} m with other axes: (x, y, z) of the wing look like {_text(axes)} of the columns"
        f"{_cause(axes)}; x points aft, y from root to tip, z up"
    )
    faults.add(where, None, message)


def other_axes(recording: Recording, wing: Wing) -> tuple[Axes, float, float] | None:
    """Return the axes that fit clearly better than those given, with both misfits (root mean square, m); else None."""
    known = {marker.name: marker.position for marker in wing.markers}
    if len(recording.markers) < LEAST_MARKERS or any(name not in known for name in recording.markers):
        return None
    rest = np.array([known[name] for name in recording.markers])
    shown = recording.values[:: max(1, len(recording.values) // FRAMES)].reshape(-1, len(rest), 3)
    hinge = np.array([0.0, wing.hinge.y, wing.hinge.z])
    before = _misfit(shown, AS_GIVEN, rest - hinge, hinge)
    if before <= WRONG * wing.span:
        return None
    misfits = [_misfit(shown, axes, rest - hinge, hinge) for axes in EVERY]
    # Of axes that fit equally, as with either sign of z, those that are nearest to the given ones.
    best = min(range(len(EVERY)), key=lambda k: (round(misfits[k] / wing.span, 3), _changes(EVERY[k])))
    return (EVERY[best], misfits[best], before) if misfits[best] < RIGHT * before else None


def _misfit(shown: Float[Array, "T M 3"], axes: Axes, rest: Float[Array, "M 3"], hinge: Float[Array, " 3"]) -> float:
    """Return the root mean square (m) of what flapping about the hinge does not change, and of a y below it."""
    order, signs = axes
    x, y, z = np.moveaxis(shown[..., list(order)] * signs - hinge, -1, 0)
    away = np.hypot(rest[:, 1], rest[:, 2])
    squares = (x - rest[:, 0]) ** 2 + (np.hypot(y, z) - away) ** 2 + np.minimum(y, 0.0) ** 2
    return float(np.sqrt(np.nanmean(squares))) if np.isfinite(squares).any() else 0.0


def _changes(axes: Axes) -> int:
    order, signs = axes
    return sum(a != k for k, a in enumerate(order)) + sum(sign < 0 for sign in signs)


def _text(axes: Axes) -> str:
    return "(" + ", ".join(("-" if sign < 0 else "") + "xyz"[axis] for axis, sign in zip(*axes, strict=True)) + ")"


def _cause(axes: Axes) -> str:
    """Return the likely cause of such axes as the end of a clause; empty where there is no usual one."""
    if axes == ((0, 1, 2), (1, -1, 1)):
        return ", as of a left wing, which must be mirrored: change the sign of y"
    return ": swap the columns, or change their signs" if axes[0] != (0, 1, 2) else ": change the signs of the columns"
