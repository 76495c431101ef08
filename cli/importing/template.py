"""``wingfit wing-template`` and ``wingfit wing-drawing``: a wing from an outline, and its picture, without a server."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from wingfit.cli.base.files import check_file, new_file, read_bytes, write_text
from wingfit.cli.base.output import next_step, number, print_json, remarks, say, table
from wingfit.client.transport import WingfitError

if TYPE_CHECKING:
    from wingfit.importers.planform import WingTemplate
    from wingfit.records.description.wing_plan import WingPlan

Sides = Literal["left", "right", "top", "bottom", "low-x", "high-x", "low-y", "high-y"]
_AREA, _LENGTH = 1e4, 1e3  # cm^2, mm


def wing_template(
    outline_file: Annotated[Path, typer.Argument(metavar="OUTLINE", help="SVG, DXF, or CSV of points or stations.")],
    root: Annotated[Sides | None, typer.Option(help="Side on which the root is; in a table low-x, high-y, ...")] = None,
    leading_edge: Annotated[Sides | None, typer.Option(help="Side on which the leading edge is.")] = None,
    unit: Annotated[
        Literal["m", "cm", "mm", "um", "in", "ft", "page"] | None,
        typer.Option(help="Unit of the coordinates; page: the size on the page of an SVG is the real one."),
    ] = None,
    mm_per_unit: Annotated[float | None, typer.Option(help="Millimetres per unit of the coordinates.")] = None,
    span_mm: Annotated[float | None, typer.Option(help="Length from root end to tip, mm; the scale follows.")] = None,
    hinge_mm: Annotated[
        float | None, typer.Option(help="Distance from the flapping axis out to the root end of the outline, mm.")
    ] = None,
    hinge_z_mm: Annotated[
        float | None, typer.Option(help="Height of that axis above the plane of the wing, mm; default: in it.")
    ] = None,
    origin: Annotated[
        str | None, typer.Option(help="Point X,Y of the file that is x = 0, y = 0; default: leading edge at the root.")
    ] = None,
    outline: Annotated[str | None, typer.Option(help="Name of the outline, if the file has several.")] = None,
    close: Annotated[bool, typer.Option("--close", help="The line from last to first point belongs to it.")] = False,
    fill_gaps: Annotated[bool, typer.Option("--fill-gaps", help="Gaps, e.g. between feathers, count as wing.")] = False,
    accuracy: Annotated[float, typer.Option(help="Largest error of the area of the stations, as a fraction.")] = 0.001,
    structure: Annotated[
        Literal["sheet", "rigid"] | None, typer.Option(help="A wing without rods, such as that of an animal.")
    ] = None,
    mass_g: Annotated[
        float | None, typer.Option(help="Mass of such a wing without markers, g, spread evenly over its area.")
    ] = None,
    thickness_mm: Annotated[str | None, typer.Option(help="Thickness: one number, or ROOT,TIP, mm.")] = None,
    marker_grid: Annotated[str | None, typer.Option(help="Markers: number along span x along chord, e.g. 4x3.")] = None,
    markers: Annotated[
        Path | None, typer.Option(help="Markers: CSV with name,x,y as in the outline; optional z_mm, mass_g.")
    ] = None,
    marker_z_mm: Annotated[float | None, typer.Option(help="Height of the markers above the plane, mm.")] = None,
    marker_mass_g: Annotated[float | None, typer.Option(help="Mass of each marker, g.")] = None,
    name: Annotated[str | None, typer.Option(help="Name of the wing; default: that of the file.")] = None,
    decimal: Annotated[Literal["point", "comma"], typer.Option(help="Decimal separator of a table.")] = "point",
    output: Annotated[Path | None, new_file("Write the description to FILE.yaml.", "--output", "-o")] = None,
    drawing: Annotated[Path | None, new_file("Draw the described wing to FILE.svg.", "--drawing")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite files that were written before.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was read as JSON.")] = False,
) -> None:
    """Describe a wing by an outline of its planform; write dataset.yaml with placeholders for what it does not show.

    Scale, root side, leading edge and flapping axis must be stated by the file or by you; nothing is guessed. 'wingfit
    datasets check' lists the placeholders that are left.

    Example: wingfit wing-template wing.svg --root left --leading-edge top --span-mm 210 --hinge-mm 15 -o wing.yaml
    """
    from wingfit.importers import planform
    from wingfit.records.errors import DatasetError

    for path, option in ((output, "--output"), (drawing, "--drawing")):
        _check_new(path, option, outline_file, force=force)
    try:
        found = planform.wing_template(
            outline_file, root=root, leading_edge=leading_edge, unit=unit, mm_per_unit=mm_per_unit, span_mm=span_mm,
            hinge_mm=hinge_mm, hinge_z_mm=hinge_z_mm, origin=_pair("--origin", origin, ",", "12.5,3"), outline=outline,
            close=close, fill_gaps=fill_gaps, accuracy=accuracy,
            structure=structure, mass_g=mass_g, thickness_mm=_thickness(thickness_mm),
            marker_grid=_grid(marker_grid), marker_file=None if markers is None else str(markers),
            marker_z_mm=marker_z_mm, marker_mass_g=marker_mass_g, name=name, decimal=decimal,
        )  # fmt: skip
    except DatasetError as error:
        raise _refused("no wing was described", error) from None
    if output is not None:
        write_text(output, found.yaml, f"description of {found.file}")
    if drawing is not None:
        from wingfit.records.description.wing_plan import read_plan
        from wingfit.report.wing_drawing import wing_drawing as draw

        write_text(drawing, draw(read_plan(found.yaml.encode(), found.file)), "drawing")
    if as_json:
        print_json(found.as_json() | {"written": None if output is None else str(output)})
        return
    _show(found)
    if output is None:
        next_step("nothing was written; to write the description, add: --output FILE.yaml")
    else:
        next_step(f"fill in {output}, then: wingfit wing-drawing {output} -o wing.svg")


def wing_drawing(
    wing: Annotated[Path, typer.Argument(metavar="WING", help="dataset.yaml of a wing, or a dataset.")],
    output: Annotated[Path, new_file("Write the drawing to FILE.svg.", "--output", "-o")],
    force: Annotated[bool, typer.Option("--force", help="Overwrite a drawing that was written before.")] = False,
) -> None:
    """Draw a described wing from above, to scale: outline, stations, flapping axis, rods and markers.

    A description that is not filled in yet is drawn as far as it goes.

    Example: wingfit wing-drawing examples/robird -o robird.svg
    """
    from wingfit.records.errors import DatasetError
    from wingfit.report.wing_drawing import wing_drawing as draw

    _check_new(output, "--output", wing, force=force)
    try:
        text = draw(_plan(wing))
    except DatasetError as error:
        raise _refused(f"{wing} cannot be drawn", error) from None
    write_text(output, text, "drawing")
    next_step(f"open {output} in a browser, correct {wing}, then: wingfit datasets check FOLDER")


def _plan(path: Path) -> WingPlan:
    from wingfit.records import load_dataset, wing_or_vehicle
    from wingfit.records.description.wing_plan import plan_of, read_plan

    file = path / "dataset.yaml" if path.is_dir() else path
    if file.suffix.lower() in (".yaml", ".yml"):
        raw = read_bytes(file)
        if not re.search(rb"^vehicle:", raw, re.MULTILINE):
            return read_plan(raw, file.name)
    dataset = wing_or_vehicle(load_dataset(path))
    return plan_of(dataset.vehicle if dataset.recordings[0].forces else dataset.wing)


def _check_new(path: Path | None, option: str, source: Path, *, force: bool) -> None:
    check_file(path, option)
    if path is None or not path.exists():
        return
    if source.exists() and path.samefile(source):
        raise typer.BadParameter(f"{path} is the file that is read; name another", param_hint=option)
    if not force:
        raise typer.BadParameter(f"{str(path)!r} exists; name another, or overwrite it with --force", param_hint=option)


def _refused(title: str, error: ValueError) -> WingfitError:
    faults = [vars(fault) for fault in getattr(error, "errors", [])]
    return WingfitError(title, f"{len(faults)} error{'s' if len(faults) > 1 else ''}", errors=faults)


def _pair(option: str, text: str | None, separator: str, example: str) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        first, second = (float(part) for part in text.split(separator))
    except ValueError:
        raise typer.BadParameter(f"{text!r} must be two numbers, such as {example}", param_hint=option) from None
    return first, second


def _thickness(text: str | None) -> tuple[float, float] | None:
    return _pair("--thickness-mm", text if text is None or "," in text else f"{text},{text}", ",", "12,6")


def _grid(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    match = re.fullmatch(r"\s*([0-9]{1,4})\s*x\s*([0-9]{1,4})\s*", text)
    if not match:
        raise typer.BadParameter(f"{text!r} must be two whole numbers, such as 4x3", param_hint="--marker-grid")
    return int(match[1]), int(match[2])


def _show(found: WingTemplate) -> None:
    """Print the facts and who stated them, and the measures of the wing."""
    sizes, area = found.measures, found.outline_area_m2
    say(f"{found.file}: {found.title}, outline {found.outline!r}, {len(found.sections.y)} stations")
    table(["fact", "value", "stated by"], [[f.fact, f.value, f"{f.by}: {f.where}".rstrip(": ")] for f in found.facts])
    rows = [
        ["span", number(sizes.span_m * _LENGTH), "mm", "root end to tip"],
        ["area", number(sizes.area_m2 * _AREA), "cm^2", f"of the outline {number(area * _AREA, 5)} cm^2"],
        ["mean chord", number(sizes.mean_chord_m * _LENGTH), "mm", "area / span"],
        ["aspect ratio", number(sizes.aspect_ratio), "", "span^2 / area, of one wing"],
        ["tip radius R", number(sizes.tip_radius_m * _LENGTH), "mm", "flapping axis to tip"],
        ["r2", number(sizes.second_moment_radius_m * _LENGTH), "mm", "radius of the second moment of area"],
        ["r2 / R", number(sizes.second_moment_radius), "", ""],
    ]
    table(["measure", ">value", "unit", "of one wing"], rows)
    if found.markers:
        say(f"{len(found.markers)} marker{'' if len(found.markers) == 1 else 's'}")
    remarks(f"{found.file}: {one}" for one in found.remarks)
