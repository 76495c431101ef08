"""The process that reads HDF5 files of SLEAP: ``python -m wingfit.importers.readers.sleap_process JSON``.

It reads the file from standard input and writes a line of JSON (names of the markers), then the positions [T, M, 3] as
a ``.npy`` file. :mod:`wingfit.records.files.confined` starts it and limits its memory and time.
"""

from __future__ import annotations

import io
import json
import math
import sys
from typing import Any, BinaryIO

import h5py
import numpy as np

from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError, check_most, fail, shown
from wingfit.records.files.confined import Convert, Limits, confine
from wingfit.records.limits import MAX_CHUNK_BYTES, MAX_MARKERS, MAX_NAME_BYTES, MIB

# Filters that come with h5py; others are code that this process must not load.
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32, h5py.h5z.FILTER_LZF}
_BROKEN = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, IndexError, OverflowError)
_FLAT = (
    "the tracks are those of one camera, in pixels (2 coordinates); triangulate first, with two or more calibrated "
    "cameras (sleap-anipose or Anipose), and import the 3-D file"
)


def convert(source: BinaryIO, output: BinaryIO, label: str, limits: Limits) -> None:
    """Write names and positions of the SLEAP file ``source`` to ``output``; DatasetError says what is wrong."""
    try:
        with h5py.File(io.BytesIO(source.read()), "r") as file:
            labels, positions = _tracks(file, label, limits)
    except DatasetError:
        raise
    except _BROKEN as error:
        cause = shown(" ".join(str(error).split()))
        raise fail(label, None, f"not a readable HDF5 file: {cause}; it may be cut off: export it again") from None
    output.write(json.dumps(labels).encode() + b"\n")
    np.save(output, positions, allow_pickle=False)


def _tracks(file: Any, label: str, limits: Limits) -> tuple[list[str], Array]:
    if "tracks" not in file:
        members = ", ".join(sorted(str(name)[:40] for name in file)[:8]) or "nothing"
        message = (
            f"is HDF5 without a variable 'tracks' (it has {members}); of a SLEAP project export the analysis file, and "
            "from DeepLabCut, Anipose and DLTdv export CSV"
        )
        raise fail(label, members, message)
    tracks = _variable(file, "tracks", label)
    if tracks.ndim != 4 or tracks.dtype.kind != "f" or tracks.dtype.itemsize > 8:
        message = f"tracks is {tracks.dtype} of shape {list(tracks.shape)}; it must be real numbers of 4 dimensions"
        raise fail(label, list(tracks.shape), f"{message}: export the analysis file again")
    check_most(label, "tracks has", tracks.size, limits.values, "numbers", "cut the recording in parts")
    nodes = _names(file, "node_names", label)
    order = _order(tracks.shape, len(nodes) if nodes else None, label)
    positions = np.transpose(np.asarray(tracks[()], dtype=np.float64), order)
    frames, owners, points, _ = positions.shape
    check_most(label, "has", owners * points, MAX_MARKERS, "nodes of all tracks", "export fewer tracks")
    labels = _labels(nodes, _names(file, "track_names", label), owners, points)
    return labels, np.ascontiguousarray(positions.reshape(frames, owners * points, 3))


def _order(shape: tuple[int, ...], nodes: int | None, label: str) -> tuple[int, int, int, int]:
    """Return the order of dimensions that makes ``shape`` (frames, tracks, nodes, 3)."""
    analysis = shape[1] in (2, 3) and (nodes is None or shape[2] == nodes)
    triangulated = shape[3] in (2, 3) and (nodes is None or shape[2] == nodes)
    if analysis and triangulated and shape[1] == shape[3]:
        message = f"tracks has the shape {list(shape)}, of which two dimensions could be the coordinates"
        raise fail(label, list(shape), f"{message}; export more than three frames")
    # Names of tracks and nodes are stored with analysis files only.
    if analysis and (nodes is not None or not triangulated):
        coordinates, order = shape[1], (3, 0, 2, 1)
    elif triangulated:
        coordinates, order = shape[3], (0, 1, 2, 3)
    else:
        message = (
            f"tracks has the shape {list(shape)}; it must be (tracks, 3, nodes, frames) or (frames, tracks, nodes, 3)"
        )
        raise fail(label, list(shape), f"{message}: export the file again")
    if coordinates == 2:
        raise fail(f"{label}, tracks", list(shape), _FLAT)
    return order


def _labels(nodes: list[str], owners: list[str], tracks: int, points: int) -> list[str]:
    """Return a name for each node of each track; numbers where the file has no names."""
    names = nodes if len(nodes) == points else [f"node{k + 1}" for k in range(points)]
    if tracks == 1:
        return list(names)
    whose = owners if len(owners) == tracks else [f"track{k + 1}" for k in range(tracks)]
    return [f"{owner}_{name}" for owner in whose for name in names]


def _variable(file: Any, name: str, label: str) -> Any:
    """Return the variable ``name``; DatasetError if it is a link, has data in other files, or too large chunks."""
    if not isinstance(file.get(name, getlink=True), h5py.HardLink) or not isinstance(file[name], h5py.Dataset):
        raise fail(label, name, f"{name!r} is no variable in this file; export the file again")
    variable = file[name]
    if variable.is_virtual or variable.external or variable.shape is None:
        raise fail(label, name, f"{name!r} stores its data in other files; export the file again")
    chunk = math.prod(variable.chunks or ()) * variable.dtype.itemsize / MIB
    check_most(label, f"a chunk of {name} takes", chunk, MAX_CHUNK_BYTES / MIB, "MiB", "write smaller chunks")
    pipeline = variable.id.get_create_plist()
    filters = [pipeline.get_filter(index)[0] for index in range(pipeline.get_nfilters())]
    if set(filters) - _FILTERS or len(set(filters)) < len(filters):
        raise fail(label, str(filters), f"{name} is packed by the HDF5 filters {filters}; pack it by gzip alone")
    return variable


def _names(file: Any, name: str, label: str) -> list[str]:
    """Return the texts of the variable ``name``; none if it does not exist."""
    if name not in file:
        return []
    variable = _variable(file, name, label)
    check_most(label, f"{name} has", variable.size, MAX_MARKERS, "entries", "export fewer")
    check_most(label, f"each of {name} takes", variable.dtype.itemsize, MAX_NAME_BYTES, "bytes", "shorten the names")
    values = np.atleast_1d(variable[()]).reshape(-1)
    return [value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value) for value in values]


def _prepare() -> Convert:
    return convert


if __name__ == "__main__":
    confine(sys.argv[1:], _prepare, "cut the recording in parts")
