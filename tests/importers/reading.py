"""Short ways to import text and to catch what is refused."""

from __future__ import annotations

from typing import Any

import pytest

from wingfit.importers import Given, ImportedTracks, import_bytes
from wingfit.records import DatasetError

NAME = "file.dat"


def read(content: str | bytes, **options: Any) -> ImportedTracks:
    """Import ``content`` with the options of ``wingfit import``."""
    raw = content.encode() if isinstance(content, str) else content
    return import_bytes(raw, NAME, Given(**options))


def refused(content: str | bytes, **options: Any) -> str:
    """Return the message with which ``content`` is refused; every fault has a place and a message."""
    with pytest.raises(DatasetError) as caught:
        read(content, **options)
    assert all(fault.where and fault.message for fault in caught.value.errors)
    return str(caught.value)


def table(rows: int = 10, header: str = "time_s,tip_x_mm,tip_y_mm,tip_z_mm", **cells: str) -> str:
    """Return a plain table at 100 Hz; ``cells`` r3c1="..." replaces the cell in row 3 (from 0), column 1."""
    lines = [header]
    for t in range(rows):
        row = [f"{t / 100:.2f}", f"{t}.5", "200.25", "-3"]
        lines.append(",".join(cells.get(f"r{t}c{c}", cell) for c, cell in enumerate(row)))
    return "\n".join(lines) + "\n"
