"""Routes that submit, list, fetch, watch, cancel and delete diagnoses, and return their findings and reports."""

from __future__ import annotations

import json
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from starlette.responses import HTMLResponse, Response

from wingfit.client.answers import Page
from wingfit.client.diagnosis_answers import Diagnosis, PartialFinding
from wingfit.records import SeriesDataset, wing_or_vehicle
from wingfit.service.answers import checked
from wingfit.service.container import DOWNLOAD_SLOT, Service, ServiceDep
from wingfit.service.diagnoses import checks, views
from wingfit.service.diagnoses.requests import DiagnosisIn
from wingfit.service.http import list_query as q
from wingfit.service.http import responses as http
from wingfit.service.http.list_routes import add_edit_route, add_groups_route
from wingfit.service.http.problems import ProblemError, conflict, error_item, invalid
from wingfit.service.rigs.stored_rig import given_rig, requested_rig, stored_rig
from wingfit.service.routes.jobs import Actions, add_job_routes, load_any, submit_job
from wingfit.service.runs import spec_views
from wingfit.service.storage import listing, store
from wingfit.service.storage.listing import Wanted
from wingfit.service.storage.tables import DiagnosisRow, RunRow
from wingfit.workers import jobs

router = APIRouter(prefix="/v1/diagnoses", tags=["diagnoses"])

# A report has inline styles, runs no scripts and loads nothing; the web page may show it in a frame.
REPORT_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'self'; sandbox allow-popups allow-popups-to-escape-sandbox"
    ),
    "X-Frame-Options": "SAMEORIGIN",
}
_EVENTS = """id: 12
event: step
data: {"sequence": 12, "stage": "refitting with hinge offset", "progress": 0.62, "evaluations": 5210}

id: 12
event: state
data: {"id": "dx_7d20c14be5a9f386", "state": "SUCCEEDED", "verdict": "named"}

"""
_ACTIONS: Actions = {"cancel": (jobs.Cancel(), "Cancel a diagnosis; if it is running, it ends within seconds.")}
add_groups_route(router, "diagnoses", DiagnosisRow)
add_edit_route(router, "diagnosis", DiagnosisRow, Diagnosis, views.diagnosis)
add_job_routes(router, "diagnosis", lambda service: service.diagnosing, Diagnosis, _ACTIONS, "step", _EVENTS)


@router.post(
    "",
    status_code=202,
    response_model=Diagnosis,
    responses={202: {"headers": http.LOCATION}, **http.errors(409, 429)},
    summary="Submit a diagnosis",
)
def submit(
    request: Request, service: ServiceDep, body: DiagnosisIn, idempotency_key: http.RepeatKey = None
) -> Response:
    """Submit a diagnosis of a dataset or run; it is stored before the answer, and computed when its turn comes."""

    def plan() -> DiagnosisRow:
        run = _run(service, body.run_id)
        dataset_id = _dataset_id(body, run)
        dataset = load_any(service, dataset_id)
        given = given_rig(run.rig) if body.rig is None and run and run.rig else body.rig
        rig, of_run = requested_rig(given, dataset), store.spec(run) if run else None
        if isinstance(dataset, SeriesDataset) and rig:
            spec = checks.checked_rig(body, dataset, rig, service.diagnoser, of_run, _genome(run))
        else:
            known = wing_or_vehicle(dataset)
            spec = checks.checked(body, known, service.engine, service.diagnoser, of_run, _genome(run))
        name = body.name or f"{dataset.name}, {spec_views.model_name(dataset, spec.calibration)}"
        row = DiagnosisRow(dataset_id=dataset_id, kind=dataset.kind, name=name, **stored_rig(given))
        row.run_id, row.spec = body.run_id, store.spec_json(spec)
        return row

    return submit_job(request, service, service.diagnosing, idempotency_key, body, plan)


@router.get("", response_model=Page[Diagnosis], responses=http.errors(), summary="List diagnoses")
def list_diagnoses(
    service: ServiceDep,
    dataset_id: q.OfDataset = None,
    run_id: Annotated[str | None, Query(max_length=200)] = None,
    state: jobs.State | None = None,
    active: q.Active = False,
    badge: q.Fit = None,
    text: q.Text = None,
    sort: q.OfDiagnoses = "created_at",
    order: q.Way = None,
    limit: http.Limit = 50,
    cursor: http.Cursor = None,
) -> Page[Diagnosis]:
    """List diagnoses, newest first unless sorted otherwise."""
    equal = {"dataset_id": dataset_id, "run_id": run_id, "state": state}
    wanted = Wanted(DiagnosisRow, equal, text, active, badge, sort, q.ascending(sort, order))
    with service.database.read() as session:
        rows, following = listing.page(session, wanted, limit, cursor)
    return {"items": [views.diagnosis(row) for row in rows], "next_cursor": following}


@router.get(
    "/{diagnosis_id}/finding",
    response_model=dict[str, Any],
    responses=http.errors(404, 409),
    summary="Finding",
    dependencies=[DOWNLOAD_SLOT],
)
def finding(service: ServiceDep, diagnosis_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the finding (result) of a diagnosis that has succeeded; see /v1/schemas/finding."""
    return http.marked(json.dumps(finding_of(service, diagnosis_id)).encode(), http.JSON, if_none_match)


@router.get("/{diagnosis_id}/partial", responses=http.errors(404), summary="Partial finding")
def partial(service: ServiceDep, diagnosis_id: str) -> PartialFinding | None:
    """Return what a diagnosis without a finding knows: the misfit of the nominal model, and the leading hypotheses.

    Null before its nominal model has been fitted, and once it has a finding.
    """
    with service.database.read() as session:
        known = store.partial_finding(session, diagnosis_id)
    return None if known is None else checked(PartialFinding, known)


@router.get(
    "/{diagnosis_id}/report",
    response_class=HTMLResponse,
    responses=http.errors(404, 409),
    summary="Report",
    dependencies=[DOWNLOAD_SLOT],
)
def report(service: ServiceDep, diagnosis_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the report on a diagnosis that has succeeded: one HTML file without external resources."""
    text = service.diagnoser.html(finding_of(service, diagnosis_id))
    return http.marked(text.encode(), "text/html", if_none_match, REPORT_HEADERS)


def _run(service: Service, run_id: str | None) -> RunRow | None:
    """Return the run that the request names, None if it names none; raise a 422 if there is no such run."""
    if run_id is None:
        return None
    try:
        with service.database.read() as session:
            return store.one(session, RunRow, run_id)
    except ProblemError as problem:
        message = "there is no such run; GET /v1/runs lists them"
        raise invalid(problem.detail, [error_item("body.run_id", run_id, message)]) from None


def _dataset_id(body: DiagnosisIn, run: RunRow | None) -> str:
    if run is None and body.dataset_id is None:
        message = "name a dataset, or a run to start from (run_id)"
        raise invalid("there is nothing to diagnose", [error_item("body.dataset_id", None, message)])
    if run is not None and body.dataset_id not in (None, run.dataset_id):
        message = f"the run is on dataset {run.dataset_id}; leave dataset_id out, or name that one"
        raise invalid("run and dataset differ", [error_item("body.dataset_id", body.dataset_id, message)])
    return body.dataset_id or (run.dataset_id if run else "")


def _genome(run: RunRow | None) -> dict[str, float]:
    """Return the best genome of ``run`` (empty if ``run`` is None); raise a 409 if the run has none yet."""
    if run is None:
        return {}
    if run.genome is None:
        message = f"the run is {run.state} and has no genome yet; wait for its first generation, or leave run_id out"
        raise conflict(f"run {run.id}: {message}", state=run.state)
    return run.genome


def finding_of(service: Service, diagnosis_id: str) -> dict[str, Any]:
    """Return the finding of a diagnosis as JSON; raise a 404, or a 409 before the diagnosis has succeeded."""
    with service.database.read() as session:
        return store.finding(session, diagnosis_id)
