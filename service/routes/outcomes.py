"""Routes about results of a run (history, genome, result, tracks, loads), and simulations of a given genome."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Annotated, Literal, cast

from fastapi import APIRouter, Query
from pydantic import Field
from starlette.responses import JSONResponse, Response

from wingfit.calibration.search import CalibrationSpec
from wingfit.client import answers as a
from wingfit.client.force_answers import Agreement, ForceResult, ForceSimulation
from wingfit.client.load_answers import Loads
from wingfit.client.series_answers import SeriesResult
from wingfit.records import Dataset
from wingfit.service.answers import answer
from wingfit.service.container import DOWNLOAD_SLOT, SIMULATION_SLOT, Service, ServiceDep
from wingfit.service.http import json_reads
from wingfit.service.http import responses as http
from wingfit.service.http.problems import conflict, error_item, invalid
from wingfit.service.outcomes import force_views, load_views
from wingfit.service.outcomes.requests import LoadsIn, OutputName, SimulationIn, WingIn
from wingfit.service.routes.jobs import load
from wingfit.service.runs import best_genome, spec_views, views
from wingfit.service.runs.request_checks import gene_names
from wingfit.service.runs.simulation_hints import with_remedy
from wingfit.service.storage import store
from wingfit.service.storage.tables import RunRow
from wingfit.workers.jobs import State

AnyResult = Annotated[a.Result | ForceResult | SeriesResult, Field(discriminator="kind")]
router = APIRouter(prefix="/v1", tags=["outcomes"])


@router.get(
    "/runs/{run_id}/history",
    response_model=a.Page[a.HistoryItem],
    responses=http.errors(404),
    summary="Fetch the history",
    dependencies=[DOWNLOAD_SLOT],
)
async def history(
    service: ServiceDep,
    run_id: str,
    after: Annotated[int, Query(ge=0, le=http.LARGEST_INTEGER, description="last sequence that the caller has")] = 0,
    limit: Annotated[int, Query(ge=1, le=http.LARGEST_HISTORY_PAGE)] = http.HISTORY_PAGE,
) -> Response:
    """Return finished generations, ascending; ``next_cursor`` is the value of ``after`` for the next page."""
    return await json_reads.answer(
        lambda: json_reads.history(service.database, run_id, after, limit), short=limit <= http.HISTORY_PAGE
    )


@router.get(
    "/runs/{run_id}/genome", response_model=a.GenomeInfo, responses=http.errors(404, 409), summary="Best genome"
)
def genome(service: ServiceDep, run_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return every gene with its nominal value and its value in the best genome so far."""
    return http.tagged(best_genome.standing(service, run_row(service, run_id)), if_none_match)


@router.get("/runs/{run_id}/result", response_model=AnyResult, responses=http.errors(404, 409), summary="Result")
def result(service: ServiceDep, run_id: str, if_none_match: http.IfNoneMatch = None) -> Response:
    """Return the result of a run that has succeeded."""
    row = run_row(service, run_id)
    if row.result is None:
        raise conflict(_no_result(row), state=row.state)
    return http.tagged(force_views.stored(row.kind, row.result), if_none_match)


@router.get(
    "/runs/{run_id}/comparison",
    response_model=a.Comparison,
    responses=http.errors(404, 409),
    summary="Tracks",
    dependencies=[SIMULATION_SLOT],
)
def comparison(
    service: ServiceDep,
    run_id: str,
    recording: Annotated[str | None, Query(max_length=200, description="default: the first of the dataset")] = None,
    genome: Literal["best", "nominal"] = "best",
) -> Response:
    """Return the recorded and the simulated positions of the markers over one recording."""
    dataset, spec, wanted, values = _chosen(service, run_id, recording, genome)
    with simulating():
        tracks = service.engine.compare(spec, dataset, values, wanted)
    return JSONResponse(views.comparison(tracks))


@router.get(
    "/runs/{run_id}/loads",
    response_model=Loads,
    responses=http.errors(404, 409),
    summary="Loads",
    dependencies=[SIMULATION_SLOT],
)
def loads(
    service: ServiceDep,
    run_id: str,
    recording: Annotated[str | None, Query(max_length=200, description="default: the first of the dataset")] = None,
    genome: Literal["best", "nominal"] = "best",
    outputs: Annotated[
        list[OutputName] | None, Query(max_length=100, description="repeatable; default: all of them")
    ] = None,
) -> Response:
    """Return torques, forces, powers and energies over one beat, simulated in the condition of a recording."""
    dataset, spec, wanted, values = _chosen(service, run_id, recording, genome)
    with simulating():
        found = service.engine.loads(spec, dataset, values, dataset.recording(wanted))
    return JSONResponse({"recording": wanted, "outputs": load_views.outputs(found, load_views.wanted(outputs or True))})


@router.post(
    "/simulations",
    response_model=a.Simulation | ForceSimulation,
    responses=http.errors(409),
    summary="Simulate one recording's condition",
    dependencies=[SIMULATION_SLOT],
)
def simulate(service: ServiceDep, body: SimulationIn) -> Response:
    """Simulate the condition of a recording with the genome of the request; nothing is stored."""
    dataset = load(service, body.dataset_id)
    check_recording(dataset, body.recording, "body.recording")
    spec_views.refuse_foreign(body, dataset)
    spec_views.refuse_cutoff(body.low_pass_hz, [dataset.recording(body.recording)])
    spec_views.refuse_effects(body.effects, dataset, body)
    spec = spec_views.simulation_spec(body)
    values = _genome_of(service, dataset, spec, body)
    simulated = _tracks if dataset.kind == "tracks" else _forces
    with simulating():
        return JSONResponse(simulated(service, spec, dataset, values, body))


@router.post(
    "/loads",
    response_model=Loads,
    responses=http.errors(409),
    summary="Simulate any condition's loads",
    dependencies=[SIMULATION_SLOT],
)
def loads_under(service: ServiceDep, body: LoadsIn) -> Response:
    """Simulate the loads of a wing with the genome and in the condition of the request; nothing is stored."""
    dataset = load(service, body.dataset_id)
    check_recording(dataset, body.recording, "body.recording")
    if dataset.kind != "tracks":
        item = error_item("body.dataset_id", body.dataset_id, "describes a vehicle; loads inside the wing need a wing")
        raise invalid("there are no such loads", [item])
    spec_views.refuse_effects(body.effects, dataset)
    spec = spec_views.simulation_spec(body)
    values = _genome_of(service, dataset, spec, body)
    recorded = dataset.recording(body.recording)
    changed = replace(recorded, condition=load_views.condition(recorded.condition, body.condition))
    with simulating():
        found = service.engine.loads(spec, dataset, values, changed)
    outputs = load_views.outputs(found, load_views.wanted(body.outputs))
    return JSONResponse({"recording": body.recording, "outputs": outputs})


def _tracks(
    service: Service, spec: CalibrationSpec, dataset: Dataset, genome: dict[str, float], body: SimulationIn
) -> a.Simulation:
    tracks = service.engine.compare(spec, dataset, genome, body.recording)
    simulation = cast(a.Simulation, {**views.comparison(tracks), "mean_distance_mm": views.mean_distance_mm(tracks)})
    names = load_views.wanted(body.outputs)
    if names:
        found = service.engine.loads(spec, dataset, genome, dataset.recording(body.recording))
        simulation["outputs"] = load_views.outputs(found, names)
    return simulation


def _forces(
    service: Service, spec: CalibrationSpec, dataset: Dataset, genome: dict[str, float], body: SimulationIn
) -> ForceSimulation:
    found = service.engine.forces(spec, dataset, genome, body.recording, "nominal")
    agreed = service.engine.agreements(spec, dataset, genome, body.recording)
    agreements = [answer(Agreement, one, source="given") for one in agreed]
    return {**force_views.forces(found, "given"), "agreements": agreements}


def _genome_of(service: Service, dataset: Dataset, spec: CalibrationSpec, body: WingIn) -> dict[str, float]:
    """Return the nominal genome with the genes of the request ``body``; raise a 422 if they do not fit the model."""
    known = gene_names(service.engine, spec, dataset)
    faults = spec_views.unknown_genes((("body.genome", name) for name in body.genome), known)
    if faults:
        raise invalid("the genome names genes that the model does not have", faults)
    try:
        return service.engine.genome(spec, dataset, body.genome)
    except ValueError as error:
        raise invalid("a value is out of bounds", [error_item("body.genome", None, str(error))]) from None


def _chosen(
    service: Service, run_id: str, recording: str | None, genome: Literal["best", "nominal"]
) -> tuple[Dataset, CalibrationSpec, str, dict[str, float]]:
    """Return the dataset, specification, recording name and genome with which to simulate a run.

    ``recording`` None: the first of the dataset. Raises a 409 for a run on forces, a 422 for an unknown recording.
    """
    row = run_row(service, run_id)
    if row.kind != "tracks":
        where = f"; /v1/runs/{run_id}/forces has them" if row.kind == "forces" else ", and no wing"
        raise conflict(f"run {run_id} is on {row.kind}{where}")
    dataset, spec = service.datasets.flapping(row.dataset_id), store.spec(row)
    wanted = dataset.recordings[0].name if recording is None else recording
    check_recording(dataset, wanted, "query.recording")
    values = best_genome.best(row) if genome == "best" else service.engine.genome(spec, dataset, {})
    return dataset, spec, wanted, values


def run_row(service: Service, run_id: str) -> RunRow:
    """Return the database row of the run; raise a 404 if there is none."""
    with service.database.read() as session:
        return store.one(session, RunRow, run_id)


def _no_result(row: RunRow) -> str:
    if row.state in (State.FAILED, State.CANCELLED):
        return f"run {row.id} is {row.state} and has no result; /v1/runs/{row.id}/genome has its best genome"
    return f"run {row.id} is {row.state}; it has a result when it has SUCCEEDED"


def check_recording(dataset: Dataset, name: str, where: str) -> None:
    """Raise a 422 if the dataset has no recording ``name``; ``where``: its place in the request, for the message."""
    known = [recording.name for recording in dataset.recordings]
    if name not in known:
        raise invalid("unknown recording", [error_item(where, name, f"unknown; known are {', '.join(known)}")])


@contextmanager
def simulating() -> Iterator[None]:
    """Turn a ValueError within the block, a failed simulation, into a 409 that says what to do."""
    try:
        yield
    except ValueError as error:
        raise conflict(f"the simulation failed: {with_remedy(str(error))}") from None
