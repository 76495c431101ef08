"""Writes CSV (RFC 4180) with numbers in full precision; a spreadsheet cannot run any of its text as a formula."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

MEDIA_TYPE = "text/csv"
Cell = str | float | bool | None
# A cell that begins with one of these may be taken as a formula (OWASP, CSV injection), also with full-width signs.
FORMULA = tuple("=+-@\t\r\n\0＝＋－＠")


def lines(rows: Iterable[Sequence[Cell]]) -> str:
    """CSV text of rows of cells. None gives an empty cell; a text that looks like a formula gets an apostrophe."""
    buffer = io.StringIO()
    csv.writer(buffer).writerows([_plain(cell) for cell in row] for row in rows)
    return buffer.getvalue()


def _plain(cell: Cell) -> str | float | None:
    if isinstance(cell, bool):
        return "true" if cell else "false"
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell
