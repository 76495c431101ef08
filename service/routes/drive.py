"""Routes for rigs of the user's own: those installed here, and the work of drivers, which simulate a job's rig."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import numpy as np
from fastapi import APIRouter
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from wingfit.client import drive_answers as a
from wingfit.records import Series, SeriesDataset
from wingfit.rigs.load import plug_ins
from wingfit.rigs.rig_model import Simulated
from wingfit.service.container import Service, ServiceDep
from wingfit.service.http import responses as http
from wingfit.service.http.problems import conflict, error_item, invalid, not_found
from wingfit.service.rigs.requests import ResultIn, ResultsIn, WorkIn
from wingfit.service.rigs.stored_rig import DECLARED
from wingfit.service.storage import store
from wingfit.service.storage.tables import DatasetJobRow, DiagnosisRow, RunRow
from wingfit.workers.jobs import State

router = APIRouter(prefix="/v1", tags=["rigs"])
TABLES: dict[str, type[DatasetJobRow]] = {"run": RunRow, "dx": DiagnosisRow}


@router.get("/rigs", response_model=a.InstalledRigs, responses=http.errors(), summary="List installed rigs")
def installed() -> a.InstalledRigs:
    """List the rigs that are installed on the server, whose simulations it runs itself."""
    return {"rigs": list(plug_ins())}


@router.post(
    "/drive/{job_id}/work",
    response_model=a.Work,
    responses=http.errors(404, 409),
    summary="Take simulations to compute",
)
async def work(service: ServiceDep, body: WorkIn, job_id: str) -> a.Work:
    """Take simulations of a run or diagnosis whose rig you simulate; the job runs while a driver asks for its work."""
    board = service.driving.board
    deadline = asyncio.get_running_loop().time() + body.wait_s
    with board.changes.watch(job_id) as changed:
        while True:
            changed.clear()
            row = await run_in_threadpool(_row, service, job_id)
            if body.leaving:
                board.release(job_id, body.driver)
            if body.leaving or State(row.state).final or board.changes.closed:
                return _work(row, body, [])
            if calls := board.take(job_id, body.driver, body.limit, body.holding):
                return _work(row, body, [call.simulation() for call in calls])
            if row.state == State.QUEUED:  # it has a driver now
                await run_in_threadpool(service.runner.wake)
            left = deadline - asyncio.get_running_loop().time()
            if left <= 0:
                return _work(row, body, [])
            with suppress(TimeoutError):
                await asyncio.wait_for(changed.wait(), left)


@router.post(
    "/drive/{job_id}/results",
    response_model=a.Settled,
    responses=http.errors(404, 409),
    summary="Return results of simulations",
)
def results(service: ServiceDep, body: ResultsIn, job_id: str) -> a.Settled:
    """Return results of simulations that :func:`work` gave; a simulation that fails has a reason instead of channels.

    Nothing is taken if one of the results is malformed. An error of the simulation itself ends the job.
    """
    row, board = _row(service, job_id), service.driving.board
    dataset = service.datasets.get(row.dataset_id)
    if not isinstance(dataset, SeriesDataset):
        raise not_found("driven job", job_id)
    if error := next((result.error for result in body.results if result.error), None):
        board.give_up(job_id, error)
        return {"taken": 0, "unknown": 0}
    taken, faults = dict[str, Simulated](), []
    for place, result in enumerate(body.results):
        call = board.given_call(job_id, result.id)
        if call is None:
            continue
        if result.id in taken:
            faults.append(error_item(f"body.results.{place}.id", result.id, "it has a result above; give one for each"))
            continue
        try:
            taken[result.id] = _simulated(result, dataset.recording(call.recording))
        except ValueError as fault:
            faults.append(error_item(f"body.results.{place}", result.id, str(fault)))
    if faults:
        raise invalid("the results are malformed", faults)

    def wanted(session: Session) -> bool:
        return not State(store.one(session, type(row), job_id).state).final

    done = service.driving.settle(job_id, body.driver, taken, wanted)
    count = len(taken) if done else 0
    return {"taken": count, "unknown": len(body.results) - count}


def _row(service: Service, job_id: str) -> DatasetJobRow:
    """Return the driven job that a request names; raise a 404 if there is none, a 409 if the server simulates it."""
    table = TABLES.get(job_id.partition("_")[0])
    if table is None:
        raise not_found("run or diagnosis", job_id)
    with service.database.read() as session:
        row = store.one(session, table, job_id)
    if not row.driven:
        raise conflict(f"the server simulates the rig of {job_id} itself; it needs no driver")
    return row


def _work(row: DatasetJobRow, body: WorkIn, simulations: list[a.Simulation]) -> a.Work:
    return {
        "job_id": row.id,
        "dataset_id": row.dataset_id,
        "state": row.state,  # type: ignore[typeddict-item]
        "stage": row.stage,
        "progress": row.progress,
        "eta_seconds": row.eta_seconds,
        "error": row.error,
        "rig": (row.rig or {})[DECLARED] if body.with_rig else None,
        "simulations": simulations,
    }


def _simulated(result: ResultIn, recording: Series) -> Simulated:
    """Return the result of a driver as a model returns it; ValueError if it does not fit the recording."""
    if (result.channels is None) == (result.reason is None):
        raise ValueError("give either channels, or the reason why the simulation failed")
    if result.channels is None:
        return Simulated(np.full(recording.values.shape, np.nan), result.reason)
    count, columns = len(recording.times), []
    for name in recording.channels:
        values = result.channels.get(name)
        if values is None:
            have = ", ".join(result.channels) or "none"
            raise ValueError(f"there is no channel {name!r}, but {have}; return all that were recorded")
        if len(values) != count:
            raise ValueError(
                f"channel {name!r} has {len(values)} values; recording {recording.name!r} has {count} samples: return "
                "one for each"
            )
        columns.append(values)
    return Simulated(np.array(columns, float).T, None)
