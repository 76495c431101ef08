"""Pixels of the ends of a waved wand, in the table of wingfit or in that of DLTdv.

That of wingfit has one row for each camera and frame: ``camera,frame,x1_px,y1_px,x2_px,y2_px``, and the columns
``x3_px,y3_px`` for a wand with three markers; a marker that is not seen has empty cells. That of DLTdv (``*xypts.csv``)
has one row for each frame, and the columns ``pt1_cam1_X``, ``pt1_cam1_Y``, ``pt1_cam2_X``, ...; pixels count from 1.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from wingfit.cameras.files.dlt import DltOrigin
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail
from wingfit.records.files.number_table import Table, header_of, read_table, require
from wingfit.records.limits import MAX_ROWS

_DLTDV = re.compile(r"pt([0-9]+)_cam([0-9]+)_([XY])", re.IGNORECASE)


def camera_names(raw: bytes, file: str) -> tuple[str, ...]:
    """Return the names of the cameras of a table of wand points, in its order; those of DLTdv are cam1, cam2, ..."""
    matches = _dltdv_columns(raw, file)
    if matches:
        numbers = sorted({int(match[2]) for match in matches})
        return tuple(f"cam{number}" for number in numbers)
    return tuple(dict.fromkeys(read_table(raw, file, "camera").labels))


def read_wand_points(
    raw: bytes, file: str, markers: int, sizes_px: Sequence[tuple[int, int]], origin: DltOrigin | None = None
) -> dict[str, Float[Array, "T M 2"]]:
    """Return the pixels of the ``markers`` (2 or 3) of a wand, by camera; rows are frames, NaN is a marker not seen.

    Args:
        raw: the table.
        file: its name, for messages.
        markers: of the wand, in the order of its distances.
        sizes_px: width and height of the images of each camera, in the order of ``camera_names``.
        origin: how DLTdv counts pixels (see :mod:`wingfit.cameras.files.dlt`).

    Raises:
        DatasetError: names line, value and remedy.
    """
    matches = _dltdv_columns(raw, file)
    if matches:
        return _of_dltdv(raw, file, markers, sizes_px, origin)
    if origin not in (None, "opencv"):
        message = f"origin {origin!r} is for files of DLTdv; this table counts from the upper left pixel: leave it out"
        raise fail(file, origin, message)
    columns = [f"{axis}{marker}_px" for marker in range(1, markers + 1) for axis in "xy"]
    require(header_of(raw, file), ("camera", "frame", *columns), file)
    table = read_table(raw, file, "camera")
    known = {"frame", *columns}
    extra = [name for name in table.columns if name not in known]
    if extra:
        message = f"column {extra[0]!r} belongs to no marker of a wand with {markers}; give the distances of all"
        raise fail(f"{file}, line 1", extra[0], message)
    return _by_camera(table, np.stack([table.column(name) for name in columns], axis=1).reshape(-1, markers, 2))


def _by_camera(table: Table, pixels: Float[Array, "N M 2"]) -> dict[str, Float[Array, "T M 2"]]:
    frames = table.column("frame")
    wrong = np.flatnonzero(~((frames >= 0) & (frames < MAX_ROWS) & (frames == np.floor(frames))))
    if len(wrong):
        value = f"{frames[wrong[0]]:g}"
        message = f"frame {value} is no whole number from 0 to {MAX_ROWS - 1}; number the frames"
        raise fail(f"{table.file}, row {wrong[0] + 1}", value, message)
    found: dict[str, Array] = {}
    done = set[tuple[str, int]]()
    for row, (camera, frame) in enumerate(zip(table.labels, frames.astype(int), strict=True), 1):
        if (camera, int(frame)) in done:
            message = f"frame {frame} of camera {camera!r} appears twice; keep one row"
            raise fail(f"{table.file}, row {row}", str(frame), message)
        done.add((camera, int(frame)))
        if camera not in found:
            found[camera] = np.full((int(frames.max()) + 1, *pixels.shape[1:]), np.nan)
        found[camera][frame] = pixels[row - 1]
    return found


def _dltdv_columns(raw: bytes, file: str) -> list[re.Match[str]]:
    """Return the columns of DLTdv; an empty list for another table."""
    matches = [_DLTDV.fullmatch(name) for name in header_of(raw, file) if name]
    return [match for match in matches if match] if matches and all(matches) else []


def _of_dltdv(
    raw: bytes, file: str, markers: int, sizes_px: Sequence[tuple[int, int]], origin: DltOrigin | None
) -> dict[str, Float[Array, "T M 2"]]:
    if origin is None:
        message = "a table of DLTdv does not state where pixels count from"
        remedy = "give the origin: lower-left (DLTdv to version 7, Argus) or upper-left (DLTdv 8)"
        raise fail(file, None, f"{message}; {remedy}")
    table = read_table(raw, file)
    columns = {name.lower(): values for name, values in table.columns.items()}
    points = {int(match[1]) for match in _dltdv_columns(raw, file)}
    if points != set(range(1, markers + 1)):
        listed = ", ".join(f"pt{point}" for point in sorted(points)[:6])
        message = f"the points are {listed}; a wand with {markers} markers has pt1 to pt{markers} and no others"
        raise fail(f"{file}, line 1", listed, message)
    found: dict[str, Array] = {}
    for (_, height), camera in zip(sizes_px, camera_names(raw, file), strict=True):
        names = [f"pt{point}_{camera}_{axis}" for point in range(1, markers + 1) for axis in "xy"]
        require([*columns], names, file)
        pixels = np.stack([columns[name] for name in names], axis=1).reshape(-1, markers, 2)
        if origin == "lower-left":
            pixels = np.stack([pixels[..., 0] - 1, height - pixels[..., 1]], axis=2)
        elif origin == "upper-left":
            pixels = pixels - 1
        found[camera] = pixels
    return found
