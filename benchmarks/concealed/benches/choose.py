"""Chooses the bench of a build."""

from __future__ import annotations

from typing import Any

from benchmarks.concealed.benches.bench import Bench
from benchmarks.concealed.benches.continuous import ContinuousBench
from benchmarks.concealed.benches.vehicle import VehicleBench
from benchmarks.concealed.benches.vortex_lattice import VortexLatticeBench
from benchmarks.concealed.benches.wing import WingBench
from benchmarks.concealed.trials import LATTICE, ROD, Build


def bench_of(build: Build) -> Bench[Any, Any]:
    """The bench of the rig named in ``build``."""
    if build.rig == "vehicle":
        return VortexLatticeBench(build) if build.plant == LATTICE else VehicleBench(build)
    return ContinuousBench(build) if build.plant == ROD else WingBench(build)
