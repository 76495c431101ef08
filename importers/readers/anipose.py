"""CSV of 3-D poses of Anipose.

Columns NAME_x, NAME_y, NAME_z, NAME_error, NAME_ncams, NAME_score for each body part, then M_00 to M_22, center_0 to
center_2 (a rotation that Anipose applies when it computes angles; the positions are as triangulated) and fnum, the
number of the frame from 0. There is no unit (it is that of the calibration board) and no rate.
"""

from __future__ import annotations

from wingfit.importers.numbers import Layout, read_samples
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader, raw_of
from wingfit.importers.source import Source, separator_of
from wingfit.records.errors import Faults, fail

_QUALITY = ("error", "ncams", "score")


def recognises(source: Source) -> bool:
    """Return whether there is a column fnum, and one with the number of cameras or the error of a body part."""
    cells = source.cells(1)
    return "fnum" in cells and any(cell.endswith(("_ncams", "_error")) for cell in cells)


def read(source: Source, given: Given) -> Raw:
    """Return the poses of an Anipose file; DatasetError names line, column and remedy."""
    separator = separator_of(source.head[0]) if source.head else ","
    cells, faults = source.cells(1, separator), Faults()
    for index, cell in enumerate(cells):
        if cell in cells[:index] and not faults.full:
            faults.add(source.at(1, index + 1), cell, f"column {cell!r} appears twice; remove one")
    faults.raise_any()
    if "fnum" not in cells:
        raise fail(source.at(1), None, "there is no column fnum with numbers of frames; export the file again")
    # Names may contain underscores: the suffix is split off from the right.
    parts = list(dict.fromkeys(cell[: -len("_error")] for cell in cells if cell.endswith(("_error", "_ncams"))))
    for part in parts:
        missing = [f"{part}_{axis}" for axis in "xyz" if f"{part}_{axis}" not in cells]
        if missing and not faults.full:
            faults.add(source.at(1), part, f"there is no column {', '.join(missing)}; export the file again")
    faults.raise_any()
    columns = [(cells.index(f"{part}_x"), cells.index(f"{part}_y"), cells.index(f"{part}_z")) for part in parts]
    layout = Layout(parts, columns, cells, frame=cells.index("fnum"))
    raw = raw_of(layout, read_samples(source.rows(separator, 2), layout, source, given.decimal))
    raw.unit_hint = "positions are in the unit of the calibration board"
    raw.rate_hint = "the column fnum counts the frames of the video"
    raw.remarks = [f"not imported: {', '.join(_QUALITY)} of each point"]
    return raw


READER = Reader("anipose", "Anipose 3-D CSV", recognises, read)
