"""Routes that submit, list, fetch, watch, cancel and delete trackings of films, and return their tracks."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from starlette.responses import FileResponse, HTMLResponse, Response

from wingfit.client.answers import Page
from wingfit.client.films import answers as a
from wingfit.records import DatasetError, Wing
from wingfit.records.description.wing_description import parse_wing
from wingfit.records.files.archive import write_zip
from wingfit.service.container import DOWNLOAD_SLOT, UPLOAD_SLOT, Service, ServiceDep
from wingfit.service.datasets.new_datasets import opened, stored
from wingfit.service.films import views
from wingfit.service.films.description import DESCRIPTION, LABELS, write_description
from wingfit.service.films.files import CAMERAS, COVARIANCE, REPORT, TRACKS, TrackingFiles
from wingfit.service.films.films import require_opencv
from wingfit.service.films.requests import CALIBRATION, FilmedDatasetIn, TrackingIn
from wingfit.service.http import csv_text
from wingfit.service.http import list_query as q
from wingfit.service.http import responses as http
from wingfit.service.http.problems import ProblemError, conflict, error_item, invalid
from wingfit.service.routes.jobs import Actions, add_job_routes, load, submit_job
from wingfit.service.storage import listing, store
from wingfit.service.storage.listing import Wanted
from wingfit.service.storage.tables import FilmRow, TrackedRow, TrackingRow
from wingfit.workers import jobs

router = APIRouter(prefix="/v1/trackings", tags=["trackings"])
ARCHIVE = "application/octet-stream"
_FILE = "films.zip"  # of a dataset that was made of films
# The figures of the report run scripts, which the sandbox keeps from the API: they have an origin of their own, and
# load and send nothing.
REPORT_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'self'; sandbox allow-scripts allow-downloads"
    ),
    "X-Frame-Options": "SAMEORIGIN",
}
_EVENTS = """id: 12
event: step
data: {"sequence": 12, "stage": "detecting", "progress": 0.42, "elapsed_seconds": 31.5, "eta_seconds": 43.0}

id: 12
event: state
data: {"id": "tk_9e0b6a7c1d2f3458", "state": "SUCCEEDED"}

"""
_ACTIONS: Actions = {"cancel": (jobs.Cancel(), "Cancel a tracking; if it is running, it ends within seconds.")}
add_job_routes(router, "tracking", lambda service: service.tracking, a.Tracking, _ACTIONS, "step", _EVENTS)


@router.post(
    "",
    status_code=202,
    response_model=a.Tracking,
    responses={202: {"headers": http.LOCATION}, **http.errors(409, 429, 501)},
    summary="Submit a tracking",
)
def submit(request: Request, service: ServiceDep, body: TrackingIn, idempotency_key: http.RepeatKey = None) -> Response:
    """Submit the tracking of the markers in a film, all of whose files are there; computed when its turn comes."""

    def plan() -> TrackingRow:
        film = _film(service, body.film_id)
        _check_frames(film, body)
        spec = _spec(service, body)
        require_opencv()
        _check(service, film, spec)
        row = TrackingRow(film_id=film.id, dataset_id=body.dataset_id, spec=spec)
        row.name = body.name or f"{film.name}, {body.kind}"
        return row

    return submit_job(request, service, service.tracking, idempotency_key, body, plan)


@router.post(
    "/dataset",
    status_code=201,
    response_model=a.FilmedDataset,
    responses={201: {"headers": http.LOCATION}, **http.errors(409, 429, 501)},
    summary="Make a dataset of tracked films",
    dependencies=[UPLOAD_SLOT],
)
def make_dataset(
    request: Request, service: ServiceDep, body: FilmedDatasetIn, idempotency_key: http.RepeatKey = None
) -> Response:
    """Align the tracks of one or more films to a described wing, and store them as a new dataset.

    All films get one frame: the cameras stayed where they were. The new dataset states the noise of each marker, the
    errors of the frame, and the cameras.
    """
    again = http.repeat(request, idempotency_key, body.model_dump_json())
    with service.database.read() as session:
        earlier = store.earlier_answer(session, again)
    if earlier:
        return http.sent(earlier)
    wing = _described(service, body)
    films = [_tracked(service, number, one.tracking_id) for number, one in enumerate(body.recordings)]
    require_opencv()
    from wingfit.service.films.aligning import dataset_of_films  # imported late: the server starts faster

    try:
        dataset, alignments = dataset_of_films(wing, body, films)
        archive = write_zip(dataset)
    except DatasetError as error:
        items = [error_item(fault.where, fault.value, fault.message) for fault in error.errors]
        raise invalid("the tracks were not aligned", items) from None
    found = opened(service, archive, _FILE)
    return http.sent(
        stored(service, again, found, (_FILE, archive), body=lambda made: {"dataset": made, "alignments": alignments})
    )


@router.get("", response_model=Page[a.Tracking], responses=http.errors(), summary="List trackings")
def list_trackings(
    service: ServiceDep,
    film_id: Annotated[str | None, Query(max_length=200)] = None,
    state: jobs.State | None = None,
    limit: http.Limit = 50,
    cursor: http.Cursor = None,
    active: q.Active = False,
) -> Page[a.Tracking]:
    """List trackings, newest first."""
    wanted = Wanted(TrackingRow, {"film_id": film_id, "state": state}, active=active)
    with service.database.read() as session:
        rows, following = listing.page(session, wanted, limit, cursor)
    return {"items": [views.tracking(row) for row in rows], "next_cursor": following}


@router.get(
    "/{tracking_id}/result",
    response_model=a.TrackingResult,
    responses=http.errors(404, 409),
    summary="Summary of the tracks",
    dependencies=[DOWNLOAD_SLOT],
)
def result(service: ServiceDep, tracking_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the summary of the tracks of a tracking that has succeeded, with some instants to look at."""
    with service.database.read() as session:
        _succeeded(store.one(session, TrackingRow, tracking_id))
        found = session.get_one(TrackedRow, tracking_id)
    return http.tagged(found.body, if_none_match)


@router.get(
    "/{tracking_id}/tracks.csv",
    response_class=FileResponse,
    responses={200: {"content": {csv_text.MEDIA_TYPE: {"schema": {"type": "string"}}}}, **http.errors(404, 409)},
    summary="Tracks",
    dependencies=[DOWNLOAD_SLOT],
)
def tracks(service: ServiceDep, tracking_id: str) -> Response:
    """Return the tracks as CSV: `time_s`, and x, y, z of each marker (m), as 'wingfit track' writes them."""
    path = _file(service, tracking_id, TRACKS)
    return FileResponse(path, media_type=csv_text.MEDIA_TYPE, filename=f"{tracking_id}-{TRACKS}")


@router.get(
    "/{tracking_id}/covariance.npz",
    response_class=FileResponse,
    responses={
        200: {"content": {ARCHIVE: {"schema": {"type": "string", "format": "binary"}}}},
        **http.errors(404, 409),
    },
    summary="Covariances of the tracks",
    dependencies=[DOWNLOAD_SLOT],
)
def covariance(service: ServiceDep, tracking_id: str) -> Response:
    """Return the covariances of all places (m^2) as a NumPy archive: `names`, `times`, `covariance`."""
    path = _file(service, tracking_id, COVARIANCE)
    return FileResponse(path, media_type=ARCHIVE, filename=f"{tracking_id}-{COVARIANCE}")


@router.get(
    "/{tracking_id}/report.html",
    response_class=HTMLResponse,
    responses=http.errors(404, 409),
    summary="Pictures of the tracks",
    dependencies=[DOWNLOAD_SLOT],
)
def report(service: ServiceDep, tracking_id: str) -> Response:
    """Return pictures of the tracks: one HTML file, with its scripts, without external resources."""
    return FileResponse(_file(service, tracking_id, REPORT), media_type="text/html", headers=REPORT_HEADERS)


def _film(service: Service, film_id: str) -> FilmRow:
    """Return the film that the request names; a 422 if there is none, a 409 if files are not there."""
    try:
        with service.database.read() as session:
            row = store.one(session, FilmRow, film_id)
    except ProblemError as problem:
        message = "there is no such film; GET /v1/films lists them"
        raise invalid(problem.detail, [error_item("body.film_id", film_id, message)]) from None
    if gone := views.absent(row, service.films.files):
        raise conflict(
            f"film {film_id} has not all its files on this server: {', '.join(gone)}; upload each: "
            f"PUT /v1/films/{film_id}/files/NAME"
        )
    return row


def _check_frames(film: FilmRow, body: TrackingIn) -> None:
    """Raise a 422 if a film ends before the first frame that is to be tracked; a container may not state its end."""
    for camera in film.cameras:
        if 0 < (camera["frames"] or 0) <= body.first_frame:
            message = (
                f"the film of camera {camera['name']} has {camera['frames']} frames, counted from 0; begin earlier"
            )
            raise invalid("there is no frame to track", [error_item("body.first_frame", body.first_frame, message)])


def _spec(service: Service, body: TrackingIn) -> dict[str, Any]:
    """Return the settings of a tracking, as its row stores them."""
    if body.dataset_id is not None and body.places:
        message = "name a dataset or give places of the markers, not both"
        raise invalid("the markers have two places", [error_item("body.places", None, message)])
    if body.last_frame is not None and body.last_frame <= body.first_frame:
        message = f"must be more than first_frame, {body.first_frame}: it is not included"
        raise invalid("there is no frame to track", [error_item("body.last_frame", body.last_frame, message)])
    if body.light == "strobe" and body.clocks_within_ms:
        message = "with a strobe, its flashes show the clocks; leave it out"
        raise invalid(
            "the clocks are not needed", [error_item("body.clocks_within_ms", body.clocks_within_ms, message)]
        )
    spec = body.model_dump(include=set(a.TrackingSpec.__annotations__))
    if body.dataset_id is not None:
        spec["places"] = _places(service, body.dataset_id)
    return spec


def _places(service: Service, dataset_id: str) -> list[dict[str, Any]]:
    axes = ("x_m", "y_m", "z_m")
    return [
        {"marker": one.name, **dict(zip(axes, map(float, one.position), strict=True))}
        for one in _wing(service, dataset_id).markers
    ]


def _described(service: Service, body: FilmedDatasetIn) -> Wing:
    """Return the wing that the request describes, or whose dataset it names."""
    if (body.dataset_id is None) == (body.description is None):
        given = "both are" if body.description else "neither is"
        message = f"{given} given: name a dataset of the wing, or send its description"
        raise invalid("the wing is not described once", [error_item("body.dataset_id", body.dataset_id, message)])
    if body.dataset_id is not None:
        return _wing(service, body.dataset_id)
    try:
        return parse_wing((body.description or "").encode(), "description")
    except DatasetError as error:
        items = [error_item(f"body.{fault.where}", fault.value, fault.message) for fault in error.errors]
        raise invalid("the description of the wing cannot be read", items) from None


def _wing(service: Service, dataset_id: str) -> Wing:
    dataset = load(service, dataset_id)
    if dataset.kind != "tracks":
        message = "describes a vehicle; name the dataset of a wing"
        raise invalid("the dataset has no markers", [error_item("body.dataset_id", dataset_id, message)])
    return dataset.wing


def _tracked(service: Service, number: int, tracking_id: str) -> TrackingFiles:
    """Return the files of the tracking that recording ``number`` of a request names; a 422 if there is none."""
    try:
        with service.database.read() as session:
            row = store.one(session, TrackingRow, tracking_id)
            film = store.one(session, FilmRow, row.film_id)
    except ProblemError as problem:
        message = "there is no such tracking; GET /v1/trackings lists them"
        where = f"body.recordings.{number}.tracking_id"
        raise invalid(problem.detail, [error_item(where, tracking_id, message)]) from None
    tracks, covariance = (_file(service, row.id, name) for name in (TRACKS, COVARIANCE))
    return TrackingFiles(tracks, covariance, _cameras(service, film, tracks.parent))


def _cameras(service: Service, film: FilmRow, folder: Path) -> Path:
    """Return the file of cameras of the tracks in ``folder``; a 409 if another has replaced it."""
    copied = folder / CAMERAS
    if copied.is_file():
        return copied
    # Of a tracking by an earlier version, whose description names the file of the film.
    if film.calibration is None or CALIBRATION in views.absent(film, service.films.files):
        raise conflict(f"film {film.id} has no file of cameras on this server; upload it again")
    if film.calibration not in (folder / DESCRIPTION).read_text(encoding="utf-8"):
        raise conflict(f"the cameras of film {film.id} were replaced after it was tracked: track it again")
    return service.films.files.video(film.id, film.calibration)


def _check(service: Service, film: FilmRow, spec: dict[str, Any]) -> None:
    """Raise a 422 for places and labels of markers that cannot be right."""
    from wingfit.cameras.project import read_film  # imported late: the server starts faster
    from wingfit.cameras.track.labels import check_labels

    with TemporaryDirectory(prefix="wingfit-") as scratch:
        try:
            described = read_film(write_description(Path(scratch), film, spec, service.films.files))
            check_labels(described.labels, described.cameras, described.names)
        except DatasetError as error:
            items = [error_item(_where(fault.where), fault.value, fault.message) for fault in error.errors]
            raise invalid("the film cannot be tracked so", items) from None


def _where(place: str) -> str:
    """Return where in the request something is that stands at ``place`` in the files of a description."""
    if not place.startswith(LABELS):
        return "body.film_id" if ": films." in place else "body.places"
    line = re.search(r", line (\d+)", place)
    return f"body.labels.{int(line[1]) - 2}" if line else "body.labels"  # after the header


def _succeeded(row: TrackingRow) -> TrackingRow:
    if row.state != jobs.State.SUCCEEDED:
        raise conflict(f"tracking {row.id} is {row.state}; it has tracks when it has SUCCEEDED", state=row.state)
    return row


def _file(service: Service, tracking_id: str, name: str) -> Path:
    """Return the path of a file with tracks; a 409 before the tracking has succeeded, and if the file is gone."""
    with service.database.read() as session:
        row = _succeeded(store.one(session, TrackingRow, tracking_id))
    path = service.films.files.tracked(row.film_id, row.id) / name
    if not path.is_file():
        raise conflict(
            f"{name} of tracking {tracking_id} is not on this server (backups hold no films and tracks): submit the "
            f"tracking of film {row.film_id} again"
        )
    return path
