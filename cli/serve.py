"""``wingfit serve``: starts the server."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from wingfit.client.client import WingfitError


def serve(
    ctx: typer.Context,
    data: Annotated[
        Path | None, typer.Option(help="Folder of the database; default: $WINGFIT_DATA or ./wingfit-data.")
    ] = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on; default 127.0.0.1.")] = None,
    port: Annotated[int | None, typer.Option(help="TCP port; default 8321; 0: any free port.")] = None,
    evaluator: Annotated[str | None, typer.Option(help="ray (default), processes or in_process.")] = None,
    workers: Annotated[int | None, typer.Option(help="Worker processes; default: one per core.")] = None,
    ray_address: Annotated[str | None, typer.Option(help="Existing Ray cluster; default: start one.")] = None,
) -> None:
    """Serve the API and the page until Ctrl-C; unfinished runs continue at the next start.

    Example: wingfit serve --data ~/wingfit-data --port 8321
    """
    from wingfit.service.server import ServeError  # imported late: other commands start faster
    from wingfit.service.server import serve as run_server
    from wingfit.service.settings import Settings, SettingsError

    chosen = {f"WINGFIT_{name.upper()}": str(value) for name, value in ctx.params.items() if value is not None}
    try:
        settings = Settings.from_env(dict(os.environ) | chosen)
    except SettingsError as error:
        raise typer.BadParameter(str(error)) from error
    try:
        run_server(settings)
    except ServeError as error:
        raise WingfitError("the server does not start", str(error)) from error
