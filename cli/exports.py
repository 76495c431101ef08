"""``wingfit runs export`` and ``wingfit diagnoses export``: all of a job as a file, or on standard output."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from wingfit.cli.base.files import check_file
from wingfit.cli.base.output import Url, note
from wingfit.cli.datasets import size
from wingfit.cli.forces.runs import RunId
from wingfit.client.client import DEFAULT_URL, Client
from wingfit.client.transport import ENDINGS, Format

STANDARD_OUTPUT = Path("-")
DiagnosisId = Annotated[str, typer.Argument(help="Id of a diagnosis, from 'wingfit diagnoses list'.")]
FormatName = Annotated[
    str, typer.Option("--format", help="json: all of it; csv: a table; netcdf: series and maps, which needs a file.")
]
Output = Annotated[Path, typer.Option("--output", "-o", help="File to write to; standard output if left out, or -.")]


def export_run(
    run_id: RunId, format_name: FormatName = "json", output: Output = STANDARD_OUTPUT, url: Url = DEFAULT_URL
) -> None:
    """Write a run as a file: csv has its history, netcdf also every recording as the best genome has it.

    Example: wingfit runs export ID --format csv -o history.csv
    """
    wanted = _checked(format_name, output)
    with Client(url) as client:
        _write(lambda path: client.export_run(run_id, wanted, path), output)


def export_diagnosis(
    diagnosis_id: DiagnosisId,
    format_name: FormatName = "json",
    output: Output = STANDARD_OUTPUT,
    url: Url = DEFAULT_URL,
) -> None:
    """Write a diagnosis that has succeeded as a file: csv has its ranking, netcdf its maps and misfits.

    Example: wingfit diagnoses export ID --format csv -o ranking.csv
    """
    wanted = _checked(format_name, output)
    with Client(url) as client:
        _write(lambda path: client.export_diagnosis(diagnosis_id, wanted, path), output)


def _checked(name: str, output: Path) -> Format:
    if name not in ENDINGS:
        raise typer.BadParameter(f"{name}: must be one of {', '.join(ENDINGS)}", param_hint="--format")
    if output != STANDARD_OUTPUT:
        check_file(output, "--output", (ENDINGS[name],))
    elif name == "netcdf":
        raise typer.BadParameter("netcdf is no text; name a file, -o FILE.nc", param_hint="--output")
    return name


def _write(save: Callable[[Path], Path], output: Path) -> None:
    """Whole or not at all, on standard output too."""
    if output == STANDARD_OUTPUT:
        with TemporaryDirectory(prefix="wingfit-") as scratch, save(Path(scratch) / "export").open("rb") as stream:
            sys.stdout.flush()
            shutil.copyfileobj(stream, sys.stdout.buffer)
        return
    save(output)
    note(f"{output}, {size(output.stat().st_size)}")
