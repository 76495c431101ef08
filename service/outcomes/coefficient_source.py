"""Selects the genome with which to compute the forces of one recording, for a run on forces.

Its coefficients were estimated from that recording ("local") or from all fitted recordings together ("joint"), or are
the average of the local estimates, those of the global model (a function of the condition), or nominal.
"""

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

# Default source: the first of these that the run has.
PREFERENCE: tuple[Source, ...] = ("local", "joint", "global", "average", "nominal")

# Estimated coefficients by stage.
Estimates = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Chosen:
    """A genome for computing forces: ``source`` of its coefficients, all genes (name to value), remarks for users."""

    source: Source
    genome: Mapping[str, float]
    remarks: tuple[str, ...] = ()


def chosen(service: Service, row: RunRow, dataset: Dataset, recording: str, requested: Source | None) -> Chosen:
    """Return the genome for ``recording`` from the ``requested`` source (None: the first available of PREFERENCE).

    Raises a 409 if the run has no coefficients from that source.
    """
    available = offered(service, row, dataset, recording, estimates(service, row, dataset))
    source = requested or next(iter(available))
    if source not in available:
        later = "" if row.result else "; more when the run has SUCCEEDED"
        message = f"run {row.id} has no {source} coefficients for recording {recording!r}"
        raise conflict(f"{message}; it has: {', '.join(available)}{later}", state=row.state)
    return available[source]()


def offered(
    service: Service, row: RunRow, dataset: Dataset, recording: str, found: Estimates
) -> dict[Source, Callable[[], Chosen]]:
    """Return, by source, functions that return the genome of the run for ``recording``, in the order of PREFERENCE.

    Only sources that the run has are included; ``found``: its estimates so far (:func:`estimates`).
    """
    spec = store.spec(row)
    nominal = service.engine.genome(spec, dataset, {})

    def of(source: Source, values: Mapping[str, float], remarks: tuple[str, ...] = ()) -> Chosen:
        return Chosen(source, nominal | dict(values), remarks)

    def by_law() -> Chosen:
        predicted = service.engine.predict(spec, dataset, law(row, dataset), dataset.recording(recording).condition)
        return of("global", predicted.values, predicted.remarks)

    given: dict[Source, Callable[[], Chosen]] = {"nominal": partial(of, "nominal", {})}
    fitted: Source
    fitted, stage = ("joint", "joint") if spec.mode == "joint" else ("local", recording)
    if stage in found:
        given[fitted] = partial(of, fitted, found[stage])
    if row.result is not None and spec.mode == "local":
        # In the result, the average of the estimates is ``best``.
        average = {gene["name"]: gene["best"] for gene in row.result["genes"]}
        given["average"] = partial(of, "average", average)
        if row.result["global_model"] is not None:
            given["global"] = by_law
    return {source: given[source] for source in PREFERENCE if source in given}


def estimates(service: Service, row: RunRow, dataset: Dataset) -> Estimates:
    """Return the values estimated so far (stage of the run, gene, value); empty before the first checkpoint."""
    with service.database.read() as session:
        checkpoint = store.checkpoint(session, row.id)
    return service.engine.found(store.spec(row), dataset, checkpoint) if checkpoint else {}


def law(row: RunRow, dataset: Dataset) -> GlobalModel:
    """Return the run's global model; raise a 409 with the reason if there is none."""
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
        why = next((remark for remark in row.result["remarks"] if remark.startswith("no global model")), None)
        raise conflict(why or "the run has no global model: only mode 'local' gives one, one estimate per recording")
    return force_views.law(stored, dataset)
