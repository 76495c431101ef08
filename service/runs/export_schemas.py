"""Exports of runs and diagnoses as JSON: whole documents, to be kept."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from wingfit.service.diagnoses.schemas import DiagnosisOut
from wingfit.service.outcomes.force_schemas import AnyResult
from wingfit.service.runs.schemas import DatasetOut, GenomeOut, HistoryItem, RunOut

Format = Literal["json", "csv", "netcdf"]


class ExportOut(BaseModel):
    """What every export says of itself."""

    schema_id: str
    wingfit_version: str
    exported_at: str
    dataset: DatasetOut


class RunExportOut(ExportOut):
    """A run with all that it has found; ``genome`` is null before its first generation, ``result`` before its end."""

    schema_id: Literal["urn:wingfit:schema:run-export:1"] = "urn:wingfit:schema:run-export:1"
    run: RunOut
    request: Annotated[dict[str, Any], Field(description="the body of POST /v1/runs that repeats the run")]
    genome: GenomeOut | None
    result: AnyResult | None
    history: list[HistoryItem]


class DiagnosisExportOut(ExportOut):
    """A diagnosis with what it found, see /v1/schemas/finding."""

    schema_id: Literal["urn:wingfit:schema:diagnosis-export:1"] = "urn:wingfit:schema:diagnosis-export:1"
    diagnosis: DiagnosisOut
    finding: dict[str, Any]
