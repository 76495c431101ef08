"""The file of calibrated cameras, ``cameras.yaml``: readable, in units that names state, and complete.

The covariance stands in the same file, so that one atomic replacement writes both.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.cameras.camera import COEFFICIENTS, Camera, Lens
from wingfit.cameras.files.camera_set import CameraSet, check_cameras, rotation_of
from wingfit.cameras.files.keys import mapping_at, value_at
from wingfit.records.array_types import Array
from wingfit.records.description.yaml_text import Document, read_yaml, write_yaml
from wingfit.records.errors import fail, nearest, shown
from wingfit.records.files.replace import replace_file

FORMAT, VERSION = "wingfit cameras", 1
KEYS = ("name", "size_px", "focal_px", "centre_px", "lens", "rotation_rad", "translation_m", "row_us")
COVARIANCE_KEYS = ("parameters", "lower_triangle")
HEADER = """# Calibrated cameras. Pixel (0, 0) is the centre of the upper left pixel; x to the right, y down.
# A point X (m) has the place R X + translation_m in the axes of a camera (x right, y down, z forward); rotation_rad is
# the rotation vector of R. Lens coefficients are those of OpenCV. The covariance is in the units px, 1, rad and m;
# turns and moves are those after the stated pose.
"""


def write_cameras(path: Path, found: CameraSet) -> None:
    """Write cameras, and their covariance if there is one, to ``path``, which is replaced atomically.

    DatasetError if a number is not valid, so that what is written can be read.
    """
    check_cameras(str(path), found)
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "cameras": [_described(one) for one in found.cameras]}
    if found.covariance is not None:
        rows = [found.covariance[i, : i + 1].tolist() for i in range(len(found.covariance))]
        data["covariance"] = {"parameters": list(found.parameters), "lower_triangle": rows}
    replace_file(path, (HEADER + write_yaml(_decimals(data))).encode())


def read_project(raw: bytes, file: str) -> CameraSet:
    """Return the cameras in the contents ``raw`` of ``file``; DatasetError names line, value and remedy."""
    document = read_yaml(raw, file)
    data = mapping_at(document, (), ("format", "version", "cameras"), ("covariance",))
    if data["format"] != FORMAT or data["version"] != VERSION:
        value = f"{data['format']} {data['version']}"
        message = f"{value!r} is not {FORMAT!r} version {VERSION}; write the file with this version of wingfit"
        raise fail(document.where(("version",)), value, message)
    entries = _list(document, ("cameras",), None)
    cameras = tuple(_camera(document, ("cameras", i)) for i in range(len(entries)))
    check_cameras(file, CameraSet(cameras))
    covariance = _covariance(document, cameras) if "covariance" in data else None
    return check_cameras(file, CameraSet(cameras, covariance))


def _described(camera: Camera) -> dict[str, Any]:
    names = COEFFICIENTS[camera.lens.model]
    return {
        "name": camera.name,
        "size_px": list(camera.size_px),
        "focal_px": np.diag(camera.matrix)[:2].tolist(),
        "centre_px": camera.matrix[:2, 2].tolist(),
        "lens": {"model": camera.lens.model, **dict(zip(names, camera.lens.coefficients, strict=True))},
        "rotation_rad": Rotation.from_matrix(camera.rotation).as_rotvec().tolist(),
        "translation_m": camera.translation.tolist(),
        "row_us": camera.row_s * 1e6,
    }


def _decimals(data: Any) -> Any:
    """Return ``data`` with floats as decimals of the same digits: the writer of YAML gives them an exact form."""
    if isinstance(data, dict):
        return {key: _decimals(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_decimals(value) for value in data]
    return Decimal(repr(data)) if isinstance(data, float) else data


def _camera(document: Document, path: tuple[str | int, ...]) -> Camera:
    data = mapping_at(document, path, KEYS)
    name = data["name"]
    if not isinstance(name, str):
        raise fail(document.where((*path, "name")), name, f"{shown(name)} is no text; put the name in quotes")
    focal, centre, rotation, translation = (
        _numbers(document, (*path, key), count)
        for key, count in (("focal_px", 2), ("centre_px", 2), ("rotation_rad", 3), ("translation_m", 3))
    )
    size = _numbers(document, (*path, "size_px"), 2)
    if (size != np.floor(size)).any():
        raise fail(document.where((*path, "size_px")), size[0], "sizes are whole numbers of pixels: width, height")
    matrix = np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1.0]])
    lens = _lens(document, (*path, "lens"))
    turned = rotation_of(rotation, document.where((*path, "rotation_rad")))
    row_us = _number(document, (*path, "row_us"))
    return Camera(name, (int(size[0]), int(size[1])), matrix, lens, turned, translation, row_us / 1e6)


def _lens(document: Document, path: tuple[str | int, ...]) -> Lens:
    data = value_at(document, path)
    model = data.get("model") if isinstance(data, dict) else None
    if model not in COEFFICIENTS:
        message = f"{shown(model)} is no model of a lens; {nearest(str(model), COEFFICIENTS)}"
        raise fail(document.where((*path, "model")), model, message)
    names = COEFFICIENTS[model]
    mapping_at(document, path, ("model", *names))
    return Lens(model, tuple(_number(document, (*path, name)) for name in names))


def _covariance(document: Document, cameras: tuple[Camera, ...]) -> Array:
    path = ("covariance",)
    mapping_at(document, path, COVARIANCE_KEYS)
    names = CameraSet(cameras).parameters
    stated = _list(document, (*path, "parameters"), len(names))
    for i, (one, name) in enumerate(zip(stated, names, strict=True)):
        if one != name:
            message = f"{shown(one)} stands where {name} is expected; write the file again"
            raise fail(document.where((*path, "parameters", i)), one, message)
    rows = _list(document, (*path, "lower_triangle"), len(names))
    covariance = np.zeros((len(names), len(names)))
    for i in range(len(rows)):
        covariance[i, : i + 1] = _numbers(document, (*path, "lower_triangle", i), i + 1)
    return covariance + np.tril(covariance, -1).T


def _list(document: Document, path: tuple[str | int, ...], count: int | None) -> list[Any]:
    data = value_at(document, path)
    if not isinstance(data, list) or (count is not None and len(data) != count):
        wanted = "a list" if count is None else f"a list of {count}"
        raise fail(document.where(path), data, f"{shown(data)} is not {wanted}; see docs/cameras.md")
    return data


def _numbers(document: Document, path: tuple[str | int, ...], count: int) -> Array:
    data = _list(document, path, count)
    return np.array([_number(document, (*path, i)) for i in range(len(data))])


def _number(document: Document, path: tuple[str | int, ...]) -> float:
    value = value_at(document, path)
    if not isinstance(value, Decimal) or not np.isfinite(float(value)):
        raise fail(document.where(path), value, f"{shown(value)} is no finite number; give a number")
    return float(value)
