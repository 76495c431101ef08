"""``wingfit runs``: submit, follow and control calibrations, and print their results."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from wingfit.cli.base import options as o
from wingfit.cli.base.files import new_file, write_text
from wingfit.cli.base.output import duration, emit, moment, next_step, note, number, percent, progress, say, table
from wingfit.cli.base.rounding import with_unit
from wingfit.cli.charts.commands import history, residual
from wingfit.cli.driving import drive_job, rig_here, rig_setting
from wingfit.cli.forces.runs import forces, predict
from wingfit.cli.jobs import (
    INTERRUPTED,
    JobKind,
    check_ended_well,
    commands,
    dataset_id,
    follow,
    next_of,
    state_of,
    state_word,
)
from wingfit.cli.results import print_genes, print_result
from wingfit.client import answers as a
from wingfit.client.client import DEFAULT_URL, Client
from wingfit.service.limits import MOST_WORKERS
from wingfit.service.runs.spec_fields_by_kind import IDLE, VEHICLE_ONLY, WING_ONLY
from wingfit.service.units import MN

PAUSING_SECONDS = 0.2  # between two looks at a run that is about to pause


def best(run: a.Run) -> str:
    """Return the smallest misfit of a run so far as text, in the unit of its kind; a dash for none."""
    if run["kind"] == "tracks":
        return "–" if run["best_mm"] is None else f"{run['best_mm']:.2f} mm"
    if run["kind"] == "series":
        return "–" if run["best_percent"] is None else f"{number(run['best_percent'], 3)} % of range"
    return "–" if run["best_mn"] is None else with_unit(run["best_mn"] / MN)


def _stage(run: a.Run) -> str:
    stage = (run["stage"] if run["state"] == "RUNNING" else None) or run["state"].lower()
    return f"{stage}, generation {run['generations']}, best {best(run)}"


RUNS = JobKind(
    name="run",
    plural="runs",
    help="Submit, follow, control and export calibrations, and print their results.",
    work="calibrating",
    submit="wingfit runs submit DATASET",
    read="result",
    outcome=">best",
    outcome_of=best,
    stage_of=_stage,
    exported="csv holds the history, netcdf also every recording as simulated with the best genome",
    find=Client.runs,
    fetch=Client.run,
    wait=Client.wait,
    cancel=Client.cancel,
    delete=Client.delete_run,
    export=Client.export_run,
    update=Client.update_run,
)
app = commands(RUNS)
app.command()(forces)
app.command()(predict)
app.command()(history)
app.command()(residual)


@app.command()
def submit(
    ctx: typer.Context,
    dataset: Annotated[str, typer.Argument(help="Id of a dataset, or a folder, .zip or .nc file to upload first.")],
    division: o.Division = None,
    search_division: Annotated[
        str | None, typer.Option(help="Search with this coarser division, then Gauss-Newton with --division.")
    ] = None,
    mode: Annotated[
        str | None, typer.Option(help="staged (vacuum, then tunnel), joint, or local (each recording on its own).")
    ] = None,
    method: Annotated[str | None, typer.Option(help="genetic, cma_es, gauss_newton or auto.")] = None,
    finish: Annotated[bool, typer.Option("--finish", help="Gauss-Newton after the search of each stage.")] = False,
    population: Annotated[int | None, typer.Option(help="Individuals per generation.")] = None,
    stall: Annotated[int | None, typer.Option(help="Generations without improvement that end a stage.")] = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Smallest relative change that counts as an improvement.")
    ] = None,
    max_generations: Annotated[int | None, typer.Option(help="Limit of generations per stage.")] = None,
    seed: Annotated[int | None, typer.Option(help="The same seed gives the same numbers.")] = None,
    bounds_factor: o.BoundsFactor = None,
    accuracy_mm: o.Accuracy = None,
    recordings: o.Recordings = None,
    genes: o.Genes = None,
    effects: o.With = None,
    preset: o.Preset = None,
    without: o.Without = None,
    axes: o.Axes = None,
    low_pass_hz: o.LowPass = None,
    peel_width_beats: o.PeelWidth = None,
    rig: o.Rig = None,
    workers: Annotated[
        int, typer.Option(min=1, max=MOST_WORKERS, help="With your --rig: processes that simulate here.")
    ] = 1,
    name: Annotated[str | None, typer.Option(help="A name for the run.")] = None,
    watch_it: Annotated[bool, typer.Option("--watch", help="Stay and show the progress.")] = False,
    url: o.Url = DEFAULT_URL,
    as_json: o.AsJson = False,
) -> None:
    """Submit a calibration. Defaults: van der Grinten's thesis for wings, Armanini et al. (2016) for vehicles.

    With your own --rig, this command simulates it, and ends with the run.

    Example: wingfit runs submit ID --division 11 --seed 7 --watch
    """
    with Client(url) as client:
        own = rig_here(rig)
        settings = o.settings(ctx, "dataset", "watch_it", "rig", "workers", "url", "as_json") | rig_setting(rig, own)
        run = client.submit_run(dataset_id(client, dataset), **settings)
        stays = watch_it or own is not None
        if stays:
            note(f"run {run['id']}")
        if own is not None and rig is not None:
            drive_job(client, run["id"], own, rig, workers, "calibrating")
        if stays:
            run = follow(client, RUNS, run["id"])
    emit(run, _ended if stays else _submitted, as_json=as_json, then=next_of(RUNS, run))
    check_ended_well(RUNS, run)


@app.command()
def show(run_id: o.JobId, url: o.Url = DEFAULT_URL, as_json: o.AsJson = False) -> None:
    """Show the settings, the state and the progress of a run.

    Example: wingfit runs show ID --json
    """
    with Client(url) as client:
        run = client.run(run_id)
    emit(run, _show, as_json=as_json, then=next_of(RUNS, run))


@app.command()
def watch(run_id: o.JobId, url: o.Url = DEFAULT_URL, as_json: o.AsJson = False) -> None:
    """Show the progress of a run until it ends. Ctrl-C ends this command; the run continues.

    Example: wingfit runs watch ID
    """
    with Client(url) as client:
        run = follow(client, RUNS, run_id)
    emit(run, _ended, as_json=as_json, then=next_of(RUNS, run))
    check_ended_well(RUNS, run)


@app.command()
def pause(run_id: o.JobId, url: o.Url = DEFAULT_URL) -> None:
    """Stop a run after its current generation, and wait until it is paused; it can be resumed.

    Ctrl-C ends this command; the run pauses all the same.

    Example: wingfit runs pause ID
    """
    with Client(url) as client:
        run = client.pause(run_id)
        try:
            with progress("pausing") as report:
                while run["pending_action"] == "PAUSE":
                    report(None, note=_stage(run))
                    time.sleep(PAUSING_SECONDS)
                    run = client.run(run_id)
        except KeyboardInterrupt:
            note(f"\nrun {run_id} pauses after its current generation; look: 'wingfit runs show {run_id}'")
            raise typer.Exit(INTERRUPTED) from None
    say(state_of(RUNS, run))
    next_step(next_of(RUNS, run))


@app.command()
def resume(run_id: o.JobId, url: o.Url = DEFAULT_URL) -> None:
    """Continue a paused run, with the same numbers as without the pause.

    Example: wingfit runs resume ID
    """
    with Client(url) as client:
        run = client.resume(run_id)
    say(state_of(RUNS, run))
    next_step(next_of(RUNS, run))


@app.command()
def genome(
    run_id: o.JobId,
    output: Annotated[
        Path | None, new_file("Also write {name: value} as JSON, for 'simulate --genome'.", "--output", "-o")
    ] = None,
    url: o.Url = DEFAULT_URL,
    as_json: o.AsJson = False,
) -> None:
    """Print every gene of a run: its value in the best genome so far, and its nominal value.

    Example: wingfit runs genome ID -o best.json
    """
    with Client(url) as client:
        answer = client.genome(run_id)
    if output:
        values = {gene["name"]: gene["best"] for gene in answer["genes"]}
        write_text(output, json.dumps(values, indent=2) + "\n", "genome")
    if not as_json and not answer["final"]:
        note("the run has not ended; these are the best values so far")
    if output:
        then = f"wingfit simulate --dataset DATASET_ID --genome {output}"
    else:
        then = f"wingfit runs genome {run_id} -o best.json" if answer["final"] else f"wingfit runs watch {run_id}"
    emit(answer, lambda answer: print_genes(answer["genes"]), as_json=as_json, then=then)


@app.command()
def result(run_id: o.JobId, url: o.Url = DEFAULT_URL, as_json: o.AsJson = False) -> None:
    """Print the misfit of each recording before and after the calibration, and the estimates with their errors.

    Example: wingfit runs result ID
    """
    with Client(url) as client:
        result = client.result(run_id)
    then = f"wingfit diagnose --run {run_id}" + (" --rig my_rig.py" if result["kind"] == "series" else "")
    emit(result, print_result, as_json=as_json, then=then)


def _show(run: a.Run) -> None:
    rows = [
        ["run", f"{run['id']} {run['name'] or ''}"],
        ["dataset", run["dataset_id"]],
        *([["notes", run["notes"]]] if run["notes"] else []),
        ["state", f"{state_word(run)}{', stage ' + run['stage'] if run['stage'] else ''}"],
        ["progress", f"{percent(run['progress'])}, {duration(run['eta_seconds'])} left"],
        ["generations", f"{run['generations']} ({run['evaluations']} evaluations)"],
        ["best", f"{best(run)} {'per marker' if run['kind'] == 'tracks' else 'RMS'}"],
        ["settings", ", ".join(_settings(run))],
        ["submitted", moment(run["created_at"])],
        ["ended", moment(run["finished_at"])],
    ]
    table(["", ""], rows + ([["error", run["error"]]] if run["error"] else []))


def _settings(run: a.Run) -> list[str]:
    """Return "name value" for each setting that the run's kind of dataset and its method use."""
    spec = run["spec"]
    unused = set({"tracks": VEHICLE_ONLY, "forces": WING_ONLY}.get(run["kind"], (*VEHICLE_ONLY, *WING_ONLY)))
    unused |= {*IDLE.get(spec["method"], ()), *(["seed"] if spec["method"] == "gauss_newton" else [])}
    words: dict[type, Callable[..., str]] = {
        bool: lambda value: "yes" if value else "no",
        list: lambda value: " ".join(map(str, value)),
    }
    used = {key: value for key, value in spec.items() if key not in unused and value not in (None, [], {})}
    return [f"{key} {words.get(type(value), str)(value)}" for key, value in used.items()]


def _submitted(run: a.Run) -> None:
    say(state_of(RUNS, run))


def _ended(run: a.Run) -> None:
    say(f"{state_of(RUNS, run)}, best {best(run)} after {run['generations']} generations")
