"""Routes that submit, list, fetch, control and delete runs."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from starlette.responses import JSONResponse, Response

from wingfit.calibration.preparation import prepare_rig
from wingfit.calibration.search import CalibrationSpec
from wingfit.calibration.spec import SearchDivisionError
from wingfit.client.answers import Checked, Page, Run
from wingfit.records import AnyDataset, SeriesDataset, wing_or_vehicle
from wingfit.rigs.rig import Rig
from wingfit.service.container import Service, ServiceDep
from wingfit.service.http import json_reads
from wingfit.service.http import list_query as q
from wingfit.service.http import responses as http
from wingfit.service.http.list_routes import add_edit_route, add_groups_route
from wingfit.service.http.problems import error_item, invalid
from wingfit.service.rigs.stored_rig import requested_rig, stored_rig
from wingfit.service.routes.jobs import Actions, add_job_routes, load_any, submit_job
from wingfit.service.runs import spec_views, views
from wingfit.service.runs.request_checks import gene_names, refuse_unknown
from wingfit.service.runs.requests import RunIn
from wingfit.service.storage import store
from wingfit.service.storage.listing import Wanted
from wingfit.service.storage.tables import RunRow
from wingfit.workers import jobs

router = APIRouter(prefix="/v1/runs", tags=["runs"])
_EVENTS = """id: 12
event: generation
data: {"sequence": 12, "stage": "structural", "generation": 11, "best_mm": 1.84, "progress": 0.31}

id: 12
event: state
data: {"id": "run_5c1e07a94bd83f26", "state": "SUCCEEDED"}

"""
_ACTIONS: Actions = {
    "cancel": (jobs.Cancel(), "Cancel a run; if it is running, it ends after its current generation."),
    "pause": (jobs.Pause(), "Pause a run; if it is running, it pauses after its current generation."),
    "resume": (jobs.Resume(), "Continue a paused run after its last finished generation."),
}
add_groups_route(router, "runs", RunRow)
add_edit_route(router, "run", RunRow, Run, views.run)
add_job_routes(router, "run", lambda service: service.calibrating, Run, _ACTIONS, "generation", _EVENTS)


@router.post(
    "",
    status_code=202,
    response_model=Run,
    responses={
        200: {"model": Checked, "description": "Nothing is wrong with it (validate_only)"},
        202: {"headers": http.LOCATION},
        **http.errors(409, 429),
    },
    summary="Submit a calibration",
)
def submit(
    request: Request,
    service: ServiceDep,
    body: RunIn,
    validate_only: Annotated[bool, Query(description="only say whether it would be accepted")] = False,
    idempotency_key: http.RepeatKey = None,
) -> Response:
    """Submit a calibration; it is stored before the answer is sent, and computed when its turn comes."""

    def plan() -> RunRow:
        dataset, spec = _planned(service, body)
        name = body.name or spec_views.run_name(dataset, spec)[: store.LONGEST_NAME]
        row = RunRow(dataset_id=body.dataset_id, kind=dataset.kind, name=name, **stored_rig(body.rig))
        row.spec = store.spec_json(spec)
        return row

    if validate_only:
        row = plan()
        return JSONResponse(Checked(name=row.name, spec=spec_views.run_settings(store.spec(row))))
    return submit_job(request, service, service.calibrating, idempotency_key, body, plan)


@router.get("", response_model=Page[Run], responses=http.errors(), summary="List runs")
async def list_runs(
    service: ServiceDep,
    dataset_id: q.OfDataset = None,
    state: jobs.State | None = None,
    active: q.Active = False,
    badge: q.Fit = None,
    text: q.Text = None,
    sort: q.OfRuns = "created_at",
    order: q.Way = None,
    limit: http.Limit = http.PAGE,
    cursor: http.Cursor = None,
) -> Response:
    """List runs, newest first unless sorted otherwise."""
    equal = {"dataset_id": dataset_id, "state": state}
    wanted = Wanted(RunRow, equal, text, active, badge, sort, q.ascending(sort, order))
    # A filter may pass over many rows before it finds one, and an order looks at all.
    short = limit <= http.PAGE and wanted.plain
    return await json_reads.answer(lambda: json_reads.runs(service.database, wanted, limit, cursor), short=short)


def _planned(service: Service, body: RunIn) -> tuple[AnyDataset, CalibrationSpec]:
    """Return the dataset of a request, and its specification with every default filled in; raise a 422 if invalid."""
    whole = load_any(service, body.dataset_id)
    spec_views.refuse_foreign(body, whole)
    rig = requested_rig(body.rig, whole)
    if isinstance(whole, SeriesDataset) and rig:
        return whole, _planned_for_rig(body, rig, whole)
    dataset = wing_or_vehicle(whole)
    spec_views.refuse_cutoff(body.low_pass_hz, dataset.recordings)
    spec_views.refuse_effects(body.effects, dataset, body)
    spec = spec_views.calibration_spec(body)
    refuse_unknown(spec, dataset, gene_names(service.engine, spec, dataset))
    spec_views.refuse_idle(body, spec.method)
    try:
        spec = service.engine.check(spec, dataset)
    except SearchDivisionError as error:
        fault = error_item("body.search_division", spec.search_division, str(error))
        raise invalid("the specification does not fit the dataset", [fault]) from None
    except ValueError as error:
        raise invalid("the specification does not fit the dataset", [error_item("body", None, str(error))]) from None
    spec_views.refuse_idle(body, spec.method)
    return dataset, spec


def _planned_for_rig(body: RunIn, rig: Rig, dataset: SeriesDataset) -> CalibrationSpec:
    spec = spec_views.calibration_spec(body)
    spec_views.refuse_idle(body, spec.method)
    try:
        return prepare_rig(spec, rig, dataset).spec
    except ValueError as error:
        raise invalid("the specification does not fit the dataset", [error_item("body", None, str(error))]) from None
