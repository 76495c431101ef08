"""``wingfit cameras``: calibrates cameras from images of a chessboard, and reads calibrations of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from wingfit.cli.base.files import new_file, write_text
from wingfit.cli.base.output import late_progress, note
from wingfit.client.transport import WingfitError

if TYPE_CHECKING:
    from wingfit.cameras.calibrate.result import Calibration
    from wingfit.records.errors import DatasetError

app = typer.Typer(no_args_is_help=True, help="Calibrate cameras, and read calibrations of other programs.")
Unit = Literal["m", "cm", "mm"]


@app.command()
def boards(
    images: Annotated[
        list[str],
        typer.Argument(metavar="NAME=FOLDER", help="Images of the chessboard of each camera, 2 to 8 cameras."),
    ],
    board: Annotated[str, typer.Option(help="Inner corners of the chessboard: COLUMNSxROWS, for example 9x6.")],
    square_mm: Annotated[float, typer.Option(help="Side of a square in mm, measured over many squares.")],
    output: Annotated[Path, new_file("Write the calibrated cameras: FILE.yaml.", "--output", "-o")] = Path(
        "cameras.yaml"
    ),
    lens: Annotated[
        Literal["pinhole", "brown", "rational", "fisheye"], typer.Option(help="Model of the lenses.")
    ] = "brown",
    world: Annotated[
        str | None, typer.Option(help="View whose board gives origin and axes; default: the first camera's.")
    ] = None,
    report: Annotated[Path | None, new_file("Write pictures of the residuals: FILE.html.", "--report")] = None,
) -> None:
    """Calibrate cameras from images of a chessboard that they saw together.

    Images belong together by the number in their names, or by their order. Not every camera needs to see every view.

    Example: wingfit cameras boards left=boards/left right=boards/right --board 9x6 --square-mm 25 -o cameras.yaml
    """
    from wingfit.cameras.calibrate.board import Board  # imported late: other commands start faster
    from wingfit.cameras.calibrate.boards import find_boards
    from wingfit.cameras.calibrate.from_boards import calibrate_boards
    from wingfit.cameras.calibrate.report import calibration_report
    from wingfit.cameras.files.camera_set import CameraSet
    from wingfit.cameras.files.project import write_cameras
    from wingfit.records.errors import DatasetError

    columns, rows = _board(board)
    files = _images(images)
    try:
        with late_progress("finding the chessboard") as shown:
            seen = find_boards(files, Board(columns, rows, square_mm / 1000), report=shown)
        found = calibrate_boards(seen, lens=lens, world=world)
        write_cameras(output, CameraSet(found.cameras, found.covariance))
    except DatasetError as error:
        raise _refused(error) from error
    _show(found)
    note(f"cameras written to {output}")
    if report:
        write_text(report, calibration_report(found), "report of the calibration")
    note("next: describe the films in film.yaml (docs/cameras.md), then: wingfit track film.yaml -o tracks.csv")


@app.command()
def convert(
    file: Annotated[
        Path, typer.Argument(help="Calibration by OpenCV or Anipose, or DLT coefficients of DLTdv or easyWand.")
    ],
    output: Annotated[Path, new_file("Write the cameras: FILE.yaml.", "--output", "-o")] = Path("cameras.yaml"),
    unit: Annotated[Unit | None, typer.Option(help="Unit of places in the file, which does not state it.")] = None,
    size_px: Annotated[
        list[str] | None, typer.Option(help="WIDTHxHEIGHT of images, for all or for each camera.")
    ] = None,
    dlt_origin: Annotated[
        Literal["lower-left", "upper-left", "opencv"] | None,
        typer.Option(help="Where pixels of DLT coefficients count from: DLTdv, easyWand and Argus use lower-left."),
    ] = None,
    extrinsics: Annotated[Path | None, typer.Option(help="Second file of a stereo calibration by OpenCV.")] = None,
) -> None:
    """Read cameras that another program calibrated, and write them as cameras.yaml.

    Example: wingfit cameras convert calibration.toml --unit mm -o cameras.yaml
    """
    from wingfit.cameras.files.project import write_cameras
    from wingfit.cameras.files.read import read_cameras
    from wingfit.records.errors import DatasetError

    sizes = [_size(one) for one in size_px or []]
    try:
        found = read_cameras(file, length_unit=unit, sizes_px=sizes, dlt_origin=dlt_origin, extrinsics=extrinsics)
        write_cameras(output, found)
    except DatasetError as error:
        raise _refused(error) from error
    for camera in found.cameras:
        print(f"  camera {camera.name}: {camera.size_px[0]} x {camera.size_px[1]} px, lens {camera.lens.model}")
    for remark in found.notes:
        note(f"remark: {remark}")
    note(f"cameras written to {output}")


def _show(found: Calibration) -> None:
    print(f"RMS distance {found.rms_px:.3f} px over {len(found.images)} views; world: {found.world}")
    for camera, errors, coverage in zip(found.cameras, found.errors, found.coverage, strict=True):
        print(f"  camera {camera.name}: {errors.rms_px:.3f} px, {100 * coverage.fraction:.0f} % of the image seen")
    for rejection in found.rejected:
        note(f"rejected: {rejection}")
    for warning in found.warnings:
        note(f"warning: {warning}")


def _refused(error: DatasetError) -> WingfitError:
    count = f"{error.count} error{'s' if error.count > 1 else ''}"
    return WingfitError("the cameras were not written", count, errors=[vars(one) for one in error.errors])


def _board(text: str) -> tuple[int, int]:
    try:
        columns, rows = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise typer.BadParameter(
            f"{text!r}: give inner corners as COLUMNSxROWS, as 9x6", param_hint="--board"
        ) from None
    return columns, rows


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise typer.BadParameter(f"{text!r}: give WIDTHxHEIGHT, as 1920x1080", param_hint="--size-px") from None
    return width, height


def _images(stated: list[str]) -> dict[str, list[Path]]:
    """Return the image files of each camera, from NAME=FOLDER."""
    from wingfit.cameras.video.source import IMAGES

    found: dict[str, list[Path]] = {}
    for one in stated:
        name, separator, folder = one.partition("=")
        place = Path(folder)
        if not separator or not name or not place.is_dir():
            raise typer.BadParameter(f"{one!r}: give NAME=FOLDER, with a folder of images", param_hint="images")
        found[name] = sorted(file for file in place.iterdir() if file.suffix.lower() in IMAGES)
        if not found[name]:
            raise typer.BadParameter(f"{place} holds no images ({', '.join(IMAGES)})", param_hint="images")
    return found
