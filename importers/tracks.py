"""What an import returns: tracks in metres and seconds, what was stated about them and by whom, and their gaps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.files.table import write_table

DECIMALS = 12  # of metres
_FRAMES_OF_PART = 1000
FactName = Literal["unit", "rate", "times", "axes", "up", "first frame"]


@dataclass(frozen=True)
class Statement:
    """One fact about the tracks: its ``value`` as text, stated ``by`` the file or the user, and ``where``.

    ``where`` is a place in the file ("line 3, Units") or an option ("--unit").
    """

    fact: FactName
    value: str
    by: Literal["file", "user"]
    where: str


@dataclass(frozen=True)
class Gaps:
    """Counts of positions that are missing, over all frames and markers that were imported, by cause.

    Attributes:
        empty: no coordinate is there; the cells are empty, or a sparse file lists none.
        nan: the file writes "not a number" in one of its spellings (NaN, null, N/A, ...).
        zeros: all three coordinates are exactly zero, which capture programs write for a marker that was not seen.
        residual: a C3D file marks the point as invalid by a negative residual.
        partial: one or two coordinates are missing; the others are discarded.
    """

    empty: int = 0
    nan: int = 0
    zeros: int = 0
    residual: int = 0
    partial: int = 0

    @property
    def total(self) -> int:
        """Return the count of all missing positions."""
        return sum(getattr(self, field.name) for field in fields(self))


@dataclass(frozen=True, eq=False)
class ImportedTracks:
    """Tracks of one file.

    Attributes:
        file: name of the file, without folders.
        format: name of the format, as ``--format`` takes it.
        title: name of the format for readers.
        markers: names [M], as datasets allow them: letters, digits, ``.``, ``_``, ``-``.
        labels: names [M] as they are in the file.
        times: [T], s; they increase.
        positions: [T, M, 3], m; NaN (in all three coordinates) where a marker was not seen.
        frame: "wing" if the axes are x aft, y outboard, z up; "body" if they are x to the nose, y right, z down; "file"
            if they are those of the file.
        statements: the facts, each with who stated it.
        gaps: missing positions by cause.
        remarks: what else the reader should know: parts of the file that are not imported, new names, rounding.
    """

    file: str
    format: str
    title: str
    markers: tuple[str, ...]
    labels: tuple[str, ...]
    times: Float[Array, " T"]
    positions: Float[Array, "T M 3"]
    frame: Literal["wing", "body", "file"]
    statements: tuple[Statement, ...]
    gaps: Gaps
    remarks: tuple[str, ...]

    def statement(self, fact: FactName) -> Statement | None:
        """Return the statement of ``fact``, or None if nobody stated it."""
        return next((one for one in self.statements if one.fact == fact), None)

    @property
    def rate_hz(self) -> float:
        """Return the frames per second between the closest frames, Hz."""
        return float(1 / np.min(np.diff(self.times)))

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last frame, s."""
        return float(self.times[-1] - self.times[0])

    def csv(self) -> str:
        """Return the tracks as a table of ``recordings/<name>.csv`` (docs/formats.md): seconds, metres, gaps empty.

        Positions are rounded to 1e-12 m, so that 37.2 mm are written as 0.0372.
        """
        return "".join(self.csv_parts())

    def csv_parts(self) -> Iterator[str]:
        """Yield the table of :meth:`csv` in parts of some frames, so that it need not be in memory as a whole."""
        columns = [f"{marker}_{axis}_m" for marker in self.markers for axis in "xyz"]
        for start in range(0, len(self.times), _FRAMES_OF_PART):
            part = slice(start, start + _FRAMES_OF_PART)
            values = np.round(self.positions[part], DECIMALS).reshape(-1, len(columns))
            text = write_table(columns, self.times[part], values)
            yield text if start == 0 else text[text.index("\n") + 1 :]
