"""Texts of the error messages that name the folder when the server's disk is full, and say what to do."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
# A folder in which no file can be created.
UNUSABLE = frozenset({errno.ENOENT, errno.ENOTDIR, errno.EACCES, errno.EPERM, errno.EROFS})
REMEDY = "make room there, or set TMPDIR to a folder with room and restart the server; then repeat the request"


def while_spooling(error: BaseException | None) -> str | None:
    """Return the message for an error that occurred while a request was read; None for errors of another kind.

    The web framework writes large parts of a request to temporary files, which fails if their disk is full.
    """
    if not isinstance(error, OSError):
        return None
    if error.errno in FULL:
        return f"the folder for temporary files of the server, {_temporary()}, is full ({error.strerror}): {REMEDY}"
    if error.errno in UNUSABLE:
        place = f", {os.fsdecode(error.filename)}" if isinstance(error.filename, str | bytes) else ""
        return f"the server has no folder for temporary files that it can use ({error.strerror}{place}): {REMEDY}"
    return None


def anywhere(error: BaseException) -> str | None:
    """Return the message for an error that occurred anywhere in a request; None unless the disk is full."""
    if not isinstance(error, OSError):
        return None
    if isinstance(error, FileNotFoundError) and "temporary directory" in str(error.strerror):
        return while_spooling(error)
    if error.errno not in FULL:
        return None
    place = Path(os.fsdecode(error.filename)).parent if isinstance(error.filename, str | bytes) else _temporary()
    return f"the disk of the server is full ({error.strerror}), at {place}: {REMEDY}"


def _temporary() -> str:
    try:
        return tempfile.gettempdir()
    except FileNotFoundError as error:
        return str(error.strerror)
