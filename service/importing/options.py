"""Fields of the form that carries a file of a tracking system: the options of ``wingfit import``."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import Form, Request

from wingfit.importers import Given
from wingfit.importers.limits import MAX_RATE, MIN_RATE
from wingfit.importers.readers import READERS
from wingfit.service.http.problems import error_item, invalid

LONGEST = 50_000
FILE = "file"
FLAP_FREQUENCY = "flap_frequency_hz"  # of the description alone


async def options(
    request: Request,
    unit: Annotated[
        Literal["m", "cm", "mm", "um", "in", "ft"] | None,
        Form(description="unit of positions, if the file does not state it"),
    ] = None,
    rate_hz: Annotated[
        float | None,
        Form(ge=MIN_RATE, le=MAX_RATE, description="frames per second, if the file states neither rate nor times"),
    ] = None,
    axes: Annotated[
        str | None,
        Form(
            max_length=200,
            description="where the axes of the file point: `x aft, y out, z up` (or fore, in, down) for the frame of a "
            "dataset, `x nose, y right, z down` for body axes; without it, positions stay in the axes of the file",
        ),
    ] = None,
    format: Annotated[  # noqa: A002  # as on the command line
        str | None,
        Form(max_length=40, description=f"format, if the content fits several: {', '.join(READERS)}"),
    ] = None,
    time_unit: Annotated[
        Literal["s", "ms", "us"] | None, Form(description="unit of a column of times that does not state it")
    ] = None,
    decimal: Annotated[Literal["point", "comma"], Form(description="decimal separator of text files")] = "point",
    columns: Annotated[
        str | None,
        Form(max_length=LONGEST, description="columns of a plain table: `time=t; tip=a,b,c; root=d,e,f`"),
    ] = None,
    rows: Annotated[
        str | None,
        Form(max_length=LONGEST, description="read only these rows of a plain table: `sequence=3,side=left`"),
    ] = None,
    keep_zeros: Annotated[bool, Form(description="positions 0, 0, 0 are seen; by default they are gaps")] = False,
    keep_unlabelled: Annotated[bool, Form(description="import markers that were not identified, too")] = False,
    incomplete: Annotated[
        bool, Form(description="import a file that has other than the count of frames that it states")
    ] = False,
    markers: Annotated[
        str | None,
        Form(max_length=LONGEST, description="only these markers: `tip,root`; * stands for any letters: `right_*`"),
    ] = None,
    repeated: Annotated[
        Literal["gaps", "first"] | None,
        Form(description="rows with the same time: merge them, with gaps where they differ; or keep the first"),
    ] = None,
) -> Given:
    """Return the options of the form; a 422 lists fields that do not exist, because a misspelt one would be ignored."""
    known = (*Given.names(), *([FLAP_FREQUENCY] if request.url.path.endswith("/description") else []))
    form = await request.form()
    faults = [
        error_item(f"body.{name[:200]}", value if isinstance(value, str) else None, f"unknown field; {_known(known)}")
        for name, value in form.multi_items()
        if name != FILE and name not in known
    ]
    if faults:
        raise invalid("the form has unknown fields", faults)
    return Given(
        unit, rate_hz, axes, format, time_unit, decimal, columns, rows, keep_zeros, keep_unlabelled, incomplete,
        markers, repeated,
    )  # fmt: skip


def _known(names: tuple[str, ...]) -> str:
    return f"known: {', '.join((FILE, *names))}"
