"""Reads the calibrated model of a stored run or diagnosis, and writes it as a file."""

from __future__ import annotations

from wingfit.diagnosis.finding import Finding
from wingfit.export.calibrated_model import CalibratedModel, Provenance
from wingfit.export.formats import ExportedFile, FormatError, exported
from wingfit.export.from_finding import ChoiceError, of_finding
from wingfit.export.from_rig import of_series, of_series_finding
from wingfit.export.from_run import of_forces, of_tracks
from wingfit.export.runtime.parts import Origin
from wingfit.records import SeriesDataset, wing_or_vehicle
from wingfit.report.finding_file import finding_from_json
from wingfit.service.container import Service
from wingfit.service.diagnoses import views as diagnosis_views
from wingfit.service.http.problems import conflict, error_item, invalid
from wingfit.service.outcomes import force_views
from wingfit.service.rigs.stored_rig import rig_of
from wingfit.service.runs import best_genome
from wingfit.service.storage import store
from wingfit.service.storage.tables import DatasetRow, DiagnosisRow, RunRow
from wingfit.service.version import source_commit, wingfit_version


def of_run(service: Service, run_id: str) -> CalibratedModel:
    """Return the model of the run ``run_id``; raise a 404 if there is none, a 409 before the run has a result."""
    with service.database.read() as session:
        row = store.one(session, RunRow, run_id)
        dataset_row = store.one(session, DatasetRow, row.dataset_id)
    if row.result is None:
        raise conflict(
            f"run {run_id} is {row.state}; it has a model to take away when it has SUCCEEDED", state=row.state
        )
    spec, loaded = store.spec(row), service.datasets.get(row.dataset_id)
    source = _provenance("run", row, dataset_row, spec.seed)
    if isinstance(loaded, SeriesDataset) and row.rig is not None:
        return of_series(spec, rig_of(row.rig), loaded, best_genome.best(row), row.result, source)
    dataset = wing_or_vehicle(loaded)
    if row.kind == "tracks":
        return of_tracks(spec, dataset, best_genome.best(row), row.result, source)
    law = row.result["global_model"]
    return of_forces(spec, dataset, row.result, law and force_views.law(law, dataset), source)


def of_diagnosis(service: Service, diagnosis_id: str, hypothesis: str | None) -> CalibratedModel:
    """Return the model of a diagnosis with the effects of the ``hypothesis``; None: with those that it names.

    Raises a 404 if there is no such diagnosis, a 409 before it has succeeded or if a hypothesis must be chosen, and a
    422 for an unknown one.
    """
    with service.database.read() as session:
        row = store.one(session, DiagnosisRow, diagnosis_id)
        dataset_row = store.one(session, DatasetRow, row.dataset_id)
        finding: Finding = finding_from_json(store.finding(session, diagnosis_id))
    spec = diagnosis_views.spec(row)
    source = _provenance("diagnosis", row, dataset_row, spec.calibration.seed)
    loaded, nominal = service.datasets.get(row.dataset_id), spec.calibration
    try:
        if isinstance(loaded, SeriesDataset) and row.rig is not None:
            return of_series_finding(nominal, rig_of(row.rig), loaded, finding, hypothesis, source)
        return of_finding(nominal, wing_or_vehicle(loaded), finding, hypothesis, source)
    except ChoiceError as error:
        if hypothesis is None:
            raise conflict(str(error), verdict=finding.verdict) from None
        raise invalid("there is no such model", [error_item("query.hypothesis", hypothesis, str(error))]) from None


def written(model: CalibratedModel, format_name: str) -> ExportedFile:
    """Return ``model`` as a file; raise a 422 for a format that does not fit it."""
    try:
        return exported(model, format_name)
    except FormatError as error:
        raise invalid("the model has no such format", [error_item("query.format", format_name, str(error))]) from None


def _provenance(origin: Origin, row: RunRow | DiagnosisRow, dataset: DatasetRow, seed: int) -> Provenance:
    return Provenance(
        origin=origin,
        id=row.id,
        name=row.name or "",
        dataset=dataset.name or "",
        dataset_sha256=dataset.sha256,
        wingfit_version=wingfit_version(),
        commit=source_commit(),
        seed=seed,
        created_at=store.now(),
        source="",
    )
