"""Creates files and folders that only the user who runs this process can read, whatever the umask."""

from __future__ import annotations

import logging
import os
import stat
from pathlib import Path
from typing import IO

LOG = logging.getLogger("wingfit")
FOLDER, FILE = 0o700, 0o600
OTHERS = 0o077  # all rights of the group and of everybody


def make_folder(folder: Path, *names: str) -> None:
    """Create ``folder`` with access for its owner only, or remove other users' access to an existing one.

    An existing folder is changed only if this user owns it and it is empty or contains a file named in ``names``; any
    other folder may be used by other programs. If the folder stays accessible to others, a warning is logged.
    """
    try:
        folder.mkdir(FOLDER, parents=True)
    except FileExistsError:
        if not folder.is_dir():
            raise
        tighten(folder, ours=_is_ours(folder, names))
    else:
        folder.chmod(FOLDER)  # the umask may have taken rights from the owner


def _is_ours(folder: Path, names: tuple[str, ...]) -> bool:
    try:
        present = {path.name for path in folder.iterdir()}
    except PermissionError:
        return False
    return not present or not present.isdisjoint(names)


def make_file(path: Path) -> None:
    """Create the empty file ``path`` for its owner only, or remove other users' rights on an existing file."""
    try:
        open(path, "xb", opener=_private).close()
    except FileExistsError:
        tighten(path)


def open_new(path: Path) -> IO[bytes]:
    """Create the file ``path`` anew, with access for its owner only, and return it open for writing (binary)."""
    path.unlink(missing_ok=True)  # an existing one would keep its rights, and its readers
    return open(path, "xb", opener=_private)


def _private(name: str, flags: int) -> int:
    handle = os.open(name, flags, FILE)
    os.fchmod(handle, FILE)  # the umask may have taken rights from the owner
    return handle


def tighten(path: Path, *, ours: bool = True) -> None:
    """Remove all rights of other users on the file or folder ``path``, and log the change.

    Only log a warning if it is not ``ours`` (others may use it), belongs to another user, or cannot be changed.
    """
    found = path.stat()
    mode = stat.S_IMODE(found.st_mode)
    if not mode & OTHERS:
        return
    if ours and found.st_uid == os.geteuid():
        try:
            path.chmod(mode & ~OTHERS)
        except OSError as error:
            reason = error.strerror or str(error)
        else:
            LOG.info("%s was open to other users (mode %04o); now it is not (%04o)", path, mode, mode & ~OTHERS)
            return
    else:
        reason = "it holds other files" if found.st_uid == os.geteuid() else f"it belongs to user {found.st_uid}"
    LOG.warning("%s stays open to other users (mode %04o): %s; to close it: chmod go-rwx %s", path, mode, reason, path)
