"""``wingfit import``: reads the files of motion-capture systems and digitisers, without a server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from wingfit.cli.base.output import next_step, print_json
from wingfit.client.transport import WingfitError

if TYPE_CHECKING:
    from wingfit.importers import Given, ImportedTracks


def import_(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Files of tracked markers.")],
    unit: Annotated[
        Literal["m", "cm", "mm", "um", "in", "ft"] | None,
        typer.Option(help="Unit of positions, if the file does not state it."),
    ] = None,
    rate_hz: Annotated[
        float | None, typer.Option(help="Frames per second, if the file states neither rate nor times.")
    ] = None,
    axes: Annotated[
        str | None,
        typer.Option(
            help="Where each axis of the file points: 'x aft, y out, z up' (also fore, in, down) for a wing, 'x nose, "
            "y right, z down' for body axes. Default: positions stay in the axes of the file."
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write tracks: FILE.csv for one file, or a folder.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite tracks that were written before.")] = False,
    format_: Annotated[
        str | None, typer.Option("--format", help="Format, if the content fits several; a wrong name lists all.")
    ] = None,
    time_unit: Annotated[
        Literal["s", "ms", "us"] | None, typer.Option(help="Unit of a column of times that does not state it.")
    ] = None,
    decimal: Annotated[Literal["point", "comma"], typer.Option(help="Decimal separator of text files.")] = "point",
    columns: Annotated[
        str | None, typer.Option(help="Columns of a plain table: 'time=t; tip=a,b,c; root=d,e,f'.")
    ] = None,
    rows: Annotated[
        str | None, typer.Option(help="Read only these rows of a plain table: 'sequence=3,side=left'.")
    ] = None,
    keep_zeros: Annotated[
        bool, typer.Option("--keep-zeros", help="Positions 0,0,0 are seen; default: they are gaps.")
    ] = False,
    keep_unlabelled: Annotated[
        bool, typer.Option("--keep-unlabelled", help="Import markers that were not identified, too.")
    ] = False,
    incomplete: Annotated[
        bool, typer.Option("--incomplete", help="Import a file with other than the count of frames that it states.")
    ] = False,
    markers: Annotated[
        str | None, typer.Option(help="Only these markers: 'tip,root'; * stands for any letters: 'right_*'.")
    ] = None,
    repeated: Annotated[
        Literal["gaps", "first"] | None,
        typer.Option(help="Rows with the same time: merge them, with gaps where they differ; or keep the first."),
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Option(
            help="Write a whole dataset to this new folder: with --axes of a wing, the wing described from its tracks; "
            "else, series of positions."
        ),
    ] = None,
    flap_frequency_hz: Annotated[
        float | None, typer.Option(help="For --dataset; default: as the tracks show it.")
    ] = None,
    airspeed_m_s: Annotated[float | None, typer.Option(help="For --dataset; default: 0.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was read as JSON.")] = False,
) -> None:
    """Read tracked markers from the files of other programs; show what was understood; write tracks in s and m.

    Reads C3D, TRC, and the text of Motive (OptiTrack), Qualisys, Vicon Nexus, DLTdv, DeepLabCut (3-D) and Anipose, HDF5
    of SLEAP (3-D), and plain tables. The content shows the format. What a file does not state must be given; nothing is
    guessed. Tracks of one camera must be triangulated first.

    Example: wingfit import trial.c3d --axes 'x aft, y out, z up' --dataset my-wing
    """
    from wingfit.cli.importing import results  # imported late: other commands start faster
    from wingfit.importers import Given

    given = Given(
        unit=unit,
        rate_hz=rate_hz,
        axes=axes,
        format=format_,
        time_unit=time_unit,
        decimal=decimal,
        columns=columns,
        rows=rows,
        keep_zeros=keep_zeros,
        keep_unlabelled=keep_unlabelled,
        incomplete=incomplete,
        markers=markers,
        repeated=repeated,
    )
    from wingfit.cli.importing import start

    start.check(dataset, output, flap_frequency_hz, airspeed_m_s)
    targets = _targets(files, output, force=force)
    found = _read(files, given)
    started = start.started(found, dataset, flap_frequency_hz, airspeed_m_s, rows)
    written = results.write(found, targets)
    if as_json:
        print_json([results.as_json(tracks, path) for tracks, path in zip(found, written, strict=True)])
        return
    for tracks in found:
        results.show(tracks)
    if started is not None and dataset is not None:
        start.show(started, dataset, found[0].frame)
    elif targets:
        next_step(f"wingfit align {targets[0]} --wing dataset.yaml, or list them in a dataset.yaml (docs/formats.md)")
    else:
        next_step(
            "nothing was written; to write the tracks, add: --output FILE.csv; to write a dataset: --dataset FOLDER"
        )


def _targets(files: list[Path], output: Path | None, *, force: bool) -> list[Path]:
    """Return the files to write, one for each of ``files``; none without ``output``. Usage errors for what is wrong."""
    if output is None:
        return []
    from wingfit.importers.markers import allowed

    if output.suffix.lower() == ".csv" and not output.is_dir():
        if len(files) > 1:
            raise typer.BadParameter(f"{output} is one file for {len(files)}; name a folder", param_hint="--output")
        targets = [output]
    else:
        targets = [output / f"{allowed(file.stem) or 'tracks'}.csv" for file in files]
    for target, file in zip(targets, files, strict=True):
        if targets.count(target) > 1:
            message = f"several files would be written to {target}; import them one by one"
            raise typer.BadParameter(message, param_hint="--output")
        if target.exists() and file.exists() and target.samefile(file):
            raise typer.BadParameter(f"{target} is the file that is read; name another", param_hint="--output")
        if target.exists() and not force:
            message = f"{str(target)!r} exists; name another file or folder, or overwrite it with --force"
            raise typer.BadParameter(message, param_hint="--output")
    return targets


def _read(files: list[Path], given: Given) -> list[ImportedTracks]:
    """Return the tracks of all ``files``; WingfitError lists the faults of all."""
    from wingfit.importers import import_tracks
    from wingfit.records.errors import DatasetError

    found, faults = [], list[dict[str, Any]]()
    for file in files:
        try:
            found.append(import_tracks(file, **vars(given)))
        except DatasetError as error:
            faults += [vars(fault) for fault in error.errors if vars(fault) not in faults]
    if faults:
        raise WingfitError(
            "no tracks were imported", f"{len(faults)} error{'s' if len(faults) > 1 else ''}", errors=faults
        )
    return found
