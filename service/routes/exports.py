"""Routes that return runs and diagnoses as files: JSON, CSV, NetCDF; and their calibrated models to take away."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from pydantic_core import to_json
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response, StreamingResponse

from wingfit.client.export_answers import DiagnosisExport, Format, ModelFormat, RunExport
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.service.container import DOWNLOAD_SLOT, HeldSlots, Service, ServiceDep
from wingfit.service.diagnoses import exports as diagnosis_exports
from wingfit.service.http import csv_text
from wingfit.service.http import responses as http
from wingfit.service.http.awaited import while_awaited
from wingfit.service.outcomes import calibrated_models
from wingfit.service.routes.diagnoses import finding_of
from wingfit.service.runs import best_genome, run_netcdf
from wingfit.service.runs import exports as run_exports
from wingfit.service.runs import netcdf_variables as nc
from wingfit.service.storage.tables import DiagnosisRow, RunRow

router = APIRouter(prefix="/v1", tags=["exports"])
FormatQuery = Annotated[Format, Query(description="json: all of it; csv: a table; netcdf: series and maps")]

ModelFormatQuery = Annotated[
    ModelFormat,
    Query(
        description="python: a file or package without wingfit; tables: CSV and JSON over the fitted range; "
        "fmu: FMI 3.0; json: all values in SI units"
    ),
]
Hypothesis = Annotated[
    str | None,
    Query(
        max_length=1000,
        description='effects joined by "+", or "nominal": the model to take of a diagnosis that names none for certain',
    ),
]

_HISTORY = """sequence,stage,generation,best_m2,mean_m2,diversity,best_mm,evaluations,failed,reasons,elapsed_seconds
1,structural,0,0.00021,0.0013,0.29,1.84,50,0,,1.2
"""
_RANKING = (
    "rank,effects,title,family,source,signature,probability,evidence,score,freedom,explained,predicted,misfit_m,"
    "refitted\n1,hinge_offset,Hinge off its place,actuation,,,0.9,41.0,82.0,1,0.91,0.88,0.0005,true\n"
)


def _described(example: str) -> dict[str, Any]:
    """Return the OpenAPI description of an answer as CSV (with ``example``) or NetCDF."""
    saved = {"Content-Disposition": {"description": "name to save it under", "schema": {"type": "string"}}}
    return {
        "headers": saved,
        "content": {
            csv_text.MEDIA_TYPE: {"schema": {"type": "string"}, "example": example},
            nc.MEDIA_TYPE: {"schema": {"type": "string", "format": "binary"}},
        },
    }


@router.get(
    "/runs/{run_id}/export",
    response_model=RunExport,
    responses={200: _described(_HISTORY), **http.errors(404, 409)},
    summary="Export a run",
)
async def export_run(
    request: Request,
    service: ServiceDep,
    held: HeldSlots,
    run_id: str,
    format: FormatQuery = "json",  # noqa: A002
) -> Response:
    """Return a run as a file; NetCDF requires a simulation of every recording, and may wait for other exports."""
    if format != "netcdf":
        await held.enter_async_context(service.downloads.slot())
        return await run_in_threadpool(_run, service, run_id, format)
    exported = await run_in_threadpool(run_exports.of, service, RunRow, run_id)
    genome = await run_in_threadpool(best_genome.standing, service, exported.row)
    async with service.exports.slot():
        body = await while_awaited(request, lambda gone: run_netcdf.file(service, exported, genome, gone))
        await held.enter_async_context(service.answers.slot())
    return Response(body, media_type=nc.MEDIA_TYPE, headers=http.attachment(f"{run_id}.nc"))


def _run(service: Service, run_id: str, format: Format) -> Response:  # noqa: A002
    exported = run_exports.of(service, RunRow, run_id)
    if format == "csv":
        table = run_exports.table(service.database, exported.row)
        headers = http.attachment(f"{run_id}-history.csv")
        return StreamingResponse(table, media_type=csv_text.MEDIA_TYPE, headers=headers)
    document = run_exports.document(service, exported)
    return StreamingResponse(document, media_type=http.JSON, headers=http.attachment(f"{run_id}.json"))


@router.get(
    "/diagnoses/{diagnosis_id}/export",
    response_model=DiagnosisExport,
    responses={200: _described(_RANKING), **http.errors(404, 409)},
    summary="Export a diagnosis",
    dependencies=[DOWNLOAD_SLOT],
)
def export_diagnosis(
    service: ServiceDep,
    diagnosis_id: str,
    format: FormatQuery = "json",  # noqa: A002
) -> Response:
    """Return a diagnosis that has succeeded as a file: all of it, its ranking (CSV), or maps and misfits (NetCDF)."""
    exported, found = run_exports.of(service, DiagnosisRow, diagnosis_id), finding_of(service, diagnosis_id)
    body: str | bytes
    if format == "csv":
        body, media_type, name = diagnosis_exports.table(found), csv_text.MEDIA_TYPE, "-ranking.csv"
    elif format == "netcdf":
        body, media_type, name = diagnosis_exports.file(exported, found), nc.MEDIA_TYPE, ".nc"
    else:
        body, media_type, name = to_json(diagnosis_exports.document(exported, found)), http.JSON, ".json"
    return Response(body, media_type=media_type, headers=http.attachment(f"{diagnosis_id}{name}"))


def _model_described() -> dict[str, Any]:
    saved = {"Content-Disposition": {"description": "name to save it under", "schema": {"type": "string"}}}
    binary = {"schema": {"type": "string", "format": "binary"}}
    types = ("text/x-python", "application/zip", "application/json", "application/octet-stream")
    return {"description": "the model as a file", "headers": saved, "content": dict.fromkeys(types, binary)}


@router.get(
    "/runs/{run_id}/model",
    response_class=Response,
    responses={200: _model_described(), **http.errors(404, 409)},
    summary="Take the calibrated model of a run away",
)
async def run_model(
    service: ServiceDep,
    held: HeldSlots,
    run_id: str,
    format: ModelFormatQuery = "python",  # noqa: A002
) -> Response:
    """Return the calibrated model of a run that has succeeded as a file that needs no wingfit."""
    model = await run_in_threadpool(calibrated_models.of_run, service, run_id)
    return await _model(service, held, model, format)


@router.get(
    "/diagnoses/{diagnosis_id}/model",
    response_class=Response,
    responses={200: _model_described(), **http.errors(404, 409)},
    summary="Take the model of a diagnosis away",
)
async def diagnosis_model(
    service: ServiceDep,
    held: HeldSlots,
    diagnosis_id: str,
    format: ModelFormatQuery = "python",  # noqa: A002
    hypothesis: Hypothesis = None,
) -> Response:
    """Return the model of a diagnosis, with the effects that it names, as a file that needs no wingfit.

    A verdict that names no effects for certain has several models; ``hypothesis`` chooses one.
    """
    model = await run_in_threadpool(calibrated_models.of_diagnosis, service, diagnosis_id, hypothesis)
    return await _model(service, held, model, format)


async def _model(service: Service, held: HeldSlots, model: CalibratedModel, format_name: str) -> Response:
    """Return ``model`` as a file; it may wait for other exports, as tables simulate many conditions."""
    async with service.exports.slot():
        file = await run_in_threadpool(calibrated_models.written, model, format_name)
        await held.enter_async_context(service.answers.slot())
    return Response(file.body, media_type=file.media_type, headers=http.attachment(file.name))
