"""Writes CSV (RFC 4180): numbers in full precision, and text so that a spreadsheet runs none of it as a formula."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

MEDIA_TYPE = "text/csv"
Cell = str | float | bool | None
# A cell that begins with one of these may be taken as a formula (OWASP, CSV injection), also with full-width signs.
FORMULA = tuple("=+-@\t\r\n\0＝＋－＠")


def lines(rows: Iterable[Sequence[Cell]]) -> str:
    """Return rows of cells as CSV text: None as an empty cell, and text that looks like a formula after a "'"."""
    buffer = io.StringIO()
    csv.writer(buffer).writerows([_plain(cell) for cell in row] for row in rows)
    return buffer.getvalue()


def _plain(cell: Cell) -> str | float | None:
    if isinstance(cell, bool):
        return "true" if cell else "false"
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell
