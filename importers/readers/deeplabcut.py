"""CSV of DeepLabCut.

The first rows are levels of the header: scorer, (individuals,) bodyparts, coords. The first column is the number of the
frame, from 0. Tracks of one camera have x, y, likelihood in pixels and are refused; a triangulated file has x, y, z.
There is no unit (it is that of the calibration) and no rate.
"""

from __future__ import annotations

from wingfit.importers.numbers import Layout, read_samples
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader, raw_of
from wingfit.importers.source import Source, separator_of
from wingfit.records.errors import Faults, fail

_LEVELS = ("scorer", "individuals", "bodyparts", "coords")
TRIANGULATE = "triangulate first, with two or more calibrated cameras, and import the 3-D file"


def recognises(source: Source) -> bool:
    """Return whether the first cells of the first rows are the levels of the header."""
    first = [(source.cells(line) or [""])[0] for line in range(1, 5)]
    return "bodyparts" in first and "coords" in first


def read(source: Source, given: Given) -> Raw:
    """Return the 3-D tracks of a DeepLabCut file; DatasetError names line and remedy."""
    separator = separator_of(source.head[0]) if source.head else ","
    levels = dict[str, list[str]]()
    for line in range(1, 5):
        cells = source.cells(line, separator)
        if not cells or cells[0] not in _LEVELS:
            break
        levels[cells[0]] = cells[1:]
    if "bodyparts" not in levels or "coords" not in levels:
        raise fail(source.file, ", ".join(levels), "the rows bodyparts and coords are missing; export the file again")
    parts, coordinates = levels["bodyparts"], levels["coords"]
    if "z" not in coordinates:
        message = f"the tracks are those of one camera, in pixels (x, y); {TRIANGULATE}"
        raise fail(source.at(len(levels)), ", ".join(sorted(set(coordinates))), message)
    owners = levels.get("individuals", [""] * len(parts))
    if not len(parts) == len(coordinates) == len(owners):
        message = f"has {len(coordinates)} cells and the row of body parts {len(parts)}; export the file again"
        raise fail(source.at(len(levels)), len(coordinates), message)
    layout = _layout(source, owners, parts, coordinates, len(levels))
    samples = read_samples(source.rows(separator, len(levels) + 1), layout, source, given.decimal)
    hint = "positions are in the unit of the calibration"
    return raw_of(layout, samples, unit_hint=hint, rate_hint="the first column counts the frames of the video")


def _layout(source: Source, owners: list[str], parts: list[str], coordinates: list[str], line: int) -> Layout:
    places, faults = dict[str, dict[str, int]](), Faults()
    several = len({owner for owner in owners if owner != "single"}) > 1
    for index, (owner, part, coordinate) in enumerate(zip(owners, parts, coordinates, strict=True), 1):
        label = f"{owner}_{part}" if several else part
        found = places.setdefault(label, {})
        if coordinate in found:
            faults.add(source.at(line, index + 1), label, f"{coordinate} of {label!r} appears twice; rename one")
        found[coordinate] = index
    for label, found in places.items():
        missing = [axis for axis in "xyz" if axis not in found]
        if missing and not faults.full:
            faults.add(source.at(line), label, f"{label!r} has no {', '.join(missing)}; export the file again")
    faults.raise_any()
    columns = [(found["x"], found["y"], found["z"]) for found in places.values()]
    names = ["frame", *(f"{part} {axis}" for part, axis in zip(parts, coordinates, strict=True))]
    return Layout([*places], columns, names, frame=0)


READER = Reader("deeplabcut", "DeepLabCut CSV", recognises, read)
