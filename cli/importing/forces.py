"""``wingfit import-forces``: reads forces from the files of balances, without a server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from wingfit.cli.base.files import check_file, new_file, write_text
from wingfit.cli.base.output import next_step, number, print_json, remarks, say, table
from wingfit.cli.base.rounding import force_unit
from wingfit.client.transport import WingfitError

if TYPE_CHECKING:
    from wingfit.importers.forces import ImportedForces


def import_forces(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="CSV, TSV or TDMS file of a balance.")],
    unit: Annotated[
        Literal["N", "mN", "uN", "kN", "gf", "kgf", "lbf"] | None,
        typer.Option(help="Unit of the forces, if the file does not state it."),
    ] = None,
    rate_hz: Annotated[
        float | None, typer.Option(help="Samples per second, if the file states neither rate nor times.")
    ] = None,
    time_unit: Annotated[
        Literal["s", "ms", "us"] | None, typer.Option(help="Unit of a column of times that does not state it.")
    ] = None,
    axes: Annotated[
        str | None, typer.Option(help="Where a force above 0 of Fx, Fy, Fz points: 'x nose, y right, z down'.")
    ] = None,
    balance: Annotated[
        Literal["body", "wind"] | None, typer.Option(help="Whether the balance turns with the body, or not.")
    ] = None,
    body_pitch_deg: Annotated[
        float | None, typer.Option(help="Body pitch, nose up from the stream; for a balance in wind axes.")
    ] = None,
    start_s: Annotated[float | None, typer.Option(help="Time in the file at which a beat starts.")] = None,
    columns: Annotated[
        str | None,
        typer.Option(help="Columns by role (time, fx, fy, fz, lift, drag, thrust): 'time=t; fx=ch1; fz=ch3'."),
    ] = None,
    group: Annotated[str | None, typer.Option(help="Group of a TDMS file, if several have forces.")] = None,
    decimal: Annotated[Literal["point", "comma"], typer.Option(help="Decimal separator of a table.")] = "point",
    output: Annotated[Path | None, new_file("Write the forces to FILE.csv.", "--output", "-o")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that was written before.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was read as JSON.")] = False,
) -> None:
    """Read the forces of a balance; show what was understood; write them in s, N and body axes for a dataset.

    Units, axes, signs and times that the file does not state must be given; nothing is guessed.

    Example: wingfit import-forces run3.csv --axes 'x nose, y right, z down' --balance body -o recordings/run3.csv
    """
    from wingfit.importers import forces
    from wingfit.records.errors import DatasetError

    _check_target(output, file, force=force)
    try:
        found = forces.import_forces(
            file, unit=unit, rate_hz=rate_hz, time_unit=time_unit, axes=axes, balance=balance,
            body_pitch_deg=body_pitch_deg, start_s=start_s, columns=columns, group=group, decimal=decimal,
        )  # fmt: skip
    except DatasetError as error:
        many = f"{error.count} error{'s' if error.count > 1 else ''}"
        raise WingfitError("no forces were imported", many, errors=[vars(one) for one in error.errors]) from None
    if output is not None:
        write_text(output, found.csv(), f"forces of {found.file}")
    if as_json:
        print_json(found.as_json() | {"written": None if output is None else str(output)})
        return
    _show(found)
    if output is None:
        next_step("nothing was written; to write the forces, add: --output FILE.csv")
    else:
        next_step("list it under recordings: of dataset.yaml, then: wingfit datasets check FOLDER")


def _check_target(path: Path | None, source: Path, *, force: bool) -> None:
    check_file(path, "--output")
    if path is None or not path.exists():
        return
    if source.exists() and path.samefile(source):
        raise typer.BadParameter(f"{path} is the file that is read; name another", param_hint="--output")
    if not force:
        raise typer.BadParameter(
            f"{str(path)!r} exists; name another, or overwrite it with --force", param_hint="--output"
        )


def _show(found: ImportedForces) -> None:
    """Print the facts and who stated them, and a row for each axis."""
    samples = f"{len(found.times)} samples, {number(float(found.times[-1] - found.times[0]))} s"
    say(f"{found.file}: {found.title}, {samples}, {number(found.rate_hz)} samples per second")
    table(["fact", "value", "stated by"], [[f.fact, f.value, f"{f.by}: {f.where}"] for f in found.statements])
    rows = found.summary()
    show = force_unit([row["rms_n"] for row in rows])
    where = {"x": "x, to the nose", "z": "z, down"}
    cells = [
        [where[row["axis"]], *(show.show(row[key]) for key in ("mean_n", "low_n", "high_n", "rms_n")), row["gaps"]]
        for row in rows
    ]
    table(["force on the body", *(f">{one} {show.name}" for one in ("mean", "least", "most", "rms")), ">gaps"], cells)
    remarks(f"{found.file}: {one}" for one in found.remarks)
