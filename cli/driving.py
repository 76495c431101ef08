"""``wingfit drive``: simulates the rig of a job on a server, on this machine; and how other commands do so."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from wingfit.cli.base import options as o
from wingfit.cli.base.output import next_step, note, progress
from wingfit.cli.jobs import INTERRUPTED
from wingfit.client.client import DEFAULT_URL, Client, WingfitError
from wingfit.service.limits import MOST_WORKERS

if TYPE_CHECKING:
    from wingfit.client.drive_answers import Work
    from wingfit.rigs.rig import Rig

Reference = Annotated[
    str,
    typer.Argument(metavar="RIG", help="The rig with which the job was submitted: my_rig.py or package.module:rig."),
]
Workers = Annotated[int, typer.Option(min=1, max=MOST_WORKERS, help="Number of processes that simulate.")]


def drive(job_id: o.JobId, reference: Reference, workers: Workers = 1, url: o.Url = DEFAULT_URL) -> None:
    """Simulate your rig for a run or diagnosis of a server, until it has ended; several machines may drive one job.

    Ctrl-C ends this command; the job waits in the queue until you drive it again, and continues.

    Example: wingfit drive dx_7d20c14be5a9f386 my_rig.py --workers 4
    """
    rig = _loaded(reference)
    with Client(url) as client:
        work = drive_job(client, job_id, rig, reference, workers, "driving")
    note(f"{job_id} is {work['state']}" + (f": {work['error']}" if work["error"] else ""))
    if work["state"] != "SUCCEEDED":
        raise typer.Exit(1)
    group = "diagnoses watch" if job_id.startswith("dx_") else "runs result"
    next_step(f"wingfit {group} {job_id}")


def drive_job(client: Client, job_id: str, rig: Rig, reference: str, workers: int, what: str) -> Work:
    """Simulate ``rig`` for a job until it has ended, and show its progress as the work ``what``."""
    from wingfit._drive import drive as drive_here  # imported late: other commands start faster

    try:
        with progress(what) as show:
            return drive_here(
                client,
                job_id,
                rig,
                workers=workers,
                on_work=lambda work: show(work["progress"], work["eta_seconds"], work["stage"] or "starting"),
            )
    except KeyboardInterrupt:
        note(f"\n{job_id} waits in the queue; go on with: wingfit drive {job_id} {reference}")
        raise typer.Exit(INTERRUPTED) from None


def rig_here(reference: str | None) -> Rig | None:
    """Return the rig in a file or module of this machine; None for the name of one that is installed on the server."""
    if reference is None or not (reference.endswith(".py") or ":" in reference):
        return None
    return _loaded(reference)


def rig_setting(reference: str | None, rig: Rig | None) -> dict[str, Any]:
    """Return the setting ``rig`` of a request: the declaration of ``rig``, or the name of one on the server."""
    if rig is None:
        return {} if reference is None else {"rig": reference}
    from wingfit.rigs.declaration import declaration

    return {"rig": declaration(rig)}


def _loaded(reference: str) -> Rig:
    from wingfit.rigs.load import RigError, load_rig

    try:
        return load_rig(reference)
    except RigError as error:
        raise WingfitError("the rig cannot be loaded", str(error)) from error
