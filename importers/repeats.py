"""Rows of a file that have the same time: what differs between them, and how they become one frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wingfit.importers.options import REPEATED, Given, ask
from wingfit.importers.raw import Raw
from wingfit.records.array_types import Array, Index, Mask
from wingfit.records.errors import DatasetError, counted

_LISTED = 4


def repeated(raw: Raw, order: Array | Index, file: str, unit: str = "") -> DatasetError:
    """Return the question what becomes of the rows whose ``order`` [T] (times or numbers of frames) repeats.

    ``order`` must not decrease; ``unit``: of its values, as it stands behind a number.
    """
    starts, differ = _groups(order), _differing(raw, order)
    first = int(np.flatnonzero(np.diff(order) == 0)[0])
    names = [name for m, name in enumerate(raw.labels) if differ[:, m].any()]
    what = "time" if raw.times is not None else "number"
    count = int(np.count_nonzero(np.diff([*starts, len(order)]) > 1))
    lines = f"{raw.line_word}s {raw.lines[first]} and {raw.lines[first + 1]}"
    times = f"{count} {what}s stand" if count > 1 else f"one {what} stands"
    says = f"{times} in more than one {raw.line_word}, the first ({order[first]:g}{unit}) in {lines}"
    if names:
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        says += f"; these differ in the positions of {', '.join(names[:_LISTED])}{more}"
    else:
        says += ", with the same positions"
    remedy = (
        "merge such rows, with gaps where they differ: --repeated gaps; or keep the first of them: --repeated first"
    )
    return ask("repeated", f"{file}, {raw.line_word} {raw.lines[first + 1]}", float(order[first]), f"{says}; {remedy}",
               REPEATED)  # fmt: skip


def without_repeats(raw: Raw, given: Given) -> Raw:
    """Return ``raw`` with one frame for each time (or number of a frame), if the user says how to merge those."""
    order = raw.times if raw.times is not None else raw.frames
    if given.repeated is None or order is None or len(order) < 2 or not (np.diff(order) >= 0).all():
        return raw
    starts = _groups(order)
    if len(starts) == len(order):
        return raw
    positions = raw.positions[starts]
    repeats = f"in {counted(len(order) - len(starts), 'row')} the time is that of the row before"
    remark = f"{repeats}; the first row is kept"
    if given.repeated == "gaps":
        differ = _differing(raw, order)
        seen: Mask = np.all(np.isfinite(raw.positions), axis=2)
        group = np.searchsorted(starts, np.arange(len(order)), side="right") - 1
        for row in np.flatnonzero(np.diff(group, prepend=-1) == 0):
            fill: Mask = seen[row] & ~np.all(np.isfinite(positions[group[row]]), axis=1)
            positions[group[row], fill] = raw.positions[row, fill]
        positions[differ] = np.nan
        remark = f"{repeats}; they are merged, with {counted(int(differ.sum()), 'gap')} where they differ"
    return replace(
        raw,
        positions=positions,
        lines=raw.lines[starts],
        times=None if raw.times is None else raw.times[starts],
        frames=None if raw.frames is None else raw.frames[starts],
        invalid=None if raw.invalid is None else raw.invalid[starts],
        remarks=[*raw.remarks, remark],
    )


def _groups(order: Array | Index) -> Index:
    """Return the index of the first row of each value in ``order`` [T], which does not decrease."""
    return np.flatnonzero(np.diff(order, prepend=order[0] - 1) > 0)


def _differing(raw: Raw, order: Array | Index) -> Mask:
    """Return for each value of ``order`` and each marker whether its rows show it at different positions."""
    starts = _groups(order)
    filled = np.where(np.isfinite(raw.positions), raw.positions, np.inf)
    low = np.minimum.reduceat(filled, starts)
    high = np.maximum.reduceat(np.where(np.isinf(filled), -np.inf, filled), starts)
    found: Mask = np.any(high > low, axis=2)
    return found
