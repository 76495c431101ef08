"""What the service needs of diagnosis and report, behind one seam: `ModelDiagnoser` is the real one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

from wingfit import report
from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis import DiagnosisSpec, Finding, Progress, check, diagnose
from wingfit.records import Dataset


class Diagnoser(Protocol):
    """Finds what a model left out, and says so; ValueError says what is wrong with a request."""

    def check(self, spec: DiagnosisSpec, dataset: Dataset) -> None:
        """ValueError when ``spec`` does not fit ``dataset``."""
        ...

    def diagnose(self, spec: DiagnosisSpec, dataset: Dataset, evaluator: Evaluator) -> Iterator[Progress]:
        """Diagnose; the last that comes has the finding."""
        ...

    def stored(self, finding: Finding) -> dict[str, Any]:
        """``finding`` as JSON."""
        ...

    def html(self, stored: dict[str, Any]) -> str:
        """The report of a stored finding: one HTML file that needs nothing else."""
        ...


class ModelDiagnoser:
    """Diagnoses the flexible wing on tracks, and the blade-element wing of a vehicle on forces."""

    def check(self, spec: DiagnosisSpec, dataset: Dataset) -> None:
        """Plan without running anything."""
        check(dataset, spec)

    def diagnose(self, spec: DiagnosisSpec, dataset: Dataset, evaluator: Evaluator) -> Iterator[Progress]:
        """Diagnose."""
        return diagnose(dataset, spec, evaluator)

    def stored(self, finding: Finding) -> dict[str, Any]:
        """``finding`` as JSON."""
        return report.finding_json(finding)

    def html(self, stored: dict[str, Any]) -> str:
        """The report."""
        return report.html(report.finding_from_json(stored))
