"""Submit, list, fetch, control and delete runs."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request
from sqlalchemy.orm import Session
from starlette.responses import JSONResponse, Response

from wingfit.calibration.search import CalibrationSpec
from wingfit.records import Dataset
from wingfit.service.container import Service, ServiceDep
from wingfit.service.http import json_reads
from wingfit.service.http import responses as http
from wingfit.service.http.problems import ProblemError, error_item, invalid
from wingfit.service.runs import spec_views, views
from wingfit.service.runs.request_checks import gene_names, unknown_recordings
from wingfit.service.runs.schemas import CheckedOut, Page, RunOut
from wingfit.service.runs.spec_schemas import RunIn
from wingfit.service.storage import store
from wingfit.service.storage.tables import RunRow
from wingfit.workers import jobs

router = APIRouter(prefix="/v1/runs", tags=["runs"])


@router.post(
    "",
    status_code=202,
    response_model=RunOut,
    responses={
        200: {"model": CheckedOut, "description": "Nothing is wrong with it (validate_only)"},
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
    """Submit a calibration; it is stored when this answers, and computed when its turn comes."""
    if validate_only:
        dataset, spec = _asked(service, body)
        name = body.name or spec_views.run_name(dataset, spec)
        return JSONResponse(CheckedOut(name=name, spec=spec_views.spec_out(spec)).model_dump(mode="json"))
    # Without defaults, so that an option that a later version adds does not make an earlier request another one.
    again = http.repeat(request, idempotency_key, body.model_dump_json(exclude_defaults=True))
    with service.database.read() as session:
        earlier = store.earlier_answer(session, again)
    if earlier:
        return http.sent(earlier)
    dataset, spec = _asked(service, body)
    name = body.name or spec_views.run_name(dataset, spec)

    def create(session: Session) -> store.Answer:
        owner = store.admitted(session, body.dataset_id, service.settings.max_active)
        row = RunRow(id=store.new_id("run"), owner=owner, name=name, dataset_id=body.dataset_id, kind=dataset.kind)
        row.spec = store.spec_json(spec)
        row.created_at, row.evaluations, row.elapsed_seconds = store.now(), 0, 0.0
        store.put_job(row, jobs.step(None, jobs.Submit())[0])
        session.add(row)
        return store.Answer(202, f"/v1/runs/{row.id}", views.run(row).model_dump(mode="json"))

    answer, new = http.created(service.database, again, create)
    if new:
        service.enqueue(service.calibrating, answer.body["id"])
    return http.sent(answer)


@router.get("", response_model=Page[RunOut], responses=http.errors(), summary="List runs")
async def list_runs(
    service: ServiceDep,
    dataset_id: Annotated[str | None, Query(max_length=200)] = None,
    state: jobs.State | None = None,
    limit: http.Limit = http.PAGE,
    cursor: http.Cursor = None,
) -> Response:
    """List runs, newest first."""
    # A filter may pass over many rows before it finds one.
    short = limit <= http.PAGE and dataset_id is None and state is None
    return await json_reads.answer(short, json_reads.runs, service.database, limit, cursor, dataset_id, state)


@router.get("/{run_id}", response_model=RunOut, responses=http.errors(404), summary="Fetch a run")
async def fetch(service: ServiceDep, run_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return one run with its progress."""
    return http.marked(json_reads.run(service.database, run_id), http.JSON, if_none_match)


@router.delete("/{run_id}", status_code=204, responses=http.errors(404, 409), summary="Delete a run")
def delete(service: ServiceDep, run_id: str) -> None:
    """Delete a run that has ended, with its history."""
    with service.database.write() as session:
        store.delete_run(session, run_id)
    service.changes.publish(run_id)


@router.post("/{run_id}/cancel", status_code=202, responses=http.errors(404, 409), summary="Cancel a run")
def cancel(service: ServiceDep, run_id: str) -> RunOut:
    """Cancel a run; one under way ends with its present generation."""
    return _steered(service, run_id, jobs.Cancel())


@router.post("/{run_id}/pause", status_code=202, responses=http.errors(404, 409), summary="Pause a run")
def pause(service: ServiceDep, run_id: str) -> RunOut:
    """Pause a run; one under way pauses after its present generation."""
    return _steered(service, run_id, jobs.Pause())


@router.post("/{run_id}/resume", status_code=202, responses=http.errors(404, 409), summary="Resume a run")
def resume(service: ServiceDep, run_id: str) -> RunOut:
    """Go on after the last finished generation."""
    return _steered(service, run_id, jobs.Resume())


def _steered(service: Service, run_id: str, event: jobs.Event) -> RunOut:
    row = service.runner.control(service.calibrating, run_id, event)
    assert isinstance(row, RunRow)  # noqa: S101  # for the type checker: the rows of calibrations
    return views.run(row)


def load(service: Service, dataset_id: str) -> Dataset:
    """The dataset that a body names, or a 422."""
    try:
        return service.datasets.get(dataset_id)
    except ProblemError as problem:
        if problem.status != 404:
            raise
        message = "there is no such dataset; GET /v1/datasets lists them"
        raise invalid(problem.detail, [error_item("body.dataset_id", dataset_id, message)]) from None


def _asked(service: Service, body: RunIn) -> tuple[Dataset, CalibrationSpec]:
    """What a request is about and asks for, or a 422."""
    dataset = load(service, body.dataset_id)
    spec_views.refuse_foreign(body, dataset)
    spec_views.refuse_cutoff(body.low_pass_hz, dataset.recordings)
    spec_views.refuse_effects(body.effects, dataset, body)
    spec = _checked(service, spec_views.of_run(body), dataset)
    spec_views.refuse_idle(body, spec.method)
    return dataset, spec


def _checked(service: Service, spec: CalibrationSpec, dataset: Dataset) -> CalibrationSpec:
    """The specification with everything decided, or a 422."""
    known_genes = gene_names(service.engine, spec, dataset)
    known_recordings = tuple(recording.name for recording in dataset.recordings)
    genes = [(f"body.genes.{place}", name) for place, name in enumerate(spec.genes)]
    faults = [*unknown_recordings(spec.recordings, known_recordings), *spec_views.unknown_genes(genes, known_genes)]
    if faults:
        raise invalid("the request names what does not exist", faults)
    try:
        return service.engine.check(spec, dataset)
    except ValueError as error:
        raise invalid("the specification does not fit the dataset", [error_item("body", None, str(error))]) from None
