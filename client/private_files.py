"""Who on the machine may read what the service stores: only the user who runs it, whatever his umask."""

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
    """Create ``folder`` for its owner alone, or close one that exists to all other users.

    An existing folder is closed only if it is ours and is empty or holds one of ``names``: any other may serve other
    programs too. Where it stays open, as a volume of Kubernetes that belongs to root does, a warning is logged.
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
    """Create ``path``, empty, for its owner alone, or close one that exists to all other users."""
    try:
        open(path, "xb", opener=_private).close()
    except FileExistsError:
        tighten(path)


def open_new(path: Path) -> IO[bytes]:
    """Open ``path`` for writing, as a new file that only its owner can read."""
    path.unlink(missing_ok=True)  # an existing one would keep its rights, and its readers
    return open(path, "xb", opener=_private)


def _private(name: str, flags: int) -> int:
    handle = os.open(name, flags, FILE)
    os.fchmod(handle, FILE)  # the umask may have taken rights from the owner
    return handle


def tighten(path: Path, *, ours: bool = True) -> None:
    """Take all rights on ``path`` from other users, and log it; only a warning where that must not or cannot be."""
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
