"""Chooses the bench of a build."""

from __future__ import annotations

from typing import Any

from benchmarks.concealed.benches.bench import Bench
from benchmarks.concealed.benches.vehicle import VehicleBench
from benchmarks.concealed.benches.wing import WingBench
from benchmarks.concealed.trials import Build


def bench_of(build: Build) -> Bench[Any, Any]:
    """The bench of the rig named in ``build``."""
    return VehicleBench(build) if build.rig == "vehicle" else WingBench(build)
