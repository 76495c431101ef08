"""The functions of `wingfit.diagnosis` and `wingfit.report` that the service calls; tests can replace the class."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from wingfit import report
from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis import DiagnosisSpec, Finding, Progress, check, diagnose
from wingfit.records import Dataset


class Diagnoser:
    """Diagnoses datasets of marker tracks (flexible wing) and of forces (blade-element model of a vehicle)."""

    def check(self, spec: DiagnosisSpec, dataset: Dataset) -> None:
        """Raise ValueError if ``spec`` does not fit ``dataset``."""
        check(dataset, spec)

    def diagnose(self, spec: DiagnosisSpec, dataset: Dataset, evaluator: Evaluator) -> Iterator[Progress]:
        """Compute the diagnosis and yield its progress; the last item has the finding (the result)."""
        return diagnose(dataset, spec, evaluator)

    def stored(self, finding: Finding) -> dict[str, Any]:
        """Return ``finding`` as JSON."""
        return report.finding_json(finding)

    def html(self, stored: dict[str, Any]) -> str:
        """Return the report on a finding (``stored``: its JSON) as one HTML file without external resources."""
        return report.html(report.finding_from_json(stored))
