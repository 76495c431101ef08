"""Copies of the database: taken while the service works, checked, and put back."""

from __future__ import annotations

import errno
import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from tempfile import mkstemp
from urllib.parse import quote

from service.database import FILE_NAME, Database, DataFolderError, FolderLock, make_folder
from service.permissions import FILE, open_new

SUFFIX = ".backup"


class BackupError(RuntimeError):
    """A copy that cannot be taken or put back; the message says why and what to do."""


def snapshot(folder: Path) -> Path:
    """A copy of the database in ``folder`` as it is now, in a file of its own there, checked; the caller removes it.

    One reading transaction: what is written meanwhile goes on, and is not in the copy.
    """
    try:
        handle, name = mkstemp(SUFFIX, "copy-", folder)
    except OSError as error:
        raise BackupError(f"cannot write into {folder}: {error.strerror}") from error
    os.fchmod(handle, FILE)  # whatever the umask
    os.close(handle)
    target = Path(name)
    try:
        source = sqlite3.connect(f"file:{quote(str(folder / FILE_NAME))}?mode=ro", uri=True)
        with closing(source), closing(sqlite3.connect(target)) as copy:
            source.backup(copy)
            copy.execute("PRAGMA journal_mode=DELETE")  # one file, without a log beside it
        check(target)
    except (OSError, sqlite3.Error) as error:
        target.unlink(missing_ok=True)
        raise BackupError(f"the database cannot be copied ({error}); is the disk full?") from error
    except BackupError:
        target.unlink(missing_ok=True)
        raise
    return target


def forget_snapshots(folder: Path) -> None:
    """Remove copies that a process left when it was killed."""
    for left in folder.glob(f"copy-*{SUFFIX}"):
        left.unlink(missing_ok=True)


def check(path: Path) -> None:
    """BackupError unless ``path`` is a whole database of this service."""
    try:
        with closing(sqlite3.connect(f"file:{quote(str(path))}?mode=ro&immutable=1", uri=True)) as copy:
            (found,) = copy.execute("PRAGMA integrity_check(1)").fetchone()
            versions = copy.execute("SELECT version_num FROM alembic_version").fetchall()
    except sqlite3.Error as error:
        raise BackupError(f"{path} is no backup of wingfit, or is damaged: {error}; take another one") from None
    if found != "ok" or len(versions) != 1:
        raise BackupError(f"{path} is damaged: {found}; take another one")


def restore(backup: Path, folder: Path) -> None:
    """Put a copy into a data folder that has no database; BackupError says why not.

    Jobs that were under way go on from their last stored step when a server starts there.
    """
    if not backup.is_file():
        raise BackupError(f"{backup} is no file; name what 'wingfit backup' wrote")
    check(backup)
    target = folder / FILE_NAME
    try:
        make_folder(folder)
        lock = FolderLock(folder)
    except DataFolderError as error:
        raise BackupError(str(error)) from None
    except OSError as error:
        raise BackupError(f"cannot use the folder {folder}: {error.strerror}") from None
    try:
        present = [path.name for path in folder.glob(f"{FILE_NAME}*")]
        if present:
            raise BackupError(
                f"{folder} holds {', '.join(sorted(present))} already; move that away, or name another folder"
            )
        _copied(backup, target)
    finally:
        lock.release()
    try:
        Database(folder).close()  # to the newest schema, or a refusal of one that is newer
    except DataFolderError as error:
        target.unlink(missing_ok=True)
        raise BackupError(str(error)) from None


def move(copy: Path, target: Path) -> None:
    """Move ``copy`` to ``target``, also into another file system; only its owner can read it there either."""
    try:
        copy.replace(target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        _copied(copy, target)
    finally:
        copy.unlink(missing_ok=True)


def _copied(backup: Path, target: Path) -> None:
    """Copy whole or not at all."""
    part = target.with_suffix(".part")
    try:
        with backup.open("rb") as source, open_new(part) as into:
            shutil.copyfileobj(source, into)
            into.flush()
            os.fsync(into.fileno())
        part.replace(target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise BackupError(f"cannot write {target}: {error.strerror}") from error
