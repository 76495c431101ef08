"""Routes that upload, list, fetch and delete datasets."""

from __future__ import annotations

import hashlib
from collections.abc import AsyncIterator
from pathlib import PurePath
from typing import Annotated

from fastapi import APIRouter, Form, Query, Request, UploadFile
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response, StreamingResponse

from wingfit.client import answers as a
from wingfit.client.recorded.answers import SeriesValues
from wingfit.records import SeriesDataset
from wingfit.report.wing_drawing import wing_drawing
from wingfit.service.container import DOWNLOAD_SLOT, UPLOAD_SLOT, ServiceDep
from wingfit.service.datasets.new_datasets import opened, stored
from wingfit.service.http import list_query as q
from wingfit.service.http import responses as http
from wingfit.service.http.list_routes import add_edit_route
from wingfit.service.http.problems import ProblemError, conflict, error_item, invalid
from wingfit.service.http.request_limits import UPLOAD_LIMIT
from wingfit.service.runs import views
from wingfit.service.runs.requests import Title
from wingfit.service.storage import listing, store
from wingfit.service.storage.database import Database
from wingfit.service.storage.listing import Wanted
from wingfit.service.storage.tables import DatasetRow

router = APIRouter(prefix="/v1/datasets", tags=["datasets"])
DRAWING_TYPE = "image/svg+xml"
# A drawing has its colours as attributes: it needs no styles, scripts or files.
DRAWING_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; sandbox"
    )
}
MEDIA_TYPES = {".zip": "application/zip", ".nc": "application/x-netcdf"}
OTHER_TYPE = "application/octet-stream"
PIECE = 4 * 2**20
ARCHIVE_TYPES = (*MEDIA_TYPES.values(), OTHER_TYPE)


@router.post(
    "",
    status_code=201,
    response_model=a.Dataset,
    responses={201: {"headers": http.LOCATION}, **http.errors(400, 409, 413, 429)},
    summary="Upload a dataset",
    dependencies=[UPLOAD_SLOT],
)
def upload(
    request: Request,
    service: ServiceDep,
    file: UploadFile,
    name: Annotated[Title | None, Form(description="instead of the dataset's own, which is numbered if in use")] = None,
    idempotency_key: http.RepeatKey = None,
) -> Response:
    """Upload a zip of a dataset folder, or a NetCDF file; stored byte for byte if it reads without error.

    The checks (docs/checks.md) refuse mistakes that are certain; doubtful ones are `warnings` of the answer.
    """
    data = file.file.read(UPLOAD_LIMIT + 1)
    if len(data) > UPLOAD_LIMIT:
        raise ProblemError(413, "too-large", f"the archive is larger than {UPLOAD_LIMIT // 2**20} MiB")
    filename = PurePath(file.filename or "dataset.zip").name[:200] or "dataset.zip"
    digest = hashlib.sha256(data).hexdigest()
    again = http.repeat(request, idempotency_key, digest, filename, name or "")
    with service.database.read() as session:
        earlier = store.earlier_answer(session, again)
    if earlier:
        return http.sent(earlier)
    return http.sent(stored(service, again, opened(service, data, filename), (filename, data), name))


@router.get("", response_model=a.Page[a.Dataset], responses=http.errors(), summary="List datasets")
def list_datasets(
    service: ServiceDep,
    kind: a.Kind | None = None,
    text: q.Text = None,
    sort: q.OfDatasets = "created_at",
    order: q.Way = None,
    limit: http.Limit = 50,
    cursor: http.Cursor = None,
) -> a.Page[a.Dataset]:
    """List datasets, newest first unless sorted otherwise."""
    wanted = Wanted(DatasetRow, {"kind": kind}, text, sort=sort, ascending=q.ascending(sort, order))
    with service.database.read() as session:
        rows, following = listing.page(session, wanted, limit, cursor)
    return {"items": [views.dataset(row) for row in rows], "next_cursor": following}


@router.get("/{dataset_id}", response_model=a.Dataset, responses=http.errors(404), summary="Fetch a dataset")
def fetch(service: ServiceDep, dataset_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the description of one dataset: its recordings, and the conditions under which they were made."""
    with service.database.read() as session:
        row = store.one(session, DatasetRow, dataset_id)
    return http.tagged(views.dataset(row), if_none_match)


@router.get(
    "/{dataset_id}/archive",
    response_class=Response,
    responses={
        200: {"content": {kind: {"schema": {"type": "string", "format": "binary"}} for kind in ARCHIVE_TYPES}},
        **http.errors(404),
    },
    summary="Fetch the archive",
    dependencies=[DOWNLOAD_SLOT],
)
def fetch_archive(service: ServiceDep, dataset_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the uploaded file, byte for byte."""
    with service.database.read() as session:
        row = store.one(session, DatasetRow, dataset_id)
        tag = f'"{row.sha256}"'
        if http.matches(if_none_match, tag):
            return Response(status_code=304, headers={"ETag": tag})
    suffix = PurePath(row.filename).suffix.lower()
    known = suffix in MEDIA_TYPES
    size = {"Content-Length": str(row.size_bytes)}
    headers = {"ETag": tag, **size, **http.attachment(f"{dataset_id}{suffix if known else '.bin'}")}
    pieces = _pieces(service.database, dataset_id, row.size_bytes)
    return StreamingResponse(pieces, media_type=MEDIA_TYPES.get(suffix, OTHER_TYPE), headers=headers)


async def _pieces(database: Database, dataset_id: str, size: int) -> AsyncIterator[bytes]:
    """Yield the uploaded file in pieces; each is a separate read, because a long read makes the database's log grow."""

    def piece(start: int) -> bytes:
        with database.look() as connection:
            return store.archive_piece(connection, dataset_id, start, min(PIECE, size - start))

    for start in range(0, size, PIECE):
        yield await run_in_threadpool(piece, start)


@router.get(
    "/{dataset_id}/series",
    response_model=SeriesValues,
    responses=http.errors(404, 409),
    summary="Fetch the values of a recording of series",
)
def fetch_series(
    service: ServiceDep,
    dataset_id: str,
    recording: Annotated[str | None, Query(max_length=200, description="its name; without it, the first")] = None,
    if_none_match: http.IfNoneMatch = None,
) -> Response:
    """Return channels and inputs of one recording of a rig of the user's own, to look at them."""
    dataset = service.datasets.get(dataset_id)
    if not isinstance(dataset, SeriesDataset):
        raise conflict(f"dataset {dataset_id} has {dataset.kind}, not series")
    try:
        chosen = dataset.recordings[0] if recording is None else dataset.recording(recording)
    except ValueError as error:
        raise invalid("there is no such recording", [error_item("query.recording", recording, str(error))]) from None
    return http.tagged(views.series_values(chosen), if_none_match)


@router.get(
    "/{dataset_id}/drawing",
    response_class=Response,
    responses={200: {"content": {DRAWING_TYPE: {"schema": {"type": "string"}}}}, **http.errors(404, 409)},
    summary="Fetch a drawing of the described wing",
)
def fetch_drawing(service: ServiceDep, dataset_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the described wing from above, to scale, as SVG: outline, flapping axis, rods and markers."""
    drawing = wing_drawing(service.datasets.flapping(dataset_id).rig)
    return http.marked(drawing.encode(), DRAWING_TYPE, if_none_match, DRAWING_HEADERS)


add_edit_route(router, "dataset", DatasetRow, a.Dataset, views.dataset)


@router.delete("/{dataset_id}", status_code=204, responses=http.errors(404, 409), summary="Delete a dataset")
def delete(service: ServiceDep, dataset_id: str) -> None:
    """Delete a dataset that no run or diagnosis refers to."""
    with service.database.write() as session:
        service.datasets.delete(session, dataset_id)
