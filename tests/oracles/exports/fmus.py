"""Exported FMUs: models with known genes, an importer, and the simulation in a steady state."""

from __future__ import annotations

from benchmarks.export.fmu import problems
from benchmarks.export.fmu.importer import Fmu, Running
from benchmarks.export.fmu.models import true_vehicle, true_wing
from benchmarks.export.fmu.steady import conditions_within, inputs_at, percent, vehicle_errors

__all__ = [
    "Fmu", "Running", "conditions_within", "inputs_at", "percent", "problems", "true_vehicle", "true_wing",
    "vehicle_errors",
]  # fmt: skip
