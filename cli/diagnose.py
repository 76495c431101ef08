"""``wingfit diagnose``: identifies physics missing from a model; ``wingfit diagnoses``: lists and follows diagnoses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from wingfit.cli.base import options as o
from wingfit.cli.base.files import new_file, write_text
from wingfit.cli.base.output import emit, note, progress
from wingfit.cli.charts.commands import finding_residual
from wingfit.cli.driving import drive_job, rig_here, rig_setting
from wingfit.cli.findings import print_finding
from wingfit.cli.jobs import INTERRUPTED, JobKind, check_ended_well, commands, dataset_id, follow
from wingfit.client.client import DEFAULT_URL, Client, WingfitError
from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.service.limits import MOST_WORKERS

ReportFile = Annotated[Path | None, new_file("Save the report, one HTML file: FILE.html.", "--report")]
FindingJson = Annotated[bool, typer.Option("--json", help="Print the finding as JSON.")]


def _stage(one: Diagnosis) -> str:
    return one["stage"] or "starting" if one["state"] == "RUNNING" else one["state"].lower()


DIAGNOSES = JobKind(
    name="diagnosis",
    plural="diagnoses",
    help="List, follow, export, cancel and delete diagnoses.",
    work="diagnosing",
    submit="wingfit diagnose DATASET",
    read="watch",
    outcome="verdict",
    outcome_of=lambda one: one["verdict"] or "–",
    stage_of=_stage,
    exported="csv holds the ranking, netcdf the maps and misfits",
    find=Client.diagnoses,
    fetch=Client.diagnosis,
    wait=Client.wait_for_diagnosis,
    cancel=Client.cancel_diagnosis,
    delete=Client.delete_diagnosis,
    export=Client.export_diagnosis,
    update=Client.update_diagnosis,
)
app = commands(DIAGNOSES)
app.command("residual")(finding_residual)


def diagnose(
    ctx: typer.Context,
    dataset: o.DatasetOrPath = None,
    run_id: Annotated[
        str | None, typer.Option("--run", help="Id of a run: start from its best genome and its settings.")
    ] = None,
    division: o.Division = None,
    preset: o.Preset = None,
    without: o.Without = None,
    axes: o.Axes = None,
    low_pass_hz: o.LowPass = None,
    peel_width_beats: o.PeelWidth = None,
    effects: o.With = None,
    suspects: Annotated[
        list[str] | None,
        typer.Option(
            "--suspect", callback=o.names, help="Consider only these effects, e.g. added_mass,hinge_offset; repeatable."
        ),
    ] = None,
    recordings: o.Recordings = None,
    genes: o.Genes = None,
    fixed: Annotated[
        list[str] | None, typer.Option(help="NAME=VALUE or FILE.json: genes that are not estimated; repeatable.")
    ] = None,
    bounds_factor: o.BoundsFactor = None,
    accuracy_mm: o.Accuracy = None,
    refits: Annotated[int | None, typer.Option(help="Largest number of effects refitted in full; default: 8.")] = None,
    refine: Annotated[
        bool, typer.Option(help="Allow a finer discretisation where the number of bodies limits the accuracy.")
    ] = True,
    exhaustive: Annotated[
        bool, typer.Option("--exhaustive", help="Fit every pair of the effects given with --suspect; at most 20.")
    ] = False,
    seed: Annotated[int | None, typer.Option(help="The same seed gives the same finding.")] = None,
    name: Annotated[str | None, typer.Option(help="A name for the diagnosis.")] = None,
    report: ReportFile = None,
    as_json: FindingJson = False,
    local: Annotated[bool, typer.Option("--local", help="Compute here, without a server; DATASET is a path.")] = False,
    rig: o.Rig = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, max=MOST_WORKERS, help="Processes that simulate here; default: one per processor, 1 with --rig."
        ),
    ] = None,
    url: o.Url = DEFAULT_URL,
) -> None:
    """Identify the physics missing from a model: what, where, how certain, validated on held-out recordings.

    Example: wingfit diagnose examples/robird --division 11 --report robird.html
    """
    settings = o.settings(ctx, "dataset", "fixed", "report", "as_json", "local", "rig", "workers", "url")
    if fixed:
        settings["fixed"] = o.read_genome(fixed, "--fixed")
    if local:
        _diagnose_here(dataset, settings, workers, report, rig, as_json=as_json)
        return
    own = rig_here(rig)
    if workers is not None and own is None:
        raise typer.BadParameter("the server has its own; give it with --local or your --rig", param_hint="--workers")
    if dataset is None and run_id is None:
        raise typer.BadParameter("name a dataset, or a run with --run", param_hint="DATASET")
    with Client(url) as client:
        settings |= rig_setting(rig, own)
        submitted = client.submit_diagnosis(dataset and dataset_id(client, dataset), **settings)
        note(f"diagnosis {submitted['id']}")
        if own is not None and rig is not None:
            drive_job(client, submitted["id"], own, rig, workers or 1, "diagnosing")
        _print_when_done(client, submitted["id"], report, as_json=as_json)


@app.command()
def watch(
    diagnosis_id: o.JobId, report: ReportFile = None, url: o.Url = DEFAULT_URL, as_json: FindingJson = False
) -> None:
    """Show the progress of a diagnosis, then its finding. Ctrl-C ends this command; the diagnosis continues.

    Example: wingfit diagnoses watch ID --report finding.html
    """
    with Client(url) as client:
        _print_when_done(client, diagnosis_id, report, as_json=as_json)


def _print_when_done(client: Client, diagnosis_id: str, report: Path | None, *, as_json: bool) -> None:
    check_ended_well(DIAGNOSES, follow(client, DIAGNOSES, diagnosis_id))
    if report:
        write_text(report, client.report(diagnosis_id), "report")
    then = f"wingfit diagnoses watch {diagnosis_id} --report finding.html"
    if report:
        then = f"open {report} in a browser, or: wingfit diagnoses export {diagnosis_id} --format csv -o ranking.csv"
    emit(client.finding(diagnosis_id), print_finding, as_json=as_json, then=then)


def _diagnose_here(
    dataset: str | None,
    settings: dict[str, Any],
    workers: int | None,
    report: Path | None,
    rig: str | None,
    *,
    as_json: bool,
) -> None:
    if "run_id" in settings:
        raise typer.BadParameter("runs are on a server; leave --run or --local out", param_hint="--run")
    if dataset is None:
        raise typer.BadParameter("name the folder, .zip or .nc", param_hint="DATASET")
    path = Path(dataset)
    if not path.exists():
        raise WingfitError("no such dataset", f"{path} does not exist; give a folder, a .zip or a .nc file")
    from wingfit.report import finding_json, html  # imported late: other commands start faster
    from wingfit.service.diagnoses.local import diagnose as diagnose_here

    try:
        with progress("diagnosing") as show:
            finding = diagnose_here(path, settings, workers, show, rig)
    except KeyboardInterrupt:
        note("\nthe diagnosis was stopped; nothing was stored")
        raise typer.Exit(INTERRUPTED) from None
    if report:
        write_text(report, html(finding), "report")
    words = f"open {report} in a browser" if report else "the same command with --report finding.html draws the finding"
    emit(finding_json(finding), print_finding, as_json=as_json, then=words)
