"""``wingfit cameras``: calibrates cameras with a chessboard or a wand, and reads calibrations of other programs."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from wingfit.cli.base.files import new_file, read_bytes, write_text
from wingfit.cli.base.output import late_progress, next_step, note
from wingfit.client.transport import WingfitError

if TYPE_CHECKING:
    from wingfit.cameras.calibrate.result import Calibration
    from wingfit.records.errors import DatasetError

app = typer.Typer(no_args_is_help=True, help="Calibrate cameras, and read calibrations of other programs.")
Unit = Literal["m", "cm", "mm"]
FILM = "describe the films in film.yaml (docs/cameras.md), then: wingfit track film.yaml -o tracks.csv"


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
    from wingfit.records.errors import DatasetError

    columns, rows = _board(board)
    files = _images(images)
    try:
        with late_progress("finding the chessboard") as shown:
            seen = find_boards(files, Board(columns, rows, square_mm / 1000), report=shown)
        found = calibrate_boards(seen, lens=lens, world=world)
    except DatasetError as error:
        raise _refused(error) from error
    _finish(found, output, report)


@app.command()
def wand(
    points: Annotated[
        Path,
        typer.Argument(metavar="POINTS", help="Pixels of the wand: a CSV of docs/cameras.md, or xypts.csv of DLTdv."),
    ],
    length_mm: Annotated[
        list[float],
        typer.Option(help="Distance of the two markers in mm; three times (1-2, 2-3, 1-3) for three markers."),
    ],
    size_px: Annotated[
        list[str] | None, typer.Option(help="WIDTHxHEIGHT of images, for all or for each camera, without --lenses.")
    ] = None,
    focal_px: Annotated[
        list[float] | None,
        typer.Option(help="Rough focal length in pixels, for all or for each camera; it is estimated too."),
    ] = None,
    lenses: Annotated[
        Path | None, typer.Option(help="Cameras whose lenses are known (cameras.yaml), in place of --focal-px.")
    ] = None,
    free: Annotated[
        list[str] | None, typer.Option(help="Parameters of the lenses to estimate; default: f_x and f_y of --focal-px.")
    ] = None,
    origin: Annotated[
        Literal["lower-left", "upper-left", "opencv"] | None,
        typer.Option(help="Where pixels of DLTdv count from: lower-left to version 7, upper-left in version 8."),
    ] = None,
    output: Annotated[Path, new_file("Write the calibrated cameras: FILE.yaml.", "--output", "-o")] = Path(
        "cameras.yaml"
    ),
    report: Annotated[Path | None, new_file("Write pictures of the residuals: FILE.html.", "--report")] = None,
) -> None:
    """Calibrate the poses of cameras from a wand of known length that was waved in front of them.

    Axes are those of the first camera. One frame in five is not used: it shows the error of the wand's length.

    Example: wingfit cameras wand wand.csv --length-mm 240 --size-px 1280x1024 --focal-px 1900 -o cameras.yaml
    """
    from wingfit.cameras.calibrate.wand import Wand, calibrate_wand
    from wingfit.cameras.files.wand_cameras import known_cameras, rough_cameras
    from wingfit.cameras.files.wand_points import camera_names, read_wand_points
    from wingfit.records.errors import DatasetError

    if (lenses is None) == (not focal_px) or (lenses is not None) == bool(size_px):
        raise typer.BadParameter("give either --lenses, or --size-px and --focal-px", param_hint="--lenses")
    sizes = [_size(one) for one in size_px or []]
    raw = read_bytes(points)
    try:
        names = camera_names(raw, points.name)
        start = known_cameras(lenses, names) if lenses else rough_cameras(names, sizes, focal_px or [])
        stick = Wand(tuple(one / 1000 for one in length_mm))
        tracks = read_wand_points(raw, points.name, stick.markers, [one.size_px for one in start], origin)
        found = calibrate_wand(tracks, start, stick, free=free or (() if lenses else ("f_x", "f_y")))
    except DatasetError as error:
        raise _refused(error) from error
    _finish(found, output, report)


def _finish(found: Calibration, output: Path, report: Path | None) -> None:
    """Write the calibrated cameras to ``output`` and the ``report``, and print what was found."""
    from wingfit.cameras.calibrate.report import calibration_report
    from wingfit.cameras.files.camera_set import CameraSet
    from wingfit.cameras.files.project import write_cameras
    from wingfit.records.errors import DatasetError

    try:
        write_cameras(output, CameraSet(found.cameras, found.covariance))
    except DatasetError as error:
        raise _refused(error) from error
    _show(found)
    note(f"cameras written to {output}")
    if report:
        write_text(report, calibration_report(found), "report of the calibration")
    next_step(FILM)


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
    import numpy as np

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
    for one, other in combinations(found.cameras, 2):
        print(f"  {one.name} and {other.name} are {np.linalg.norm(one.centre - other.centre):.3f} m apart")
    for remark in found.notes:
        note(f"remark: {remark}")
    note(f"cameras written to {output}")
    next_step(FILM)


def _show(found: Calibration) -> None:
    from wingfit.records.errors import counted

    print(f"RMS distance {found.rms_px:.3f} px over {len(found.images)} views; world: {found.world}")
    for camera, errors, coverage in zip(found.cameras, found.errors, found.coverage, strict=True):
        print(f"  camera {camera.name}: {errors.rms_px:.3f} px, {100 * coverage.fraction:.0f} % of the image seen")
    if found.wand is not None:
        print(
            f"  length of the wand: RMS error {found.wand.used_rms_percent:.3f} %, and "
            f"{found.wand.held_out_rms_percent:.3f} % in frames that were not used"
        )
    for rejection in found.rejected:
        points = "all points" if rejection.points is None else counted(rejection.points, "point")
        note(f"rejected: camera {rejection.camera}, image {rejection.image}, {points}: {rejection.reason}")
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
    from wingfit.cameras.video.source import IMAGES, images_in, same_film

    found, places = dict[str, list[Path]](), dict[str, Path]()
    for one in stated:
        name, separator, folder = one.partition("=")
        place = Path(folder)
        if not separator or not name or not place.is_dir():
            raise typer.BadParameter(f"{one!r}: give NAME=FOLDER, with a folder of images", param_hint="images")
        if name in found:
            raise typer.BadParameter(f"camera {name!r} is given twice; give each a name", param_hint="images")
        found[name] = sorted(images_in(place))
        if not found[name]:
            raise typer.BadParameter(f"{place} holds no images ({', '.join(IMAGES)})", param_hint="images")
        same = next((other for other in found if other != name and same_film(places[other], place)), None)
        if same is not None:
            message = f"{name!r} has the images of {same!r}, or copies of them; give the images of each camera"
            raise typer.BadParameter(message, param_hint="images")
        places[name] = place
    return found
