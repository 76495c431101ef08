"""Read calibrated cameras from a file of any known format, which its content shows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from wingfit.cameras.files.anipose import read_anipose
from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.dlt import DltOrigin, read_dlt
from wingfit.cameras.files.opencv import read_opencv
from wingfit.cameras.files.project import FORMAT, read_project
from wingfit.records.errors import check_most, fail
from wingfit.records.limits import MAX_DESCRIPTION_BYTES, MIB

CameraFormat = Literal["wingfit", "opencv", "anipose", "dlt"]
LengthUnit = Literal["m", "cm", "mm"]
METRES: dict[LengthUnit, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001}
HEAD = 4096  # bytes that show the format
_OPENCV = re.compile(rb"\s*(?:%YAML[ :]1\.|(?:<\?xml[^>]*>\s*)?<opencv_storage>)")
_PROJECT = re.compile(rb"^format:\s*['\"]?" + FORMAT.encode(), re.MULTILINE)
_TOML_TABLE = re.compile(rb"^\s*\[[^\[\],]+\]\s*(?:#.*)?$", re.MULTILINE)
_NUMBER_ROW = re.compile(rb"\s*[-+.0-9][-+.,0-9eE \t]*\r?(?:\n|$)")


def read_cameras(
    path: Path,
    *,
    length_unit: LengthUnit | None = None,
    sizes_px: Sequence[tuple[int, int]] = (),
    dlt_origin: DltOrigin | None = None,
    extrinsics: Path | None = None,
) -> CameraSet:
    """Return the cameras in the file ``path``.

    Args:
        path: ``cameras.yaml`` of wingfit; OpenCV's YAML or XML; ``calibration.toml`` of Anipose; or a table of DLT
            coefficients of DLTdv, easyWand or Argus.
        length_unit: unit of places in files that do not state it: all but that of wingfit.
        sizes_px: width and height of the images of each camera, or of all, for DLT coefficients and for OpenCV's files
            that do not state it.
        dlt_origin: how the pixels of DLT coefficients are counted (see :mod:`wingfit.cameras.files.dlt`).
        extrinsics: second file of an OpenCV stereo calibration.

    Raises:
        DatasetError: for a file of none of these formats, one that is not valid, and options that it needs.
    """
    raw = _read(path)
    metres = None if length_unit is None else METRES[length_unit]
    file = path.name
    match recognise(raw, file):
        case "wingfit":
            return read_project(raw, file)
        case "opencv":
            size = sizes_px[0] if sizes_px else None
            second = None if extrinsics is None else _read(extrinsics)
            return read_opencv(raw, file, metres=metres, size_px=size, extrinsics=second)
        case "anipose":
            return read_anipose(raw, file, metres)
        case "dlt":
            if metres is None or not sizes_px or dlt_origin is None:
                raise fail(file, None, _needs(metres, sizes_px, dlt_origin))
            return read_dlt(raw, file, sizes_px, dlt_origin, metres)


def recognise(raw: bytes, file: str) -> CameraFormat:
    """Return the format of the contents ``raw`` of ``file``; DatasetError if it is none that is known."""
    head = raw[:HEAD].removeprefix(b"\xef\xbb\xbf")
    if _OPENCV.match(head):
        return "opencv"
    if _PROJECT.search(head):
        return "wingfit"
    if _TOML_TABLE.search(head):
        return "anipose"
    if _NUMBER_ROW.match(head):
        return "dlt"
    message = (
        f"this is none of the known files of cameras: {FORMAT} (cameras.yaml), OpenCV (.yml, .xml), Anipose "
        "(calibration.toml), DLT coefficients (.csv with 11 rows)"
    )
    raise fail(file, head[:16].decode("latin-1"), message)


def _needs(metres: float | None, sizes: Sequence[tuple[int, int]], origin: DltOrigin | None) -> str:
    missing = []
    if metres is None:
        missing.append("the unit of length (m, cm or mm)")
    if not sizes:
        missing.append("the size of the images (px)")
    if origin is None:
        missing.append("the origin of pixels: lower-left (DLTdv to version 7, Argus) or upper-left (DLTdv 8)")
    return f"DLT coefficients do not contain {', nor '.join(missing)}; state it"


def _read(path: Path) -> bytes:
    try:
        size = path.stat().st_size
        check_most(str(path), "is", size / MIB, MAX_DESCRIPTION_BYTES / MIB, "MiB", "give a file of cameras")
        return path.read_bytes()
    except OSError as error:
        raise fail(str(path), None, f"cannot be read: {error.strerror}; check the path") from None
