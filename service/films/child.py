"""What the processes that read videos have in common.

FFmpeg decodes what strangers upload: a damaged or malicious file may crash it, make it loop, or take gigabytes. Only a
process of its own ends then.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Sequence
from pathlib import Path

from wingfit.records.errors import DatasetError, Fault
from wingfit.records.files.confined import ENVIRONMENT

NICENESS = 5
VIDEOS = "videos"  # name of the folder with the videos of a film
LENGTHS = struct.Struct("!II")  # of the JSON and of the bytes of an answer about a video
FAULTS = 3  # exit status: the input has faults, which standard output lists
OF_LIBRARIES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_CACHE_DIR",
    # These decide how sums are rounded, and tracks are those of 'wingfit track' bit for bit.
    "OPENBLAS_CORETYPE",
    "OPENBLAS_L2_SIZE",
)


def command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs ``module`` as a process."""
    return [sys.executable, "-P", "-m", module, *arguments]


def environment() -> dict[str, str]:
    """Return the necessary part of the server's environment, which may contain secrets."""
    return {name: os.environ[name] for name in (*ENVIRONMENT, *OF_LIBRARIES) if name in os.environ} | {
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        # A video is one file: no other program opens it, and it refers to no other file or address.
        "OPENCV_VIDEOIO_PRIORITY_LIST": "FFMPEG",
        "OPENCV_FFMPEG_CAPTURE_OPTIONS": "protocol_whitelist;file",
        "OPENCV_LOG_LEVEL": "OFF",
        "OPENCV_FFMPEG_LOGLEVEL": "-8",
    }


def listed(error: DatasetError) -> list[list[str | None]]:
    """Return the faults of ``error`` as JSON, without paths of the server, which mean nothing to its users."""
    return [[_place(fault.where), fault.value, fault.message] for fault in error.errors]


def _place(where: str | None) -> str:
    path = Path(where or "")
    return f"video of camera {path.name.split('.')[0]}" if path.parent.name == VIDEOS else str(where)


def error_of(faults: Sequence[Sequence[object]]) -> DatasetError:
    """Return the error with the ``faults`` that a process listed; not trusted, converted to text."""
    return DatasetError(
        [Fault(str(where), None if value is None else str(value), str(text)) for where, value, text in faults]
    )
