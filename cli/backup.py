"""``wingfit backup`` and ``wingfit restore``: a copy of everything, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wingfit.cli.base.output import Url, moment, note, progress, say, table
from wingfit.cli.datasets import size
from wingfit.client.client import DEFAULT_URL, Client, WingfitError

if TYPE_CHECKING:
    from wingfit.service.storage.backup_contents import Contents


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
    from wingfit.service.storage.backup import BackupError, check  # the database waits until it is needed

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
    keep_keys: Annotated[
        bool, typer.Option("--keep-keys", help="Let the API keys of the backup in as before; else they are revoked.")
    ] = False,
) -> None:
    """Put a backup into an empty data folder; jobs that were under way go on when a server starts there.

    Prints the API keys that are good in the backup, and whose data it brings.

    Example: wingfit restore wings.sqlite3 --data wingfit-data
    """
    from wingfit.service.storage.backup import BackupError
    from wingfit.service.storage.backup import restore as put_back

    try:
        brought = put_back(file, data, keep_keys=keep_keys)
    except BackupError as error:
        raise WingfitError("nothing was restored", str(error)) from None
    _list(brought)
    note(_about_keys(len(brought.keys), data, keep_keys))
    note(f"restored into {data}; start it: wingfit serve --data {data}")


def _list(brought: Contents) -> None:
    say("API keys that are good in the backup:")
    keys = [[key.id, key.name, key.owner, ", ".join(key.scopes), moment(key.created_at)] for key in brought.keys]
    table(["id", "name", "owner", "good for", "made"], keys)
    say("owners of what is in it:")
    owners = [
        ["(no key)" if one.owner is None else one.owner, str(one.datasets), str(one.runs), str(one.diagnoses)]
        for one in brought.owners
    ]
    table(["owner", ">datasets", ">runs", ">diagnoses"], owners, "nobody: there is no data")


def _about_keys(count: int, data: Path, keep_keys: bool) -> str:
    make = f"make a new one: wingfit keys create NAME --scope admin --data {data}"
    if not count:
        return f"the backup brings no good API key; where the server needs one, {make}"
    if keep_keys:
        return f"{count} API keys of the backup are good in {data} too: whoever has one gets in"
    return (
        f"{count} API keys of the backup are revoked in {data}: whoever made the backup may have them. "
        f"If you trust it, restore with --keep-keys into another folder; else {make}"
    )


def _copy_of(data: Path, file: Path) -> None:
    """Copy the database in the folder of a server that is not running."""
    from wingfit.service.storage.backup import BackupError, move, snapshot
    from wingfit.service.storage.database import FILE_NAME, DataFolderError, FolderLock

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
