"""Routes that read files of tracking systems; nothing of them is stored."""

from __future__ import annotations

from pathlib import PurePath
from typing import Annotated

from fastapi import APIRouter, Depends, Form, UploadFile
from pydantic_core import to_json
from starlette.responses import Response, StreamingResponse

from wingfit.client.importing.answers import FirstDescription, TrackImport
from wingfit.importers import Given, inspect_bytes
from wingfit.importers.inspection import Inspection
from wingfit.importers.markers import allowed
from wingfit.importers.start import MAX_FREQUENCY, MIN_FREQUENCY, Conditions, start_dataset
from wingfit.records.errors import DatasetError
from wingfit.service.container import READ_SLOT
from wingfit.service.http import csv_text
from wingfit.service.http import responses as http
from wingfit.service.http.problems import ProblemError, error_item, invalid
from wingfit.service.http.request_limits import UPLOAD_LIMIT
from wingfit.service.importing import views
from wingfit.service.importing.options import only_fields, options

router = APIRouter(prefix="/v1/imports", tags=["imports"])
Options = Annotated[Given, Depends(options)]
_FIELDS, _AND_FREQUENCY = Depends(only_fields()), Depends(only_fields("flap_frequency_hz"))
_EXAMPLE = "time_s,tip_x_m,tip_y_m,tip_z_m\n0.0,0.02,0.48,0.003\n0.005,,,\n"


@router.post(
    "",
    response_model=TrackImport,
    responses=http.errors(400, 413),
    summary="Read a file of a tracking system",
    dependencies=[_FIELDS, READ_SLOT],
)
def import_file(file: UploadFile, given: Options) -> Response:
    """Return what was understood of the file, the options that it does not state, and a preview of the tracks."""
    found = _inspected(file, given)
    if not found.settled_by_options:
        raise _refused(found)
    return Response(to_json(views.imported(found)), media_type=http.JSON)


@router.post(
    "/table",
    response_class=Response,
    responses={
        200: {
            "headers": {"Content-Disposition": {"description": "name to save it under", "schema": {"type": "string"}}},
            "content": {csv_text.MEDIA_TYPE: {"schema": {"type": "string"}, "example": _EXAMPLE}},
        },
        **http.errors(400, 413),
    },
    summary="Convert a file of a tracking system",
    dependencies=[_FIELDS, READ_SLOT],
)
def import_table(file: UploadFile, given: Options) -> Response:
    """Return the tracks as the table of a recording: times in seconds, positions in metres, empty cells in gaps."""
    found = _inspected(file, given)
    if found.tracks is None:
        raise _refused(found)
    name = allowed(PurePath(found.file).stem) or "tracks"
    headers = http.attachment(f"{name}.csv")
    return StreamingResponse(found.tracks.csv_parts(), media_type=csv_text.MEDIA_TYPE, headers=headers)


@router.post(
    "/description",
    response_model=FirstDescription,
    responses=http.errors(400, 413),
    summary="Describe a wing by its tracks",
    dependencies=[_AND_FREQUENCY, READ_SLOT],
)
def import_description(
    file: UploadFile,
    given: Options,
    flap_frequency_hz: Annotated[
        float | None,
        Form(ge=MIN_FREQUENCY, le=MAX_FREQUENCY, description="flap frequency, if the tracks do not show it clearly"),
    ] = None,
) -> Response:
    """Return a first description of the rig by its tracks alone, for dataset.yaml; what is assumed is marked in it.

    With `axes` of a wing it is a wing; otherwise series of the positions of the markers, without a wing.
    """
    found = _inspected(file, given)
    if found.tracks is None:
        raise _refused(found)
    name = allowed(PurePath(found.file).stem) or "wing"
    try:
        start = start_dataset([found.tracks], name, Conditions(flap_frequency_hz, rows=given.rows))
    except DatasetError as error:
        found.error = DatasetError(error.errors, error.count)  # without its traceback, which holds the tracks
        raise _refused(found) from None
    return Response(to_json(views.description(start)), media_type=http.JSON)


def _inspected(file: UploadFile, given: Given) -> Inspection:
    data = file.file.read(UPLOAD_LIMIT + 1)
    if len(data) > UPLOAD_LIMIT:
        detail = f"the file is larger than {UPLOAD_LIMIT // 2**20} MiB; cut the recording in parts, or use the command"
        raise ProblemError(413, "too-large", f"{detail} wingfit import")
    return inspect_bytes(data, PurePath(file.filename or "").name[:200] or "file", given)


def _refused(found: Inspection) -> ProblemError:
    """Return the 422 with all faults of the file, as the command line lists them, and the options that are missing."""
    faults = found.error.errors if found.error else []
    items = [error_item(fault.where, fault.value, fault.message) for fault in faults]
    problem = invalid("no tracks were imported", items)
    if found.questions:
        problem.extra["questions"] = views.questions(found)
    return problem
