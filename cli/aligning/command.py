"""``wingfit align``: brings tracks in any camera axes to the frame of a described wing, without a server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from wingfit.cli.base.files import new_file, write_text
from wingfit.cli.base.output import late_progress, note, print_json
from wingfit.client.transport import WingfitError


def align(
    tracks: Annotated[Path, typer.Argument(metavar="TRACKS", help="Tracks: what wingfit import writes, or reads.")],
    wing: Annotated[Path, typer.Option(help="Description of the wing: dataset.yaml, or the keys of a wing alone.")],
    output: Annotated[
        Path | None, new_file("Write the tracks in the wing's frame: FILE.csv.", "--output", "-o")
    ] = None,
    axes: Annotated[
        Literal["wing", "body"],
        typer.Option(help="Of what is written: 'wing' for a dataset; 'body' (x nose, y right, z down) for kinematics."),
    ] = "wing",
    force: Annotated[bool, typer.Option("--force", help="Overwrite tracks that were written before.")] = False,
    side: Annotated[Literal["left", "right"] | None, typer.Option(help="Side of the wing; default: estimated.")] = None,
    up: Annotated[
        str | None, typer.Option(help="Axis of the tracks that is up: x, y, z, -x, -y or -z; default: estimated.")
    ] = None,
    label: Annotated[
        list[str] | None, typer.Option(help="TRACK=MARKER: which marker a track is; repeat it for others.")
    ] = None,
    ignore_names: Annotated[
        bool, typer.Option("--ignore-names", help="The names of tracks say nothing about markers.")
    ] = False,
    body: Annotated[str, typer.Option(help="Tracks on the body that carries the hinge: A,B,C.")] = "",
    mean_flap_deg: Annotated[
        float | None, typer.Option(help="Mean flap angle over the beat; default: that of the described drive.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Find the frame of a wing in tracks of any camera axes, name its markers, and write the tracks in that frame.

    Estimates the hinge from the motion, distinguishes a left wing from a right one, assigns tracks to the described
    markers, repairs swapped labels, and refuses where the answer is not certain.

    Example: wingfit align trial.csv --wing dataset.yaml -o aligned.csv
    """
    from wingfit._align import align_tracks  # imported late: other commands start faster
    from wingfit.cli.aligning import results
    from wingfit.records.errors import DatasetError

    _check_output(output, tracks, force=force)
    try:
        with late_progress("aligning") as report:
            found = align_tracks(
                tracks,
                wing,
                side=side,
                up=up,
                labels=_labels(label or []),
                ignore_names=ignore_names,
                body=tuple(name.strip() for name in body.split(",") if name.strip()),
                mean_flap_deg=mean_flap_deg,
                report=report,
            )
    except DatasetError as error:
        count = f"{error.count} error{'s' if error.count > 1 else ''}"
        raise WingfitError("the tracks were not aligned", count, errors=[vars(one) for one in error.errors]) from error
    if output:
        write_text(output, found.csv(axes), f"aligned tracks of {found.file}")
    if as_json:
        print_json(found.as_json() | {"written": None if output is None else str(output)})
        return
    results.show(found)
    if not output:
        note("nothing was written; to write the tracks, add: --output FILE.csv")


def _check_output(output: Path | None, tracks: Path, *, force: bool) -> None:
    if output is None or not output.exists():
        return
    if tracks.exists() and output.samefile(tracks):
        raise typer.BadParameter(f"{output} is the file that is read; name another", param_hint="--output")
    if not force:
        raise typer.BadParameter(f"{output} exists; name another, or overwrite it with --force", param_hint="--output")


def _labels(given: list[str]) -> dict[str, str]:
    pairs = dict[str, str]()
    for one in given:
        track, equals, marker = one.rpartition("=")
        if not equals or not track or not marker:
            raise typer.BadParameter(f"{one!r} is not of the form TRACK=MARKER", param_hint="--label")
        if track in pairs:
            raise typer.BadParameter(f"track {track!r} is given twice", param_hint="--label")
        pairs[track] = marker
    return pairs
