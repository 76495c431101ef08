"""Fields of the form that carries a file of a tracking system: the options of ``wingfit import``."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Annotated, Literal

from fastapi import Form, Request

from wingfit.importers import Given
from wingfit.importers.limits import MAX_RATE, MIN_RATE
from wingfit.importers.readers import READERS
from wingfit.service.http.problems import error_item, invalid

LONGEST = 50_000
FILE = "file"


def only_fields(*more: str) -> Callable[[Request], Awaitable[None]]:
    """Return a dependency that refuses what would be ignored in a form of the fields ``more``, options and a file.

    Its 422 lists fields that do not exist, because a misspelt one would be ignored, fields that stand twice, of which
    one would be ignored, and empty ones, which would count as not given.
    """
    known = (FILE, *Given.names(), *more)

    async def check(request: Request) -> None:
        form = await request.form()
        faults, seen = [], set[str]()
        for name, value in form.multi_items():
            where, text = f"body.{name[:200]}", value if isinstance(value, str) else None
            if name not in known:
                faults.append(error_item(where, text, f"unknown field; known: {', '.join(known)}"))
            elif name in seen:
                faults.append(error_item(where, text, "stands more than once in the form; send it once"))
            elif text == "":
                faults.append(error_item(where, text, "is empty; give a value, or leave the field out"))
            seen.add(name)
        if faults:
            raise invalid("the form has fields that cannot be used", faults)
        if FILE not in seen or isinstance(form[FILE], str):
            found = request.headers.get("Content-Type", "none")[:200]
            message = f"no file was sent (content type: {found}); send it as the field 'file' of multipart/form-data"
            raise invalid("the request has no file", [error_item(f"body.{FILE}", None, message)])

    return check


async def options(
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
    """Return the options of the form."""
    return Given(
        unit, rate_hz, axes, format, time_unit, decimal, columns, rows, keep_zeros, keep_unlabelled, incomplete,
        markers, repeated,
    )  # fmt: skip
