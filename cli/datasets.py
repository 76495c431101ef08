"""``wingfit datasets``: upload, inspect and check recordings."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wingfit.cli.base.options import AsJson, Url
from wingfit.cli.base.output import (
    Columns,
    emit,
    moment,
    next_step,
    number,
    progress,
    records,
    remarks,
    say,
    size,
)
from wingfit.cli.jobs import NewName, NewNotes, changes, edited
from wingfit.cli.jobs import upload as upload_dataset
from wingfit.client import answers as a
from wingfit.client.client import DEFAULT_URL, Client, WingfitError

if TYPE_CHECKING:
    from wingfit.checks import Mistake
    from wingfit.records import AnyDataset, Series, SeriesDataset

app = typer.Typer(no_args_is_help=True, help="Upload, list, fetch, delete and check datasets.")

DatasetId = Annotated[str, typer.Argument(help="Id of a dataset, from 'wingfit datasets list'.")]
Source = Annotated[Path, typer.Argument(help="Folder with dataset.yaml, a .zip of it, or a .nc file.")]


@app.command("list")
def list_(url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """List the datasets on the server.

    Example: wingfit datasets list
    """
    with Client(url) as client:
        datasets = client.datasets()
    then = f"wingfit datasets show {datasets[0]['id']}" if datasets else "wingfit datasets upload FOLDER"
    emit(datasets, _list, as_json=as_json, then=then)


@app.command()
def upload(
    path: Source,
    name: Annotated[str | None, typer.Option(help="Name on the server; default: the dataset's own.")] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Upload a dataset; a folder is zipped first.

    Example: wingfit datasets upload examples/robird
    """
    with Client(url) as client:
        dataset = upload_dataset(client, path, name)
    emit(dataset, partial(_uploaded, url=url), as_json=as_json, then=_next(dataset))


@app.command()
def show(dataset_id: DatasetId, url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """Show one dataset with its recordings and their conditions.

    Example: wingfit datasets show ID
    """
    with Client(url) as client:
        dataset = client.dataset(dataset_id)
    emit(dataset, _show, as_json=as_json, then=_next(dataset))


@app.command()
def download(
    dataset_id: DatasetId,
    output: Annotated[Path, typer.Option("--output", "-o", help="File or folder to write to.")] = Path(),
    url: Url = DEFAULT_URL,
) -> None:
    """Download a dataset as it was uploaded.

    Example: wingfit datasets download ID -o robird.zip
    """
    with Client(url) as client, progress("downloading") as report:
        target = client.download(dataset_id, output, on_bytes=lambda got, total: report(got / total if total else None))
    say(str(target))
    next_step(f"wingfit datasets check {shlex.quote(str(target))}")


@app.command()
def edit(dataset_id: DatasetId, name: NewName = None, notes: NewNotes = None, url: Url = DEFAULT_URL) -> None:
    """Change the name or the notes of a dataset.

    Example: wingfit datasets edit ID --notes 'after the repair'
    """
    with Client(url) as client:
        say(edited("dataset", client.update_dataset(dataset_id, **changes(name, notes))))


@app.command()
def delete(dataset_id: DatasetId, url: Url = DEFAULT_URL) -> None:
    """Delete a dataset; delete the runs and diagnoses that refer to it first.

    Example: wingfit datasets delete ID
    """
    with Client(url) as client:
        client.delete_dataset(dataset_id)
    say(f"dataset {dataset_id} deleted")
    next_step("wingfit datasets list")


@app.command()
def check(
    path: Source,
    fix: Annotated[
        Path | None,
        typer.Option(
            "--fix", help="Write a corrected copy into this new folder, with the changes that need no decision."
        ),
    ] = None,
) -> None:
    """Check a dataset on this machine, without a server: its format, and its physics (docs/checks.md).

    Example: wingfit datasets check my-campaign/
    """
    from wingfit.checks import check_dataset  # imported late: other commands start faster

    try:
        dataset, mistakes = check_dataset(path)
    except ValueError as error:
        raise _refused(f"{path} is not a valid dataset", error) from error
    if fix is not None:
        try:
            _fix(path, fix, mistakes)
        except ValueError as error:
            raise _refused("no corrected copy was written", error) from error
        return
    remarks((str(one) for one in mistakes if not one.certain), "warning")
    certain = [vars(one.fault) for one in mistakes if one.certain]
    if certain:
        fixable = any(one.edits for one in mistakes)
        hint = f"; for a corrected copy: wingfit datasets check {path} --fix NEW_FOLDER" if fixable else ""
        raise WingfitError(f"{path} has mistakes", f"{len(certain)} errors{hint}", errors=certain)
    _valid(path, dataset)
    next_step(f"wingfit datasets upload {shlex.quote(str(path))}")


def _refused(title: str, error: ValueError) -> WingfitError:
    faults = [vars(fault) for fault in getattr(error, "errors", [])]
    count = getattr(error, "count", len(faults))
    detail = f"{count} errors" if faults else str(error)
    return WingfitError(
        title, detail + (f", of which {len(faults)} are listed" if count > len(faults) else ""), errors=faults
    )


def _fix(path: Path, target: Path, mistakes: Sequence[Mistake]) -> None:
    """Write the corrected copy, and say what was changed, what was not, and whether it passes the checks now."""
    from wingfit.checks import check_dataset
    from wingfit.checks.repair import repaired

    edits = repaired(path, target, mistakes)
    for edit in edits:
        say(f"changed {edit}")
    for one in mistakes:
        if not one.edits:
            say(f"not changed {one}")
    left = check_dataset(target).mistakes
    remarks((str(one) for one in left), "left")
    say(f"{target}: {len(edits)} changes; {path} is as it was" + ("" if left else "; the copy passes all checks"))
    next_step(f"wingfit datasets {'check' if left else 'upload'} {shlex.quote(str(target))}")


def _valid(path: Path, dataset: AnyDataset) -> None:
    from wingfit.records import Recording, SeriesDataset

    if isinstance(dataset, SeriesDataset):
        say(f"{path} is valid: '{dataset.name}', rig '{dataset.rig}'")
        records(dataset.recordings, _series_columns(dataset))
        return
    what = "wing" if dataset.kind == "tracks" else "vehicle"
    say(f"{path} is valid: '{dataset.name}', {what} '{dataset.rig.name}'")
    columns: Columns[Recording] = {
        "recording": lambda r: r.name,
        "rig": lambda r: r.rig,
        "use": lambda r: _use(held_out=r.name in dataset.held_out),
        ">frames": lambda r: len(r.times),
        ">missing": lambda r: _missing(r.valid),
    }
    records(dataset.recordings, columns)


def _series_columns(dataset: SeriesDataset) -> Columns[Series]:
    return {
        "recording": lambda r: r.name,
        "use": lambda r: _use(held_out=r.name in dataset.held_out),
        "repeats": lambda r: r.repeats or "–",
        ">samples": lambda r: len(r.times),
        ">duration": lambda r: number(float(r.times[-1] - r.times[0]), unit="s"),
        ">missing": lambda r: _missing(r.valid),
    }


def _missing(valid: Any) -> str:
    return f"{100 * float((~valid).mean()) if valid.size else 0:.1f} %"


def _list(datasets: list[a.Dataset]) -> None:
    columns: Columns[a.Dataset] = {
        "id": "id",
        "name": "name",
        ">recordings": lambda d: len(d["recordings"]),
        ">size": lambda d: size(d["size_bytes"]),
        "uploaded": lambda d: moment(d["created_at"]),
    }
    records(datasets, columns, "no datasets")


def _warned(dataset: a.Dataset) -> None:
    """Print the likely mistakes that the server found at the upload."""
    for one in dataset["warnings"]:
        text = f"{one['where']}, {one['kind']}: {one['value']}; expected {one['expected']}"
        remarks([f"{text}; likely cause: {one['cause']}; change {one['change']}"], "warning")


def _uploaded(dataset: a.Dataset, url: str) -> None:
    _warned(dataset)
    say(f"dataset {dataset['id']} '{dataset['name']}' with {len(dataset['recordings'])} recordings")
    say(f"its page: {url.rstrip('/')}/#dataset={dataset['id']}")


def _next(dataset: a.Dataset) -> str:
    """Return what comes after the upload of a dataset: a calibration, or the diagnosis of a rig of the user's own."""
    if dataset["kind"] == "series":
        return f"wingfit diagnose {dataset['id']} --rig my_rig.py"
    return f"wingfit runs submit {dataset['id']} --watch"


def _show(dataset: a.Dataset) -> None:
    say(f"{dataset['name']}  {dataset['id']}")
    say(f"{size(dataset['size_bytes'])}, uploaded {moment(dataset['created_at'])}")
    if dataset["description"]:
        say(dataset["description"])
    _warned(dataset)
    if dataset["rig"]:
        _show_series(dataset, dataset["rig"])
        return
    angle = "lag" if dataset["kind"] == "tracks" else "body pitch"
    columns: Columns[a.RecordingInfo] = {
        "recording": "name",
        "rig": "rig",
        "use": lambda r: _use(held_out=r["held_out"]),
        ">frames": "frames",
        ">missing": lambda r: f"{r['missing_percent']:.1f} %",
        ">flap": lambda r: number(r["flap_frequency_hz"], unit="Hz"),
        f">{angle}": lambda r: number(r["angle_of_attack_deg"] if r["channels"] else r["phase_lag_deg"], unit="deg"),
        ">pressure": lambda r: number(r["pressure_mbar"], unit="mbar"),
        ">airspeed": lambda r: number(r["airspeed_m_s"], unit="m/s"),
    }
    records(dataset["recordings"], columns)


def _show_series(dataset: a.Dataset, rig: a.RigInfo) -> None:
    say(f"rig {rig['name']}")
    for what, quantities in (("channels", rig["channels"]), ("inputs", rig["inputs"]), ("settings", rig["settings"])):
        if quantities:
            say(f"{what}: {', '.join(_with_unit(one['name'], one['unit']) for one in quantities)}")
    columns: Columns[a.RecordingInfo] = {
        "recording": "name",
        "use": lambda r: _use(held_out=r["held_out"]),
        ">samples": "frames",
        ">duration": lambda r: number(r["duration_s"], unit="s"),
        ">missing": lambda r: f"{r['missing_percent']:.1f} %",
    }
    settings = {f">{one['name']}": _setting(one["name"], one["unit"]) for one in rig["settings"]}
    records(dataset["recordings"], {**columns, **settings})


def _setting(name: str, unit: str) -> Callable[[a.RecordingInfo], str]:
    return lambda recording: number(recording["settings"].get(name), unit="" if unit == "1" else unit)


def _with_unit(name: str, unit: str) -> str:
    return name if unit == "1" else f"{name} ({unit})"


def _use(*, held_out: bool) -> str:
    return "held out" if held_out else "fitted"
