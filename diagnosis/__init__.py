"""What a model left out: where it differs from the recordings, which effect does that, and the proof."""

from wingfit.diagnosis.diagnose import check, diagnose, diagnose_subject
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.spec import DiagnosisSpec, Progress

__all__ = ["DiagnosisSpec", "Finding", "Progress", "check", "diagnose", "diagnose_subject"]
