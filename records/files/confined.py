"""Reads a stranger's NetCDF file in a process of its own, within limits of memory, processor time and wall time.

One wrong bit can make the HDF5 library loop for ever inside a call, crash, or take gigabytes. In a process of its own
that ends this process alone. Each file gets a new one, so that none can change what comes of the next. It answers with
the project's own form (:mod:`wingfit.records.files.parsed`), which the caller checks again: nothing that it says is
trusted.

``python -m wingfit.records.files.confined JSON`` (label and limits) reads the file from standard input and writes its
own form to standard output; where the exit status is ``FAULTS``, JSON that says what is wrong with the file. Any other
status but 0 is a failure: ``BROKE``, or a signal, while it read; 1, the interpreter's own, before it began.
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
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, NoReturn

from wingfit.records.errors import DatasetError, Fault, fail
from wingfit.records.limits import MAX_UPLOADED_NETCDF_VALUES, MAX_VALUES, MIB

# Whoever uploads waits, but whoever only looks must not wait for him.
NICENESS = 5
FILES_OPEN = 64
FAULTS, BROKE = 3, 4
NOT_BEGUN = 1
# Exit statuses that are error numbers: there is no room for the answer.
NO_ROOM = (errno.ENOSPC, errno.EDQUOT)
PASSED_ON = ("PATH", "LANG", "LC_ALL", "TMPDIR", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
LONGEST_FAULTS, LONGEST_TRACE = 64 * 2**10, 4000

AGAIN = "the file may be damaged: write it again, or upload a zip"
LOG = logging.getLogger("wingfit")


class ReaderError(RuntimeError):
    """The process that reads files did not do so, and not for the file's sake."""


@dataclass(frozen=True)
class Limits:
    """What reading one file may take.

    Attributes:
        values: numbers in it.
        memory_mib: address space beyond that of the process before it opens the file, MiB.
        processor_s: processor time, s.
        wall_s: time, s; more than that of the processor, for which others wait too.
        output_mib: size of the project's own form, MiB.
        storage: whether chunks, filters and texts of fixed length are limited (:mod:`wingfit.records.files.netcdf`).
    """

    values: int
    memory_mib: int
    processor_s: int
    wall_s: int
    output_mib: int
    storage: bool = True


def limits_of_upload(size: int) -> Limits:
    """What an uploaded file of ``size`` bytes may take: an answer comes within 20 s, whatever it is.

    On a Xeon an honest file of 14.8 million numbers, twice what may be uploaded, took 7.5 s of processor time, and
    327 MB of resident memory with the interpreter and the libraries.
    """
    processor = min(16, 6 + size // (4 * MIB))
    return Limits(
        values=MAX_UPLOADED_NETCDF_VALUES,
        memory_mib=256,
        processor_s=processor,
        wall_s=min(18, 3 * processor),
        output_mib=16 + MAX_UPLOADED_NETCDF_VALUES * 8 // MIB,
    )


# For files that earlier versions read and stored, some of them larger than what is taken now.
STORED = Limits(values=MAX_VALUES, memory_mib=3072, processor_s=300, wall_s=900, output_mib=1024, storage=False)


def convert_netcdf(data: bytes, label: str, limits: Limits | None = None) -> bytes:
    """The dataset in ``data`` in the project's own form; DatasetError says what is wrong with it.

    ``label`` is what messages call the file. Without ``limits`` they are those of an upload of this size. OSError where
    the temporary folder is full or no process can be started; ReaderError where it ended before it read the file.
    """
    limits = limits or limits_of_upload(len(data))
    with tempfile.TemporaryFile() as given, tempfile.TemporaryFile() as made, tempfile.TemporaryFile() as said:
        given.write(data)
        given.seek(0)
        status = _run((given, made, said), label, limits)
        made.seek(0)
        if status == FAULTS:
            raise _refusal(made.read(LONGEST_FAULTS), label)
        if status:
            said.seek(0)
            LOG.warning("%r cannot be read as NetCDF (status %d): %r", label, status, said.read(LONGEST_TRACE))
            raise _failure(status, label, limits)
        return made.read(limits.output_mib * MIB)


def _run(streams: tuple[IO[bytes], IO[bytes], IO[bytes]], label: str, limits: Limits) -> int:
    """Exit status of the child over its standard streams; below 0 the signal that ended it."""
    command = [
        sys.executable,
        "-P",
        "-m",
        "wingfit.records.files.confined",
        json.dumps({"label": label, "limits": asdict(limits)}),
    ]
    # No more of the server's environment than is needed: it may hold keys and tokens.
    environment = {name: os.environ[name] for name in PASSED_ON if name in os.environ} | {
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "OPENBLAS_NUM_THREADS": "1",
        "HDF5_PLUGIN_PATH": os.devnull,  # filters are code: none but the library's own
    }
    given, made, said = streams
    child = subprocess.Popen(  # noqa: S603  # our own words
        command, stdin=given, stdout=made, stderr=said, env=environment, start_new_session=True
    )
    try:
        return child.wait(limits.wall_s)
    except subprocess.TimeoutExpired:
        return -signal.SIGALRM
    finally:
        child.kill()
        child.wait()


def _failure(status: int, label: str, limits: Limits) -> Exception:
    """Why a child ended without an answer."""
    if status in NO_ROOM:
        return OSError(status, os.strerror(status))
    if status == NOT_BEGUN:
        return ReaderError("the process that reads NetCDF files cannot start; the log of the server says why")
    if status == -signal.SIGKILL:
        return ReaderError("the system ended the process that read the file, most likely for lack of memory; try later")
    return fail(label, None, _why(status, limits))


def _why(status: int, limits: Limits) -> str:
    if status == -signal.SIGXCPU:
        return f"takes more than {limits.processor_s} s of processor time to read; {AGAIN}, or write larger chunks"
    if status == -signal.SIGALRM:
        return f"was not read within {limits.wall_s} s; {AGAIN}, or try again when the server is less busy"
    if status == -signal.SIGXFSZ:
        return f"takes more than {limits.output_mib} MiB unpacked; split the dataset"
    what = f"signal {-status}" if status < 0 else f"exit status {status}"
    return f"the HDF5 library fails on it ({what}); {AGAIN}"


def _refusal(answer: bytes, label: str) -> DatasetError:
    """What the child found wrong; its words are taken as text and nothing else."""
    try:
        said = json.loads(answer)
        faults = [Fault(str(where), value and str(value), str(message)) for where, value, message in said["faults"]]
        return DatasetError(faults, int(said["found"]))
    except Exception:  # whatever it is that a hostile file made it say
        return fail(label, None, f"the HDF5 library fails on it; {AGAIN}")


# -- in the child ----------------------------------------------------------------------------------------


def main(arguments: Sequence[str]) -> None:
    """Convert standard input to standard output."""
    given = json.loads(arguments[0])
    label, limits = given["label"], Limits(**given["limits"])
    os.nice(NICENESS)
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_CPU, limits.processor_s, 1)
    _limit(resource.RLIMIT_FSIZE, limits.output_mib * MIB)
    _limit(resource.RLIMIT_NOFILE, FILES_OPEN)
    from wingfit.records.files.netcdf import parse_netcdf
    from wingfit.records.files.parsed import pack

    if sys.platform == "linux":  # elsewhere there is no such limit, or no way to tell what is taken already
        _limit(resource.RLIMIT_AS, _address_space() + limits.memory_mib * MIB)
    try:
        _, parsed = parse_netcdf(sys.stdin.buffer, label, limits.values, storage=limits.storage)
        pack(parsed, sys.stdout.buffer)
    except DatasetError as error:
        _refuse([[fault.where, fault.value, fault.message] for fault in error.errors], error.found)
    except MemoryError:
        message = (
            f"takes more than {limits.memory_mib} MiB of memory to read; write smaller chunks, or split the dataset"
        )
        _refuse([[label, None, message]], 1)
    except OSError as error:  # of the answer: those of the file are faults
        traceback.print_exc()
        sys.exit(error.errno if error.errno in NO_ROOM else BROKE)
    except Exception:  # whatever it is that a hostile file makes the library do
        traceback.print_exc()
        sys.exit(BROKE)


def _limit(which: int, most: int, slack: int = 0) -> None:
    """Set a limit for good; ``slack`` is how far the hard one, that of an unnamed kill, is beyond it."""
    _, hard = resource.getrlimit(which)
    hard = most + slack if hard == resource.RLIM_INFINITY else min(most + slack, hard)
    resource.setrlimit(which, (min(most, hard), hard))


def _address_space() -> int:
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[0]
    return int(pages) * resource.getpagesize()


def _refuse(faults: list[list[Any]], found: int) -> NoReturn:
    sys.stdout.seek(0)
    sys.stdout.truncate()
    json.dump({"faults": faults, "found": found}, sys.stdout)
    sys.exit(FAULTS)


if __name__ == "__main__":
    main(sys.argv[1:])
