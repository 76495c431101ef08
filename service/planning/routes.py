"""The route that plans an experiment like that of a dataset."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from typing import Any

from fastapi import APIRouter, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import JSONResponse, Response

from wingfit.client.planning.answers import Plan
from wingfit.planning import PlanSpec, plan_dataset
from wingfit.records import Dataset
from wingfit.service.container import HeldSlots, ServiceDep
from wingfit.service.http import responses as http
from wingfit.service.http.awaited import while_awaited
from wingfit.service.http.problems import ErrorItem, ProblemError, error_item, invalid
from wingfit.service.jobs.interruptible import InterruptibleEvaluator
from wingfit.service.jobs.job_kind import InterruptedStepError
from wingfit.service.planning.requests import PlanIn
from wingfit.service.runs import spec_views
from wingfit.workers import make_evaluator

router = APIRouter(prefix="/v1", tags=["plans"])
_OF_PLAN = (
    "noise_mm", "noise_mn", "correlation", "scatter_percent", "zero_mn", "beats", "frames", "markers", "add", "power",
    "target_percent", "genome",
)  # fmt: skip
# How messages begin that name no field, but something of it.
_ABOUT = {
    "no recording": "recordings", "unknown suspect": "suspects", "unknown gene": "genes", "gene ": "genome",
    "the genome": "genome",
}  # fmt: skip


@router.post(
    "/datasets/{dataset_id}/plan",
    response_model=Plan,
    responses=http.errors(404, 409),
    summary="Plan an experiment",
)
async def plan(request: Request, service: ServiceDep, held: HeldSlots, dataset_id: str, body: PlanIn) -> Response:
    """Predict which genes and effects recordings like those of a dataset identify, and which recordings add most.

    Nothing is stored. It takes seconds to minutes, may wait for other plans, and ends when the client hangs up.
    """
    dataset = await run_in_threadpool(service.datasets.flapping, dataset_id)
    spec = await run_in_threadpool(_spec, body, dataset)
    async with service.plans.slot():
        found = await while_awaited(request, lambda gone: planned(dataset, spec, gone))
        await held.enter_async_context(service.answers.slot())
    return JSONResponse(found)


def _spec(body: PlanIn, dataset: Dataset) -> PlanSpec:
    """Return the settings that ``body`` describes; raise a 422 for those that the rig of ``dataset`` does not have."""
    spec_views.refuse_foreign(body, dataset)
    spec_views.refuse_cutoff(body.low_pass_hz, dataset.recordings)
    spec_views.refuse_effects(body.effects, dataset, body)
    calibration = spec_views.calibration_spec(body)
    suspects = None if body.suspects is None else tuple(body.suspects)
    spec = PlanSpec(calibration, suspects)
    return replace(spec, **{name: getattr(body, name) for name in _OF_PLAN})


def planned(dataset: Dataset, spec: PlanSpec, gone: Callable[[], bool]) -> dict[str, Any]:
    """Return the plan as plain data; raise a 422 where ``spec`` does not fit, a 503 if the client has hung up."""
    with closing(make_evaluator("in_process")) as evaluator:
        try:
            return plan_dataset(dataset, spec, InterruptibleEvaluator(evaluator, gone)).as_dict()
        except InterruptedStepError:
            raise ProblemError(503, "gone", "the client has hung up; the plan was ended") from None
        except ValueError as error:
            raise invalid("no plan can be made", [_fault(str(error), spec)]) from None


def _fault(message: str, spec: PlanSpec) -> ErrorItem:
    """Return ``message`` at the field of the request that it is about; at the body if it is about none."""
    word = message.partition(" ")[0]
    name = word if word in _OF_PLAN else next((one for head, one in _ABOUT.items() if message.startswith(head)), None)
    if name is None:
        return error_item("body", None, message)
    return error_item(f"body.{name}", getattr(spec, name) if word in _OF_PLAN else None, message)
