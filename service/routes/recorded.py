"""Routes that show what a dataset holds: the described wing, tracks and forces over the beat, samples, checks."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import Response

from wingfit.client.recorded import answers as a
from wingfit.records import Dataset, Recording
from wingfit.service.container import DOWNLOAD_SLOT, Service, ServiceDep
from wingfit.service.datasets import beat_views, wing_views
from wingfit.service.http import responses as http
from wingfit.service.http.problems import conflict, error_item, invalid
from wingfit.service.storage import store
from wingfit.service.storage.tables import DatasetRow

router = APIRouter(prefix="/v1/datasets/{dataset_id}", tags=["datasets"])
RecordingName = Annotated[str | None, Query(max_length=200, description="its name; without it, the first")]
BeatNumber = Annotated[int | None, Query(ge=1, le=10**9, description="number of one beat; without it, their mean")]
MarkerName = Annotated[str | None, Query(max_length=200, description="of tracks: its name; without it, the first")]


@router.get(
    "/wing", response_model=a.DescribedWing, responses=http.errors(404, 409), summary="Fetch the described wing"
)
def fetch_wing(service: ServiceDep, dataset_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the described wing at rest: outline, rods, hinge, markers, drive, frame error and cameras."""
    return http.tagged(wing_views.described_wing(_of_kind(service, dataset_id, "tracks")), if_none_match)


@router.get(
    "/tracks",
    response_model=a.Tracks,
    responses=http.errors(404, 409),
    summary="Fetch the markers of a recording over one beat",
    dependencies=[DOWNLOAD_SLOT],
)
def fetch_tracks(
    service: ServiceDep,
    dataset_id: str,
    recording: RecordingName = None,
    beat: BeatNumber = None,
    if_none_match: http.IfNoneMatch = None,
) -> Response:
    """Return the mean beat of the markers, or a single one, and their distance from the described rest positions."""
    dataset = _of_kind(service, dataset_id, "tracks")
    chosen = _recording(dataset, recording)
    try:
        answer = beat_views.tracks(chosen, dataset.wing, beat)
    except ValueError as error:
        raise invalid("there is no such beat", [error_item("query.beat", beat, str(error))]) from None
    return http.tagged(answer, if_none_match)


@router.get(
    "/samples",
    response_model=a.Samples,
    responses=http.errors(404, 409),
    summary="Fetch a marker, or the forces, over time",
    dependencies=[DOWNLOAD_SLOT],
)
def fetch_samples(
    service: ServiceDep,
    dataset_id: str,
    recording: RecordingName = None,
    marker: MarkerName = None,
    if_none_match: http.IfNoneMatch = None,
) -> Response:
    """Return the coordinates of one marker, or the forces of a vehicle, over time, with the gaps."""
    dataset = service.datasets.flapping(dataset_id)
    chosen = _recording(dataset, recording)
    wing = dataset.wing if dataset.kind == "tracks" else None
    if wing is None and marker is not None:
        raise conflict(f"dataset {dataset_id} has forces, not markers")
    try:
        answer = beat_views.samples(chosen, wing, marker or chosen.markers[0] if wing else None)
    except ValueError as error:
        raise invalid("there is no such marker", [error_item("query.marker", marker, str(error))]) from None
    return http.tagged(answer, if_none_match)


@router.get(
    "/forces",
    response_model=a.Forces,
    responses=http.errors(404, 409),
    summary="Fetch the forces of a recording over the mean beat",
    dependencies=[DOWNLOAD_SLOT],
)
def fetch_forces(
    service: ServiceDep, dataset_id: str, recording: RecordingName = None, if_none_match: http.IfNoneMatch = None
) -> Response:
    """Return the mean beat of the recorded forces, and the motion of the wings."""
    dataset = _of_kind(service, dataset_id, "forces")
    return http.tagged(beat_views.forces(_recording(dataset, recording), dataset.vehicle), if_none_match)


@router.get("/checks", response_model=a.Checks, responses=http.errors(404), summary="List the checks of a dataset")
def fetch_checks(service: ServiceDep, dataset_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return which checks the upload carried out, and how many likely mistakes each found."""
    with service.database.read() as session:
        row = store.one(session, DatasetRow, dataset_id)
        kind, warnings = row.kind, row.warnings
    return http.tagged(wing_views.checks(kind, warnings), if_none_match)


def _of_kind(service: Service, dataset_id: str, kind: str) -> Dataset:
    dataset = service.datasets.flapping(dataset_id)
    if dataset.kind != kind:
        raise conflict(f"dataset {dataset_id} has {dataset.kind}, not {kind}")
    return dataset


def _recording(dataset: Dataset, name: str | None) -> Recording:
    try:
        return dataset.recordings[0] if name is None else dataset.recording(name)
    except ValueError as error:
        raise invalid("there is no such recording", [error_item("query.recording", name, str(error))]) from None
