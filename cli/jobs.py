"""Commands for both runs and diagnoses (jobs): list, edit, cancel, delete, export; functions to follow and upload."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import typer

from wingfit.cli.base.files import check_file
from wingfit.cli.base.options import AsJson, JobId, Url
from wingfit.cli.base.output import duration, emit, moment, next_step, note, percent, progress, say, size, table
from wingfit.client.client import DEFAULT_URL, Client, WingfitError
from wingfit.client.export_answers import Format
from wingfit.client.transport import ENDINGS

START_SECONDS = 1.0  # between two looks at a server that starts
ACTIVE = "QUEUED", "RUNNING"  # states of a job that waits for the server's start
WISHES: dict[str | None, str] = {"PAUSE": "pausing", "CANCEL": "cancelling"}  # the words of the web page
INTERRUPTED = 130  # exit code after Ctrl-C
STANDARD_OUTPUT = Path("-")
FormatName = Annotated[
    str, typer.Option("--format", help="json: everything; csv: a table; netcdf: series and maps, which needs a file.")
]
NewName = Annotated[str | None, typer.Option("--name", help="The new name; default: it stays.")]
NewNotes = Annotated[str | None, typer.Option("--notes", help="The new notes, '' for none; default: they stay.")]
Output = Annotated[Path, typer.Option("--output", "-o", help="File to write to; default, or -: standard output.")]


@dataclass(frozen=True)
class JobKind:
    """Texts and client methods in which the commands for runs and for diagnoses differ.

    ``stage_of`` and ``outcome_of`` return the stage and the outcome of a job as text; ``outcome`` is the heading of the
    column of outcomes, ``work`` the title of the progress bar, ``submit`` an example command, ``read`` the command that
    shows what a job has found, ``exported`` the help on export formats. ``find`` lists the jobs, ``fetch`` returns one,
    ``update`` changes name and notes.
    """

    name: str
    plural: str
    help: str
    work: str
    submit: str
    read: str
    outcome: str
    outcome_of: Callable[[Any], str]
    stage_of: Callable[[Any], str]
    exported: str
    find: Callable[..., list[Any]]
    fetch: Callable[[Client, str], Any]
    wait: Callable[[Client, str, Callable[[Any], None]], Any]
    cancel: Callable[[Client, str], Any]
    delete: Callable[[Client, str], None]
    export: Callable[[Client, str, Format, Path], Path]
    update: Callable[..., Any]


def commands(kind: JobKind) -> typer.Typer:
    """Return a command group with list, edit, cancel, delete and export, to which the caller adds further commands."""
    app = typer.Typer(no_args_is_help=True, help=kind.help)
    group = f"wingfit {kind.plural}"

    def command(name: str, text: str, example: str) -> Callable[..., Any]:
        return app.command(name, help=f"{text}\n\nExample: {group} {name} {example}")

    @command("list", f"List the {kind.plural} on the server, the newest first.", "--state RUNNING")
    def list_(
        dataset: Annotated[str | None, typer.Option(help="Only those of this dataset id.")] = None,
        state: Annotated[str | None, typer.Option(help="Only those in this state, e.g. RUNNING.")] = None,
        url: Url = DEFAULT_URL,
        as_json: AsJson = False,
    ) -> None:
        with Client(url) as client:
            jobs = kind.find(client, dataset_id=dataset, state=state.upper() if state else None)
        columns = ["id", "name", "state", ">progress", ">left", kind.outcome, "submitted"]
        then = next_of(kind, jobs[0]) if jobs else kind.submit
        rows = [_row(kind, job) for job in jobs]
        emit(jobs, lambda _: table(columns, rows, f"no {kind.plural}"), as_json=as_json, then=then)

    @command("edit", f"Change the name or the notes of a {kind.name}.", "ID --notes 'after the repair'")
    def edit(job_id: JobId, name: NewName = None, notes: NewNotes = None, url: Url = DEFAULT_URL) -> None:
        with Client(url) as client:
            say(edited(kind.name, kind.update(client, job_id, **changes(name, notes))))

    @command("cancel", f"Stop a {kind.name} for good; its results so far are kept.", "ID")
    def cancel(job_id: JobId, url: Url = DEFAULT_URL) -> None:
        with Client(url) as client:
            say(state_of(kind, kind.cancel(client, job_id)))
        next_step(f"{group} delete {job_id}, or keep it for its history")

    @command("delete", f"Delete a {kind.name} that has ended, with its results.", "ID")
    def delete(job_id: JobId, url: Url = DEFAULT_URL) -> None:
        with Client(url) as client:
            kind.delete(client, job_id)
        say(f"{kind.name} {job_id} deleted")
        next_step(f"{group} list")

    @command("export", f"Write a {kind.name} to a file: {kind.exported}.", f"ID --format csv -o {kind.name}.csv")
    def export(
        job_id: JobId, format_name: FormatName = "json", output: Output = STANDARD_OUTPUT, url: Url = DEFAULT_URL
    ) -> None:
        _export(kind, job_id, format_name, output, url)

    return app


def _row(kind: JobKind, job: Any) -> list[object]:
    progress = percent(job["progress"]), duration(job["eta_seconds"])
    return [job["id"], job["name"] or "", state_word(job), *progress, kind.outcome_of(job), moment(job["created_at"])]


def state_word(job: Any) -> str:
    """Return the state of a job, or what it is about to do: pausing, or cancelling."""
    return WISHES.get(job["pending_action"]) or str(job["state"])


def changes(name: str | None, notes: str | None) -> dict[str, str | None]:
    """Return the arguments of ``Client.update_run`` and others; typer.BadParameter if there is nothing to change."""
    if name is None and notes is None:
        raise typer.BadParameter("give a new name, or notes ('' for none)", param_hint="--name or --notes")
    return {"name": name, "notes": notes}


def edited(what: str, answer: Any) -> str:
    """Return id, name and notes of a changed dataset or job as text."""
    return f"{what} {answer['id']} '{answer['name']}'" + (f"\n{answer['notes']}" if answer["notes"] else "")


def state_of(kind: JobKind, job: Any) -> str:
    """Return kind, id and state of a job as one line of text."""
    return f"{kind.name} {job['id']} {state_word(job)}"


def next_of(kind: JobKind, job: Any) -> str:
    """Return the command that comes next for a job, by its state."""
    group = f"wingfit {kind.plural}"
    match job["state"]:
        case "SUCCEEDED":
            return f"{group} {kind.read} {job['id']}"
        case "PAUSED":
            return f"{group} resume {job['id']}"
        case "FAILED" | "CANCELLED":
            return f"{kind.submit}, or {group} delete {job['id']}"
    return f"{group} watch {job['id']}"


def follow(client: Client, kind: JobKind, job_id: str) -> Any:
    """Show the progress of a job until it ends, and return the job; Ctrl-C ends the command, and the job continues."""
    try:
        with progress(kind.work) as report:
            while kind.fetch(client, job_id)["state"] in ACTIVE:
                health = client.health()
                if health["status"] != "starting" or not health["detail"]:
                    break
                report(None, note=health["detail"])
                time.sleep(START_SECONDS)
            return kind.wait(
                client, job_id, lambda job: report(job["progress"], job["eta_seconds"], kind.stage_of(job))
            )
    except KeyboardInterrupt:
        note(
            f"\n{kind.name} {job_id} continues on the server; follow it: 'wingfit {kind.plural} watch {job_id}', "
            f"stop it: 'wingfit {kind.plural} cancel {job_id}'"
        )
        raise typer.Exit(INTERRUPTED) from None


def check_ended_well(kind: JobKind, job: Any) -> None:
    """Raise WingfitError if the job failed or was cancelled."""
    if job["state"] == "FAILED":
        raise WingfitError(f"{kind.name} {job['id']} failed", job["error"] or "the server gives no reason")
    if job["state"] == "CANCELLED":
        raise WingfitError(f"{kind.name} {job['id']} was cancelled")


def upload(client: Client, path: Path, name: str | None = None) -> Any:
    """Upload the dataset at ``path`` with a progress bar, and return it; ``name`` replaces its own."""
    with progress("uploading") as report:
        return client.upload_dataset(
            path, name=name, on_bytes=lambda sent, total: report(sent / max(total, 1), note=size(total))
        )


def dataset_id(client: Client, dataset: str) -> str:
    """Return ``dataset``, an id; or, if it is a path, upload the dataset there and return its new id."""
    if not Path(dataset).exists():
        return dataset
    uploaded = upload(client, Path(dataset))
    note(f"dataset {uploaded['id']} '{uploaded['name']}'")
    return str(uploaded["id"])


def _export(kind: JobKind, job_id: str, format_name: str, output: Path, url: str) -> None:
    """Write an export of a job to the file ``output`` or, for ``-``, to standard output, once it is complete."""
    if format_name not in ENDINGS:
        raise typer.BadParameter(f"{format_name}: must be one of {', '.join(ENDINGS)}", param_hint="--format")
    if output != STANDARD_OUTPUT:
        check_file(output, "--output", (ENDINGS[format_name],))
    elif format_name == "netcdf":
        raise typer.BadParameter("netcdf is not text; name a file, -o FILE.nc", param_hint="--output")
    with Client(url) as client:
        if output != STANDARD_OUTPUT:
            kind.export(client, job_id, format_name, output)
            note(f"{output}, {size(output.stat().st_size)}")
            if format_name == "netcdf":
                next_step(f"read {output} with h5netcdf, xarray or netCDF4")
            else:
                next_step(f"wingfit {kind.plural} export {job_id} --format netcdf -o {output.with_suffix('.nc')}")
            return
        with TemporaryDirectory(prefix="wingfit-") as scratch:
            path = kind.export(client, job_id, format_name, Path(scratch) / "export")
            with path.open("rb") as stream:
                sys.stdout.flush()
                shutil.copyfileobj(stream, sys.stdout.buffer)
