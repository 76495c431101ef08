"""The database: one process owns the data folder, one connection writes, others only read.

SQLite before 3.51.3 can corrupt a database in WAL mode when two connections write or checkpoint at the same
time. Therefore readers are opened read-only, and the folder is locked against a second server.
"""

from __future__ import annotations

import errno
import fcntl
import os
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import IO, Any, ClassVar, cast
from urllib.parse import quote

from alembic import command
from alembic.config import Config
from alembic.script import ScriptDirectory
from alembic.util import CommandError
from sqlalchemy import Engine, create_engine, event
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session
from sqlalchemy.pool import QueuePool, StaticPool

from wingfit.client import private_files
from wingfit.service.auth.access import OwnSession
from wingfit.service.storage import fail_points
from wingfit.service.storage.disk_space import FULL

FILE_NAME = "wingfit.sqlite3"
LOCK_NAME = "wingfit.lock"
BUSY_SECONDS = 10.0  # that a statement waits for a lock
WRITER, READER = ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON"), ("query_only=ON",)
READERS = 16


class DataFolderError(RuntimeError):
    """Raised when the data folder cannot be used; the message says why and what to do."""


class DatabaseClosedError(RuntimeError):
    """Raised by reads and writes while the service stops; steps not stored are computed again after the next start."""


def is_full(error: Exception) -> bool:
    """Return whether ``error`` means that the disk is full or had an I/O error, so that a later attempt may succeed."""
    if isinstance(error, OSError):
        return error.errno in FULL
    text = str(getattr(error, "orig", error))
    return isinstance(error, OperationalError | sqlite3.OperationalError) and any(
        sign in text for sign in ("is full", "disk I/O error")
    )


class FolderLock:
    """Lock on a data folder, which only one server process may use at a time; held until :meth:`close`.

    A POSIX record lock ends with its process and is not inherited by worker processes. It does not stop the same
    process from locking twice, therefore the class attribute ``_held`` lists the files that this process has locked.
    """

    _held: ClassVar[set[Path]] = set()

    def __init__(self, folder: Path) -> None:
        self.path = (folder / LOCK_NAME).resolve()
        if self.path in self._held:
            raise DataFolderError(f"this process already serves the data folder {folder}")
        try:
            private_files.make_file(self.path)
            self._file: IO[str] = self.path.open("a+", encoding="ascii")
        except OSError as error:
            raise DataFolderError(
                f"cannot write into the data folder {folder}: {error.strerror}; set WINGFIT_DATA to one that you can "
                "write into"
            ) from None
        try:
            fcntl.lockf(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in (errno.EACCES, errno.EAGAIN):
                self._file.close()
                raise DataFolderError(
                    f"the data folder {folder} cannot be locked ({error.strerror}), as on some network file systems; "
                    "set WINGFIT_DATA to a folder on a disk of this machine"
                ) from None
            self._file.seek(0)
            owner = self._file.read().strip() or "unknown"
            self._file.close()
            raise DataFolderError(
                f"another wingfit server (process {owner}) uses the data folder {folder}; stop it, or set "
                "WINGFIT_DATA to another folder"
            ) from None
        self._file.truncate(0)
        self._file.write(f"{os.getpid()}\n")
        self._file.flush()
        self._held.add(self.path)

    def close(self) -> None:
        """Unlock the folder."""
        self._held.discard(self.path)
        self._file.close()


class Database:
    """The open database of a data folder. Many sessions can read at a time, only one can write."""

    def __init__(self, folder: Path) -> None:
        """Lock ``folder`` (created if missing), migrate its database to the newest schema and open it.

        Only the user who runs the process can then read the folder. DataFolderError if it cannot be used.
        """
        try:
            make_folder(folder)
        except OSError as error:
            raise DataFolderError(
                f"cannot create the data folder {folder}: {error.strerror}; set WINGFIT_DATA"
            ) from None
        self._lock = FolderLock(folder)
        self._guard = threading.Lock()
        self._closed = self._released = False
        path = (folder / FILE_NAME).resolve()
        try:
            _close_to_others(path)
            self._writer = _engine(f"sqlite:///{path}", "BEGIN IMMEDIATE", WRITER, poolclass=StaticPool)
            migrate(self._writer)
        except Exception as error:
            self._lock.close()
            if isinstance(error, DataFolderError):
                raise
            raise DataFolderError(f"cannot open the database {path}: {error}") from error
        url = f"sqlite:///file:{quote(str(path))}?mode=ro&uri=true"
        self._readers = _engine(url, "BEGIN", READER, poolclass=QueuePool, pool_size=READERS, max_overflow=READERS)
        # Without a limit, because the event loop must not wait for a connection.
        self._lookers = _engine(url, "BEGIN", READER, poolclass=QueuePool, pool_size=READERS, max_overflow=-1)
        self.version = 0
        """Changes with every write."""

    @contextmanager
    def write(self) -> Iterator[Session]:
        """Open a session for one write transaction: stored durably when the block ends, undone if the block raises.

        Only one write runs at a time. Queries return only the rows that the caller may see, as in :meth:`read`.
        """
        with self._guard:
            if self._closed:
                raise DatabaseClosedError("the service is stopping")
            try:
                with OwnSession(self._writer, expire_on_commit=False) as session, session.begin():
                    yield session
                    fail_points.passing("commit")
            finally:
                self.version += 1
            fail_points.passing("committed")

    @contextmanager
    def read(self) -> Iterator[Session]:
        """Open a session for reading one consistent snapshot of the database.

        Queries return only the rows that :data:`wingfit.service.auth.access.CALLER`, who sent the request, may see.
        """
        if self._closed:
            raise DatabaseClosedError("the service is stopping")
        with OwnSession(self._readers, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def look(self) -> Iterator[sqlite3.Connection]:
        """Open a plain SQLite connection for fast reads of one consistent snapshot of the database.

        Queries return the rows of all owners, unless they select the caller's own rows themselves.
        """
        if self._closed:
            raise DatabaseClosedError("the service is stopping")
        with closing(self._lookers.raw_connection()) as pooled:
            connection = cast(sqlite3.Connection, pooled.driver_connection)
            connection.execute("BEGIN")
            try:
                yield connection
            finally:
                connection.execute("ROLLBACK")

    def close(self, seconds: float = -1) -> bool:
        """Refuse further reads and writes; after the current write, close all connections and unlock the folder.

        Returns whether the current write ended within ``seconds`` (negative: no limit); if not, everything stays open.
        """
        self._closed = True
        if not self._guard.acquire(timeout=seconds):
            return False
        try:
            if not self._released:
                self._released = True
                self._readers.dispose()
                self._lookers.dispose()
                self._writer.dispose()
                self._lock.close()
        finally:
            self._guard.release()
        return True


def make_folder(folder: Path) -> None:
    """Create the data folder ``folder``, or remove other users' access to an existing one."""
    private_files.make_folder(folder, FILE_NAME, LOCK_NAME)


def _close_to_others(path: Path) -> None:
    """Let only the owner read the database file at ``path`` (created if missing) and SQLite's files beside it."""
    private_files.make_file(path)
    for name in (f"{path}-wal", f"{path}-shm"):  # SQLite creates them with the permissions of the database
        with suppress(FileNotFoundError):
            private_files.tighten(Path(name))


def revisions() -> list[str]:
    """Return the versions of the database schema that this wingfit knows, e.g. "0003", oldest first."""
    return [script.revision for script in ScriptDirectory.from_config(_migrations()).walk_revisions()][::-1]


def _migrations() -> Config:
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    return config


def migrate(engine: Engine, revision: str = "head") -> None:
    """Migrate the database schema to ``revision``; DataFolderError if a newer wingfit wrote the database."""
    config = _migrations()
    script = ScriptDirectory.from_config(config)
    with engine.connect() as connection:
        config.attributes["connection"] = connection
        try:
            command.upgrade(config, revision)
        except CommandError as error:
            raise DataFolderError(
                f"a newer wingfit wrote the database (this one knows schema {script.get_current_head()}): "
                f"{error}; install the newer wingfit, or set WINGFIT_DATA to another folder"
            ) from None
        connection.commit()


def _engine(url: str, begin: str, pragmas: Sequence[str], **pool: Any) -> Engine:
    """Create the SQLAlchemy engine for ``url``; each new connection runs the SQLite ``pragmas``.

    ``begin``: the SQL statement that starts each transaction; ``pool``: arguments about the connection pool.
    """
    engine = create_engine(url, connect_args={"check_same_thread": False, "timeout": BUSY_SECONDS}, **pool)

    def prepare(connection: sqlite3.Connection, _record: Any) -> None:
        # The driver must not begin transactions itself: schema changes and reads are part of ours.
        connection.isolation_level = None
        for pragma in pragmas:
            connection.execute(f"PRAGMA {pragma}")

    event.listen(engine, "connect", prepare)
    event.listen(engine, "begin", lambda connection: connection.exec_driver_sql(begin))
    return engine
