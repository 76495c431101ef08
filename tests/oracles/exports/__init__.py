"""Calibrated models, and exported files that run where neither wingfit nor scipy can be imported."""

from __future__ import annotations

from benchmarks.common.files import EXAMPLES
from benchmarks.export.agreement import vehicle_error
from benchmarks.export.isolated import FILE_NEEDS, PACKAGE_NEEDS, run, site_of
from benchmarks.export.models import SOURCE, calibrated_vehicle

__all__ = ["EXAMPLES", "FILE_NEEDS", "PACKAGE_NEEDS", "SOURCE", "calibrated_vehicle", "run", "site_of", "vehicle_error"]
