"""``wingfit diagnose``: what a model left out; and ``wingfit diagnoses``, to come back to one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from wingfit.cli.base.files import check_file, write_text
from wingfit.cli.base.output import AsJson, Url, duration, moment, note, print_json, progress, say, table
from wingfit.cli.datasets import size
from wingfit.cli.effects import With, names
from wingfit.cli.exports import DiagnosisId, export_diagnosis
from wingfit.cli.findings import print_finding
from wingfit.cli.simulate import read_genome
from wingfit.client.client import DEFAULT_URL, Client, WingfitError
from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.service.limits import MOST_WORKERS

app = typer.Typer(no_args_is_help=True, help="List, watch, export, cancel and delete diagnoses.")
app.command("export")(export_diagnosis)

INTERRUPTED = 130
ReportFile = Annotated[Path | None, typer.Option("--report", help="Save the report, one HTML file: FILE.html.")]
FindingJson = Annotated[bool, typer.Option("--json", help="Print the finding as JSON.")]


def diagnose(
    dataset: Annotated[
        str | None, typer.Argument(help="Folder, .zip or .nc, which is uploaded; or the id of a dataset.")
    ] = None,
    run: Annotated[str | None, typer.Option(help="Id of a run: start from its best genome, with its settings.")] = None,
    division: Annotated[
        str | None, typer.Option(help="4, 11, 24, or bodies per strip, e.g. 3,3,3,2; 11 if left out.")
    ] = None,
    preset: Annotated[
        str | None, typer.Option(help="Vehicles: a model of 'wingfit models'; proposed if left out.")
    ] = None,
    without: Annotated[
        list[str] | None, typer.Option(help="Vehicles: leave out this term, e.g. clap-and-peel; repeatable.")
    ] = None,
    axis: Annotated[
        list[str] | None, typer.Option(help="Vehicles: fit this force axis, x or z; repeatable; all if left out.")
    ] = None,
    low_pass_hz: Annotated[
        float | None, typer.Option(help="Vehicles: cut-off; 3.2 x flap frequency if left out, 0: none.")
    ] = None,
    peel_width_beats: Annotated[
        float | None, typer.Option(help="Vehicles: beats over which the end of the peel is smoothed.")
    ] = None,
    with_: With = None,
    suspect: Annotated[
        list[str] | None, typer.Option(help="Consider only these effects, e.g. added_mass,hinge_offset; repeatable.")
    ] = None,
    recording: Annotated[list[str] | None, typer.Option(help="Fit only this recording; repeatable.")] = None,
    gene: Annotated[list[str] | None, typer.Option(help="Free only this gene; repeatable.")] = None,
    fixed: Annotated[list[str] | None, typer.Option(help="NAME=VALUE or FILE.json: a gene that keeps a value.")] = None,
    bounds_factor: Annotated[
        float | None, typer.Option(help="Genes from estimate / factor to estimate * factor.")
    ] = None,
    accuracy_mm: Annotated[
        float | None, typer.Option(help="Largest error of a simulated marker, 0.02 to 1; 0.1 if left out.")
    ] = None,
    refits: Annotated[int | None, typer.Option(help="Effects refitted in full at most; 8 if left out.")] = None,
    refine: Annotated[
        bool, typer.Option(help="Whether a finer division may be taken where the division limits.")
    ] = True,
    seed: Annotated[int | None, typer.Option(help="The same seed gives the same finding.")] = None,
    name: Annotated[str | None, typer.Option(help="A name to find the diagnosis by.")] = None,
    report: ReportFile = None,
    as_json: FindingJson = False,
    local: Annotated[bool, typer.Option("--local", help="Compute here, without a server; DATASET is a path.")] = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_WORKERS, help="With --local: processes; one per processor if left out."),
    ] = None,
    url: Url = DEFAULT_URL,
) -> None:
    """Find the physics that a model left out: where, what, how sure, and the proof on held-out recordings.

    Example: wingfit diagnose examples/robird --division 11 --report robird.html
    """
    check_file(report, "--report", (".html",))
    asked: dict[str, Any] = {
        "run_id": run,
        "division": division,
        "preset": preset,
        "without": _names(without, "--without"),
        "axes": axis or None,
        "low_pass_hz": low_pass_hz,
        "peel_width_beats": peel_width_beats,
        "effects": _names(names(with_), "--with"),
        "suspects": _names(suspect, "--suspect"),
        "recordings": recording or None,
        "genes": gene or None,
        "fixed": read_genome(fixed, "--fixed") if fixed else None,
        "bounds_factor": bounds_factor,
        "accuracy_mm": accuracy_mm,
        "refits": refits,
        "refine": None if refine else False,
        "seed": seed,
        "name": name,
    }
    asked = {key: value for key, value in asked.items() if value is not None}
    if local:
        _here(dataset, asked, workers, report, as_json=as_json)
        return
    if workers is not None:
        raise typer.BadParameter("the server has its own; give it with --local", param_hint="--workers")
    if dataset is None and run is None:
        raise typer.BadParameter("name a dataset, or a run with --run", param_hint="DATASET")
    with Client(url) as client:
        submitted = client.submit_diagnosis(_dataset_id(client, dataset), **asked)
        note(f"diagnosis {submitted['id']}")
        _tell(client, submitted["id"], report, as_json=as_json)


@app.command("list")
def list_(
    dataset: Annotated[str | None, typer.Option(help="Only diagnoses of this dataset id.")] = None,
    state: Annotated[str | None, typer.Option(help="Only diagnoses in this state, e.g. RUNNING.")] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """List the diagnoses on the server.

    Example: wingfit diagnoses list --state SUCCEEDED
    """
    with Client(url) as client:
        found = client.diagnoses(dataset_id=dataset, state=state.upper() if state else None)
    if as_json:
        print_json(found)
        return
    rows = [
        [
            one["id"],
            one["name"],
            one["state"],
            f"{100 * one['progress']:.0f} %",
            duration(one["eta_seconds"]),
            one["verdict"] or "–",
            moment(one["created_at"]),
        ]
        for one in found
    ]
    columns = ["id", "name", "state", ">progress", ">left", "verdict", "submitted"]
    table(columns, rows, "no diagnoses; make one: wingfit diagnose DATASET")


@app.command()
def watch(
    diagnosis_id: DiagnosisId, report: ReportFile = None, url: Url = DEFAULT_URL, as_json: FindingJson = False
) -> None:
    """Show the progress of a diagnosis until it ends, then what it found; Ctrl-C leaves it going.

    Example: wingfit diagnoses watch ID --report found.html
    """
    check_file(report, "--report", (".html",))
    with Client(url) as client:
        _tell(client, diagnosis_id, report, as_json=as_json)


@app.command()
def cancel(diagnosis_id: DiagnosisId, url: Url = DEFAULT_URL) -> None:
    """Stop a diagnosis for good.

    Example: wingfit diagnoses cancel ID
    """
    with Client(url) as client:
        found = client.cancel_diagnosis(diagnosis_id)
    say(f"diagnosis {found['id']} {found['state']}")


@app.command()
def delete(diagnosis_id: DiagnosisId, url: Url = DEFAULT_URL) -> None:
    """Delete a diagnosis that has ended, with its finding.

    Example: wingfit diagnoses delete ID
    """
    with Client(url) as client:
        client.delete_diagnosis(diagnosis_id)
    say(f"diagnosis {diagnosis_id} deleted")


def _tell(client: Client, diagnosis_id: str, report: Path | None, *, as_json: bool) -> None:
    """Wait for a diagnosis, then say what it found."""
    ended = _follow(client, diagnosis_id)
    if ended["state"] == "FAILED":
        raise WingfitError(f"diagnosis {diagnosis_id} failed", ended["error"] or "the server gives no reason")
    if ended["state"] == "CANCELLED":
        raise WingfitError(f"diagnosis {diagnosis_id} was cancelled")
    if report:
        _save(report, client.report(diagnosis_id))
    found = client.finding(diagnosis_id)
    print_json(found) if as_json else print_finding(found)


def _follow(client: Client, diagnosis_id: str) -> Diagnosis:
    try:
        with progress("diagnosing") as tell:
            return client.wait_for_diagnosis(
                diagnosis_id, lambda one: tell(one["progress"], one["eta_seconds"], _stage(one))
            )
    except KeyboardInterrupt:
        note(
            f"\ndiagnosis {diagnosis_id} goes on without you; 'wingfit diagnoses watch {diagnosis_id}' to come back, "
            f"'wingfit diagnoses cancel {diagnosis_id}' to stop it"
        )
        raise typer.Exit(INTERRUPTED) from None


def _stage(one: Diagnosis) -> str:
    return one["stage"] or "starting" if one["state"] == "RUNNING" else one["state"].lower()


def _here(
    dataset: str | None, asked: dict[str, Any], workers: int | None, report: Path | None, *, as_json: bool
) -> None:
    if "run_id" in asked:
        raise typer.BadParameter("runs are on a server; leave --run or --local out", param_hint="--run")
    if dataset is None:
        raise typer.BadParameter("name the folder, .zip or .nc", param_hint="DATASET")
    path = Path(dataset)
    if not path.exists():
        raise WingfitError("no such dataset", f"{path} does not exist; give a folder, a .zip or a .nc file")
    from wingfit.report import finding_json, html  # what computes waits until it is needed
    from wingfit.service.diagnoses.local import diagnose as diagnose_here

    try:
        with progress("diagnosing") as tell:
            found = diagnose_here(path, asked, workers, tell)
    except KeyboardInterrupt:
        note("\nthe diagnosis was given up; nothing was kept")
        raise typer.Exit(INTERRUPTED) from None
    if report:
        _save(report, html(found))
    plain = finding_json(found)
    print_json(plain) if as_json else print_finding(plain)


def _dataset_id(client: Client, dataset: str | None) -> str | None:
    """The id of ``dataset``, which is uploaded if it is a path."""
    if dataset is None or not Path(dataset).exists():
        return dataset
    with progress("uploading") as tell:
        uploaded = client.upload_dataset(
            dataset, on_bytes=lambda sent, total: tell(sent / max(total, 1), note=size(total))
        )
    note(f"dataset {uploaded['id']} '{uploaded['name']}'")
    return uploaded["id"]


def _names(words: list[str] | None, option: str) -> list[str] | None:
    """Names of effects or terms as the server writes them: clap-and-peel and added_mass,damage are understood."""
    found = [name.strip().replace("-", "_") for word in words or [] for name in word.split(",")]
    if "" in found:
        raise typer.BadParameter("a name is empty; leave the option or the comma out", param_hint=option)
    return found or None


def _save(path: Path, text: str) -> None:
    write_text(path, text)
    note(f"report written to {path}; open it in a browser")
