"""Writers of C3D and HDF5. C3D is written by ezc3d, where it is installed, and by hand for what ezc3d does not write.

They share no code with the importers.
"""

from __future__ import annotations

import io
import struct
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from benchmarks.data_in.truth import Truth

INTEL, DEC, MIPS = 84, 85, 86


def have_ezc3d() -> bool:
    """Return whether ezc3d is installed."""
    try:
        import ezc3d  # noqa: F401
    except ImportError:
        return False
    return True


def by_ezc3d(truth: Truth, *, unit: str = "mm", scale: float = 1.0, analogue: bool = False) -> bytes:
    """Return a C3D file written by ezc3d; gaps have NaN, which it stores as residual -1."""
    import ezc3d

    file = ezc3d.c3d()
    points = np.full((4, len(truth.names), truth.frames), 1.0)
    points[:3] = (truth.mm * scale).transpose(2, 1, 0)
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    file["parameters"]["POINT"]["RATE"]["value"] = [truth.rate]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(truth.names)
    file["data"]["points"] = points
    if analogue:
        file["parameters"]["ANALOG"]["RATE"]["value"] = [4 * truth.rate]
        file["parameters"]["ANALOG"]["LABELS"]["value"] = ["Fx", "Fz"]
        file["data"]["analogs"] = np.random.default_rng(0).normal(size=(1, 2, 4 * truth.frames))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "wing.c3d"
        file.write(str(path))
        return path.read_bytes()


def by_hand(
    truth: Truth,
    *,
    processor: int = INTEL,
    integers: float = 0.0,
    unit: str = "mm",
    rate: float | None = None,
    first: int = 1,
    trial: bool = False,
) -> bytes:
    """Return a C3D file after its specification.

    ``processor``: Intel, DEC or MIPS; ``integers``: the scale (mm) of 16-bit integers, 0 for floats; ``first``: number
    of the first frame; ``trial``: counts of frames are in the group TRIAL, and those in the header overflow.
    """
    order = ">" if processor == MIPS else "<"
    rate = truth.rate if rate is None else rate
    scale = integers or -1.0

    def real(value: float) -> bytes:
        if processor != DEC:
            return struct.pack(order + "f", value)
        raw = struct.pack("<f", value * 4)
        return raw[2:] + raw[:2]

    def parameter(group: int, name: str, kind: int, shape: list[int], data: bytes) -> bytes:
        body = struct.pack("bB", kind, len(shape)) + bytes(shape) + data + b"\0"
        return struct.pack("bb", len(name), group) + name.encode() + struct.pack(order + "H", len(body) + 2) + body

    def group(number: int, name: str) -> bytes:
        return struct.pack("bb", len(name), -number) + name.encode() + struct.pack(order + "H", 3) + b"\0"

    def words(*values: int) -> bytes:
        return struct.pack(f"{order}{len(values)}H", *values)

    count, frames = len(truth.names), truth.frames
    width = max(len(name) for name in truth.names)
    section = group(1, "POINT") + parameter(1, "USED", 2, [], words(count))
    section += parameter(1, "SCALE", 4, [], real(scale)) + parameter(1, "RATE", 4, [], real(rate))
    section += parameter(1, "LABELS", -1, [width, count], "".join(n.ljust(width) for n in truth.names).encode())
    if unit:
        section += parameter(1, "UNITS", -1, [len(unit)], unit.encode())
    section += parameter(1, "Y_SCREEN", -1, [2], b"+Z")
    if trial:
        section += group(2, "TRIAL") + parameter(2, "ACTUAL_START_FIELD", 2, [2], words(first % 65536, first // 65536))
        last = first + frames - 1
        section += parameter(2, "ACTUAL_END_FIELD", 2, [2], words(last % 65536, last // 65536))
    blocks = -(-(len(section) + 6) // 512)
    section = bytes([1, 80, blocks, processor]) + section + b"\0\0"
    header = bytes([2, 80]) + words(count, 0, min(first, 65535), min(first + frames - 1, 65535), 0)
    header += real(scale) + words(2 + blocks, 0) + real(rate)
    return header.ljust(512, b"\0") + section.ljust(512 * blocks, b"\0") + _points(truth, processor, integers, order)


def _points(truth: Truth, processor: int, integers: float, order: str) -> bytes:
    missing = np.isnan(truth.mm).any(axis=2, keepdims=True)
    four = np.concatenate([np.where(missing, 0.0, truth.mm), np.where(missing, -1.0, 0.0)], axis=2)
    if integers:
        four[..., :3] /= integers
        data = np.round(four).astype(order + "i2").tobytes()
    elif processor == DEC:
        halves = (four * 4).astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1]
        data = np.ascontiguousarray(halves).tobytes()
    else:
        data = four.astype(order + "f4").tobytes()
    return data + b"\0" * (-len(data) % 512)


def sleap(truth: Truth, *, form: str = "analysis", coordinates: int = 3, packed: bool = True) -> bytes:
    """Return HDF5 of SLEAP: an "analysis" file (tracks, coordinates, nodes, frames) or a "triangulated" one."""
    buffer = io.BytesIO()
    values = truth.mm[..., :coordinates]
    options: dict[str, Any] = {"compression": "gzip", "chunks": True} if packed else {}
    with h5py.File(buffer, "w") as file:
        if form == "analysis":
            file.create_dataset("tracks", data=values.transpose(2, 1, 0)[None], **options)
            file.create_dataset("node_names", data=[name.encode() for name in truth.names])
            file.create_dataset("track_names", data=[b"bird"])
            file.create_dataset("track_occupancy", data=np.ones((truth.frames, 1), dtype=np.uint8))
            file.create_dataset("point_scores", data=np.ones((1, len(truth.names), truth.frames)))
        else:
            file.create_dataset("tracks", data=values[:, None], **options)
    return buffer.getvalue()
