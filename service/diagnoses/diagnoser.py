"""The functions of `wingfit.diagnosis` and `wingfit.report` that the service calls; tests can replace the class."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from wingfit import report
from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis import (
    DiagnosisSpec,
    Finding,
    Progress,
    check,
    check_diagnosis_of_rig,
    diagnose,
    diagnose_rig,
)
from wingfit.records import AnyDataset, Dataset, SeriesDataset
from wingfit.rigs.rig import Rig


class Diagnoser:
    """Diagnoses marker tracks (flexible wing), forces (blade-element model of a vehicle), and series (any rig)."""

    def check(self, spec: DiagnosisSpec, dataset: Dataset) -> None:
        """Raise ValueError if ``spec`` does not fit ``dataset``."""
        check(dataset, spec)

    def check_rig(self, spec: DiagnosisSpec, dataset: SeriesDataset, rig: Rig) -> None:
        """Raise ValueError if ``spec`` does not fit the series of ``dataset`` and their simulation ``rig``."""
        check_diagnosis_of_rig(rig, dataset, spec)

    def diagnose(
        self, spec: DiagnosisSpec, dataset: AnyDataset, evaluator: Evaluator, rig: Rig | None = None
    ) -> Iterator[Progress]:
        """Compute the diagnosis and yield its progress; the last item has the finding (the result).

        ``rig``: simulation of a dataset of series; None for others.
        """
        if isinstance(dataset, SeriesDataset):
            if rig is None:
                raise ValueError(f"series of rig {dataset.rig!r} need its simulation")
            return diagnose_rig(rig, dataset, spec, evaluator)
        return diagnose(dataset, spec, evaluator)

    def stored(self, finding: Finding) -> dict[str, Any]:
        """Return ``finding`` as JSON."""
        return report.finding_json(finding)

    def html(self, stored: dict[str, Any]) -> str:
        """Return the report on a finding (``stored``: its JSON) as one HTML file without external resources."""
        return report.html(report.finding_from_json(stored))
