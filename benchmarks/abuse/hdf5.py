"""Uploads NetCDF files (HDF5) with a changed byte, and files that are crafted to take much memory or time to read."""

from __future__ import annotations

import io
import math
import sys
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import httpx
import numpy as np

from benchmarks.abuse import uploads
from benchmarks.common.progress import show
from benchmarks.common.server_process import Server, descendants

Json = dict[str, Any]
Make = Callable[[h5py.File], None]

MUTATED = 3000
AT_ONCE = 2  # number of simultaneous uploads
HEAP = b"GCOL"  # signature of an HDF5 global heap
HEAP_BYTES = 512  # length of a heap's part that is changed
MIB = 2**20
ANSWER_SECONDS = 120.0  # time limit of an upload
SLOWEST_SECONDS, PEAK_MB = 20.0, 1024.0
READ_SECONDS, UPLOAD_SECONDS = 2.0, 20.0  # longest acceptable time of other clients' requests
LOOK_SECONDS, OTHERS_SECONDS = 0.02, 0.2
UPLOAD_EVERY = 25


def abused(http: httpx.Client, server: Server, names: dict[str, str], seed: int, mutated: int = MUTATED) -> Json:
    """Upload ``mutated`` randomly changed files and all crafted ones, two at once, while other clients use the server.

    ``names``: ids of existing objects. Returns the figures for the report: time of the slowest upload, peak memory of
    the server, longest times that the other clients waited, and a list of failures.
    """
    files = [*crafted(), *_mutated(seed, mutated)]
    answers = _Answers(len(files))
    with _Others(str(http.base_url), names) as others, _Memory(server) as memory, ThreadPoolExecutor(AT_ONCE) as pool:
        for name, data in files:
            pool.submit(_upload, str(http.base_url), name, data, answers)
    print(file=sys.stderr)
    failures = answers.failures + others.failures
    if answers.slowest > SLOWEST_SECONDS:
        failures.append(f"{answers.slowest_name}: answered after {answers.slowest:.1f} s")
    if memory.peak_mb > PEAK_MB:
        failures.append(f"HDF5: server and children held {memory.peak_mb:.0f} MB")
    return {
        "hdf5_files": len(files),
        "hdf5_accepted": answers.accepted,
        "hdf5_slowest_s": round(answers.slowest, 2),
        "hdf5_peak_mb": round(memory.peak_mb, 1),
        "hdf5_blocked_others": bool(others.failures),
        "hdf5_others_slowest_read_s": round(others.slowest_read, 3),
        "hdf5_others_slowest_upload_s": round(others.slowest_upload, 2),
        "failures": failures,
    }


# -- the files ---------------------------------------------------------------------------------------------


def _mutated(seed: int, count: int) -> Iterator[tuple[str, bytes]]:
    """Yield ``count`` files as (name, bytes): a valid file with one byte changed at random.

    Half of the changes are anywhere, half in the heaps in which HDF5 stores texts.
    """
    rng, good = np.random.default_rng([seed, 5]), uploads.netcdf_example()
    heaps = [at for at in range(len(good)) if good.startswith(HEAP, at)]
    for number in range(count):
        data = bytearray(good)
        if number % 2:
            at = min(heaps[rng.integers(len(heaps))] + int(rng.integers(HEAP_BYTES)), len(good) - 1)
            data[at] = int(rng.choice([0, 1, 2, 4, 8, 16, 64, 255]))
        else:
            at = int(rng.integers(8, len(good)))
            data[at] ^= 1 << int(rng.integers(8))
        yield f"byte {at} of NetCDF {good[at]} -> {data[at]}", bytes(data)


def crafted() -> Iterator[tuple[str, bytes]]:
    """Yield, as (name, bytes), files with hostile contents, most of them valid HDF5."""
    for name, make in CRAFTED.items():
        yield f"crafted NetCDF, {name}", _changed(make)
    good = uploads.netcdf_example()
    for at in range(len(good)):
        if good.startswith(HEAP, at):  # change the size of its first object; with some values the library never returns
            looping = bytearray(good)
            looping[at + 25] ^= 4
            yield f"crafted NetCDF, an object of the heap at {at} that never ends", bytes(looping)
    yield "crafted NetCDF, only a signature", good[:8]
    yield "crafted NetCDF, a signature and zeros", good[:8] + bytes(4 * MIB)


def _changed(make: Make) -> bytes:
    buffer = io.BytesIO(uploads.netcdf_example())
    with h5py.File(buffer, "r+") as file:
        make(file)
    return buffer.getvalue()


def _group(file: h5py.File) -> Any:
    return next(iter(file["recordings"].values()))


def _with(name: str, **options: Any) -> Make:
    """Return a function that replaces the variable ``name`` of a file by one of the same shape, without data.

    ``options``: type and storage of the new variable, as for h5py's ``create_dataset``.
    """

    def make(file: h5py.File) -> None:
        group = _group(file)
        shape = group[name].shape
        del group[name]
        group.create_dataset(name, shape=shape, **options)

    return make


def _huge_attribute(file: h5py.File) -> None:
    del file.attrs["dataset_yaml"]
    space, kind = h5py.h5s.create(h5py.h5s.SCALAR), h5py.h5t.C_S1.copy()
    kind.set_size(40 * MIB)
    h5py.h5a.create(file.id, b"dataset_yaml", kind, space)


def _bomb(times: int) -> Make:
    """Return a function that replaces the positions in a file by data that unpack to 500 MiB.

    ``times``: how often the data are compressed.
    """

    def make(file: h5py.File) -> None:
        group = _group(file)
        shape = group["position_m"].shape
        del group["position_m"]
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_chunk(shape)
        packed = _zeros(500)
        for _ in range(times):
            plan.set_filter(h5py.h5z.FILTER_DEFLATE, 0, (6,))
        for _ in range(times - 1):
            packed = zlib.compress(packed, 9)
        space = h5py.h5s.create_simple(shape)
        made = h5py.h5d.create(group.id, b"position_m", h5py.h5t.NATIVE_DOUBLE, space, dcpl=plan)
        made.write_direct_chunk((0,) * len(shape), packed)

    return make


def _zeros(mib: int) -> bytes:
    packer = zlib.compressobj(9)
    return b"".join([*(packer.compress(bytes(MIB)) for _ in range(mib)), packer.flush()])


def _large(instants: int, **options: Any) -> Make:
    """Return a function that declares times and positions of ``instants`` samples without storing their values."""

    def make(file: h5py.File) -> None:
        group = _group(file)
        count = group["marker"].shape[0]
        for name, shape in (("time_s", (instants,)), ("position_m", (instants, count, 3))):
            del group[name]
            chunks = options.get("chunks") if name == "position_m" else None
            group.create_dataset(name, shape=shape, dtype=options.get("dtype", "f8"), chunks=chunks, fillvalue=0.0)

    return make


def _link(kind: Any) -> Make:
    def make(file: h5py.File) -> None:
        group = _group(file)
        del group["position_m"]
        group["position_m"] = kind

    return make


def _virtual(file: h5py.File) -> None:
    group = _group(file)
    shape = group["position_m"].shape
    layout = h5py.VirtualLayout(shape=shape, dtype="f8")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", shape=shape)
    del group["position_m"]
    group.create_virtual_dataset("position_m", layout)


def _external(file: h5py.File) -> None:
    group = _group(file)
    shape = group["position_m"].shape
    del group["position_m"]
    size = 8 * math.prod(shape)
    group.create_dataset("position_m", shape=shape, dtype="f8", external=[("/etc/passwd", 0, size)])


def _own_parent(file: h5py.File) -> None:
    group = _group(file)
    group["recordings"] = file["recordings"]


def _nested(file: h5py.File) -> None:
    group = file
    for _ in range(2000):
        group = group.create_group("g")


def _many_groups(file: h5py.File) -> None:
    for number in range(20_000):
        file["recordings"].create_group(f"g{number}")


def _many_attributes(file: h5py.File) -> None:
    for number in range(5000):
        file.attrs[f"a{number}"] = "x" * 100


CRAFTED: dict[str, Make] = {
    "names of 100 MB each": _with("marker", dtype="S100000000", chunks=(1,), compression="gzip"),
    "names of 2 GB each, never written": _with("marker", dtype="S2000000000", chunks=None),
    "names that are numbers": _with("marker", dtype="i8"),
    "names that are references": _with("marker", dtype=h5py.ref_dtype),
    "a description of 40 MB that is declared only": _huge_attribute,
    "a chunk that unpacks to 500 MB": _bomb(1),
    "a chunk packed twice": _bomb(2),
    "a chunk packed four times": _bomb(4),
    "a chunk of 3 GB": _with(
        "position_m", dtype="f8", maxshape=(None, None, None), chunks=(131072, 1024, 3), compression="gzip"
    ),
    "a filter that loses digits": _with("position_m", dtype="f8", scaleoffset=4),
    "numbers of 16 bytes": _with("position_m", dtype="c16"),
    "times that are compound": _with("time_s", dtype=np.dtype([("a", "f8"), ("b", "S1000000")])),
    "7 million zeros": _large(50_000),
    "7 million zeros in chunks of one": _large(50_000, chunks=(1, 1, 1)),
    "7 million zeros of 4 bytes": _large(50_000, dtype="f4"),
    "3 billion zeros": _large(20_000_000),
    "a link to itself": _link(h5py.SoftLink("/recordings")),
    "a link to another file": _link(h5py.ExternalLink("/etc/passwd", "/")),
    "data in another file": _external,
    "a virtual variable": _virtual,
    "a group that holds its parent": _own_parent,
    "2,000 groups in one another": _nested,
    "20,000 groups beside each other": _many_groups,
    "5,000 attributes": _many_attributes,
}


# -- measurements ------------------------------------------------------------------------------------------


@dataclass
class _Answers:
    """Collects the answers to the uploads; safe for several threads.

    ``total``: number of uploads; ``slowest``: longest time (s) of an upload, and ``slowest_name`` its name.
    """

    total: int
    done: int = 0
    accepted: int = 0
    slowest: float = 0.0
    slowest_name: str = ""
    failures: list[str] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, name: str, status: int, seconds: float, text: str) -> None:
        """Record the answer to the upload ``name``; any HTTP status other than 201 or 422 is a failure."""
        with self.lock:
            self.done += 1
            self.accepted += status == 201
            if seconds > self.slowest:
                self.slowest, self.slowest_name = seconds, name
            if status not in (201, 422):
                self.failures.append(f"{name}: {status} {text[:200]}")
            if self.done % 20 == 0 or self.done == self.total:
                show(f"HDF5 files: {self.done} of {self.total}", last=self.done == self.total)


def _upload(url: str, name: str, data: bytes, answers: _Answers) -> None:
    began, status, text = time.monotonic(), 0, ""
    try:
        with httpx.Client(base_url=url, timeout=ANSWER_SECONDS) as http:
            answer = http.post("/v1/datasets", files={"file": ("hostile.nc", data)})
            status, text = answer.status_code, answer.text
            if status == 201:
                http.delete(f"/v1/datasets/{answer.json()['id']}")
    except httpx.TransportError as error:
        text = repr(error)
    answers.add(name, status, time.monotonic() - began, text)


class _Thread:
    """Thread that calls :meth:`look` every ``seconds`` during a ``with`` block."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._over = seconds, threading.Event()
        self._thread = threading.Thread(target=self._go, daemon=True)

    def look(self) -> None:
        """Perform the action of the thread once."""
        raise NotImplementedError

    def _go(self) -> None:
        while not self._over.wait(self._seconds):
            self.look()

    def __enter__(self) -> Any:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()


class _Memory(_Thread):
    """Records the peak resident memory (MiB) of the server and its descendants together, during a ``with`` block."""

    def __init__(self, server: Server) -> None:
        super().__init__(LOOK_SECONDS)
        self._server, self.peak_mb = server, 0.0

    def look(self) -> None:
        """Measure the present memory of the processes, and raise the peak if it is larger."""
        held = sum(_resident_mb(pid) for pid in (self._server.pid, *descendants(self._server.pid)))
        self.peak_mb = max(self.peak_mb, held)


def _resident_mb(pid: int) -> float:
    with suppress(OSError, StopIteration):
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
        return float(next(line.split()[1] for line in lines if line.startswith("VmRSS:"))) / 1024
    return 0.0


class _Others(_Thread):
    """Other clients of the server during the uploads: they send valid requests and record how long they wait.

    ``names``: ids of existing objects.
    """

    def __init__(self, url: str, names: dict[str, str]) -> None:
        super().__init__(OTHERS_SECONDS)
        self._url, self._paths = url, ("/v1/health", "/v1/ready", f"/v1/runs/{names['{run}']}", "/v1/datasets")
        self._good, self._count = uploads.small_archive(), 0
        self.slowest_read = self.slowest_upload = 0.0
        self.failures: list[str] = []

    def look(self) -> None:
        """Request each of a few paths, and at every UPLOAD_EVERY-th call upload a valid dataset."""
        with httpx.Client(base_url=self._url, timeout=ANSWER_SECONDS) as http:
            for path in self._paths:
                seconds = self._timed(path, lambda path=path: http.get(path), 200, READ_SECONDS)  # type: ignore[misc]
                self.slowest_read = max(self.slowest_read, seconds)
            self._count += 1
            if self._count % UPLOAD_EVERY == 0:
                files = {"file": ("good.zip", self._good)}
                send = lambda: http.post("/v1/datasets", files=files)  # noqa: E731
                self.slowest_upload = max(self.slowest_upload, self._timed("a valid upload", send, 201, UPLOAD_SECONDS))

    def _timed(self, what: str, send: Callable[[], httpx.Response], status: int, most: float) -> float:
        began = time.monotonic()
        try:
            answered = send().status_code
        except httpx.TransportError as error:
            self.failures.append(f"during hostile uploads, {what}: {error!r}")
            return time.monotonic() - began
        seconds = time.monotonic() - began
        if answered != status or seconds > most:
            self.failures.append(f"during hostile uploads, {what}: {answered} after {seconds:.1f} s")
        return seconds
