"""Rows as CSV: RFC 4180, numbers with all their digits, and no text that a spreadsheet would compute."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

MEDIA_TYPE = "text/csv"
Cell = str | float | bool | None
# What makes a cell a formula, or hides what does; the wide forms count where they are typed (OWASP, CSV injection).
FORMULA = tuple("=+-@\t\r\n\0＝＋－＠")


def lines(rows: Iterable[Sequence[Cell]]) -> str:
    """Rows of cells; None is an empty one, a text that looks like a formula begins with an apostrophe."""
    buffer = io.StringIO()
    csv.writer(buffer).writerows([_plain(cell) for cell in row] for row in rows)
    return buffer.getvalue()


def _plain(cell: Cell) -> str | float | None:
    if isinstance(cell, bool):
        return "true" if cell else "false"
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell
