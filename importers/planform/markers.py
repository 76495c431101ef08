"""Markers of a described wing: a grid over the planform, or a table of names and places in the file's coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from wingfit.importers.numbers import number_of
from wingfit.importers.options import UNITS, unit_of
from wingfit.importers.planform.options import OutlineOptions
from wingfit.importers.planform.placement import Placement
from wingfit.importers.planform.stations import Sections
from wingfit.importers.source import Source, open_source, separator_of
from wingfit.records.errors import Faults, check_most, fail
from wingfit.records.limits import MAX_MARKERS, MIB

_MASSES = {"kg": 1.0, "g": 1e-3, "mg": 1e-6}
_MAX_BYTES = MIB


@dataclass(frozen=True)
class PlacedMarker:
    """A marker at rest: its place in the wing frame, m, and its mass, kg; None: not stated."""

    name: str
    x: float
    y: float
    z: float | None
    mass: float | None


def placed_markers(options: OutlineOptions, placement: Placement, sections: Sections) -> list[PlacedMarker]:
    """Return the markers that the options list; DatasetError for a table that cannot be read."""
    z = None if options.marker_z_mm is None else options.marker_z_mm * 1e-3
    mass = None if options.marker_mass_g is None else options.marker_mass_g * 1e-3
    if options.marker_grid:
        return _grid(options.marker_grid, sections, z, mass)
    if options.marker_file is None:
        return []
    return _listed(Path(options.marker_file), options, placement, z, mass)


def _grid(counts: tuple[int, int], sections: Sections, z: float | None, mass: float | None) -> list[PlacedMarker]:
    """Return markers in the middles of equal parts of the span, and there of equal parts of the chord."""
    along, across = counts
    markers = []
    for i, j in product(range(along), range(across)):
        y = sections.y[0] + (i + 0.5) / along * (sections.y[-1] - sections.y[0])
        leading, trailing = (float(np.interp(y, sections.y, edge)) for edge in (sections.leading, sections.trailing))
        x = leading + (j + 0.5) / across * (trailing - leading)
        at_x, at_y = (round(float(v), sections.decimals) for v in (x, y))
        markers.append(PlacedMarker(f"s{i + 1}c{j + 1}", at_x, at_y, z, mass))
    return markers


def _listed(
    path: Path, options: OutlineOptions, placement: Placement, z: float | None, mass: float | None
) -> list[PlacedMarker]:
    try:
        check_most(path.name, "has", path.stat().st_size / MIB, _MAX_BYTES / MIB, "MiB", "list the markers alone")
        source = open_source(path.read_bytes(), path.name)
    except OSError as error:
        raise fail("--markers", str(path), f"{path} cannot be read: {error.strerror}; check the path") from None
    separator = separator_of(source.head[0]) if source.head else ","
    columns, units = _columns(source, source.cells(1, separator))
    markers, faults = list[PlacedMarker](), Faults()
    for line, cells in source.rows(separator, 2):
        if not any(cell.strip() for cell in cells):
            continue
        values = {}
        for key, index in columns.items():
            text = cells[index].strip() if index < len(cells) else ""
            try:
                values[key] = number_of(text, options.decimal) if key != "name" else 0.0
                if values[key] != values[key] or (key == "name" and not text):
                    raise ValueError("is empty; every marker needs it")
            except ValueError as error:
                faults.add(source.at(line, key), text, str(error))
                values[key] = 0.0
        x, y = placement.apply(np.array([[values["x"], values["y"]]]))[0]
        own_z = values["z"] * units["z"] if "z" in columns else z
        own_mass = values["mass"] * units["mass"] if "mass" in columns else mass
        name = cells[columns["name"]].strip() if columns["name"] < len(cells) else ""
        markers.append(PlacedMarker(name, round(float(x), 7), round(float(y), 7), own_z, own_mass))
        check_most(path.name, "has at least", len(markers), MAX_MARKERS, "markers", "list fewer")
    faults.raise_any()
    if not markers:
        raise fail(path.name, 0, "lists no markers; write a line name,x,y for each")
    return markers


def _columns(source: Source, header: list[str]) -> tuple[dict[str, int], dict[str, float]]:
    """Return the columns name, x, y, and z and mass where there are any, with the factor of the latter to SI."""
    columns, units = dict[str, int](), dict[str, float]()
    for index, cell in enumerate(header):
        key, _, unit = cell.lower().partition("_")
        if key in ("name", "marker") and not unit:
            columns["name"] = index
        elif key in ("x", "y") and not unit:
            columns[key] = index
        elif key == "z" and unit_of(unit) in UNITS:
            numerator, denominator = UNITS[unit_of(unit) or "m"]
            columns["z"], units["z"] = index, numerator / denominator
        elif key == "mass" and unit in _MASSES:
            columns["mass"], units["mass"] = index, _MASSES[unit]
        else:
            message = f"has the column {cell!r}; markers have name,x,y (as in the outline), z_mm and mass_g (optional)"
            raise fail(source.at(1, index + 1), cell, message)
    if not {"name", "x", "y"} <= set(columns):
        raise fail(source.at(1), None, "needs the columns name,x,y; x and y in the coordinates of the outline")
    return columns, units
