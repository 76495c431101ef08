"""``wingfit backup`` and ``wingfit restore``: a copy of everything, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.client import DEFAULT_URL, Client, WingfitError
from service.commands.datasets import size
from service.commands.output import Url, note, progress


def backup(
    file: Annotated[Path, typer.Argument(help="Where to write the copy, e.g. wings.sqlite3.")],
    data: Annotated[
        Path | None, typer.Option(help="Folder of a server that is not running; else the server is asked.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite FILE.")] = False,
    url: Url = DEFAULT_URL,
) -> None:
    """Copy all datasets, runs, diagnoses and keys into one file, while the server works.

    Example: wingfit backup wings.sqlite3
    """
    if file.exists() and not force:
        raise WingfitError("no backup was made", f"{file} exists; name another file, or add --force")
    from service.backup import BackupError, check  # the database waits until it is needed

    try:
        if data is not None:
            _copy_of(data, file)
        else:
            with progress("copying") as tell, Client(url) as client:
                client.backup(file, on_bytes=lambda done, total: tell(done / max(total, 1), note=size(total)))
            check(file)
    except BackupError as error:
        raise WingfitError("no backup was made", str(error)) from None
    except OSError as error:
        raise WingfitError("no backup was made", f"cannot write {file}: {error.strerror}") from error
    note(f"{file}, {size(file.stat().st_size)}, whole and checked; wingfit restore {file} --data FOLDER puts it back")


def restore(
    file: Annotated[Path, typer.Argument(help="What 'wingfit backup' wrote.")],
    data: Annotated[Path, typer.Option(help="Data folder without a database, which is created if missing.")],
) -> None:
    """Put a backup into an empty data folder; jobs that were under way go on when a server starts there.

    Example: wingfit restore wings.sqlite3 --data wingfit-data
    """
    from service.backup import BackupError
    from service.backup import restore as put_back

    try:
        put_back(file, data)
    except BackupError as error:
        raise WingfitError("nothing was restored", str(error)) from None
    note(f"restored into {data}; start it: wingfit serve --data {data}")


def _copy_of(data: Path, file: Path) -> None:
    """Copy the database in the folder of a server that is not running."""
    from service.backup import BackupError, move, snapshot
    from service.database import FILE_NAME, DataFolderError, FolderLock

    if not (data / FILE_NAME).is_file():
        raise BackupError(f"{data} holds no {FILE_NAME}; name the data folder of a server")
    try:
        lock = FolderLock(data)
    except DataFolderError as error:
        raise BackupError(f"{error}; or ask that server: leave --data out") from None
    try:
        move(snapshot(data), file)
    finally:
        lock.release()
