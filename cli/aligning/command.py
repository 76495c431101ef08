"""``wingfit align``: brings tracks in any camera axes to the frame of a described wing, without a server."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from wingfit.cli.base.files import check_file, write_text
from wingfit.cli.base.output import late_progress, next_step, print_json
from wingfit.client.transport import WingfitError

if TYPE_CHECKING:
    from wingfit.records import CameraPose


def align(
    tracks: Annotated[
        list[Path],
        typer.Argument(
            metavar="TRACKS...",
            help="Tracks: what wingfit import or track writes, or import reads. Several are recordings by cameras that "
            "stayed where they were: they get one common frame.",
        ),
    ],
    wing: Annotated[Path, typer.Option(help="Description of the wing: dataset.yaml, or the keys of a wing alone.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Write the tracks in the wing's frame: FILE.csv; of several recordings, a folder.",
        ),
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
    flap_frequency_hz: Annotated[
        float | None,
        typer.Option(help="As set on the rig, to 2 %: the true one on the cameras' clock is found; a strobe needs it."),
    ] = None,
    covariance: Annotated[
        list[Path] | None,
        typer.Option(
            help="What wingfit track --covariance wrote, one for each recording: the noise of the markers in the "
            "axes of the wing is written beside the tracks, to FILE.noise.yaml, for dataset.yaml.",
        ),
    ] = None,
    cameras: Annotated[
        Path | None,
        typer.Option(help="Calibration in whose axes the tracks are, cameras.yaml: printed for the dataset."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Find the frame of a wing in tracks of any camera axes, name its markers, and write the tracks in that frame.

    Estimates the hinge from the motion, distinguishes a left wing from a right one, assigns tracks to the described
    markers, repairs swapped labels, and refuses where the answer is not certain.

    Example: wingfit align trial.csv --wing dataset.yaml -o aligned.csv
    """
    from wingfit._align import align_recordings  # imported late: other commands start faster
    from wingfit.cli.aligning import results
    from wingfit.records.errors import DatasetError
    from wingfit.tracking.marker_noise import marker_noise

    targets = _targets(output, tracks, force=force)
    _check_covariances(covariance or [], targets, len(tracks), axes, force=force)
    for option, given in (("--cameras", cameras), ("--covariance", covariance)):
        if given and body:
            message = "belongs to cameras that stand still in the frame of the wing; with --body, they do not"
            raise typer.BadParameter(message, param_hint=option)
    try:
        poses = _poses(cameras)
        with late_progress("aligning") as report:
            every = align_recordings(
                tracks,
                wing,
                side=side,
                up=up,
                labels=_labels(label or []),
                ignore_names=ignore_names,
                body=tuple(name.strip() for name in body.split(",") if name.strip()),
                mean_flap_deg=mean_flap_deg,
                flap_frequency_hz=flap_frequency_hz,
                report=report,
            )
            noises = [marker_noise(*one) for one in zip(every, covariance or [], strict=False)]
    except DatasetError as error:
        count = f"{error.count} error{'s' if error.count > 1 else ''}"
        raise WingfitError("the tracks were not aligned", count, errors=[vars(one) for one in error.errors]) from error
    for target, found in zip(targets, every, strict=False):
        write_text(target, found.csv(axes), f"aligned tracks of {found.file}")
    for target, noise in zip(targets, noises, strict=False):
        write_text(_noise_of(target), noise.yaml(), "keys of the recording in dataset.yaml")
    if as_json:
        written: list[str | None] = [str(one) for one in targets] if targets else [None] * len(every)
        answers = [
            found.as_json() | {"written": one, "cameras": results.cameras_of(found, poses)}
            for found, one in zip(every, written, strict=True)
        ]
        print_json(answers[0] if len(answers) == 1 else {"recordings": answers})
        return
    for found in every:
        results.show(found, poses, is_true=flap_frequency_hz is not None)
    if targets:
        next_step("list them under recordings: of dataset.yaml, then: wingfit datasets check FOLDER")
    else:
        next_step("nothing was written; to write the tracks, add: --output FILE.csv")


def _poses(file: Path | None) -> tuple[CameraPose, ...]:
    """Return the cameras in the calibration ``file``, in the axes of the tracks; none without a file."""
    if file is None:
        return ()
    from wingfit.cameras.files.read import read_cameras  # imported late, as above
    from wingfit.records.description.camera_file import LEAST_CAMERAS, MOST_CAMERAS
    from wingfit.records.description.fields import NAME_PATTERN
    from wingfit.records.errors import fail

    found = tuple(camera.pose for camera in read_cameras(file).cameras)
    if not LEAST_CAMERAS <= len(found) <= MOST_CAMERAS:
        counts = f"{len(found)} cameras; a dataset has {LEAST_CAMERAS} to {MOST_CAMERAS}"
        raise fail(str(file), len(found), f"{counts}: leave those in the file that filmed the wing")
    for one in found:
        if not re.fullmatch(NAME_PATTERN, one.name):
            raise fail(
                str(file), one.name, f"camera {one.name!r}: a dataset takes letters, digits, '.', '_', '-'; rename it"
            )
    return found


def _targets(output: Path | None, tracks: list[Path], *, force: bool) -> list[Path]:
    """Return the files to write for ``tracks``, none without ``output``; a usage error if one cannot be written."""
    if output is None:
        return []
    if len(tracks) == 1:
        check_file(output, "--output", (".csv",))
        targets = [output]
    else:
        if output.exists() and not output.is_dir():
            raise typer.BadParameter(f"{output} is a file; name a folder for several", param_hint="--output")
        targets = [output / f"{one.stem}.csv" for one in tracks]
        twice = [one.name for one in targets if targets.count(one) > 1]
        if twice:
            raise typer.BadParameter(f"two recordings would be written to {twice[0]}; rename one", param_hint="TRACKS")
    for target in targets:
        _check_output(target, tracks, force=force)
    if len(tracks) > 1:
        try:
            output.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WingfitError(f"cannot make the folder {output}", error.strerror or str(error)) from error
    return targets


def _noise_of(target: Path) -> Path:
    return target.with_suffix(".noise.yaml")


def _check_covariances(covariance: list[Path], targets: list[Path], count: int, axes: str, *, force: bool) -> None:
    """Raise a usage error if files of ``covariance`` do not fit to ``count`` recordings written to ``targets``."""
    if not covariance:
        return
    hint = "--covariance"
    if len(covariance) != count:
        raise typer.BadParameter(
            f"{len(covariance)} are given for {count} recordings; give one for each", param_hint=hint
        )
    if not targets or axes != "wing":
        raise typer.BadParameter(
            "needs --output and the axes of the wing, in which the noise is written", param_hint=hint
        )
    for one in map(_noise_of, targets):
        _check_output(one, covariance, force=force)


def _check_output(output: Path, tracks: list[Path], *, force: bool) -> None:
    if not output.exists():
        return
    if any(one.exists() and output.samefile(one) for one in tracks):
        raise typer.BadParameter(f"{output} is a file that is read; name another", param_hint="--output")
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
