"""The internal storage format of a dataset, to which an uploaded NetCDF file is converted once.

It is a zip that the service writes for its own use and does not accept as an upload: ``dataset.yaml`` byte for byte;
``layout.json`` with the number of instants of each recording and its markers, axes of force, or quantities of a series;
``recordings/<name>.f8`` with its times [T], then its values [T, C], as little-endian 64-bit numbers. Reading restores
the same dataset, bit for bit.
"""

from __future__ import annotations

import io
import json
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from typing import IO, Any

import numpy as np

from wingfit.records.array_types import Array
from wingfit.records.dataset import AnyDataset
from wingfit.records.description.yaml_text import read_yaml
from wingfit.records.errors import DatasetError, fail
from wingfit.records.files.assemble import assemble
from wingfit.records.files.folder import DESCRIPTION, RECORDINGS
from wingfit.records.files.table import Samples, too_much
from wingfit.records.limits import MAX_DESCRIPTION_BYTES, MAX_RECORDINGS

LAYOUT = "layout.json"
NUMBER = "<f8"
# Measured numbers end in noise: a higher level takes many times as long and saves a few percent.
DEFLATE_LEVEL = 1
BLOCK = 2**17  # numbers that are packed at a time
# End record of a zip below 2 GiB without a comment; in a larger one a locator of 20 bytes precedes it.
_END, _END_OF_LARGE = struct.Struct("<4s4H2LH"), b"PK\6\7"
LONGEST_ENTRY = 1024  # bytes of an entry in the directory: its name, and 46
_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Parsed:
    """Contents of a dataset's file: the text of ``dataset.yaml``, and the samples of each recording by its name."""

    description: bytes
    samples: Mapping[str, Samples]


def pack(parsed: Parsed, into: IO[bytes]) -> None:
    """Write ``parsed`` to ``into`` in the storage format, piece by piece; the same contents give the same bytes."""
    layout = {
        name: {"instants": len(one.times), "markers": one.markers, "forces": one.forces}
        | ({"quantities": one.quantities} if one.quantities else {})
        for name, one in parsed.samples.items()
    }
    with zipfile.ZipFile(into, "w", zipfile.ZIP_DEFLATED, compresslevel=DEFLATE_LEVEL) as archive:
        for name, text in ((DESCRIPTION, parsed.description), (LAYOUT, json.dumps(layout).encode())):
            with archive.open(_entry(name), "w") as stream:
                stream.write(text)
        for name, samples in parsed.samples.items():
            with archive.open(_entry(_numbers(name)), "w", force_zip64=True) as stream:
                for array in (samples.times, samples.values.reshape(-1)):
                    for start in range(0, len(array), BLOCK):
                        stream.write(array[start : start + BLOCK].astype(NUMBER, copy=False).data)


def load_parsed(data: bytes, label: str) -> AnyDataset:
    """Read the dataset that :func:`pack` wrote; ``label`` names it in messages. DatasetError if ``data`` is damaged."""
    try:
        _check_directory(data)
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return _dataset(archive, label)
    except DatasetError:
        raise
    except Exception as error:  # of any kind: the process that wrote it had read an untrusted file
        raise fail(label, None, f"its stored form is damaged ({error}); upload the file again") from None


def _check_directory(data: bytes) -> None:
    """Raise ValueError if the zip's list of entries, which zipfile reads into memory as a whole, is too large."""
    end = data[-_END.size :]
    if len(end) < _END.size or data[-_END.size - 20 :].startswith(_END_OF_LARGE):
        raise ValueError("it does not end as it was written")
    signature, _, _, _, entries, size, _, _ = _END.unpack(end)
    if signature != b"PK\5\6" or entries > MAX_RECORDINGS + 2 or size > entries * LONGEST_ENTRY:
        raise ValueError(f"it lists {entries} entries over {size} bytes; at most {MAX_RECORDINGS + 2} were written")


def _dataset(archive: zipfile.ZipFile, label: str) -> AnyDataset:
    if any(entry.compress_type != zipfile.ZIP_DEFLATED or entry.flag_bits & 1 for entry in archive.infolist()):
        raise ValueError("an entry is not deflated, or is encrypted")
    document = read_yaml(_text(archive, DESCRIPTION), f"{label}: {DESCRIPTION}")
    layout = json.loads(_text(archive, LAYOUT))

    def read(name: str, room: int) -> Samples:
        return _samples(archive, name, layout[name], room)

    return assemble(document, read, lambda name: f"{label}: {name}", lambda name, _, row: f"{label}: {name}, {row}")


def _text(archive: zipfile.ZipFile, name: str) -> bytes:
    """Return the contents of the entry ``name``; ValueError if larger than ``MAX_DESCRIPTION_BYTES``."""
    if archive.getinfo(name).file_size > MAX_DESCRIPTION_BYTES:
        raise ValueError(f"{name} is too large")
    return archive.read(name)


def _samples(archive: zipfile.ZipFile, name: str, layout: Mapping[str, Any], room: int) -> Samples:
    instants, markers, forces = int(layout["instants"]), tuple(layout["markers"]), tuple(layout["forces"])
    quantities = tuple(layout.get("quantities", ()))
    channels = 3 * len(markers) + len(forces) + len(quantities)
    if not 0 <= instants * (1 + channels) <= room:
        raise too_much(name)
    with archive.open(_numbers(name)) as stream:
        times, values = _array(stream, (instants,)), _array(stream, (instants, channels))
    return Samples(times, values, np.arange(instants), markers, forces, quantities)


def _array(stream: IO[bytes], shape: tuple[int, ...]) -> Array:
    """Read an array of this ``shape`` from ``stream``; writable, since numba treats read-only ones as another type."""
    array = np.empty(shape, dtype=NUMBER)
    rest = array.reshape(-1).view(np.uint8).data
    while rest:
        count = stream.readinto(rest)  # type: ignore[attr-defined]  # missing in the protocol
        if not count:
            raise EOFError("it ends early")
        rest = rest[count:]
    return array.astype(np.float64, copy=False)


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


def _numbers(name: str) -> str:
    return f"{RECORDINGS}/{name}.f8"
