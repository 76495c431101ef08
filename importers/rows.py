"""Which rows of a plain table are one recording, where a table holds several one after another."""

from __future__ import annotations

from array import array
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
_MOST_VALUES = 20_000  # different ones in a column


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
    coded = _coded(rows, lines, [header.index(name) for name in columns])
    repeated = [k for k, (values, _) in coded.items() if len(values) > 1][:_MOST_COLUMNS]
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
                ",".join([*before, *(f"{columns[k]}={coded[k][0][coded[k][1][at]]}" for k in chosen)])
                for at in first[:_MOST_CHOICES]
            ]
    return []


def _coded(rows: Iterable[Row], lines: Index, places: Sequence[int]) -> dict[int, tuple[list[str], Index]]:
    """Return the different cells in columns of the rows at ``lines``, and for each row the index of its cell [T].

    The keys are indices in ``places``, the columns. One is left out if its cells cannot name recordings in the option
    ``rows``; all cells of a large file would not fit in memory.
    """
    most = min(len(lines) // 2, _MOST_VALUES)
    wanted = set(lines.tolist())
    live = [(k, place, dict[str, int](), array("i")) for k, place in enumerate(places)]
    for line, cells in rows:
        if line not in wanted:
            continue
        ended = set[int]()
        for k, place, codes, found in live:
            text = cells[place].strip()
            code = codes.get(text)
            if code is None:
                code = codes[text] = len(codes)
                if len(codes) > most or not _may_name(text):
                    ended.add(k)
            found.append(code)
        live = [one for one in live if one[0] not in ended] if ended else live
    return {k: ([*codes], np.array(found, dtype=np.int64)) for k, _, codes, found in live}


def _may_name(text: str) -> bool:
    """Return whether a cell with ``text`` can name a recording in the option ``rows``."""
    return bool(text) and "," not in text and "=" not in text and len(text) <= _LONGEST


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
