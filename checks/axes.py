"""Axes, side, unit and origin of tracks, against the described rest positions.

A wing that flaps about the hinge leaves the shape of its markers almost as it is at rest: on all plants of the
concealed trials the tracks differ from the rest positions, turned about the hinge, by 0.3 to 6 % of the span (root mean
square).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations, product

import numpy as np

from wingfit.checks.mistake import Alter, Mistake, TableEdit, change_of
from wingfit.checks.tracked import Tracked, rms, turn, turned
from wingfit.records.array_types import Array, Float

FRAMES = 60  # that are compared for each of 48 assignments
FEW = 4  # with fewer markers other axes can fit by chance: they are warned about, not refused
# In spans, of the misfit of the axes as given: warned about, refused. No elastic wing that flaps is so far from its
# shape at rest, root mean square over all markers and a whole beat.
DOUBTFUL, REFUSED = 0.08, 0.15
ELSEWHERE = 0.5  # spans of that misfit: tracks of something else, such as a person who walks, or in another frame
BETTER = 0.35  # of that misfit, residual with other axes at most
UNITS = ((1000.0, "millimetres"), (100.0, "centimetres"), (39.3701, "inches"), (3.28084, "feet"), (0.001, "kilometres"))
NEAR_UNIT = 1.12  # factor between a measured scale and that of a unit
SCALE = 1.15  # largest factor between tracks and rest positions that is not remarked on
TILTED_DEG = 17.0  # a hinge that is hidden to be tilted has 11
SHIFT, SHIFTED = 0.08, 0.3  # spans: displacement that is remarked on, and of the misfit the residual at most

Axes = tuple[tuple[int, int, int], tuple[int, int, int]]
"""For x, y, z of the wing: the number of the recorded axis, and its sign."""
AS_GIVEN: Axes = ((0, 1, 2), (1, 1, 1))
LEFT: Axes = ((0, 1, 2), (1, -1, 1))
EVERY: tuple[Axes, ...] = tuple(
    ((a, b, c), (i, j, k)) for (a, b, c), (i, j, k) in product(permutations(range(3)), product((1, -1), repeat=3))
)


def check_shape(tracked: Tracked) -> Mistake | None:
    """Return the likeliest mistake in unit, axes or origin of a recording; None if its shape fits."""
    if not np.isfinite(tracked.positions).any():
        return None
    found = _unit(tracked) or _axes(tracked) or _origin(tracked)
    if len(tracked.rest) < FEW or tracked.misfit <= ELSEWHERE * tracked.wing.span:
        return found
    return replace(found or _elsewhere(tracked), certain=True)


def _elsewhere(tracked: Tracked) -> Mistake:
    return Mistake(
        "origin",
        f"recording {tracked.recording.name!r}",
        f"the tracks are {tracked.misfit:.3g} m (root mean square) from the rest positions turned about the hinge",
        f"less than {ELSEWHERE * tracked.wing.span:.3g} m, half of the span; tracks of this wing are within a tenth",
        "the tracks are those of something else, or in a frame that moves",
        f"recordings/{tracked.recording.name}.csv: positions of the described markers in the frame of the rig",
    )


def oriented(positions: Float[Array, "... 3"], axes: Axes) -> Array:
    """Return ``positions`` with x, y, z taken from the recorded axes that ``axes`` names, with their signs."""
    return np.asarray(positions[..., list(axes[0])] * axes[1])


def _unit(tracked: Tracked) -> Mistake | None:
    """Compare lengths that neither axes nor origin change: the spread of the markers within a frame."""
    scale = _scale(tracked)
    if scale is None or 1 / SCALE < scale < SCALE:
        return None
    where, span = f"recording {tracked.recording.name!r}", tracked.wing.span
    value = f"the markers are {scale:.4g} times as far from each other as at rest (wing of {span:.3g} m span)"
    for factor, unit in UNITS:
        if 1 / NEAR_UNIT < scale / factor < NEAR_UNIT:
            edit = TableEdit(
                tracked.recording.name, "columns *_m", unit, f"metres (divide by {factor:g})", _divided(factor)
            )
            return Mistake(
                "length unit",
                where,
                value,
                "the distances at rest",
                f"positions are in {unit}",
                str(edit),
                True,
                (edit,),
            )
    if scale > 1.4 or scale < 0.7:
        change = "the positions in the file, or the wing in dataset.yaml, so that both have the same scale"
        return Mistake(
            "scale",
            where,
            value,
            "the distances at rest, within 15 %",
            "a wrong scale of tracks or description",
            change,
        )
    return None


def _scale(tracked: Tracked) -> float | None:
    """Median ratio of distances between markers to those at rest, None for fewer than two markers."""
    count = len(tracked.rest)
    if count < 2:
        return None
    order = np.argsort(tracked.rest[:, 1], kind="stable")
    low, high = order[: count // 2], order[-(count // 2) :]
    rest = np.linalg.norm(tracked.rest[high] - tracked.rest[low], axis=1)
    now = np.linalg.norm(tracked.positions[:, high] - tracked.positions[:, low], axis=2)
    ratios = now[:, rest > 0] / rest[rest > 0]
    ratios = ratios[np.isfinite(ratios)]
    return float(np.median(ratios)) if ratios.size else None


def _axes(tracked: Tracked) -> Mistake | None:
    span, given = tracked.wing.span, tracked.misfit
    if given <= DOUBTFUL * span:
        return None
    step = max(1, len(tracked.positions) // FRAMES)
    few = tracked.moved(tracked.positions[::step])
    misfits = [few.moved(oriented(few.positions, axes)).misfit for axes in EVERY]
    least = min(misfits)
    if not least <= BETTER * given < np.inf:
        return None
    close = [axes for axes, misfit in zip(EVERY, misfits, strict=True) if misfit <= least + 0.01 * span]
    axes = min(close, key=lambda one: (_against_drive(tracked, one) > 2.0 * _best(tracked, close), _changes(one)))
    if axes == AS_GIVEN:
        return None
    left = axes == LEFT
    edit = TableEdit(
        tracked.recording.name, "columns (x, y, z) of every marker", "(x, y, z)", _text(axes),
        lambda times, values, _: (times, oriented(values.reshape(len(values), -1, 3), axes).reshape(values.shape)),
    )  # fmt: skip
    return Mistake(
        "side" if left else "axes",
        f"recording {tracked.recording.name!r}",
        f"the tracks are {given:.3g} m (root mean square) from the rest positions turned about the hinge",
        f"{least:.3g} m, as with (x, y, z) of the wing = {_text(axes)} of the columns",
        _cause(axes),
        change_of([edit]),
        given > REFUSED * span and len(tracked.rest) >= FEW,
        (edit,),
    )


def _best(tracked: Tracked, close: Sequence[Axes]) -> float:
    return max(0.02, min(_against_drive(tracked, one) for one in close))


def _against_drive(tracked: Tracked, axes: Axes) -> float:
    """Distance (rad) of the tracks' flap angle from the drive's, which distinguishes up from down."""
    from wingfit.checks.drive import distance  # both modules need each other

    return distance(tracked.moved(oriented(tracked.positions, axes)))


def _origin(tracked: Tracked) -> Mistake | None:
    span, given = tracked.wing.span, tracked.misfit
    if given <= DOUBTFUL * span:
        return None
    shift, misfit = _displacement(tracked)
    if np.abs(shift).max() < SHIFT * span or misfit > SHIFTED * given:
        return _tilt(tracked, given)
    text = ", ".join(f"{one:.3g}" for one in shift)
    return Mistake(
        "origin",
        f"recording {tracked.recording.name!r}",
        f"the tracks are {given:.3g} m (root mean square) from the rest positions turned about the hinge",
        f"{misfit:.3g} m, as with tracks moved by ({text}) m",
        "the origin of the recorded frame is not that of the wing frame (hinge, rest positions)",
        f"recordings/{tracked.recording.name}.csv: add ({text}) m to (x, y, z), or state hinge and rest positions in "
        "the frame of the tracks",
        given > REFUSED * span and len(tracked.rest) >= FEW,
    )


def _displacement(tracked: Tracked, rounds: int = 12) -> tuple[Array, float]:
    """Displacement [3] (m) after which the tracks fit best, and the misfit (m) then, by alternation."""
    shift, rest = np.zeros(3), tracked.rest - tracked.hinge
    places = tracked.positions - tracked.hinge
    for _ in range(rounds):
        angle = turn(places + shift, rest)
        cosine, sine = np.cos(angle), np.sin(angle)
        missing = places + shift - turned(rest, angle)
        # A Gauss-Newton step, with the angle projected out: it takes up a displacement along the turn.
        across = -(sine[:, None] * rest[:, 1] + cosine[:, None] * rest[:, 2])
        along = cosine[:, None] * rest[:, 1] - sine[:, None] * rest[:, 2]
        arm = np.stack([np.zeros_like(along), across, along], axis=-1)
        seen = np.asarray(np.isfinite(missing).all(axis=-1))
        arm, gap = np.where(seen[..., None], arm, 0.0), np.where(seen[..., None], missing, 0.0)
        mean = arm.sum(axis=1)
        square = np.maximum((arm**2).sum(axis=(1, 2)), 1e-30)
        normal = seen.sum() * np.eye(3) - np.einsum("ti,tj->ij", mean / square[:, None], mean)
        right = gap.sum(axis=(0, 1)) - np.einsum("ti,t->i", mean / square[:, None], (arm * gap).sum(axis=(1, 2)))
        shift = shift - np.linalg.solve(normal + 1e-9 * seen.sum() * np.eye(3), right)
    angle = turn(places + shift, rest)
    return shift, rms(places + shift - turned(rest, angle))


def _tilt(tracked: Tracked, given: float) -> Mistake | None:
    """The axis about which the markers turn, from the plane in which each moves, must be parallel to x."""
    moved = tracked.positions - np.nanmean(tracked.positions, axis=0)
    moved = moved[np.isfinite(moved).all(axis=-1)]
    if len(moved) < FEW:
        return None
    sizes, axes = np.linalg.eigh(moved.T @ moved)
    angle = float(np.degrees(np.arccos(min(1.0, abs(axes[0, 0])))))
    if angle < TILTED_DEG or sizes[0] > 0.05 * sizes[1]:
        return None
    return Mistake(
        "tilt",
        f"recording {tracked.recording.name!r}",
        f"the markers turn about an axis {angle:.0f} degrees off x, and are {given:.3g} m from the rest positions",
        "an axis parallel to x, the hinge",
        "the recorded frame is rotated against the wing frame",
        f"recordings/{tracked.recording.name}.csv: rotate the positions into the wing frame (x aft along the hinge, "
        "y outboard, z up)",
    )


def _divided(factor: float) -> Alter:
    return lambda times, values, _: (times, values / factor)


def _changes(axes: Axes) -> int:
    order, signs = axes
    return sum(a != k for k, a in enumerate(order)) + sum(sign < 0 for sign in signs)


def _text(axes: Axes) -> str:
    return "(" + ", ".join(("-" if sign < 0 else "") + "xyz"[axis] for axis, sign in zip(*axes, strict=True)) + ")"


def _cause(axes: Axes) -> str:
    if axes == LEFT:
        return "a left wing, which must be mirrored"
    if axes[0] == (0, 1, 2):
        names = [name for name, sign in zip("xyz", axes[1], strict=True) if sign < 0]
        return f"the sign of {' and '.join(names)}: x points aft, y from root to tip, z up"
    return "another order of the axes: x points aft, y from root to tip, z up"
