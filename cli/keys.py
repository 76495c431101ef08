"""``wingfit keys``: manages the API keys of a server that other machines can reach."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated, cast

import typer

from wingfit.cli.base.options import AsJson, Url
from wingfit.cli.base.output import Columns, emit, moment, next_step, note, records, say
from wingfit.client.client import DEFAULT_URL, Client, WingfitError
from wingfit.client.key_answers import Key, NewKey

app = typer.Typer(no_args_is_help=True, help="Create, list and revoke API keys.")

SCOPES = ("read", "write", "admin")
Data = Annotated[
    Path | None,
    typer.Option(help="Data folder of a stopped server, for the first key; default: use the running server."),
]


@app.command()
def create(
    name: Annotated[str, typer.Argument(help="Name of the key, e.g. its purpose.")],
    owner: Annotated[str | None, typer.Option(help="Owner of everything created with the key; default: NAME.")] = None,
    scope: Annotated[
        list[str] | None,
        typer.Option(help="read, write, or admin (all owners' data, and keys); repeatable; default: read and write."),
    ] = None,
    data: Data = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Create a key and print its secret, which is not shown again.

    Example: wingfit keys create bench --owner tunnel-group --data ~/wingfit-data
    """
    scopes = scope or ["read", "write"]
    for given in scopes:
        if given not in SCOPES:
            raise typer.BadParameter(f"{given!r} is none of {', '.join(SCOPES)}", param_hint="--scope")
    if not name.strip() or (owner is not None and not owner.strip()):
        raise typer.BadParameter("a name is empty", param_hint="NAME")
    if data is not None:
        made = _here(data, name, owner or name, scopes)
    else:
        with Client(url) as client:
            made = client.create_key(name, owner=owner, scopes=scopes)
    emit(made, _created, as_json=as_json, then="export WINGFIT_API_KEY=...")


@app.command("list")
def list_(url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """List all keys, without their secrets.

    Example: wingfit keys list
    """
    with Client(url) as client:
        emit(client.keys(), _list, as_json=as_json, then="wingfit keys create NAME, or wingfit keys revoke KEY_ID")


@app.command()
def revoke(key_id: Annotated[str, typer.Argument(help="From 'wingfit keys list'.")], url: Url = DEFAULT_URL) -> None:
    """Revoke a key at once; the data created with it are kept.

    Example: wingfit keys revoke KEY_ID
    """
    with Client(url) as client:
        key = client.revoke_key(key_id)
    say(f"key {key['id']} revoked at {moment(key['revoked_at'])}")
    next_step("wingfit keys list")


def _created(key: NewKey) -> None:
    say(key["secret"])
    note(
        f"key {key['id']} of {key['owner']!r}, scopes {', '.join(key['scopes'])}; the secret is not shown again. "
        "Paste it into the page, or use it in the shell"
    )


def _list(keys: list[Key]) -> None:
    columns: Columns[Key] = {
        "id": "id",
        "name": "name",
        "owner": "owner",
        "scopes": lambda key: ", ".join(key["scopes"]),
        "created": lambda key: moment(key["created_at"]),
        "revoked": lambda key: moment(key["revoked_at"]),
    }
    records(keys, columns, "no keys")


def _here(data: Path, name: str, owner: str, scopes: list[str]) -> NewKey:
    """Create a key in ``data``, the data folder of a server that is not running, and return the key with its secret."""
    from wingfit.service.auth import keys  # imported late: other commands start faster
    from wingfit.service.storage.database import Database, DataFolderError

    try:
        database = Database(data)
    except DataFolderError as error:
        remedy = "for a running server leave out --data, and set WINGFIT_API_KEY to an admin key"
        raise WingfitError("no key was made", f"{error}; {remedy}") from None
    with closing(database), database.write() as session:
        row, secret = keys.make(session, name, owner, scopes)  # type: ignore[arg-type]  # checked above
    names = ("id", "name", "owner", "scopes", "created_at", "revoked_at")
    return cast("NewKey", {name: getattr(row, name) for name in names} | {"secret": secret})
