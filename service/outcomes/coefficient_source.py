"""Which coefficients a run on forces offers for a recording: those found on it, on all, or by a law."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from wingfit.calibration.forces.result import GlobalModel, Source
from wingfit.records import Dataset
from wingfit.service.container import Service
from wingfit.service.http.problems import conflict
from wingfit.service.outcomes import force_views
from wingfit.service.storage import store
from wingfit.service.storage.tables import RunRow
from wingfit.workers.jobs import State

# What stands for a run where nothing is asked for: what was fitted to the recording first, then what predicts it.
PREFERENCE: tuple[Source, ...] = ("local", "joint", "global", "average", "nominal")


# Coefficients by the stage that found them.
Estimates = Mapping[str, Mapping[str, float]]
# Coefficients and what must be known about them.
Give = Callable[[], tuple[Mapping[str, float], tuple[str, ...]]]


@dataclass(frozen=True)
class Chosen:
    """A source, its full genome by name, and what must be known about it."""

    source: Source
    genome: Mapping[str, float]
    remarks: tuple[str, ...] = ()


def chosen(service: Service, row: RunRow, dataset: Dataset, recording: str, asked: Source | None) -> Chosen:
    """The genome of the source that is ``asked`` for, or of the best one; a 409 where the run does not have it."""
    there = offered(service, row, dataset, recording, estimates(service, row, dataset))
    source = asked or next(iter(there))
    if source not in there:
        there_are = ", ".join(there)
        later = "" if row.result else "; more when the run has SUCCEEDED"
        raise conflict(
            f"run {row.id} has no {source} coefficients for recording {recording!r}; it has: {there_are}{later}",
            state=row.state,
        )
    return there[source]()


def offered(
    service: Service, row: RunRow, dataset: Dataset, recording: str, found: Estimates
) -> dict[Source, Callable[[], Chosen]]:
    """What makes the genome of each source that the run has for a recording, the best first."""
    nominal = service.engine.genome(store.spec(row), dataset, {})
    given = _given(service, row, dataset, recording, found)

    def make(source: Source) -> Chosen:
        values, remarks = given[source]()
        return Chosen(source, nominal | dict(values), remarks)

    return {source: partial(make, source) for source in PREFERENCE if source in given}


def estimates(service: Service, row: RunRow, dataset: Dataset) -> Estimates:
    """What each stage of the run has found so far."""
    with service.database.read() as session:
        checkpoint = store.checkpoint(session, row.id)
    return service.engine.found(store.spec(row), dataset, checkpoint) if checkpoint else {}


def law(row: RunRow, dataset: Dataset) -> GlobalModel:
    """The run's global model; a 409 that says why there is none."""
    if row.kind != "forces":
        raise conflict(f"run {row.id} is on tracks; only runs on forces predict")
    if row.result is None:
        ended = row.state in (State.FAILED, State.CANCELLED)
        raise conflict(
            f"run {row.id} is {row.state} and has no result" + ("" if ended else " yet; wait until it has SUCCEEDED"),
            state=row.state,
        )
    stored = row.result["global_model"]
    if stored is None:
        why = next((remark for remark in row.result["remarks"] if "global model" in remark), None)
        raise conflict(why or "the run has no global model: only mode 'local' gives one, one estimate per recording")
    return force_views.law(stored, dataset)


def _given(service: Service, row: RunRow, dataset: Dataset, recording: str, found: Estimates) -> dict[Source, Give]:
    """What gives the coefficients of each source that there is, with remarks."""
    spec = store.spec(row)

    def by_law() -> tuple[Mapping[str, float], tuple[str, ...]]:
        predicted = service.engine.predict(spec, dataset, law(row, dataset), dataset.recording(recording).condition)
        return predicted.values, predicted.remarks

    given: dict[Source, Give] = {"nominal": lambda: ({}, ())}
    fitted: Source
    fitted, stage = ("joint", "joint") if spec.mode == "joint" else ("local", recording)
    if stage in found:
        given[fitted] = lambda: (found[stage], ())
    if row.result is not None and spec.mode == "local":
        # The average of the estimates is what the result calls best.
        average = {gene["name"]: gene["best"] for gene in row.result["genes"]}
        given["average"] = lambda: (average, ())
        if row.result["global_model"] is not None:
            given["global"] = by_law
    return given
