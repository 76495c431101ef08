"""Diagnosis of missing physics: where model and recordings differ, which effect explains that, and validation."""

from wingfit.diagnosis.diagnose import check, diagnose, diagnose_subject
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.spec import DiagnosisSpec, Progress

__all__ = ["DiagnosisSpec", "Finding", "Progress", "check", "diagnose", "diagnose_subject"]
