"""``wingfit import --dataset``: a whole dataset from tracks alone."""

from __future__ import annotations

import shlex
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import typer

from wingfit.cli.base.output import next_step, note, say, table
from wingfit.client.transport import WingfitError

if TYPE_CHECKING:
    from wingfit.importers import ImportedTracks
    from wingfit.importers.start import Start


def check(dataset: Path | None, output: Path | None, flap_frequency_hz: float | None, airspeed: float | None) -> None:
    """Raise a usage error for options that do not go together, or have impossible values."""
    from wingfit.importers.start import MAX_FREQUENCY, MIN_FREQUENCY

    for option, value, least, most in (
        ("--flap-frequency-hz", flap_frequency_hz, MIN_FREQUENCY, MAX_FREQUENCY),
        ("--airspeed-m-s", airspeed, 0.0, 1e3),
    ):
        if value is not None and dataset is None:
            raise typer.BadParameter("is for --dataset FOLDER; add it", param_hint=option)
        if value is not None and not least <= value <= most:
            raise typer.BadParameter(f"is {value:g}; it must lie in [{least:g}, {most:g}]", param_hint=option)
    if dataset is None:
        return
    if output is not None:
        raise typer.BadParameter("the dataset has the tables in it; leave out --output", param_hint="--dataset")
    if dataset.exists():
        raise typer.BadParameter(f"{str(dataset)!r} exists; name a new folder", param_hint="--dataset")


def started(
    found: list[ImportedTracks],
    dataset: Path | None,
    flap_frequency_hz: float | None,
    airspeed: float | None,
    rows: str | None,
) -> Start | None:
    """Write the dataset of the tracks ``found`` to the new folder ``dataset``; WingfitError says what is missing."""
    from wingfit.importers.start import Conditions, start_dataset
    from wingfit.records.errors import DatasetError

    if dataset is None:
        return None
    try:
        start = start_dataset(found, dataset.name, Conditions(flap_frequency_hz, airspeed, rows))
    except DatasetError as error:
        faults = [vars(fault) for fault in error.errors]
        raise WingfitError(
            "no dataset was written", f"{len(faults)} error{'s' if len(faults) > 1 else ''}", errors=faults
        ) from None
    try:
        dataset.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=dataset.parent, prefix=f".{dataset.name}.") as scratch:
            partial = Path(scratch) / dataset.name  # so that a failure leaves no part of a dataset
            (partial / "recordings").mkdir(parents=True)
            for name, text in start.files.items():
                (partial / name).write_text(text, encoding="utf-8", newline="\n")
            partial.rename(dataset)
    except OSError as error:
        raise WingfitError(f"the dataset cannot be written to {dataset}", error.strerror or str(error)) from error
    return start


def show(start: Start, dataset: Path, frame: str) -> None:
    """Print what was described, from where, and what to do next; ``frame``: of the positions."""
    what = "the wing, described from its tracks" if start.kind == "wing" else "series of positions, without a wing"
    say(f"dataset written to {dataset}: {what}")
    table(["described", "value", "source"], [[one.what, one.value, one.source] for one in start.facts])
    if start.kind == "wing":
        note(f"replace what is assumed by what you know, in {dataset / 'dataset.yaml'} (docs/formats.md)")
    elif frame == "body":
        note("the positions are in body axes; a wing is described only in its own: x aft, y out along it, z up")
    else:
        note("for a dataset of a wing, say where the axes of the file point: --axes 'x aft, y out, z up'")
    folder = shlex.quote(str(dataset))
    next_step(
        f"wingfit datasets check {folder}; then, with a server ('wingfit serve'): wingfit datasets upload {folder}"
    )
