"""Checks on the numbers of a recording, wherever they come from: order of times, amount of data, unit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from records.errors import Faults
from records.limits import IMPLAUSIBLE_SPANS, MAX_MARKERS, MAX_ROWS, MIN_FRAMES
from records.wing import Wing

Array = npt.NDArray[np.float64]
Locate = Callable[[int], str]
_SHOWN = 3


def check_numbers(times: Array, values: Array, wing: Wing, where: str, at: Locate, faults: Faults) -> None:
    """Note what is wrong with ``times`` [T] and ``values`` [T, C]; ``at(row)`` says where a row stands."""
    frames, markers = len(times), values.shape[1] // 3
    if not MIN_FRAMES <= frames <= MAX_ROWS:
        faults.add(
            where,
            frames,
            f"{frames} frames; it must be {MIN_FRAMES} to {MAX_ROWS}: record longer, or cut in parts",
        )
    if not 1 <= markers <= MAX_MARKERS:
        faults.add(where, markers, f"{markers} markers; it must be 1 to {MAX_MARKERS}")
    _check_times(times, at, faults)
    infinite = np.flatnonzero(np.isinf(values).any(axis=1))
    for row in infinite[:_SHOWN]:
        faults.add(at(int(row)), "inf", "a position is infinite; it must be finite, or missing")
    if infinite.size or not values.size:
        return
    if np.isnan(values).all():
        faults.add(where, None, "there is no position at all; leave the recording out")
        return
    _check_unit(values, wing, where, faults)


def _check_times(times: Array, at: Locate, faults: Faults) -> None:
    bad = np.flatnonzero(~np.isfinite(times))
    for row in bad[:_SHOWN]:
        faults.add(at(int(row)), times[row], "time_s is missing or not finite; every row needs its time in seconds")
    if bad.size:
        return
    for row in np.flatnonzero(np.diff(times) <= 0)[:_SHOWN] + 1:
        before, here = float(times[row - 1]), float(times[row])
        how = "the same as" if here == before else "before"
        message = f"time_s is {here!r} s, {how} the one above, {before!r} s; times must increase: sort the rows"
        faults.add(at(int(row)), here, message)


def _check_unit(values: Array, wing: Wing, where: str, faults: Faults) -> None:
    """Markers stay within about a span of the hinge; typical ones further out are in another unit or frame."""
    from_hinge = values.reshape(len(values), -1, 3) - np.array([0.0, wing.hinge.y, wing.hinge.z])
    along_axes = [np.abs(axis[np.isfinite(axis)]) for axis in np.moveaxis(from_hinge, 2, 0)]
    distance = max(float(np.median(axis)) for axis in along_axes if axis.size)
    limit = IMPLAUSIBLE_SPANS * wing.span
    if distance > limit:
        far = distance / wing.span
        unit = (
            "millimetres" if far > 100 else "centimetres" if far > 10 else "feet, or a frame whose origin is elsewhere,"
        )
        message = (
            f"positions are typically {distance:.4g} m from the hinge, of a wing with {wing.span:.4g} m span "
            f"(limit {limit:.4g} m); that looks like {unit} in columns named _m: "
            "convert to metres, in the wing frame"
        )
        faults.add(where, f"{distance:.4g}", message)
