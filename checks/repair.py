"""Writes a copy of a dataset with the changes that mistakes name: all other text of its files stays as it is."""

from __future__ import annotations

import csv
import io
import math
import re
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path as FilePath

import numpy as np

from wingfit.checks.mistake import Edit, KeyEdit, Mistake, TableEdit
from wingfit.records import load_dataset
from wingfit.records.array_types import Array
from wingfit.records.description.yaml_text import Path, dotted, read_yaml
from wingfit.records.errors import fail
from wingfit.records.files.folder import DESCRIPTION, RECORDINGS, contents
from wingfit.records.files.storage import is_netcdf

_VALUE = re.compile(r"[^\s,#\]}]+")
_DIGITS = 12  # significant: of a computed number, so that 0.49 does not become 0.49000000000000005


def repaired(source: FilePath, target: FilePath, mistakes: Sequence[Mistake]) -> list[Edit]:
    """Write a copy of the dataset ``source`` to the new folder ``target`` with the edits of ``mistakes``; return these.

    DatasetError if ``target`` exists and is not an empty folder, is inside the source, or cannot be written, or if a
    key that is to be changed is not in the file.
    """
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise fail(str(target), None, "exists and is not an empty folder; choose a new name: nothing is overwritten")
    folder = source.parent if source.name == DESCRIPTION else source
    if folder.resolve() in target.resolve().parents:
        message = f"is inside {folder}, which stays as it is; choose a new name outside"
        raise fail(str(target), None, message)
    files = _files(source)
    edits = [edit for mistake in mistakes for edit in mistake.edits]
    files[DESCRIPTION] = _described(files[DESCRIPTION], [edit for edit in edits if isinstance(edit, KeyEdit)])
    for edit in edits:
        if isinstance(edit, TableEdit):
            name = f"{RECORDINGS}/{edit.recording}.csv"
            files[name] = _altered(files[name], edit)
    try:
        for name, data in files.items():
            place = target / name
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(data)
    except OSError as error:
        message = f"cannot be written: {error.strerror or error}; choose a folder that you may write to"
        raise fail(str(target), None, message) from error
    return edits


def _files(source: FilePath) -> dict[str, bytes]:
    """Contents of ``dataset.yaml`` and of all recordings, by name, of a folder, a zip or a NetCDF file."""
    if source.name == DESCRIPTION:
        source = source.parent
    if source.is_dir():
        return {name: (source / name).read_bytes() for name in _wanted(_listed(source))}
    data = source.read_bytes()
    if is_netcdf(data):
        return contents(load_dataset(source, plausible=False), plausible=False)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = [name for name in archive.namelist() if not name.endswith("/")]
        prefix = next(name for name in names if name.rpartition("/")[2] == DESCRIPTION).removesuffix(DESCRIPTION)
        inside = [name.removeprefix(prefix) for name in names if name.startswith(prefix)]
        return {name: archive.read(prefix + name) for name in _wanted(inside)}


def _listed(folder: FilePath) -> list[str]:
    return [DESCRIPTION, *(f"{RECORDINGS}/{file.name}" for file in sorted((folder / RECORDINGS).glob("*.csv")))]


def _wanted(names: Iterable[str]) -> list[str]:
    return [name for name in names if name == DESCRIPTION or re.fullmatch(rf"{RECORDINGS}/[^/]+\.csv", name)]


def _described(raw: bytes, edits: Sequence[KeyEdit]) -> bytes:
    """Replace the value of each key in place: comments, order and all other values stay."""
    document = read_yaml(raw, DESCRIPTION)
    lines = raw.decode("utf-8-sig").splitlines(keepends=True)
    spots = sorted(
        ((*_spot(lines, document.places, edit.path), edit) for edit in edits), reverse=True, key=lambda s: s[:3]
    )
    for line, start, end, edit in spots:
        lines[line] = lines[line][:start] + edit.new + lines[line][end:]
    return "".join(lines).encode()


def _spot(lines: Sequence[str], places: dict[Path, tuple[int, int]], path: Path) -> tuple[int, int, int]:
    """Line, first and last column of the value at ``path``."""
    if path not in places:
        raise fail(DESCRIPTION, None, f"{dotted(path)} is not in the file; write it there by hand")
    line, column = places[path][0] - 1, places[path][1] - 1
    text = lines[line]
    if isinstance(path[-1], str):
        column = text.index(":", column + len(path[-1])) + 1
        column += len(text[column:]) - len(text[column:].lstrip(" "))
    found = _VALUE.match(text, column)
    if found is None:
        raise fail(DESCRIPTION, None, f"the value of {dotted(path)} is not on the line of its key; change it by hand")
    return line, found.start(), found.end()


def _altered(raw: bytes, edit: TableEdit) -> bytes:
    """Compute the columns anew; a cell whose number does not change keeps its text."""
    rows = list(csv.reader(io.StringIO(raw.decode("utf-8-sig"), newline="")))
    header, body = [name.strip() for name in rows[0]], [row for row in rows[1:] if row]
    table = np.array([[float(cell) if cell.strip() else math.nan for cell in row] for row in body])
    time, columns, names = _layout(header)
    times, values = edit.alter(table[:, time], table[:, columns], names)
    new = table.copy()
    new[:, time], new[:, columns] = times, values
    changed = ~((new == table) | (np.isnan(new) & np.isnan(table)))
    for i, j in np.argwhere(changed):
        body[i][j] = _number(new[i, j])
    return "\n".join([",".join(rows[0]), *(",".join(row) for row in body), ""]).encode()


def _layout(header: Sequence[str]) -> tuple[int, list[int], tuple[str, ...]]:
    """Column of time, columns of the channels in the order of a Recording, and the names of these channels."""
    if any(name.startswith("force_") and name.endswith("_n") for name in header):
        names = [name for name in ("force_x_n", "force_z_n") if name in header]
    else:
        markers = dict.fromkeys(name[: -len("_x_m")] for name in header if re.fullmatch(r".+_[xyz]_m", name))
        names = [f"{marker}_{axis}_m" for marker in markers for axis in "xyz"]
    return header.index("time_s"), [header.index(name) for name in names], tuple(n.rpartition("_")[0] for n in names)


def _number(value: Array | float) -> str:
    return "" if math.isnan(value) else repr(float(f"{float(value):.{_DIGITS}g}"))
