"""Routes about runs on forces: forces over the beat, predictions, and the available models."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import JSONResponse, Response

from wingfit.client.force_answers import Forces, Models, Prediction, Source
from wingfit.service.container import SIMULATION_SLOT, ServiceDep
from wingfit.service.http import responses as http
from wingfit.service.http.problems import conflict
from wingfit.service.outcomes import coefficient_source, force_views
from wingfit.service.outcomes.requests import PredictionIn
from wingfit.service.routes.outcomes import check_recording, run_row, simulating
from wingfit.service.storage import store

router = APIRouter(prefix="/v1", tags=["forces"])


@router.get("/models", responses=http.errors(), summary="Models of vehicles")
def models() -> Models:
    """List the blade-element models and their terms, with sources."""
    return force_views.models()


@router.get(
    "/runs/{run_id}/forces",
    response_model=Forces,
    responses=http.errors(404, 409),
    summary="Forces over the beat",
    dependencies=[SIMULATION_SLOT],
)
def forces(
    service: ServiceDep,
    run_id: str,
    recording: Annotated[str | None, Query(max_length=200, description="default: the first of the dataset")] = None,
    source: Annotated[
        Source | None, Query(description="of the coefficients; default: the run's best for that recording")
    ] = None,
) -> Response:
    """Return the recorded and the modelled forces over the beat, and their spectra, of one recording."""
    row = run_row(service, run_id)
    if row.kind != "forces":
        raise conflict(f"run {run_id} is on tracks; /v1/runs/{run_id}/comparison has them")
    dataset, spec = service.datasets.flapping(row.dataset_id), store.spec(row)
    wanted = dataset.recordings[0].name if recording is None else recording
    check_recording(dataset, wanted, "query.recording")
    with simulating():
        chosen = coefficient_source.chosen(service, row, dataset, wanted, source)
        found = service.engine.forces(spec, dataset, chosen.genome, wanted, chosen.source)
    answer = force_views.forces(found)
    answer["remarks"] = [*chosen.remarks, *answer["remarks"]]
    return JSONResponse(answer)


@router.post(
    "/runs/{run_id}/predictions",
    response_model=Prediction,
    responses=http.errors(404, 409),
    summary="Predict forces under any condition",
    dependencies=[SIMULATION_SLOT],
)
def predict(service: ServiceDep, run_id: str, body: PredictionIn) -> Response:
    """Return the forces over a beat that the run's global model predicts for a condition; nothing is stored."""
    row = run_row(service, run_id)
    law = coefficient_source.law(row, dataset := service.datasets.flapping(row.dataset_id))
    with simulating():
        found = service.engine.predict(store.spec(row), dataset, law, force_views.condition(body))
    return JSONResponse(force_views.prediction(found))
