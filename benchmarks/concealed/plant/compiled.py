"""Numba compilation for the plant (the simulator that produces the test data), cached on disk by source hash."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def _folder() -> Path:
    """Cache folder for compiled code, named after a hash of the sources; OSError if none is writable.

    Numba itself does not notice a change in a function called from another file.
    """
    here = Path(__file__).resolve().parent
    sources = [text for text in (file.read_bytes() for file in sorted(here.rglob("*.py"))) if b"@compiled" in text]
    digest = hashlib.sha256(b"".join(sources)).hexdigest()[:16]
    for base in (Path(numba.config.CACHE_DIR or here / "__pycache__"), Path(tempfile.gettempdir())):
        folder = base / f"plant-{digest}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        return folder
    raise OSError("no folder to cache compiled code in is writable; set NUMBA_CACHE_DIR to a writable folder")


_CACHE = _folder()


def compiled(function: F) -> F:
    """Decorator that compiles ``function`` by numba to run without the GIL; floating-point sums may be reordered."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_CACHE)
    try:
        made = numba.njit(
            cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy", nogil=True
        )(function)  # fmt: skip
    finally:
        numba.config.CACHE_DIR = before
    return cast(F, made)
