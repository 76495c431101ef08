"""How the plant's loops are compiled: cached on disk under the content of all compiled files."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def _folder() -> Path:
    """Named after what is compiled: numba itself would not notice a change in a file that is called into."""
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
    raise OSError("compiled code cannot be kept: set NUMBA_CACHE_DIR to a folder that can be written")


_CACHE = _folder()


def compiled(function: F) -> F:
    """Compile ``function``; sums may be reordered. OSError where no cache can be written."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(_CACHE)
    try:
        made = numba.njit(
            cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy", nogil=True
        )(function)  # fmt: skip
    finally:
        numba.config.CACHE_DIR = before
    return cast(F, made)
