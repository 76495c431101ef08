"""JSON exports of runs and diagnoses: complete documents for an archive."""

from __future__ import annotations

from typing import Any, Literal

from typing_extensions import TypedDict

from wingfit.client.answers import Dataset, GenomeInfo, HistoryItem, Result, Run
from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.client.force_answers import ForceResult
from wingfit.client.series_answers import SeriesResult

Format = Literal["json", "csv", "netcdf"]
ModelFormat = Literal["python", "tables", "fmu", "json"]


class Export(TypedDict):
    """The fields that every export has; ``schema_id`` names the format of the document."""

    schema_id: str
    wingfit_version: str
    exported_at: str
    dataset: Dataset


class RunExport(Export):
    """A run with all its results; ``genome`` is null before the first generation, ``result`` until the run succeeds.

    ``request`` is a JSON body for POST /v1/runs that submits the same run again; ``history`` lists the generations.
    """

    run: Run
    request: dict[str, Any]
    genome: GenomeInfo | None
    result: Result | ForceResult | SeriesResult | None
    history: list[HistoryItem]


class DiagnosisExport(Export):
    """A diagnosis with its finding; the schema of the finding is at /v1/schemas/finding."""

    diagnosis: Diagnosis
    finding: dict[str, Any]
