"""``wingfit runs``: submit, watch and steer calibrations, and fetch what they found."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from wingfit.cli.base.output import AsJson, Url, duration, mm, moment, note, number, print_json, progress, say, table
from wingfit.cli.base.rounding import with_unit
from wingfit.cli.effects import With, names
from wingfit.cli.exports import export_run
from wingfit.cli.forces.runs import RunId, force_result, forces, predict
from wingfit.client import answers as a
from wingfit.client.client import DEFAULT_URL, Client, WingfitError
from wingfit.service.runs.spec_fields_by_kind import SEARCH_ONLY, VEHICLE_ONLY, WING_ONLY
from wingfit.service.units import MN

app = typer.Typer(no_args_is_help=True, help="Submit, watch and steer calibrations; fetch what they found.")

app.command()(forces)
app.command()(predict)
app.command("export")(export_run)
INTERRUPTED = 130
CLEAR = 2.0  # standard errors from which a value differs from zero; as the page says it (service/web/parts/tables.js)


@app.command("list")
def list_(
    dataset: Annotated[str | None, typer.Option(help="Only runs of this dataset id.")] = None,
    state: Annotated[str | None, typer.Option(help="Only runs in this state, e.g. RUNNING.")] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """List the runs on the server.

    Example: wingfit runs list --state RUNNING
    """
    with Client(url) as client:
        runs = client.runs(dataset_id=dataset, state=state.upper() if state else None)
    if as_json:
        print_json(runs)
        return
    rows = [
        [
            r["id"],
            r["name"] or "",
            r["state"],
            f"{100 * r['progress']:.0f} %",
            duration(r["eta_seconds"]),
            best(r),
            moment(r["created_at"]),
        ]
        for r in runs
    ]
    columns = ["id", "name", "state", ">progress", ">left", ">best", "submitted"]
    table(columns, rows, "no runs; submit one: wingfit runs submit DATASET_ID")


@app.command()
def submit(
    dataset_id: Annotated[str, typer.Argument(help="Id of a dataset, from 'wingfit datasets list'.")],
    division: Annotated[str | None, typer.Option(help="4, 11, 24, or bodies per strip, e.g. 3,3,3,2.")] = None,
    mode: Annotated[
        str | None,
        typer.Option(help="staged (vacuum, then tunnel), joint, or local (each recording by itself)."),
    ] = None,
    method: Annotated[str | None, typer.Option(help="genetic, cma_es or gauss_newton.")] = None,
    finish: Annotated[bool, typer.Option("--finish", help="Gauss-Newton after the search of each stage.")] = False,
    population: Annotated[int | None, typer.Option(help="Individuals per generation.")] = None,
    stall: Annotated[int | None, typer.Option(help="Generations without improvement that end a stage.")] = None,
    tolerance: Annotated[float | None, typer.Option(help="Relative improvement that counts.")] = None,
    max_generations: Annotated[int | None, typer.Option(help="At most so many per stage.")] = None,
    seed: Annotated[int | None, typer.Option(help="The same seed gives the same numbers.")] = None,
    bounds_factor: Annotated[float | None, typer.Option(help="Search estimate / factor to estimate * factor.")] = None,
    accuracy_mm: Annotated[
        float | None, typer.Option(help="Largest error of a simulated marker, 0.02 to 1; 0.1 if left out.")
    ] = None,
    recording: Annotated[list[str] | None, typer.Option(help="Fit only this recording; repeatable.")] = None,
    gene: Annotated[list[str] | None, typer.Option(help="Search only this gene; repeatable.")] = None,
    with_: With = None,
    preset: Annotated[
        str | None, typer.Option(help="Vehicles: a model of 'wingfit models'; proposed if left out.")
    ] = None,
    without: Annotated[list[str] | None, typer.Option(help="Vehicles: leave out this term; repeatable.")] = None,
    axis: Annotated[
        list[str] | None, typer.Option(help="Vehicles: fit this force axis, x or z; repeatable; x if left out.")
    ] = None,
    low_pass_hz: Annotated[
        float | None, typer.Option(help="Vehicles: cut-off; 3.2 x flap frequency if left out, 0: none.")
    ] = None,
    peel_width_beats: Annotated[
        float | None, typer.Option(help="Vehicles: beats over which the end of the peel is smoothed.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="A name to find the run by.")] = None,
    watch_it: Annotated[bool, typer.Option("--watch", help="Stay and show the progress.")] = False,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Submit a calibration; what is left out follows the thesis (wings) or Armanini et al. (2016) (vehicles).

    Example: wingfit runs submit ID --division 11 --seed 7 --watch
    """
    with Client(url) as client:
        run = client.submit_run(
            dataset_id,
            division=division,
            mode=mode,
            method=method,
            finish=finish or None,
            population=population,
            stall=stall,
            tolerance=tolerance,
            max_generations=max_generations,
            seed=seed,
            bounds_factor=bounds_factor,
            accuracy_mm=accuracy_mm,
            recordings=recording or None,
            genes=gene or None,
            effects=names(with_),
            preset=preset,
            without=without or None,
            axes=axis or None,
            low_pass_hz=low_pass_hz,
            peel_width_beats=peel_width_beats,
            name=name,
        )
        if watch_it:
            note(f"run {run['id']}")
            run = follow(client, run["id"])
    if as_json:
        print_json(run)
    elif not watch_it:
        say(f"run {run['id']} {run['state']}")
        say(f"next: wingfit runs watch {run['id']}")
    else:
        _ended(run)
    _fail_unless_good(run)


@app.command()
def show(run_id: RunId, url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """Show one run: settings, state, progress.

    Example: wingfit runs show ID --json
    """
    with Client(url) as client:
        run = client.run(run_id)
    if as_json:
        print_json(run)
        return
    rows = [
        ["run", f"{run['id']} {run['name'] or ''}"],
        ["dataset", run["dataset_id"]],
        ["state", f"{run['state']}{', stage ' + run['stage'] if run['stage'] else ''}"],
        ["progress", f"{100 * run['progress']:.0f} %, {duration(run['eta_seconds'])} left"],
        ["generations", f"{run['generations']} ({run['evaluations']} evaluations)"],
        ["best", f"{best(run)} {'per marker' if run['kind'] == 'tracks' else 'RMS'}"],
        ["settings", ", ".join(settings(run))],
        ["submitted", moment(run["created_at"])],
        ["ended", moment(run["finished_at"])],
    ]
    table(["", ""], rows + ([["error", run["error"]]] if run["error"] else []))


@app.command()
def watch(run_id: RunId, url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """Show the progress of a run until it ends; Ctrl-C leaves the run going.

    Example: wingfit runs watch ID
    """
    with Client(url) as client:
        run = follow(client, run_id)
    print_json(run) if as_json else _ended(run)
    _fail_unless_good(run)


@app.command()
def cancel(run_id: RunId, url: Url = DEFAULT_URL) -> None:
    """Stop a run for good; what it has found stays.

    Example: wingfit runs cancel ID
    """
    _steer(url, lambda client: client.cancel(run_id))


@app.command()
def pause(run_id: RunId, url: Url = DEFAULT_URL) -> None:
    """Stop a run after its current generation, to go on later.

    Example: wingfit runs pause ID
    """
    _steer(url, lambda client: client.pause(run_id))


@app.command()
def resume(run_id: RunId, url: Url = DEFAULT_URL) -> None:
    """Go on with a paused run, with the same numbers as if it had never stopped.

    Example: wingfit runs resume ID
    """
    _steer(url, lambda client: client.resume(run_id))


@app.command()
def delete(run_id: RunId, url: Url = DEFAULT_URL) -> None:
    """Delete a run that has ended.

    Example: wingfit runs delete ID
    """
    with Client(url) as client:
        client.delete_run(run_id)
    say(f"run {run_id} deleted")


@app.command()
def genome(
    run_id: RunId,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Also write {name: value} as JSON, for 'simulate --genome'."),
    ] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Print the best genome so far beside the nominal one.

    Example: wingfit runs genome ID -o best.json
    """
    with Client(url) as client:
        answer = client.genome(run_id)
    if output:
        values = {gene["name"]: gene["best"] for gene in answer["genes"]}
        output.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
        note(f"written to {output}")
    if as_json:
        print_json(answer)
        return
    genes(answer["genes"])
    if not answer["final"]:
        note("the run has not ended; these are the best values so far")


@app.command()
def result(run_id: RunId, url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """Print the misfit before and after, recording by recording, and the genes; of forces also their errors.

    Example: wingfit runs result ID
    """
    with Client(url) as client:
        answer = client.result(run_id)
    if as_json:
        print_json(answer)
        return
    if answer["kind"] == "forces":
        force_result(answer)
        return
    misfits(answer)
    say("")
    genes(answer["genes"])


def best(run: a.Run) -> str:
    """The misfit of a run so far, in mm of tracks or the unit of force that fits."""
    misfit, unit = (run["best_mm"], "mm") if run["kind"] == "tracks" else (run["best_mn"], "mN")
    if misfit is None:
        return "–"
    return f"{misfit:.2f} {unit}" if unit == "mm" else with_unit(misfit / MN)


def settings(run: a.Run) -> list[str]:
    """What a run was set to: what belongs to its kind of dataset and to its method."""
    spec = run["spec"]
    foreign = set(VEHICLE_ONLY if run["kind"] == "tracks" else WING_ONLY)
    if spec["method"] == "gauss_newton":
        foreign |= {*SEARCH_ONLY, "seed"}
    shown = {key: value for key, value in spec.items() if key not in foreign and value not in (None, [], {})}
    return [f"{key} {_said(value)}" for key, value in shown.items()]


def _said(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def genes(items: list[a.GeneInfo]) -> None:
    """Print genes: nominal, best, bounds, and whether the data can tell them."""
    rows = [
        [
            g["name"],
            number(g["nominal"]),
            number(g["best"]),
            g["unit"],
            f"[{number(g['lower'], 3)}, {number(g['upper'], 3)}]",
            _error(g),
            told(g),
        ]
        for g in items
    ]
    table(["gene", ">nominal", ">best", "unit", "bounds", ">error", "the data tell it"], rows)


def _error(gene: a.GeneInfo) -> str:
    """Standard error in per cent of the value or, where the nominal value is zero, in the gene's unit."""
    absolute, percent = gene.get("standard_error"), gene["standard_error_percent"]
    if gene["nominal"] == 0 and absolute is not None:
        return f"± {number(absolute, 2)} {gene['unit'] if gene['unit'] != '1' else ''}".strip()
    return "–" if percent is None else f"± {number(percent, 2)} %"


def told(gene: a.GeneInfo) -> str:
    """Whether the data can tell a gene, in words."""
    if not gene["searched"]:
        return "not searched"
    error = gene.get("standard_error")
    if gene["nominal"] == 0 and error is not None and abs(gene["best"]) < CLEAR * error:
        return "not different from zero"
    return {True: "yes", False: "no", None: "not known yet"}[gene["identifiable"]]


def misfits(answer: a.Result) -> None:
    """Print the mean distance per marker before and after, in mm."""
    rows = [[r["name"], use(r), mm(r["before_mm"]), mm(r["after_mm"])] for r in answer["recordings"]]
    rows.append(["all fitted", "", mm(answer["before_mm"]), mm(answer["after_mm"])])
    if answer["held_out_after_mm"] is not None:
        rows.append(["all held out", "", mm(answer["held_out_before_mm"]), mm(answer["held_out_after_mm"])])
    table(["mean distance per marker", "use", ">before mm", ">after mm"], rows)
    if answer["noise_mm"] is not None:
        say(f"tracking noise alone leaves {mm(answer['noise_mm'])} mm")
    for remark in answer["remarks"]:
        note(f"note: {remark}")


def use(recording: a.RecordingResult) -> str:
    """What a run did with a recording."""
    if recording["held_out"]:
        return "held out"
    return "not fitted" if recording["stage"] is None else "fitted"


def follow(client: Client, run_id: str) -> a.Run:
    """Show progress until the run ends; after Ctrl-C say that the run goes on, and exit."""
    try:
        with progress("calibrating") as report:
            return client.wait(run_id, lambda run: report(run["progress"], run["eta_seconds"], _note(run)))
    except KeyboardInterrupt:
        note(
            f"\nrun {run_id} goes on without you; 'wingfit runs watch {run_id}' to come back, "
            f"'wingfit runs cancel {run_id}' to stop it"
        )
        raise typer.Exit(INTERRUPTED) from None


def _note(run: a.Run) -> str:
    stage = run["stage"] or run["state"].lower()
    if run["state"] != "RUNNING":
        stage = run["state"].lower()
    return f"{stage}, generation {run['generations']}, best {best(run)}"


def _steer(url: str, call: Callable[[Client], a.Run]) -> None:
    with Client(url) as client:
        run = call(client)
    say(f"run {run['id']} {run['state']}")


def _ended(run: a.Run) -> None:
    say(f"run {run['id']} {run['state']}, best {best(run)} after {run['generations']} generations")
    if run["state"] == "SUCCEEDED":
        say(f"next: wingfit runs result {run['id']}")


def _fail_unless_good(run: a.Run) -> None:
    if run["state"] == "FAILED":
        raise WingfitError(f"run {run['id']} failed", run["error"] or "the server gives no reason")
    if run["state"] == "CANCELLED":
        raise WingfitError(f"run {run['id']} was cancelled")
