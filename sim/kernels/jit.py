"""Compile kernels with numba, allowing only fused multiply-add as a change of the arithmetic; cache them on disk.

Numba's cache checks only the file of the cached function, although a kernel contains functions of other files: after a
change there, outdated code would run. The cache folder is therefore named after a hash of the source of all kernels.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, TypeVar, cast

import numba

from wingfit.sim.kernels import LANES

F = TypeVar("F", bound=Callable[..., object])

_MAX_VERSIONS = 8  # versions of the kernels whose compiled code is stored


def kernel(function: F) -> F:
    """Compile ``function``, which works on arrays of LANES individuals and allocates no array, and cache it on disk.

    The cache depends on the source of all kernels. The function is compiled without reference counting, which would
    take a third of the time of a small wing's step. Functions that allocate or copy whole arrays need
    :func:`allocating`. OSError if no folder for the cache is writable; RuntimeError if numba uses another folder.
    """
    return _compiled(function, counting=False)


def allocating(function: F) -> F:
    """Compile ``function`` like :func:`kernel`, but with reference counting, so that it may allocate or copy arrays."""
    return _compiled(function, counting=True)


def _compiled(function: F, *, counting: bool) -> F:
    folder = cache_folder(Path(inspect.getfile(function)).resolve().parent)
    with _cached_in(folder):
        compiled = numba.njit(
            cache=True, _nrt=counting, fastmath={"contract"}, error_model="numpy", nogil=True
        )(function)  # fmt: skip
    _check(function, compiled.stats.cache_path, folder)
    return cast(F, compiled)


def _check(function: Callable[..., object], path: str, folder: Path) -> None:
    """Raise RuntimeError if numba caches ``function`` at ``path`` rather than in the requested ``folder``."""
    if not Path(path).is_relative_to(folder):
        raise RuntimeError(
            f"numba {numba.__version__} caches {function.__qualname__!r} in {path} instead of {folder}: "
            "code compiled from older kernels could run; use a version of numba that respects numba.config.CACHE_DIR"
        )


def callback(function: F, signature: Any) -> Any:
    """Compile ``function`` to be called by its address with arguments of the numba type ``signature``.

    It is cached on disk under a hash of the source of its file and of all kernels. Returns numba's compiled function.
    """
    folder = cache_folder(Path(inspect.getfile(function)).resolve())
    with _cached_in(folder):
        compiled = numba.cfunc(signature, cache=True, fastmath={"contract"}, error_model="numpy", nogil=True)(function)
    _check(function, compiled._cache.cache_path, folder)
    return compiled


def inlined(function: F) -> F:
    """Compile a small function whose code is copied into each kernel that calls it, so that a call costs nothing."""
    return cast(F, numba.njit(forceinline=True, fastmath={"contract"}, error_model="numpy")(function))


@cache
def cache_folder(source: Path) -> Path:
    """Create, if needed, and return the cache folder for the kernels of ``source``, a file or folder.

    It is named after a hash of LANES and of the sources: those of this folder and of ``source``, which means all files
    of a folder, or a file and its neighbours whose names start with an underscore (shared code). OSError if no folder
    is writable.
    """
    digest = hashlib.sha256(f"{LANES} lanes".encode())
    alone = source.is_file()
    own = {source, *source.parent.glob("_*.py")} if alone else set(source.glob("*.py"))
    for file in sorted({*own, *Path(__file__).resolve().parent.rglob("*.py")}):
        digest.update(file.name.encode() + hashlib.sha256(file.read_bytes()).digest())
    beside = (source.parent if alone else source) / "__pycache__"
    places = (
        Path(numba.config.CACHE_DIR) if numba.config.CACHE_DIR else beside,
        Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "wingfit",
    )
    inner = Path(source.stem, f"kernels-{digest.hexdigest()[:16]}")
    for base in places:
        folder = base / inner
        with suppress(OSError):
            _start_with(beside / inner, folder)
            folder.mkdir(parents=True, exist_ok=True)
            folder.touch()
            if os.access(folder, os.W_OK):
                _forget_old(folder.parent)
                _forget_old(base)  # of earlier versions, which stored all folders together
                return folder
    raise OSError(
        f"compiled kernels cannot be kept in {' or '.join(map(str, places))}: "
        "set NUMBA_CACHE_DIR to a folder that can be written"
    )


def _start_with(shipped: Path, folder: Path) -> None:
    """Copy the compiled kernels in ``shipped``, part of a read-only installation, to ``folder`` if that does not exist.

    They are copied to another name and renamed, since other processes may read the folder at any time.
    """
    if folder.exists() or not shipped.is_dir():
        return
    folder.parent.mkdir(parents=True, exist_ok=True)
    copy = Path(mkdtemp(prefix="copy-", dir=folder.parent))
    try:
        shutil.copytree(shipped, copy, dirs_exist_ok=True)
        copy.rename(folder)
    except OSError:  # another process was first, or the disk is full: then the kernels are compiled
        shutil.rmtree(copy, ignore_errors=True)


def _forget_old(place: Path) -> None:
    """Remove all but the _MAX_VERSIONS most recently used folders of compiled kernels in the folder ``place``.

    A process that still needs a removed folder creates it again. Other processes may remove folders at the same time: a
    folder that has disappeared counts as oldest.
    """
    folders = sorted(place.glob("kernels-*"), key=_last_used)
    for folder in folders[:-_MAX_VERSIONS]:
        shutil.rmtree(folder, ignore_errors=True)


def _last_used(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except FileNotFoundError:
        return 0.0


@contextmanager
def _cached_in(folder: Path) -> Iterator[None]:
    """Context in which ``numba.config.CACHE_DIR``, which numba reads when it decorates a function, is ``folder``."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before
