"""How kernels are compiled: cached on disk, fused multiply-add allowed, no other liberty with the arithmetic.

Numba's cache looks at the file of the cached function alone, but a kernel contains what it calls from other files:
after an edit there, the old physics would run on. So what is compiled goes to a folder named after the content of all
kernels, and another content finds that folder empty.
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

F = TypeVar("F", bound=Callable[..., object])

_KEPT = 8  # contents of the kernels whose compiled code is kept


def kernel(function: F) -> F:
    """Compile a function over groups of lanes that makes no array, cached on disk by the content of all kernels.

    Such a function need not count references to the arrays it is given, which would take a third of a small wing's
    step; one that makes or copies whole arrays does not compile so, and is :func:`allocating`. OSError where no folder
    for the cache can be written; RuntimeError where numba puts it elsewhere.
    """
    return _compiled(function, counting=False)


def allocating(function: F) -> F:
    """The same for a function that makes arrays or copies whole ones."""
    return _compiled(function, counting=True)


def _compiled(function: F, *, counting: bool) -> F:
    folder = _cache_folder(Path(inspect.getfile(function)).resolve().parent)
    with _cached_in(folder):
        compiled = numba.njit(
            cache=True, _nrt=counting, fastmath={"contract"}, error_model="numpy", nogil=True
        )(function)  # fmt: skip
    _check(function, compiled.stats.cache_path, folder)
    return cast(F, compiled)


def _check(function: Callable[..., object], path: str, folder: Path) -> None:
    """RuntimeError where numba does not cache in the folder it was told to."""
    if not Path(path).is_relative_to(folder):
        raise RuntimeError(
            f"numba {numba.__version__} caches {function.__qualname__!r} in {path} instead of {folder}: "
            "code compiled from older kernels could run; use a numba that heeds numba.config.CACHE_DIR"
        )


def callback(function: F, signature: Any) -> Any:
    """Compile a function to be called by address, cached on disk by the content of its own file and of all kernels."""
    folder = _cache_folder(Path(inspect.getfile(function)).resolve())
    with _cached_in(folder):
        compiled = numba.cfunc(signature, cache=True, fastmath={"contract"}, error_model="numpy", nogil=True)(function)
    _check(function, compiled._cache.cache_path, folder)
    return compiled


def inlined(function: F) -> F:
    """Compile a small function into each kernel that calls it."""
    return cast(F, numba.njit(forceinline=True, fastmath={"contract"}, error_model="numpy")(function))


@cache
def _cache_folder(source: Path) -> Path:
    """Where the kernels of ``source`` are cached: named after its content and this folder's.

    Of a folder all files count; beside a file those that it may share code with, whose names start with an underscore.
    """
    digest = hashlib.sha256()
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
                _forget_old(base)  # of versions that kept all of them together
                return folder
    raise OSError(
        f"compiled kernels cannot be kept in {' or '.join(map(str, places))}: "
        "set NUMBA_CACHE_DIR to a folder that can be written"
    )


def _start_with(shipped: Path, folder: Path) -> None:
    """Fill a ``folder`` that does not exist yet with the kernels that a read-only installation brings along.

    They are copied under another name and renamed, because another process may look into the folder at any time.
    """
    if folder.exists() or not shipped.is_dir():
        return
    folder.parent.mkdir(parents=True, exist_ok=True)
    copy = Path(mkdtemp(prefix="copy-", dir=folder.parent))
    try:
        shutil.copytree(shipped, copy, dirs_exist_ok=True)
        copy.rename(folder)
    except OSError:  # the other process was first, or the disk is full: then they are compiled
        shutil.rmtree(copy, ignore_errors=True)


def _forget_old(place: Path) -> None:
    """Remove all but the last used folders; a process that still needs one makes it again.

    Another process may be doing the same: a folder that is gone meanwhile is old.
    """
    folders = sorted(place.glob("kernels-*"), key=_last_used)
    for folder in folders[:-_KEPT]:
        shutil.rmtree(folder, ignore_errors=True)


def _last_used(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except FileNotFoundError:
        return 0.0


@contextmanager
def _cached_in(folder: Path) -> Iterator[None]:
    """Numba's setting NUMBA_CACHE_DIR, which it reads where a function is decorated."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before
