"""``wingfit export``: take the calibrated model of a run or diagnosis away."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast, get_args

import typer

from wingfit.cli.base import options as o
from wingfit.cli.base.output import next_step, note, size
from wingfit.client.client import DEFAULT_URL, Client
from wingfit.client.export_answers import ModelFormat

FORMATS = get_args(ModelFormat)


def export(
    job_id: Annotated[
        str, typer.Argument(metavar="RUN_OR_DIAGNOSIS", help="Id of a run or diagnosis that has succeeded.")
    ],
    format_name: Annotated[str, typer.Option("--format", help="python, tables, fmu or json.")] = "python",
    output: Annotated[
        Path, typer.Option("--output", "-o", help="File, or folder in which the file gets the name of the rig.")
    ] = Path(),
    hypothesis: Annotated[
        str | None,
        typer.Option(
            help='Of a diagnosis: effects joined by "+", or "nominal"; needed where the verdict names none for certain.'
        ),
    ] = None,
    url: o.Url = DEFAULT_URL,
) -> None:
    """Take a calibrated model away, as a file that needs no wingfit.

    It has the parameters with their covariance, the fitted range of conditions, and where it comes from.

    Example: wingfit export run_669b16f6b6139e76 --output model.py
    """
    if format_name not in FORMATS:
        raise typer.BadParameter(f"{format_name}: must be one of {', '.join(FORMATS)}", param_hint="--format")
    if not output.is_dir() and not output.parent.exists():
        raise typer.BadParameter(f"there is no folder {output.parent}; create it first", param_hint="--output")
    with Client(url) as client:
        path = client.export_model(job_id, cast(ModelFormat, format_name), output, hypothesis=hypothesis)
    note(f"{path}, {size(path.stat().st_size)}")
    if format_name == "python":
        next_step(f"wingfit export {job_id} --format tables")
    else:
        next_step(f"wingfit export {job_id} --format python")
