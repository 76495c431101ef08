"""Cameras from the file calibration.toml of Anipose (Karashchuk et al. 2021): one table for each camera."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.files.camera_set import CameraSet, check_cameras, rotation_of
from wingfit.cameras.files.opencv import checked_matrix, lens_of
from wingfit.records.array_types import Array
from wingfit.records.errors import decode, fail, shown

MOST = 1e300  # of a number
KEYS = ("name", "size", "matrix", "distortions", "rotation", "translation")


def read_anipose(raw: bytes, file: str, metres: float | None) -> CameraSet:
    """Return the cameras in the contents ``raw`` of ``file``; ``metres`` is the unit of its translations (m).

    The unit is that of the squares of the board, often millimetres; the file does not state it.
    """
    try:
        data = tomllib.loads(decode(raw, file))
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise fail(file, None, f"not valid TOML: {error}; write the file again") from None
    tables = {key: value for key, value in data.items() if key != "metadata"}
    if not tables:
        raise fail(file, None, "no camera is in the file; give the calibration.toml that Anipose wrote")
    if metres is None:
        raise fail(
            file, None, "the unit of translations is not in the file; state the unit of the squares of the board"
        )
    cameras = tuple(_camera(table, f"{file}: {key}", metres) for key, table in tables.items())
    return check_cameras(file, CameraSet(cameras))


def _camera(table: Any, where: str, metres: float) -> Camera:
    if not isinstance(table, dict):
        raise fail(
            where, table, f"{shown(table)} is no table of a camera; give the calibration.toml that Anipose wrote"
        )
    for key in KEYS:
        if key not in table:
            raise fail(
                f"{where}.{key}", None, f"the key {key!r} is missing; give the calibration.toml that Anipose wrote"
            )
    if not isinstance(table["name"], str):
        raise fail(f"{where}.name", table["name"], f"{shown(table['name'])} is no text; put the name in quotes")
    size = _numbers(table["size"], f"{where}.size", 2)
    if (size != np.floor(size)).any():
        raise fail(f"{where}.size", size[0], "sizes are whole numbers of pixels: width, height")
    matrix = np.stack([_numbers(row, f"{where}.matrix", 3) for row in _list(table["matrix"], f"{where}.matrix", 3)])
    coefficients = _numbers(table["distortions"], f"{where}.distortions", None)
    rotation = rotation_of(_numbers(table["rotation"], f"{where}.rotation", 3), f"{where}.rotation")
    fisheye = table.get("fisheye", False)
    if not isinstance(fisheye, bool):
        raise fail(f"{where}.fisheye", fisheye, f"{shown(fisheye)} is neither true nor false; state one of them")
    return Camera(
        table["name"],
        (int(size[0]), int(size[1])),
        checked_matrix(matrix, f"{where}.matrix"),
        lens_of(coefficients, f"{where}.distortions", fisheye),
        rotation,
        _numbers(table["translation"], f"{where}.translation", 3) * metres,
    )


def _list(data: Any, where: str, count: int | None) -> list[Any]:
    if not isinstance(data, list) or (count is not None and len(data) != count):
        raise fail(where, data, f"{shown(data)} is no list of {count or 'numbers'}; write the file again")
    return data


def _numbers(data: Any, where: str, count: int | None) -> Array:
    values = _list(data, where, count)
    if not all(
        isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < MOST for value in values
    ):
        raise fail(where, data, "not all of these are finite numbers; write the file again")
    return np.array(values, dtype=float)
