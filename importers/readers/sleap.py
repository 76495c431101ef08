"""HDF5 of SLEAP: analysis files (``*.analysis.h5``) and triangulated poses (``points3d.h5`` of sleap-anipose).

Both have a variable ``tracks``. An analysis file has it as (tracks, coordinates, nodes, frames), with ``node_names``
and ``track_names``; two coordinates are pixels of one camera and are refused. A triangulated file has it as (frames,
tracks, nodes, 3). There is no unit (it is that of the calibration board) and no rate.

HDF5 is read in a separate process (:mod:`wingfit.importers.readers.sleap_process`).
"""

from __future__ import annotations

import io
import json

import numpy as np

from wingfit.importers.limits import MAX_TRACK_VALUES
from wingfit.importers.numbers import WORD
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw, Reader
from wingfit.importers.source import Source
from wingfit.records.errors import check_most, fail
from wingfit.records.files.confined import Limits, ReaderError, read_confined
from wingfit.records.limits import MAX_MARKERS, MAX_ROWS, MIB

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_DAMAGED = "the file may be damaged: export it again"
_LIMITS = Limits(
    values=MAX_TRACK_VALUES,
    memory_mib=512,
    processor_s=15,
    wall_s=60,
    output_mib=16 + MAX_TRACK_VALUES * 8 // MIB,
)


def recognises(source: Source) -> bool:
    """Return whether the file is HDF5, at one of the places where its signature may be."""
    return any(source.raw[at : at + len(SIGNATURE)] == SIGNATURE for at in (0, 512, 1024, 2048))


def read(source: Source, given: Given) -> Raw:
    """Return the 3-D tracks of a SLEAP file; DatasetError says what is wrong with it."""
    del given
    try:
        answer = read_confined("wingfit.importers.readers.sleap_process", source.raw, source.file, _LIMITS, _DAMAGED)
    except ReaderError as error:
        raise fail(source.file, None, f"cannot be read here: {error}") from None
    try:
        header, _, body = answer.partition(b"\n")
        labels = [str(label) for label in json.loads(header)]
        positions = np.load(io.BytesIO(body), allow_pickle=False)
    except (ValueError, TypeError, EOFError) as error:
        raise fail(source.file, None, f"the process that reads it gave no tracks ({error}); {_DAMAGED}") from None
    if positions.dtype != np.float64 or positions.ndim != 3 or positions.shape[1:] != (len(labels), 3):
        raise fail(source.file, None, f"the process that reads it gave no tracks; {_DAMAGED}")
    positions[np.isnan(positions)] = WORD
    check_most(source.file, "has", len(labels), MAX_MARKERS, "nodes of all tracks", "export fewer tracks")
    check_most(source.file, "has", len(positions), MAX_ROWS, "frames", "cut the recording in parts")
    return Raw(
        labels,
        positions,
        np.arange(1, len(positions) + 1),
        "frame",
        unit_hint="positions are in the unit of the calibration board",
        rate_hint="each frame is one of the video",
    )


READER = Reader("sleap", "SLEAP HDF5", recognises, read)
