"""CSV of Motive (OptiTrack).

Line 1 holds keys and values ("Format Version,1.23,Take Name,...,Export Frame Rate,120.000000,...,Length Units,Meters").
Then come rows that describe the columns (type, name, ID, in newer versions also parent, then Position, Rotation or a
quality), a row "Frame,Time (Seconds),X,Y,Z,...", and one row per frame. An empty cell is a missing marker.

Only columns of type "Marker" are measured. "Rigid Body Marker" and "Bone Marker" are where Motive expects a marker to
be, also while it is hidden; they are not imported. Motive's up axis is chosen when exporting and is not in the file.
"""

from __future__ import annotations

from collections import Counter

from wingfit.importers.numbers import Layout, count_of, positive_of, read_samples
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader, Stated, raw_of
from wingfit.importers.source import Source, separator_of
from wingfit.records.errors import counted, fail

_RATES = ("Export Frame Rate", "Capture Frame Rate")
_DATA = 2  # columns before the data
_MARKER = "marker"


def recognises(source: Source) -> bool:
    """Return whether the first cell is that of a Motive file."""
    return bool(source.cells(1)) and source.cells(1)[0] == "Format Version"


def read(source: Source, given: Given) -> Raw:
    """Return the measured markers of a Motive file; DatasetError names line and remedy."""
    line = next((n for n in range(2, len(source.head) + 1) if (source.cells(n) or [""])[0] == "Frame"), None)
    if line is None:
        message = "there is no line that starts with Frame; export with header information"
        raise fail(source.file, None, message)
    separator = separator_of(source.head[line - 1])
    keys = source.cells(1)
    stated = dict(zip(keys[::2], keys[1::2], strict=False))
    layout, remarks = _layout(source, line, separator)
    raw = raw_of(layout, read_samples(source.rows(separator, line + 1), layout, source, given.decimal), remarks=remarks)
    raw.time_unit, raw.times_where = Stated("s", f"line {line}"), f"column {layout.names[1]!r}"
    if stated.get("Length Units"):
        raw.unit = Stated(stated["Length Units"], "line 1, Length Units")
    key = next((key for key in _RATES if stated.get(key)), None)
    if key:
        raw.rates = [Stated(positive_of(stated[key], source.at(1, key), "Hz", given.decimal), f"line 1, {key}")]
    if stated.get("Total Exported Frames"):
        place = "line 1, Total Exported Frames"
        raw.frame_count = Stated(count_of(stated["Total Exported Frames"], f"{source.file}, {place}"), place)
    if stated.get("Coordinate Space", "Global").lower() != "global":
        message = "positions are relative to other bodies; export with the coordinate space Global"
        raise fail(source.at(1, "Coordinate Space"), stated["Coordinate Space"], message)
    return raw


def _layout(source: Source, line: int, separator: str) -> tuple[Layout, list[str]]:
    """Return where the measured markers are; ``line`` is that of the axes. Also remarks about the other columns."""
    axes = source.cells(line, separator)
    above = [cells for n in range(2, line) if any(cells := source.cells(n, separator))]
    if len(axes) < _DATA + 1 or not axes[1].lower().startswith("time") or len(above) < 3:
        message = f"has {len(above)} lines of names above; type, name and ID of each column are needed: export again"
        raise fail(source.at(line), len(above), message)
    if "second" not in axes[1].lower():
        raise fail(source.at(line, 2), axes[1], f"is {axes[1]!r}; it must be Time (Seconds): export with times")
    for n, cells in ((n, source.cells(n, separator)) for n in range(2, line)):
        if any(cells) and (len(cells) < len(axes) or any(cells[len(axes) :])):
            message = f"describes {len(cells)} columns, and the axes in line {line} {len(axes)}; export the file again"
            raise fail(source.at(n), len(cells), message)
    labelled = {cells[1]: cells for cells in above if len(cells) > 1 and cells[1]}
    types, names = labelled.get("Type", above[0]), labelled.get("Name", above[1])
    parts, ids = above[-1], labelled.get("ID", above[2])
    labels, columns, others = [], [], Counter[str]()
    index = _DATA
    while index < len(axes):
        kind, part = _cell(types, index), _cell(parts, index)
        if kind.lower() != _MARKER or part.lower() != "position":
            others[f"{kind or 'unnamed'} ({part})" if part else kind or "unnamed"] += bool(axes[index])
            index += 1
            continue
        same = {(_cell(names, k), _cell(ids, k)) for k in range(index, index + 3)}
        if "".join(axes[index : index + 3]).upper() != "XYZ" or len(same) > 1:
            message = "the three positions of a marker must be X, Y, Z side by side; export the file again"
            raise fail(source.at(line, index + 1), axes[index], message)
        labels.append(_cell(names, index))
        columns.append((index, index + 1, index + 2))
        index += 3
    if not labels:
        listed = ", ".join(others) or "nothing"
        message = f"there are no columns of type Marker, only {listed}; export with Markers switched on"
        raise fail(source.file, listed, message)
    left = [f"not imported: {counted(count, 'column')} of {name}" for name, count in others.items() if count]
    shown = [f"{_cell(names, k)} {axis}" if k >= _DATA else axis for k, axis in enumerate(axes)]
    return Layout(labels, columns, shown, time=1, frame=0), left


def _cell(cells: list[str], index: int) -> str:
    return cells[index] if index < len(cells) else ""


READER = Reader("motive", "Motive (OptiTrack) CSV", recognises, read)
