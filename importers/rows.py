"""Which rows of a plain table are one recording, where a table holds several one after another."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

import numpy as np

from wingfit.importers.source import Row
from wingfit.records.array_types import Array, Index
from wingfit.records.limits import MIN_FRAMES

_MOST_COLUMNS = 12  # that are tried
_MOST_CHOICES = 500
_MOST_REPEATS = 0.1  # of the rows of one recording
_LONGEST = 80  # characters of a value


def row_choices(
    rows: Iterable[Row],
    lines: Index,
    header: Sequence[str],
    columns: Sequence[str],
    order: Array | Index,
    given: str | None = None,
) -> list[str]:
    """Return values for the option ``rows``, such as "run=1", each of which selects one recording.

    One of the ``columns`` (names in ``header``), or two of them, name the recordings if ``order`` [T] (times, or
    numbers of frames, of the rows at ``lines`` [T]) increases within the rows that have the same values there, but for
    a few that repeat, for at least half of all rows. ``given``: the value of the option that chose ``lines``. Of
    several such columns, those are taken for which it does for most rows, then those with the fewest values. None are
    returned if there are no such columns.
    """
    texts = _texts(rows, lines, [header.index(name) for name in columns])
    coded = [np.unique(text, return_inverse=True) for text in texts]
    repeated = [k for k, (values, _) in enumerate(coded) if _may_name(values.tolist(), len(lines))][:_MOST_COLUMNS]
    for count in (1, 2):
        tried = []
        for chosen in combinations(repeated, count):
            group = np.zeros(len(lines), dtype=np.int64)
            for k in chosen:
                group = group * len(coded[k][0]) + coded[k][1]
            first, sizes = _recordings(group, order)
            tried.append((-int(sizes.sum()), len(first), chosen, first))
        if tried and -min(tried, key=lambda one: one[:3])[0] >= len(lines) / 2:
            _, _, chosen, first = min(tried, key=lambda one: one[:3])
            before = [given] if given else []
            return [
                ",".join([*before, *(f"{columns[k]}={texts[k][at]}" for k in chosen)]) for at in first[:_MOST_CHOICES]
            ]
    return []


def _texts(rows: Iterable[Row], lines: Index, places: Sequence[int]) -> list[list[str]]:
    """Return the cells in the columns ``places`` of the rows at ``lines``, by column."""
    wanted, found = set(lines.tolist()), [list[str]() for _ in places]
    for line, cells in rows:
        if line in wanted:
            for texts, place in zip(found, places, strict=True):
                texts.append(cells[place].strip()[: _LONGEST + 1])
    return found


def _may_name(values: Sequence[str], count: int) -> bool:
    """Return whether ``values``, the different ones of ``count`` rows, can name recordings in the option ``rows``."""
    plain = all(value and "," not in value and "=" not in value and len(value) <= _LONGEST for value in values)
    return plain and 1 < len(values) <= count / 2


def _recordings(group: Index, order: Array | Index) -> tuple[Index, Index]:
    """Return the first row and the count of rows of each ``group`` in which ``order`` increases, by first row.

    A fraction of the rows may repeat the value of the row before: the option ``repeated`` says what becomes of them.
    """
    _, first, inverse, sizes = np.unique(group, return_index=True, return_inverse=True, return_counts=True)
    by_group = np.argsort(inverse, kind="stable")
    steps, groups = np.diff(order[by_group]), inverse[by_group][1:]
    same = np.diff(inverse[by_group]) == 0
    falls = np.bincount(groups[same & (steps < 0)], minlength=len(first))
    repeats = np.bincount(groups[same & (steps == 0)], minlength=len(first))
    wrong = (falls > 0) | (repeats > _MOST_REPEATS * sizes)
    good = np.flatnonzero(np.logical_not(wrong) & (sizes >= MIN_FRAMES))
    good = good[np.argsort(first[good])]
    return first[good], sizes[good]
