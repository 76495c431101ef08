"""CSV of Vicon Nexus: the section "Trajectories".

A file has sections, separated by empty lines: Devices, Joints, Model Outputs, Trajectories, ... Each starts with its
name, then the rate in Hz, a row with the name of each marker ("subject:marker") above its first coordinate, a row
"Frame,Sub Frame,X,Y,Z,...", and a row of units. Rows of numbers follow. Axes are not stated.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from wingfit.importers.numbers import Layout, positive_of, read_samples
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader, Stated, raw_of
from wingfit.importers.source import Row, Source, separator_of
from wingfit.records.errors import fail

_SECTION = "Trajectories"
_OTHERS = ("Devices", "Joints", "Model Outputs", "Segments", "Events")
_FIXED = 2  # columns before the first marker
_DERIVATIVE = re.compile(r"[XYZ]['’]{1,2}")  # velocities and accelerations


def recognises(source: Source) -> bool:
    """Return whether the head has a line that starts a section of this format."""
    for line, text in enumerate(source.head, 1):
        name = text.strip(' \t,;\ufeff"')
        if name in (_SECTION, *_OTHERS) and _axes_near(source, line):
            return True
    return False


def _axes_near(source: Source, line: int) -> bool:
    return any(source.cells(n)[:2] == ["Frame", "Sub Frame"] for n in range(line + 1, line + 5))


def read(source: Source, given: Given) -> Raw:
    """Return the section "Trajectories" of a Vicon file; DatasetError names line and remedy."""
    separator = separator_of(next((text for text in source.head if "Sub Frame" in text), ","))
    rows, others = source.rows(separator), []
    at, cells = 0, list[str]()
    for line, row in rows:
        at = line
        cells = [cell.strip() for cell in row]
        if cells and cells[0] == _SECTION:
            break
        if cells and cells[0] in _OTHERS and not any(cells[1:]):
            others.append(cells[0])
    if not cells or cells[0] != _SECTION:
        raise fail(source.file, None, f"there is no section {_SECTION}; export the trajectories")
    header = [next(rows, (at + n, list[str]())) for n in range(1, 5)]
    (rate_line, rate), (_, names), (axes_line, axes), (unit_line, units) = header
    layout = _layout(source, names, axes, axes_line)
    samples = read_samples(_section(rows), layout, source, given.decimal)
    remarks = [f"not imported: section {name}" for name in others]
    if len(layout.names) > _FIXED + 3 * len(layout.labels):
        remarks.append("not imported: velocities and accelerations")
    raw = raw_of(layout, samples, first=1, remarks=remarks)
    raw.rates = [
        Stated(positive_of(rate[0] if rate else "", source.at(rate_line), "Hz", given.decimal), f"line {rate_line}")
    ]
    raw.unit = _unit(source, layout, [cell.strip() for cell in units], unit_line)
    return raw


def _section(rows: Iterator[Row]) -> Iterator[Row]:
    """Yield the rows up to the empty line that ends the section."""
    for line, cells in rows:
        if not any(cells):
            return
        yield line, cells


def _layout(source: Source, names: list[str], axes: list[str], line: int) -> Layout:
    axes = [cell.strip() for cell in axes]
    if axes[:_FIXED] != ["Frame", "Sub Frame"]:
        message = "must be Frame,Sub Frame,X,Y,Z,...; the header is cut off or was edited: export the file again"
        raise fail(source.at(line), ", ".join(axes[:_FIXED]), message)
    while axes and not axes[-1]:
        axes.pop()
    labels, columns, named = [], [], [*axes[:_FIXED]]
    label = ""
    for index in range(_FIXED, len(axes)):
        label = names[index].strip() if index < len(names) and names[index].strip() else label
        named.append(f"{label} {axes[index]}")
        if axes[index] == "X":
            if axes[index : index + 3] != ["X", "Y", "Z"]:
                message = "X, Y and Z of a marker must be side by side; export the file again"
                raise fail(source.at(line, index + 1), axes[index], message)
            if index >= len(names) or not names[index].strip():
                raise fail(
                    source.at(line - 1, index + 1), None, "the name above an X is missing; export the file again"
                )
            labels.append(label)
            columns.append((index, index + 1, index + 2))
        elif not _DERIVATIVE.fullmatch(axes[index]) and axes[index] not in ("Y", "Z"):
            message = f"is {axes[index][:40]!r}; a column must be X, Y, Z or a derivative, X': export the file again"
            raise fail(source.at(line, index + 1), axes[index], message)
    if not labels or 3 * len(labels) != sum(axis in ("X", "Y", "Z") for axis in axes):
        message = "there must be X, Y and Z of each marker; export the trajectories again"
        raise fail(source.at(line), ", ".join(axes), message)
    return Layout(labels, columns, named, frame=0)


def _unit(source: Source, layout: Layout, units: list[str], line: int) -> Stated[str] | None:
    """Return the unit of all positions; DatasetError if they have several."""
    found = {units[column] for place in layout.columns for column in place if column < len(units) and units[column]}
    if len(found) > 1:
        listed = ", ".join(sorted(found))
        raise fail(source.at(line), listed, f"the units {listed} differ; export all markers in the same unit")
    return Stated(found.pop(), f"line {line}") if found else None


READER = Reader("vicon", "Vicon Nexus CSV", recognises, read)
