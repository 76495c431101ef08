"""Routes that make films, take their files, and show their frames."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from wingfit.client.answers import Page
from wingfit.client.films import answers as a
from wingfit.service.auth.access import owner_of_new
from wingfit.service.container import FRAME_SLOT, ServiceDep
from wingfit.service.films import views
from wingfit.service.films.requests import FilmIn
from wingfit.service.http import responses as http
from wingfit.service.storage import listing, store
from wingfit.service.storage.tables import FilmRow

router = APIRouter(prefix="/v1/films", tags=["films"])
JPEG = "image/jpeg"
BINARY = {"schema": {"type": "string", "format": "binary"}}
Frame = Annotated[int, Path(ge=0, le=10**9, description="counted from 0")]
Width = Annotated[int | None, Query(ge=16, le=10_000, description="scale wider frames down to so many pixels")]


@router.post(
    "",
    status_code=201,
    response_model=a.Film,
    responses={201: {"headers": http.LOCATION}, **http.errors(409)},
    summary="Make a film",
)
def make(request: Request, service: ServiceDep, body: FilmIn, idempotency_key: http.RepeatKey = None) -> Response:
    """Make a film of two to eight cameras; then upload the file of calibrated cameras, and a video of each camera."""
    again = http.repeat(request, idempotency_key, body.model_dump_json(exclude_unset=True))

    def create(session: Session) -> store.Answer:
        cameras = [views.new_camera(name, body.rate_hz.get(name)) for name in body.cameras]
        row = FilmRow(id=store.new_id("fl"), owner=owner_of_new(), name=body.name, created_at=store.now())
        row.cameras, row.calibration, row.size_bytes = cameras, None, 0
        session.add(row)
        return store.Answer(201, f"/v1/films/{row.id}", service.films.view(row))

    answer, _ = http.created(service.database, again, create)
    return http.sent(answer)


@router.get("", response_model=Page[a.Film], responses=http.errors(), summary="List films")
def list_films(service: ServiceDep, limit: http.Limit = 50, cursor: http.Cursor = None) -> Page[a.Film]:
    """List films, newest first."""
    with service.database.read() as session:
        rows, following = listing.page(session, listing.Wanted(FilmRow), limit, cursor)
    return {"items": [service.films.view(row) for row in rows], "next_cursor": following}


@router.get("/{film_id}", response_model=a.Film, responses=http.errors(404), summary="Fetch a film")
def fetch(service: ServiceDep, film_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return one film: its cameras and what is known of their videos."""
    with service.database.read() as session:
        row = store.one(session, FilmRow, film_id)
    return http.tagged(service.films.view(row), if_none_match)


@router.put(
    "/{film_id}/files/{name}",
    response_model=a.Film,
    responses=http.errors(404, 408, 409, 413, 429, 501, 507),
    summary="Upload a file of a film",
    openapi_extra={"requestBody": {"required": True, "content": {"application/octet-stream": BINARY}}},
)
async def upload(request: Request, service: ServiceDep, film_id: str, name: str) -> a.Film:
    """Upload the video of a camera (`name`: the camera's), or the file of calibrated cameras (`name`: cameras).

    The body is the file itself. It is checked at once: the video must show a frame, and the file of cameras must have
    all cameras of the film. It replaces an earlier one, unless a tracking of the film has not ended.
    """
    films = service.films
    row, most = await run_in_threadpool(films.for_upload, film_id, name)
    async with service.film_uploads.slot():
        size = request.headers.get("content-length", "")
        stated = int(size) if size.isdecimal() else None
        path = await films.files.receive(row.id, name, _pieces(request), stated, most)
        return await run_in_threadpool(films.keep, row.id, name, path)


async def _pieces(request: Request) -> AsyncIterator[bytes]:
    async for piece in request.stream():
        if piece:
            yield piece


@router.get(
    "/{film_id}/frames/{camera}/{number}",
    response_class=Response,
    responses={200: {"content": {JPEG: BINARY}}, **http.errors(404, 501, 503)},
    summary="Fetch a frame",
    dependencies=[FRAME_SLOT],
)
def frame(
    service: ServiceDep,
    film_id: str,
    camera: str,
    number: Frame,
    width_px: Width = None,
    if_none_match: http.IfNoneMatch = None,
) -> Response:
    """Return one frame of a camera as JPEG, in grey."""
    tag = f'"{service.films.tag(film_id, camera)}-{number}-{width_px}"'
    headers = {"ETag": tag, "Cache-Control": "private, no-cache"}
    if http.matches(if_none_match, tag):
        return Response(status_code=304, headers=headers)
    return Response(service.films.jpeg(film_id, camera, number, width_px), media_type=JPEG, headers=headers)


@router.get(
    "/{film_id}/frames/{camera}/{number}/markers",
    response_model=a.FoundMarkers,
    responses=http.errors(404, 501, 503),
    summary="Detect markers in a frame",
    dependencies=[FRAME_SLOT],
)
def markers(service: ServiceDep, film_id: str, camera: str, number: Frame, kind: a.MarkerKind = "chequer") -> Any:
    """Return the markers that the detector sees in one frame as it is: half-lit frames of a strobe are not merged."""
    return service.films.markers(film_id, camera, number, kind)


@router.delete("/{film_id}", status_code=204, responses=http.errors(404, 409), summary="Delete a film")
def delete(service: ServiceDep, film_id: str) -> None:
    """Delete a film that no tracking refers to, with its files."""
    service.films.delete(film_id)
