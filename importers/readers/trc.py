"""TRC, the track-row-column text of Motion Analysis, also written by OpenSim and many converters.

Line 1 starts with PathFileType; lines 2 and 3 are keys and values (DataRate, NumFrames, NumMarkers, Units); line 4 has
"Frame#", "Time" and the name of each marker above its first coordinate; line 5 has X1, Y1, Z1, ...; one row per frame
follows. Cells are separated by tabs, by some programs by commas. The file does not state its axes: "(X/Y/Z)" in line 1
is the order of the columns.
"""

from __future__ import annotations

from wingfit.importers.numbers import Layout, count_of, positive_of, read_samples
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader, Stated, raw_of
from wingfit.importers.source import Source, separator_of
from wingfit.records.errors import counted, fail

_FIXED = 2  # columns before the first marker


def recognises(source: Source) -> bool:
    """Return whether the first line is that of a TRC file."""
    return bool(source.head) and source.head[0].lstrip("\ufeff").startswith("PathFileType")


def read(source: Source, given: Given) -> Raw:
    """Return the tracks of a TRC file; DatasetError names line and remedy."""
    if len(source.head) < 5:
        raise fail(source.file, len(source.head), f"has {len(source.head)} lines; the header of a TRC file has five")
    separator = separator_of(source.head[3])
    stated = _values(source, separator)
    layout = _layout(source, separator, stated)
    # Some programs leave the sixth line empty, others write only its separators.
    start = 6 if any(source.cells(6, separator)) else 7
    raw = raw_of(layout, read_samples(source.rows(separator, start), layout, source, given.decimal))
    raw.time_unit = Stated("s", "TRC format")
    raw.times_where, raw.first = "column 'Time'", 1
    if stated.get("Units"):
        raw.unit = Stated(stated["Units"], "line 3, Units")
    if stated.get("DataRate"):
        where = source.at(3, "DataRate")
        raw.rates = [Stated(positive_of(stated["DataRate"], where, "Hz", given.decimal), "line 3, DataRate")]
    if stated.get("NumFrames"):
        raw.frame_count = Stated(count_of(stated["NumFrames"], source.at(3, "NumFrames")), "line 3, NumFrames")
    return raw


def _values(source: Source, separator: str) -> dict[str, str]:
    """Return the values in line 3 by the keys in line 2."""
    keys, values = source.cells(2, separator), source.cells(3, separator)
    return {key: value for key, value in zip(keys, values, strict=False) if key}


def _layout(source: Source, separator: str, stated: dict[str, str]) -> Layout:
    cells = source.cells(4, separator)
    if len(cells) <= _FIXED or not cells[0].lower().startswith("frame") or cells[1].lower() != "time":
        message = "must start with Frame# and Time, followed by the names of the markers; export the file again"
        raise fail(source.at(4), ", ".join(cells[:_FIXED]), message)
    last = max(index for index, cell in enumerate(cells) if cell)
    labels = []
    for index in range(_FIXED, last + 1):
        is_first = (index - _FIXED) % 3 == 0
        if is_first != bool(cells[index]):
            place = "above the X of its marker" if cells[index] else "missing above an X"
            message = f"a name must be above each third column; {cells[index]!r} is not {place}: export the file again"
            raise fail(source.at(4, index + 1), cells[index], message)
        if is_first:
            labels.append(cells[index])
    if stated.get("NumMarkers"):
        count = count_of(stated["NumMarkers"], source.at(3, "NumMarkers"))
        if count != len(labels):
            message = (
                f"names {counted(len(labels), 'marker')}, but NumMarkers in line 3 is {count}; export the file again"
            )
            raise fail(source.at(4), len(labels), message)
    columns = [(_FIXED + 3 * m, _FIXED + 3 * m + 1, _FIXED + 3 * m + 2) for m in range(len(labels))]
    names = ["Frame#", "Time", *(f"{label} {axis}" for label in labels for axis in "XYZ")]
    return Layout(labels, columns, names, time=1, frame=0)


READER = Reader("trc", "TRC", recognises, read)
