"""Routes that runs, diagnoses and trackings share: fetch, watch, cancel, delete; and how their jobs are submitted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fastapi import APIRouter, Path, Request
from pydantic import BaseModel
from sqlalchemy.orm import Session
from starlette.responses import Response, StreamingResponse

from wingfit.records import AnyDataset, Dataset, wing_or_vehicle
from wingfit.service.container import Service, ServiceDep
from wingfit.service.http import responses as http
from wingfit.service.http.events import LastEventId, described, watched
from wingfit.service.http.problems import ProblemError, error_item, invalid
from wingfit.service.jobs.job_kind import JobKind
from wingfit.service.jobs.runner import JobRef
from wingfit.service.storage import store
from wingfit.service.storage.tables import JobRow
from wingfit.workers import jobs

KindOf = Callable[[Service], JobKind]
Actions = Mapping[str, tuple[jobs.Event, str]]


def submit_job(
    request: Request, service: Service, kind: JobKind, key: str | None, body: BaseModel, plan: Callable[[], JobRow]
) -> Response:
    """Store the job that a request describes, queue it, and return the answer. A repeated request gets the same answer.

    ``kind``: of the job; ``key``: the Idempotency-Key, if any; ``plan`` checks the request ``body`` and returns a job,
    not yet stored, with its subject, name and spec. Two requests with one key are equal if they contain the
    same fields with the same values. A default written out differs from a field left out, because it overrides a run's
    setting.
    """
    again = http.repeat(request, key, body.model_dump_json(exclude_unset=True))
    with service.database.read() as session:
        earlier = store.earlier_answer(session, again)
    if earlier:
        return http.sent(earlier)
    row = plan()

    def create(session: Session) -> store.Answer:
        row.id, row.created_at = store.new_id(kind.prefix), store.now()
        row.owner = store.admitted(session, row, service.settings.max_active)
        if getattr(body, "name", None) is None:
            row.name = store.free_name(session, row, row.name)
        store.put_job(row, jobs.step(None, jobs.Submit())[0])
        session.add(row)
        session.flush()  # sets the columns that have a default
        return store.Answer(202, f"{kind.path}/{row.id}", kind.view(row))

    answer, new = http.created(service.database, again, create)
    if new:
        service.runner.enqueue(JobRef.of(kind, row))
    return http.sent(answer)


def add_job_routes(
    router: APIRouter, what: str, kind_of: KindOf, answer: type, actions: Actions, step: str, example: str
) -> None:
    """Add the routes of one job of a kind to ``router``: fetch, delete, watch, and one for each of ``actions``.

    ``what``: name of the resource, e.g. "run"; ``kind_of`` returns its kind of job; ``answer``: type of its JSON
    answer; ``actions``: event that a user can apply and its description, by name; ``step``: name of the server-sent
    event that reports a step; ``example``: of a stream of events.
    """
    in_path = Path(alias=f"{what}_id")
    job = f"/{{{what}_id}}"

    @router.get(
        job,
        response_model=answer,
        responses=http.errors(404),
        summary=f"Fetch a {what}",
        description=f"Return one {what} with its progress.",
    )
    def fetch(service: ServiceDep, job_id: str = in_path, if_none_match: http.IfNoneMatch = None) -> Response:
        kind = kind_of(service)
        with service.database.read() as session:
            return http.tagged(kind.view(store.one(session, kind.table, job_id)), if_none_match)

    @router.delete(
        job,
        status_code=204,
        responses=http.errors(404, 409),
        summary=f"Delete a {what}",
        description=f"Delete a {what} that has ended, with its steps and results.",
    )
    def delete(service: ServiceDep, job_id: str = in_path) -> None:
        with service.database.write() as session:
            store.delete_job(session, kind_of(service).table, job_id)
        service.forget_job(job_id)

    def add_action(name: str, event: jobs.Event, description: str) -> None:
        @router.post(
            f"{job}/{name}",
            name=name,
            status_code=202,
            response_model=answer,
            responses=http.errors(404, 409),
            summary=f"{name.capitalize()} a {what}",
            description=description,
        )
        def act(service: ServiceDep, job_id: str = in_path) -> Any:
            kind = kind_of(service)
            return kind.view(service.runner.control(kind, job_id, event))

    for name, (event, description) in actions.items():
        add_action(name, event, description)

    @router.get(
        f"{job}/events",
        response_class=StreamingResponse,
        responses={200: described(step, example), **http.errors(404)},
        summary=f"Watch a {what}",
        description=f"Send events ``{step}`` and ``state`` as they happen; the stream ends after the final state.",
    )
    def events(service: ServiceDep, job_id: str = in_path, last_event_id: LastEventId = None) -> StreamingResponse:
        kind = kind_of(service)
        with service.database.read() as session:
            store.one(session, kind.table, job_id)
        return service.events.answer(watched(kind, job_id), last_event_id)


def load(service: Service, dataset_id: str) -> Dataset:
    """Return the dataset of a wing or vehicle that a request names; raise a 422 for another, or if there is none."""
    try:
        return wing_or_vehicle(load_any(service, dataset_id))
    except ValueError as error:
        raise invalid("this is not for series", [error_item("body.dataset_id", dataset_id, str(error))]) from None


def load_any(service: Service, dataset_id: str) -> AnyDataset:
    """Return the dataset that a request names; raise a 422 if there is no such dataset."""
    try:
        return service.datasets.get(dataset_id)
    except ProblemError as problem:
        if problem.status != 404:
            raise
        message = "there is no such dataset; GET /v1/datasets lists them"
        raise invalid(problem.detail, [error_item("body.dataset_id", dataset_id, message)]) from None
