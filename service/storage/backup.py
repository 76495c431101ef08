"""Makes backups (checked copies of the database, taken while the service runs), and restores them."""

from __future__ import annotations

import errno
import os
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory, mkstemp
from urllib.parse import quote

from wingfit.client.private_files import FILE, open_new
from wingfit.service.storage.backup_contents import Contents, ContentsError, contents, revoke_keys
from wingfit.service.storage.backup_rows import RowError, check_rows
from wingfit.service.storage.backup_schema import SchemaError, check_schema
from wingfit.service.storage.database import FILE_NAME, Database, DataFolderError, FolderLock, make_folder

SUFFIX = ".backup"
STAGING = "restore-"


class BackupError(RuntimeError):
    """Raised when a backup cannot be made or restored; the message says why and what to do."""


def snapshot(folder: Path) -> Path:
    """Copy the database in ``folder`` to a new file there, check it, and return its path; the caller removes the file.

    The copy is the state at one moment: later writes are not delayed, and are not in the copy. BackupError on failure.
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
    """Remove the copies of the database in ``folder`` that a killed process did not remove."""
    for left in folder.glob(f"copy-*{SUFFIX}"):
        left.unlink(missing_ok=True)


def check(path: Path) -> None:
    """Raise BackupError unless the file ``path`` is a complete, undamaged database of this service."""
    with _opened(path, path) as copy:
        versions = copy.execute("SELECT version_num FROM alembic_version").fetchall()
        if len(versions) != 1:
            raise BackupError(f"{path} is no backup of wingfit; take another one")
        _check_pages(copy, path)


def restore(backup: Path, folder: Path, *, keep_keys: bool = False) -> Contents:
    """Restore the file ``backup`` into the data folder ``folder``, which must hold no database; BackupError on failure.

    The backup is not trusted: it must be undamaged, and its schema must be exactly that of wingfit. Its API keys are
    revoked unless ``keep_keys``, because others may have them. Returns the keys that were valid in the backup and the
    owners of its data. Jobs continue after their last stored step when a server starts in the folder.
    """
    if not backup.is_file():
        raise BackupError(f"{backup} is no file; name what 'wingfit backup' wrote")
    target = folder / FILE_NAME
    try:
        make_folder(folder)
        lock = FolderLock(folder)
    except DataFolderError as error:
        raise BackupError(str(error)) from None
    except OSError as error:
        raise BackupError(f"cannot use the folder {folder}: {error.strerror}") from None
    with closing(lock):
        present = [path.name for path in folder.glob(f"{FILE_NAME}*")]
        if present:
            raise BackupError(
                f"{folder} holds {', '.join(sorted(present))} already; move that away, or name another folder"
            )
        return _put(backup, target, keep_keys)


def _put(backup: Path, target: Path, keep_keys: bool) -> Contents:
    """Copy ``backup`` to the file ``target`` if the copy passes all checks; return its keys and the owners of its data.

    The copy is checked, not the original, which other processes may change; and in a separate folder, so that a crash
    leaves no unchecked database where a server would open it. ``keep_keys``: whether the API keys stay valid.
    """
    for left in target.parent.glob(f"{STAGING}*"):  # by a process that was killed
        shutil.rmtree(left, ignore_errors=True)
    with TemporaryDirectory(prefix=STAGING, dir=target.parent) as name:
        staged = Path(name) / target.name
        _copied(backup, staged)
        brought = _examined(staged, backup)
        if not keep_keys:
            with _opened(staged, backup, "rw") as copy, copy:
                revoke_keys(copy)
        try:
            with closing(Database(staged.parent)) as database:  # migrates it to the newest schema
                check_rows(database)
        except (DataFolderError, RowError) as error:
            raise BackupError(f"{backup} is not put back: {error}") from None
        staged.replace(target)
    return brought


def _examined(copy: Path, name: Path) -> Contents:
    """Check the file ``copy``; return its keys and the owners of its data. BackupError if it is no database of wingfit.

    ``name``: the original file, which messages name.
    """
    with _opened(copy, name) as opened:
        try:
            check_schema(opened)  # first: reading a table could run SQL of the schema
            _check_pages(opened, name)
            return contents(opened)
        except (SchemaError, ContentsError) as error:
            raise BackupError(f"{name} is not put back: {error}") from None


@contextmanager
def _opened(path: Path, name: Path, mode: str = "ro&immutable=1") -> Iterator[sqlite3.Connection]:
    """Open the database file ``path``, which is not trusted, read-only unless ``mode`` ("rw") says otherwise.

    Errors of SQLite within the block become a BackupError about ``name``, the file that the user knows.
    """
    try:
        with closing(sqlite3.connect(f"file:{quote(str(path))}?mode={mode}", uri=True)) as copy:
            copy.text_factory = lambda text: text.decode(errors="replace")
            copy.execute("PRAGMA trusted_schema=OFF")
            copy.execute("PRAGMA cell_size_check=ON")
            yield copy
    except sqlite3.Error as error:
        raise BackupError(f"{name} is no backup of wingfit, or is damaged: {error}; take another one") from None


def _check_pages(copy: sqlite3.Connection, name: Path) -> None:
    (found,) = copy.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok":
        raise BackupError(f"{name} is damaged: {found}; take another one")


def move(copy: Path, target: Path) -> None:
    """Move the file ``copy`` to ``target``, also to another file system; only its owner can read it."""
    try:
        copy.replace(target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        _copied(copy, target)
    finally:
        copy.unlink(missing_ok=True)


def _copied(backup: Path, target: Path) -> None:
    """Copy the file ``backup`` to the new file ``target``; if that fails, remove the incomplete copy."""
    try:
        with backup.open("rb") as source, open_new(target) as into:
            shutil.copyfileobj(source, into)
            into.flush()
            os.fsync(into.fileno())
    except OSError as error:
        target.unlink(missing_ok=True)
        raise BackupError(f"cannot write {target}: {error.strerror}") from error
