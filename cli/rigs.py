"""``wingfit rig``: check a rig with a simulation of your own, and list those that are installed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wingfit.cli.base.output import next_step, note
from wingfit.client.client import WingfitError

app = typer.Typer(no_args_is_help=True, help="Check a rig with a simulation of your own, and list those installed.")

Reference = Annotated[
    str, typer.Argument(metavar="RIG", help="Python file (my_rig.py), package.module:rig, or the name of a plug-in.")
]
MARKS = {"pass": "ok", "warn": "warning", "fail": "FAILED"}


@app.command()
def check(
    reference: Reference,
    dataset: Annotated[Path, typer.Option(help="Folder, .zip or .nc with series that the rig simulates.")],
) -> None:
    """Check that a rig keeps its contract: shapes, determinism, effects off at zero, bounds, smoothness. Runs RIG.

    Example: wingfit rig check my_rig.py --dataset my-recordings
    """
    from wingfit.diagnosis.rig_check import check_rig  # imported late: other commands start faster
    from wingfit.records import DatasetError, SeriesDataset, load_dataset
    from wingfit.rigs.load import RigError, load_rig

    try:
        rig, recordings = load_rig(reference), load_dataset(dataset)
    except (RigError, DatasetError) as error:
        raise WingfitError("cannot check the rig", str(error)) from error
    if not isinstance(recordings, SeriesDataset):
        raise WingfitError("cannot check the rig", f"{dataset} describes a wing or a vehicle; give series of the rig")
    failed = 0
    for one in check_rig(rig, recordings):
        failed += one.outcome == "fail"
        typer.echo(f"{MARKS[one.outcome]:8} {one.name}{': ' if one.words else ''}{one.words}")
    if failed:
        note(f"{failed} checks failed")
        raise typer.Exit(1)
    next_step(f"wingfit diagnose {dataset} --local --rig {reference}")


@app.command("list")
def list_rigs() -> None:
    """List the installed rigs: entry points of the group "wingfit.rigs".

    Example: wingfit rig list
    """
    from wingfit.rigs.load import plug_ins

    names = plug_ins()
    for name in names:
        typer.echo(name)
    if not names:
        note("no rig is installed; give the path of a Python file instead")
    next_step(f"wingfit rig check {names[0] if names else 'my_rig.py'} --dataset FOLDER")
