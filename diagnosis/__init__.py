"""Locate differences between model and recordings, name the physics that explains them, and validate the result."""

from wingfit.diagnosis.diagnose import (
    check,
    check_diagnosis_of_rig,
    diagnose,
    diagnose_rig,
    diagnose_subject,
)
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.spec import DiagnosisSpec, Progress

__all__ = [
    "DiagnosisSpec",
    "Finding",
    "Progress",
    "check",
    "check_diagnosis_of_rig",
    "diagnose",
    "diagnose_rig",
    "diagnose_subject",
]
