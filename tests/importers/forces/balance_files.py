"""Files of balances of known forces, and short ways to import and to catch what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wingfit.importers.forces import ImportedForces, import_forces
from wingfit.records import DatasetError
from wingfit.records.array_types import Array

RATE = 500.0
TIMES = np.arange(40) / RATE
FORE, DOWN = 0.3 + 0.2 * np.sin(60 * TIMES), -1.2 + 0.5 * np.cos(60 * TIMES)  # N, on the body
BODY = {"axes": "x nose, y right, z down", "balance": "body"}


def table(header: str, *columns: Array, separator: str = ",") -> str:
    rows = (separator.join(repr(float(cell)) for cell in row) for row in zip(*columns, strict=True))
    return "\n".join([header, *rows]) + "\n"


def read(folder: Path, content: str | bytes, file: str = "run.csv", **options: Any) -> ImportedForces:
    place = folder / file
    place.write_bytes(content.encode() if isinstance(content, str) else content)
    return import_forces(place, **options)


def refused(folder: Path, content: str | bytes, file: str = "run.csv", **options: Any) -> str:
    """Return the message with which ``content`` is refused; every fault has a place and a message."""
    with pytest.raises(DatasetError) as caught:
        read(folder, content, file, **options)
    assert all(fault.where and fault.message for fault in caught.value.errors)
    return str(caught.value)


def agrees(found: ImportedForces, fore: Array = FORE, down: Array = DOWN) -> bool:
    return found.axes == ("x", "z") and bool(np.allclose(found.forces, np.column_stack([fore, down]), atol=1e-9))
