"""``wingfit track``: tracks of markers from the films of calibrated cameras, without a server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wingfit.cli.base.files import new_file, write_text
from wingfit.cli.base.output import late_progress, next_step, note, print_json
from wingfit.client.transport import WingfitError

if TYPE_CHECKING:
    from wingfit.cameras.track.result import TrackedFilm


def track(
    film: Annotated[Path, typer.Argument(metavar="FILM", help="Description: film.yaml, with cameras, films, markers.")],
    output: Annotated[Path | None, new_file("Write the tracks: FILE.csv.", "--output", "-o")] = None,
    covariance: Annotated[
        Path | None, new_file("Write the covariances of all places: FILE.npz.", "--covariance")
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder for what is detected, so that an interrupted run goes on; default: one that is removed.",
        ),
    ] = None,
    report: Annotated[Path | None, new_file("Write pictures of what was seen: FILE.html.", "--report")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Track the markers of a wing in the films of two to eight calibrated cameras.

    Detects the markers in each frame, merges the half-lit frames of a strobe, compares the clocks of cameras that are
    not synchronised, identifies the markers by their places on the wing, and triangulates them with covariances.

    Example: wingfit track film.yaml --store detected -o tracks.csv
    """
    from wingfit.cameras.project import read_film  # imported late: other commands start faster
    from wingfit.cameras.track.procedure import track as run
    from wingfit.cameras.track.progress import whole
    from wingfit.cameras.track.report import film_report
    from wingfit.records.errors import DatasetError

    try:
        with late_progress("tracking") as shown:

            def progress(step: str, part: float) -> None:
                shown(whole(step, part), None, step)

            found = run(read_film(film, store), progress)
    except DatasetError as error:
        count = f"{error.count} error{'s' if error.count > 1 else ''}"
        raise WingfitError("the films were not tracked", count, errors=[vars(one) for one in error.errors]) from error
    if output:
        write_text(output, found.csv(), f"tracks of {film}")
    if covariance:
        try:
            found.write_covariance(covariance)
        except OSError as error:
            raise WingfitError(f"cannot write {covariance}", error.strerror or str(error)) from error
        note(f"wrote {covariance}")
    if report:
        write_text(report, film_report(found), f"pictures of {film}")
    if as_json:
        print_json(found.as_json())
        return
    _show(found)
    if output:
        next_step(f"wingfit align {output} --wing dataset.yaml -o aligned.csv")
    else:
        next_step("nothing was written; to write the tracks, add: --output FILE.csv")


def _show(found: TrackedFilm) -> None:
    """Print a summary of the tracks."""
    summary = found.as_json()
    print(
        f"{summary['instants']} instants over {summary['seconds']:.3f} s; "
        f"{summary['markers_found_median']:g} of {len(found.names)} markers in the median"
    )
    for name, one in summary["markers"].items():
        deviation = one["standard_deviation_mm"]
        precise = "" if deviation is None else f", standard deviation {deviation:.3f} mm"
        print(f"  {name:12} found in {one['found_percent']:5.1f} %{precise}, {one['rejected']} rejected")
    for name, one in summary["cameras"].items():
        bad = f"; {len(one['bad_frames'])} bad frames" if one["bad_frames"] else ""
        print(f"  camera {name}: residual {one['residual_px']} px{bad}")
    for remark in summary["remarks"]:
        note(f"remark: {remark}")
