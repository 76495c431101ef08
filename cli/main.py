"""The command line: ``wingfit``, with one module for each command or group of commands.

Exit codes: 0 done, 1 an error (a line or two on standard error), 2 a usage error, 130 Ctrl-C.
"""

from __future__ import annotations

import os
import sys

import typer

from wingfit.cli import (
    backup,
    campaigns,
    datasets,
    diagnose,
    driving,
    effects,
    keys,
    rigs,
    runs,
    serve,
    simulate,
)
from wingfit.cli.aligning import command as aligning
from wingfit.cli.base.output import note
from wingfit.cli.cameras import calibrate as cameras
from wingfit.cli.cameras import track as films
from wingfit.cli.exporting import command as exporting
from wingfit.cli.forces import free_flight, kinematics
from wingfit.cli.forces import runs as force_runs
from wingfit.cli.importing import command as importing
from wingfit.cli.importing import forces as force_files
from wingfit.cli.importing import template
from wingfit.cli.planning.command import plan
from wingfit.client.client import WingfitError
from wingfit.sim.requested_lanes import requested_lanes

ERROR = 1

app = typer.Typer(
    name="wingfit",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Calibrate flapping-wing simulations on recordings of markers or of forces, and identify missing physics.",
    epilog="Example: wingfit serve, then wingfit datasets upload examples/robird",
)
app.command()(serve.serve)
app.command()(campaigns.campaign)
app.command()(campaigns.balance)
app.command("import")(importing.import_)
app.command("import-forces")(force_files.import_forces)
app.command("wing-template")(template.wing_template)
app.command("wing-drawing")(template.wing_drawing)
app.add_typer(cameras.app, name="cameras")
app.command()(films.track)
app.command()(aligning.align)
app.command()(kinematics.kinematics)
app.command()(free_flight.forces)
app.add_typer(datasets.app, name="datasets")
app.add_typer(runs.app, name="runs")
app.command()(diagnose.diagnose)
app.add_typer(diagnose.app, name="diagnoses")
app.command()(exporting.export)
app.command()(plan)
app.command()(driving.drive)
app.command()(simulate.simulate)
app.command()(force_runs.models)
app.command()(effects.effects)
app.add_typer(rigs.app, name="rig")
app.add_typer(keys.app, name="keys")
app.command()(backup.backup)
app.command()(backup.restore)


def main() -> None:
    """Run the command line; print expected errors as a message without traceback, and exit with code 1."""
    try:
        requested_lanes()  # the kernels need it when a command imports them
    except ValueError as error:
        note(f"error: {error}")
        sys.exit(ERROR)
    try:
        app()
    except WingfitError as error:
        note(f"error: {error}")
        sys.exit(ERROR)
    except BrokenPipeError:
        # The reader of the pipe has closed it (as "| head" does); without this Python prints another error at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(ERROR)
    except OSError as error:
        note(f"error: {error}")
        sys.exit(ERROR)


if __name__ == "__main__":
    main()
