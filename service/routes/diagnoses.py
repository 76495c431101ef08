"""Submit, list, fetch, watch, cancel and delete diagnoses; their findings and reports."""

from __future__ import annotations

import json
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from sqlalchemy.orm import Session
from starlette.responses import HTMLResponse, Response, StreamingResponse

from wingfit.service.container import DOWNLOAD_SLOT, Service, ServiceDep
from wingfit.service.diagnoses import checks, specs, views
from wingfit.service.diagnoses.schemas import DiagnosisIn, DiagnosisOut
from wingfit.service.http import responses as http
from wingfit.service.http.events import JobState, LastEventId, Watched, described
from wingfit.service.http.problems import ProblemError, conflict, error_item, invalid
from wingfit.service.routes.runs import load
from wingfit.service.runs import spec_views
from wingfit.service.runs.schemas import Page
from wingfit.service.storage import store
from wingfit.service.storage.tables import DiagnosisRow, RunRow
from wingfit.workers import jobs

router = APIRouter(prefix="/v1/diagnoses", tags=["diagnoses"])

# A report is drawn with styles of its own, and does and loads nothing; the page may show it in a frame.
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


@router.post(
    "",
    status_code=202,
    response_model=DiagnosisOut,
    responses={202: {"headers": http.LOCATION}, **http.errors(409, 429)},
    summary="Submit a diagnosis",
)
def submit(
    request: Request, service: ServiceDep, body: DiagnosisIn, idempotency_key: http.RepeatKey = None
) -> Response:
    """Submit a diagnosis of a dataset, or of a run; it is stored when this answers, and made when its turn comes."""
    # As it was given: a default that is named overrides the run's setting.
    again = http.repeat(request, idempotency_key, body.model_dump_json(exclude_unset=True))
    with service.database.read() as session:
        earlier = store.earlier_answer(session, again)
    if earlier:
        return http.sent(earlier)
    run = _run(service, body.run_id)
    dataset_id = _dataset_id(body, run)
    dataset = load(service, dataset_id)
    of_run = store.spec(run) if run else None
    spec = checks.checked(body, dataset, service.engine, service.diagnoser, of_run, _genome(run))
    name = body.name or f"{dataset.name}, {spec_views.model_name(dataset, spec.calibration)}"[: spec_views.LONGEST_NAME]

    def create(session: Session) -> store.Answer:
        owner = store.admitted(session, dataset_id, service.settings.max_active)
        row = DiagnosisRow(id=store.new_id("dx"), owner=owner, name=name, dataset_id=dataset_id, kind=dataset.kind)
        row.run_id, row.spec = body.run_id, specs.plain(spec)
        row.created_at, row.evaluations, row.elapsed_seconds = store.now(), 0, 0.0
        store.put_job(row, jobs.step(None, jobs.Submit())[0])
        session.add(row)
        return store.Answer(202, f"/v1/diagnoses/{row.id}", views.diagnosis(row).model_dump(mode="json"))

    answered, new = http.created(service.database, again, create)
    if new:
        service.enqueue(service.diagnosing, answered.body["id"])
    return http.sent(answered)


@router.get("", response_model=Page[DiagnosisOut], responses=http.errors(), summary="List diagnoses")
def list_diagnoses(
    service: ServiceDep,
    dataset_id: Annotated[str | None, Query(max_length=200)] = None,
    run_id: Annotated[str | None, Query(max_length=200)] = None,
    state: jobs.State | None = None,
    limit: http.Limit = 50,
    cursor: http.Cursor = None,
) -> Page[DiagnosisOut]:
    """List diagnoses, newest first."""
    equal = {"dataset_id": dataset_id, "run_id": run_id, "state": state}
    with service.database.read() as session:
        rows, following = store.page(session, DiagnosisRow, limit, cursor, **equal)
    return Page(items=[views.diagnosis(row) for row in rows], next_cursor=following)


@router.get("/{diagnosis_id}", response_model=DiagnosisOut, responses=http.errors(404), summary="Fetch a diagnosis")
def fetch(service: ServiceDep, diagnosis_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return one diagnosis with its progress."""
    with service.database.read() as session:
        row = store.diagnosis(session, diagnosis_id)
    return http.tagged(views.diagnosis(row), if_none_match)


@router.delete("/{diagnosis_id}", status_code=204, responses=http.errors(404, 409), summary="Delete a diagnosis")
def delete(service: ServiceDep, diagnosis_id: str) -> None:
    """Delete a diagnosis that has ended, with its finding."""
    with service.database.write() as session:
        store.delete_diagnosis(session, diagnosis_id)
    service.changes.publish(diagnosis_id)


@router.post("/{diagnosis_id}/cancel", status_code=202, responses=http.errors(404, 409), summary="Cancel a diagnosis")
def cancel(service: ServiceDep, diagnosis_id: str) -> DiagnosisOut:
    """Cancel a diagnosis; one under way ends within seconds."""
    row = service.runner.control(service.diagnosing, diagnosis_id, jobs.Cancel())
    assert isinstance(row, DiagnosisRow)  # noqa: S101  # for the type checker: the rows of diagnoses
    return views.diagnosis(row)


@router.get(
    "/{diagnosis_id}/finding",
    response_model=dict[str, Any],
    responses=http.errors(404, 409),
    summary="Finding",
    dependencies=[DOWNLOAD_SLOT],
)
def finding(service: ServiceDep, diagnosis_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return what a diagnosis found; see /v1/schemas/finding."""
    body = json.dumps(_finding(service, diagnosis_id)).encode()
    return http.marked(body, "application/json", if_none_match)


@router.get(
    "/{diagnosis_id}/report",
    response_class=HTMLResponse,
    responses=http.errors(404, 409),
    summary="Report",
    dependencies=[DOWNLOAD_SLOT],
)
def report(service: ServiceDep, diagnosis_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the report: one HTML file that needs nothing else."""
    text = service.diagnoser.html(_finding(service, diagnosis_id))
    return http.marked(text.encode(), "text/html", if_none_match, REPORT_HEADERS)


@router.get(
    "/{diagnosis_id}/events",
    response_class=StreamingResponse,
    responses={200: described("step", _EVENTS), **http.errors(404)},
    summary="Watch a diagnosis",
)
def events(service: ServiceDep, diagnosis_id: str, last_event_id: LastEventId = None) -> StreamingResponse:
    """Send steps and states as they happen; ends after the final state."""
    with service.database.read() as session:
        store.diagnosis(session, diagnosis_id)

    def read(session: Session, after: int, limit: int) -> JobState:
        steps = store.past_steps(session, diagnosis_id, after, limit)
        job = views.diagnosis(store.diagnosis(session, diagnosis_id))
        return JobState(job, [views.step(one) for one in steps])

    return service.events.answer(Watched(diagnosis_id, "step", read), last_event_id)


def _run(service: Service, run_id: str | None) -> RunRow | None:
    """The run that a body names, or a 422."""
    if run_id is None:
        return None
    try:
        with service.database.read() as session:
            return store.run(session, run_id)
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
    """The best genome of the run, or a 409 while it has none."""
    if run is None:
        return {}
    if run.genome is None:
        message = f"the run is {run.state} and has no genome yet; wait for its first generation, or leave run_id out"
        raise conflict(f"run {run.id}: {message}", state=run.state)
    return run.genome


def _finding(service: Service, diagnosis_id: str) -> dict[str, Any]:
    with service.database.read() as session:
        return store.finding(session, diagnosis_id)
