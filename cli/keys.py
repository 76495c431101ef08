"""``wingfit keys``: who may use a server that other machines can reach."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wingfit.cli.base.output import AsJson, Url, moment, note, print_json, say, table
from wingfit.client.client import DEFAULT_URL, Client, WingfitError
from wingfit.client.key_answers import Key, NewKey

app = typer.Typer(no_args_is_help=True, help="Make, list and revoke API keys.")

SCOPES = ("read", "write", "admin")
Data = Annotated[
    Path | None,
    typer.Option(help="Folder of a server that is not running: how the first key is made. Else the server is asked."),
]


@app.command()
def create(
    name: Annotated[str, typer.Argument(help="What it is for.")],
    owner: Annotated[
        str | None, typer.Option(help="To whom belongs what is made with it; the name if left out.")
    ] = None,
    scope: Annotated[
        list[str] | None,
        typer.Option(help="read, write, or admin (everyone's data, and keys); repeatable; read and write if left out."),
    ] = None,
    data: Data = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Make a key and print its secret, which is told this once.

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
    if as_json:
        print_json(made)
        return
    say(made["secret"])
    note(
        f"key {made['id']} of {made['owner']!r}, good for {', '.join(made['scopes'])}; it is not shown again. "
        "Use it: export WINGFIT_API_KEY=..., or paste it into the page"
    )


@app.command("list")
def list_(url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """List all keys, without their secrets.

    Example: wingfit keys list
    """
    with Client(url) as client:
        found = client.keys()
    if as_json:
        print_json(found)
        return
    table(["id", "name", "owner", "good for", "made", "revoked"], [_row(key) for key in found], "no keys")


@app.command()
def revoke(key_id: Annotated[str, typer.Argument(help="From 'wingfit keys list'.")], url: Url = DEFAULT_URL) -> None:
    """Make a key good for nothing, at once; what was made with it stays.

    Example: wingfit keys revoke KEY_ID
    """
    with Client(url) as client:
        found = client.revoke_key(key_id)
    say(f"key {found['id']} revoked at {moment(found['revoked_at'])}")


def _row(key: Key) -> list[str]:
    return [
        key["id"],
        key["name"],
        key["owner"],
        ", ".join(key["scopes"]),
        moment(key["created_at"]),
        moment(key["revoked_at"]),
    ]


def _here(data: Path, name: str, owner: str, scopes: list[str]) -> NewKey:
    """Make a key in the folder of a server that is not running."""
    from wingfit.service.auth import keys  # the database waits until it is needed
    from wingfit.service.storage.database import Database, DataFolderError

    try:
        database = Database(data)
    except DataFolderError as error:
        remedy = "a server that runs is asked without --data, with WINGFIT_API_KEY set to a key that manages keys"
        raise WingfitError("no key was made", f"{error}; {remedy}") from None
    try:
        with database.write() as session:
            row, secret = keys.make(session, name, owner, scopes)  # type: ignore[arg-type]  # checked above
    finally:
        database.close()
    return {
        "id": row.id,
        "name": row.name,
        "owner": row.owner,
        "scopes": row.scopes,
        "created_at": row.created_at,
        "revoked_at": row.revoked_at,
        "secret": secret,
    }
