"""Exported models: agreement with wingfit's own simulation, and coverage of their intervals.

``python -m benchmarks.export [--json] [--campaigns N] [--wing-campaigns N] [--seed N]``. The exported Python runs in a
process in which neither wingfit nor scipy can be imported.
"""

from __future__ import annotations

import argparse
import json
import resource
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.common.files import EXAMPLES
from benchmarks.common.machine import commit, cpu
from benchmarks.export.agreement import vehicle_error, wing_error
from benchmarks.export.coverage import WING, Coverage, vehicles, wings
from benchmarks.export.models import calibrated_wing, diagnosed_vehicle
from wingfit.records import load_dataset, wing_or_vehicle

FMU = "benchmarks.export.fmu"  # measures the FMU, where it is installed


def main() -> None:
    """Run the benchmark and print its result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--campaigns", type=int, default=40, help="simulated campaigns of a vehicle (40)")
    parser.add_argument("--wing-campaigns", type=int, default=10, help="simulated campaigns of a wing (10)")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    print(json.dumps(measured(arguments.campaigns, arguments.wing_campaigns, arguments.seed), indent=None))


def measured(campaigns: int, wing_campaigns: int, seed: int) -> dict[str, Any]:
    """Return all figures by name."""
    vehicle = diagnosed_vehicle()
    data = wing_or_vehicle(load_dataset(EXAMPLES / "robird"))
    wing = calibrated_wing(data, WING)
    with TemporaryDirectory() as first, TemporaryDirectory() as second:
        errors = {
            "vehicle_file_error_percent": vehicle_error(vehicle, Path(first)),
            "wing_package_error_percent": wing_error(wing, Path(second)),
        }
    covered = {"vehicle": list(vehicles(campaigns, seed)), "wing": list(wings(wing_campaigns, seed))}
    pooled = [one for parts in covered.values() for one in parts]
    found: dict[str, Any] = {
        "python_file_error_percent": max(errors.values()),
        **errors,
        "vehicle_effects": list(vehicle.settings.effects),
        "interval_coverage_percent": _percent(pooled),
        **{f"{kind}_coverage_percent": _percent(parts) for kind, parts in covered.items()},
        "vehicle_campaigns": campaigns,
        "wing_campaigns": wing_campaigns,
    }
    if find_spec(FMU) is not None:
        found |= import_module(FMU).measured()
    used = resource.getrusage(resource.RUSAGE_SELF)
    return {**found, "cpu_seconds": used.ru_utime + used.ru_stime, "commit": commit(), "processor": cpu()}


def _percent(parts: list[Coverage]) -> float | None:
    """Return the mean coverage of campaigns, percent; each campaign counts once. None without any."""
    return sum(one.percent for one in parts) / len(parts) if parts else None


if __name__ == "__main__":
    main()
