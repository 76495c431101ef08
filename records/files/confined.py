"""Reads an untrusted NetCDF or other HDF5 file in a separate process, with limits of memory and time.

A damaged file can make the HDF5 library loop, crash or allocate gigabytes; then only the separate process ends. Each
file is read by a new process, so that a file cannot affect the next one. The process returns the dataset in the
internal storage format (:mod:`wingfit.records.files.parsed`), which the caller checks again.

``python -m wingfit.records.files.confined JSON`` (label and limits) reads the file from standard input and writes the
storage format to standard output. If the file has faults, it writes a list of them as JSON instead, and its exit
status is ``FAULTS``. Any other status than 0 means that the process failed: a status in ``DISK_FULL`` if there was no
room for the output, ``READ_FAILED`` or a signal for a failure while it read, and ``NOT_STARTED`` (the interpreter's
own status) for a failure before it read.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, BinaryIO, NoReturn

import numpy as np

from wingfit.records.errors import DatasetError, Fault, fail
from wingfit.records.limits import MAX_UPLOADED_NETCDF_VALUES, MAX_VALUES, MIB

NICENESS = 5  # requests that only read data have priority over uploads
FILES_OPEN = 64
FAULTS, READ_FAILED = 3, 4
NOT_STARTED = 1
# Error numbers, used as exit statuses, for a disk without room for the output.
DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
ENVIRONMENT = ("PATH", "LANG", "LC_ALL", "TMPDIR", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
MAX_FAULTS_BYTES, MAX_TRACE_BYTES = 64 * 2**10, 4000

MODULE = "wingfit.records.files.confined"
UPLOAD = "the file may be damaged: write it again, or upload a zip"
LOG = logging.getLogger("wingfit")


Convert = Callable[[BinaryIO, BinaryIO, str, "Limits"], None]  # (file, output, label, limits)


class ReaderError(RuntimeError):
    """Raised if the reading process failed for a reason other than the file."""


@dataclass(frozen=True)
class Limits:
    """Limits of the process that reads one file.

    Attributes:
        values: count of numbers in the file.
        memory_mib: address space in addition to that of the process before it opens the file, MiB.
        processor_s: processor time, s.
        wall_s: elapsed time, s; more than the processor time, since processors are shared.
        output_mib: size of the output in the storage format, MiB.
        storage: whether chunks, filters and fixed-length texts are limited (:mod:`wingfit.records.files.netcdf`).
    """

    values: int
    memory_mib: int
    processor_s: int
    wall_s: int
    output_mib: int
    storage: bool = True


def limits_of_upload(size: int) -> Limits:
    """Return the limits for an uploaded file of ``size`` bytes, chosen so that every upload is answered within 20 s.

    On a Xeon, a valid file of 14.8 million numbers, twice the limit of uploads, took 7.5 s of processor time and 327 MB
    of resident memory, interpreter and libraries included.
    """
    processor = min(16, 6 + size // (4 * MIB))
    return Limits(
        values=MAX_UPLOADED_NETCDF_VALUES,
        memory_mib=256,
        processor_s=processor,
        wall_s=min(18, 3 * processor),
        output_mib=16 + MAX_UPLOADED_NETCDF_VALUES * 8 // MIB,
    )


# For files that earlier versions accepted and stored, some of them above the present limits.
STORED = Limits(values=MAX_VALUES, memory_mib=3072, processor_s=300, wall_s=900, output_mib=1024, storage=False)


def convert_netcdf(data: bytes, label: str, limits: Limits | None = None) -> bytes:
    """Convert the NetCDF file ``data`` to the internal storage format in a separate process; return the bytes.

    ``label`` names the file in messages. The default ``limits`` are those of an upload of this size. DatasetError lists
    the errors of the file. OSError if the temporary folder is full or no process can be started; ReaderError if the
    process failed before it read the file, or was killed by the system.
    """
    return read_confined(MODULE, data, label, limits or limits_of_upload(len(data)), UPLOAD)


def read_confined(module: str, data: bytes, label: str, limits: Limits, rewrite: str) -> bytes:
    """Return what ``python -m module`` writes for the file ``data``, in a separate process within the ``limits``.

    The module calls :func:`confine`. ``label`` names the file in messages, and ``rewrite`` is their remedy for a
    damaged file. Errors as in :func:`convert_netcdf`.
    """
    with tempfile.TemporaryFile() as source, tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as log:
        source.write(data)
        source.seek(0)
        status = _run(module, (source, output, log), label, limits)
        output.seek(0)
        if status == FAULTS:
            raise _faults(output.read(MAX_FAULTS_BYTES), label, rewrite)
        if status:
            log.seek(0)
            LOG.warning("%r cannot be read as HDF5 (status %d): %r", label, status, log.read(MAX_TRACE_BYTES))
            raise _failure(status, label, limits, rewrite)
        return output.read(limits.output_mib * MIB)


def _run(module: str, streams: tuple[IO[bytes], IO[bytes], IO[bytes]], label: str, limits: Limits) -> int:
    """Run ``module`` on ``streams`` (input, output, errors); return its exit status, or minus its signal."""
    options = json.dumps({"label": label, "limits": asdict(limits)})
    command = [sys.executable, "-P", "-m", module, options]
    # Only the necessary part of the server's environment, which may contain secrets.
    environment = {name: os.environ[name] for name in ENVIRONMENT if name in os.environ} | {
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "OPENBLAS_NUM_THREADS": "1",
        "HDF5_PLUGIN_PATH": os.devnull,  # no filters from plug-ins, which are code
    }
    source, output, log = streams
    child = subprocess.Popen(  # noqa: S603  # fixed words
        command, stdin=source, stdout=output, stderr=log, env=environment, start_new_session=True
    )
    try:
        return child.wait(limits.wall_s)
    except subprocess.TimeoutExpired:
        return -signal.SIGALRM
    finally:
        child.kill()
        child.wait()


def _failure(status: int, label: str, limits: Limits, rewrite: str) -> Exception:
    """Return the error to raise for a reading process that ended with ``status`` and no output."""
    if status in DISK_FULL:
        return OSError(status, os.strerror(status))
    if status == NOT_STARTED:
        return ReaderError("the process that reads HDF5 files cannot start; see the log of the server")
    if status == -signal.SIGKILL:
        return ReaderError("the system ended the process that read the file, probably for want of memory; try later")
    what = f"signal {-status}" if status < 0 else f"exit status {status}"
    processor = f"takes more than {limits.processor_s} s of processor time to read"
    causes = {
        -signal.SIGXCPU: f"{processor}; {rewrite}, or write larger chunks",
        -signal.SIGALRM: f"was not read within {limits.wall_s} s; {rewrite}, or try again when the server is less busy",
        -signal.SIGXFSZ: f"takes more than {limits.output_mib} MiB unpacked; split the dataset",
    }
    return fail(label, None, causes.get(status, f"the HDF5 library fails on it ({what}); {rewrite}"))


def _faults(answer: bytes, label: str, rewrite: str) -> DatasetError:
    """Return the error with the faults that the reading process reported as JSON; not trusted, converted to text."""
    try:
        report = json.loads(answer)
        faults = [Fault(str(where), value and str(value), str(message)) for where, value, message in report["faults"]]
        return DatasetError(faults, int(report["count"]))
    except Exception:  # of any kind: the file may be malicious
        return fail(label, None, f"the HDF5 library fails on it; {rewrite}")


# -- in the child ----------------------------------------------------------------------------------------


def main(arguments: Sequence[str]) -> None:
    """Convert the NetCDF file on standard input to the storage format on standard output, in the reading process.

    ``arguments`` holds one JSON text with the label and the limits.
    """
    confine(arguments, _netcdf, "write smaller chunks, or split the dataset")


def _netcdf() -> Convert:
    from wingfit.records.files.netcdf import parse_netcdf
    from wingfit.records.files.parsed import pack

    def convert(source: BinaryIO, output: BinaryIO, label: str, limits: Limits) -> None:
        _, parsed = parse_netcdf(source, label, limits.values, storage=limits.storage)
        pack(parsed, output)

    return convert


def confine(arguments: Sequence[str], prepare: Callable[[], Convert], smaller: str) -> None:
    """Convert the file on standard input to standard output within limits; exit statuses as at the top.

    ``arguments`` holds one JSON text with the label and the limits. ``prepare()`` imports what is needed and returns
    the function that converts; it may raise DatasetError. ``smaller``: the remedy for a file that needs much memory.
    """
    options = json.loads(arguments[0])
    label, limits = options["label"], Limits(**options["limits"])
    os.nice(NICENESS)
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_CPU, limits.processor_s, 1)
    _limit(resource.RLIMIT_FSIZE, limits.output_mib * MIB)
    _limit(resource.RLIMIT_NOFILE, FILES_OPEN)
    convert = prepare()
    np.linalg.eigvalsh(np.ones((64, 64)))  # OpenBLAS takes its memory at the first large product, and exits without it
    if sys.platform == "linux":  # elsewhere the limit does not exist, or the present size is unknown
        _limit(resource.RLIMIT_AS, _address_space() + limits.memory_mib * MIB)
    try:
        convert(sys.stdin.buffer, sys.stdout.buffer, label, limits)
    except DatasetError as error:
        _refuse([[fault.where, fault.value, fault.message] for fault in error.errors], error.count)
    except MemoryError:
        _refuse([[label, None, f"takes more than {limits.memory_mib} MiB of memory to read; {smaller}"]], 1)
    except OSError as error:  # of the output: those of the file are faults
        traceback.print_exc()
        sys.exit(error.errno if error.errno in DISK_FULL else READ_FAILED)
    except Exception:  # of any kind: the file may be malicious
        traceback.print_exc()
        sys.exit(READ_FAILED)


def _limit(which: int, most: int, slack: int = 0) -> None:
    """Limit the resource ``which`` (``resource.RLIMIT_...``): soft limit ``most``, hard limit larger by ``slack``."""
    _, hard = resource.getrlimit(which)
    hard = most + slack if hard == resource.RLIM_INFINITY else min(most + slack, hard)
    resource.setrlimit(which, (min(most, hard), hard))


def _address_space() -> int:
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[0]
    return int(pages) * resource.getpagesize()


def _refuse(faults: list[list[Any]], count: int) -> NoReturn:
    sys.stdout.seek(0)
    sys.stdout.truncate()
    json.dump({"faults": faults, "count": count}, sys.stdout)
    sys.exit(FAULTS)


if __name__ == "__main__":
    main(sys.argv[1:])
