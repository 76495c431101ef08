"""``wingfit backup`` and ``wingfit restore``: copy all data of a server into one file, and from it into a folder."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wingfit.cli.base.options import Url
from wingfit.cli.base.output import moment, next_step, note, progress, say, size, table
from wingfit.client.client import DEFAULT_URL, Client, WingfitError

if TYPE_CHECKING:
    from wingfit.service.storage.backup_contents import Contents

HELD = ("datasets", "runs", "diagnoses", "films", "trackings")


def backup(
    file: Annotated[Path, typer.Argument(help="File to write, e.g. wings.sqlite3.")],
    data: Annotated[
        Path | None, typer.Option(help="Data folder of a server that is not running; default: use the running server.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite FILE.")] = False,
    url: Url = DEFAULT_URL,
) -> None:
    """Copy the database into one file, while the server continues to work: all but the files of films.

    Example: wingfit backup wings.sqlite3
    """
    if file.exists() and not force:
        raise WingfitError("no backup was made", f"{file} exists; name another file, or add --force")
    from wingfit.service.storage.backup import BackupError, check  # imported late: other commands start faster

    try:
        if data is not None:
            _copy_of(data, file)
        else:
            with progress("copying") as report, Client(url) as client:
                client.backup(file, on_bytes=lambda done, total: report(done / max(total, 1), note=size(total)))
            check(file)
    except BackupError as error:
        raise WingfitError("no backup was made", str(error)) from None
    except OSError as error:
        raise WingfitError("no backup was made", f"cannot write {file}: {error.strerror}") from error
    note(f"{file}, {size(file.stat().st_size)}, complete and checked")
    next_step(f"wingfit restore {file} --data FOLDER")


def restore(
    file: Annotated[Path, typer.Argument(help="File that 'wingfit backup' wrote.")],
    data: Annotated[Path, typer.Option(help="Data folder without a database; created if missing.")],
    keep_keys: Annotated[
        bool, typer.Option("--keep-keys", help="Keep the API keys of the backup valid; default: revoke them.")
    ] = False,
) -> None:
    """Restore a backup into an empty data folder; unfinished jobs continue when a server starts there.

    Prints the valid API keys in the backup and the owners of its data.

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
    if films := sum(one.films for one in brought.owners):
        note(f"{films} film(s) came without their videos, which no backup has: copy the folder films of the old server")
    note(f"restored into {data}")
    next_step(f"wingfit serve --data {data}")


def _list(brought: Contents) -> None:
    say("valid API keys in the backup:")
    keys = [[key.id, key.name, key.owner, ", ".join(key.scopes), moment(key.created_at)] for key in brought.keys]
    table(["id", "name", "owner", "scopes", "created"], keys)
    say("owners of its data:")
    owners = [
        ["(no key)" if one.owner is None else one.owner, *(getattr(one, what) for what in HELD)]
        for one in brought.owners
    ]
    table(["owner", *(f">{what}" for what in HELD)], owners, "none: there is no data")


def _about_keys(count: int, data: Path, keep_keys: bool) -> str:
    make = f"create one: wingfit keys create NAME --scope admin --data {data}"
    if not count:
        return f"the backup has no valid API key; if the server needs one, {make}"
    if keep_keys:
        return f"{count} API keys of the backup are valid in {data} too: everyone who has one has access"
    return (
        f"{count} API keys of the backup are revoked in {data}: everyone who can read the backup may know them. "
        f"If you trust it, restore with --keep-keys into another folder; otherwise {make}"
    )


def _copy_of(data: Path, file: Path) -> None:
    """Copy the database in ``data``, the data folder of a server that is not running, to ``file``."""
    from wingfit.service.storage.backup import BackupError, move, snapshot
    from wingfit.service.storage.database import FILE_NAME, DataFolderError, FolderLock

    if not (data / FILE_NAME).is_file():
        raise BackupError(f"{data} holds no {FILE_NAME}; name the data folder of a server")
    try:
        lock = FolderLock(data)
    except DataFolderError as error:
        raise BackupError(f"{error}; or copy from the running server: leave --data out") from None
    with closing(lock):
        move(snapshot(data), file)
