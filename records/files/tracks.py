"""Reads tracks of one recording from CSV: ``time_s``, then MARKER_x_m, MARKER_y_m, MARKER_z_m of each marker."""

from __future__ import annotations

import re
from collections.abc import Sequence

from wingfit.records.errors import Faults, nearest
from wingfit.records.files.table import Layout, Samples, read_columns, read_table
from wingfit.records.limits import MAX_MARKERS, MAX_VALUES

_COLUMN = re.compile(r"(?P<marker>.+)_(?P<axis>[xyz])_m")
_OTHER_UNIT = re.compile(r"(?P<marker>.+?)_?(?P<axis>[xyzXYZ])(?:_?(?:mm|cm|m|px|in|um))?")


def read_tracks(raw: bytes, file: str, known: Sequence[str], room: int = MAX_VALUES) -> Samples:
    """Read tracks from the contents ``raw`` of a CSV ``file`` with at most ``room`` numbers.

    ``known`` are the names of the wing's markers. DatasetError names line and column of every error.
    """
    return read_table(raw, file, lambda header, where: _layout(header, where, known), room, "the marker was not seen")


def _layout(header: Sequence[str], where: str, known: Sequence[str]) -> Layout:
    columns, faults = read_columns(header, where, lambda name: _problem(name, known)), Faults()
    found = (_COLUMN.fullmatch(name) for name in header)
    markers = tuple(dict.fromkeys(match["marker"] for match in found if match))
    names = [f"{marker}_{axis}_m" for marker in markers for axis in "xyz"]
    for name in names:
        if name not in columns:
            message = f"column {name!r} is missing; a marker needs its x, y and z (cells may be empty)"
            faults.add(where, name, message)
    if not markers:
        faults.add(where, ",".join(header), "there is no column of a marker; add columns such as " + _example(known))
    if len(markers) > MAX_MARKERS:
        faults.add(where, len(markers), f"{len(markers)} markers; at most {MAX_MARKERS} are read: remove some")
    faults.raise_any()
    return Layout(columns["time_s"], [columns[name] for name in names], markers=markers)


def _problem(name: str, known: Sequence[str]) -> str | None:
    match = _COLUMN.fullmatch(name)
    if match and match["marker"] in known:
        return None
    if match:
        hint = f"{nearest(match['marker'], known)}; or remove the column"
        return f"no marker is called {match['marker']!r} in dataset.yaml; {hint}"
    other = _OTHER_UNIT.fullmatch(name)
    if other and other["marker"] in known:
        wanted = f"{other['marker']}_{other['axis'].lower()}_m"
        return f"unknown column {name!r}; write {wanted!r}, with positions in metres"
    return f"unknown column {name!r}; columns are time_s and {_example(known)}: remove what is neither"


def _example(known: Sequence[str]) -> str:
    marker = known[0] if known else "marker"
    return ", ".join(f"{marker}_{axis}_m" for axis in "xyz")
