"""The functions of `wingfit.diagnosis` and `wingfit.report` that the service calls, in a class that tests replace."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from wingfit import report
from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis import DiagnosisSpec, Finding, Progress, check, diagnose
from wingfit.records import Dataset


class Diagnoser:
    """Diagnoses the flexible wing on tracks, and the blade-element wing of a vehicle on forces."""

    def check(self, spec: DiagnosisSpec, dataset: Dataset) -> None:
        """ValueError when ``spec`` does not fit ``dataset``."""
        check(dataset, spec)

    def diagnose(self, spec: DiagnosisSpec, dataset: Dataset, evaluator: Evaluator) -> Iterator[Progress]:
        """Diagnose; yields the progress, and the last item has the finding."""
        return diagnose(dataset, spec, evaluator)

    def stored(self, finding: Finding) -> dict[str, Any]:
        """``finding`` as JSON."""
        return report.finding_json(finding)

    def html(self, stored: dict[str, Any]) -> str:
        """The report of a stored finding: one HTML file without external resources."""
        return report.html(report.finding_from_json(stored))
