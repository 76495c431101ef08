"""The same bits whatever number of threads BLAS has: forced, by the environment, and by default."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest

from wingfit import diagnosis
from wingfit.calibration import evaluator, result, search, summary
from wingfit.calibration.estimates import likelihood, uncertainty
from wingfit.calibration.forces import agreement, estimation, global_model
from wingfit.inference.noise import harmonic
from wingfit.service.outcomes import load_views
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs import balance, campaign
from wingfit.sim.wing import alignment, loads, planform
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.tracking import free_flight, rigid_body, smoothing, wing_kinematics

REPOSITORY = Path(__file__).parents[2]
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

GUARDED: tuple[Callable[..., object], ...] = (
    alignment.recorded_crossing, balance.record, loads.simulate_outputs, planform.bodies, campaign.record,
    BladeElementWing.beat, BladeElementWing.observe, FlexibleWing.beats, FlexibleWing.observe,
    estimation.summarise_forces, estimation.compare_forces, estimation.predict,
    agreement.agreements, agreement.comparison,
    evaluator.run_unit, global_model.fit_global, global_model.at, likelihood.iterate, likelihood.estimate,
    harmonic.noise_distance, summary.summarise, result.judge, result.compare, search.calibrate,
    uncertainty.gene_errors, uncertainty.uncertainty,
    diagnosis.check, diagnosis.diagnose, diagnosis.diagnose_subject,
    free_flight.free_flight, free_flight.recording, rigid_body.poses,
    smoothing.fit_periodic, smoothing.PeriodicFit.at, smoothing.PeriodicFit.error_at,
    wing_kinematics.from_markers, wing_kinematics.wing_motion, wing_kinematics.flap_frequency,
    wing_kinematics.pitch_law, load_views.outputs,
)  # fmt: skip


class Run(NamedTuple):
    """What a process computes and how.

    BLAS kernels (None: those of the processor), OMP_NUM_THREADS, threads set within, computations (empty: all).
    """

    kernels: str | None
    variable: str | None = None
    forced: str | None = None
    only: tuple[str, ...] = ()


class Digests(NamedTuple):
    """What a process prints."""

    digests: dict[str, str]
    threads: list[int]


def _has_avx2() -> bool:
    cpu = Path("/proc/cpuinfo")
    return cpu.exists() and " avx2 " in cpu.read_text()


# OpenBLAS's kernels for AVX2 round differently with every split, those for AVX-512 only where long sums are split.
KERNELS = "Haswell" if _has_avx2() else None
RUNS = [Run(KERNELS), Run(KERNELS, "1"), Run(KERNELS, "2"), Run(KERNELS, forced="4")]
if KERNELS:
    RUNS += [Run(None, "1", only=("diagnosis",)), Run(None, forced="4", only=("diagnosis",))]


def _digests(run: Run) -> Digests:
    environment = {name: value for name, value in os.environ.items() if name not in THREADS}
    environment |= {"OPENBLAS_CORETYPE": run.kernels} if run.kernels else {}
    environment |= {"OMP_NUM_THREADS": run.variable} if run.variable else {}
    command = [sys.executable, "-m", "tests.workers.digests", *([run.forced] if run.forced else []), *run.only]
    done = subprocess.run(command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return Digests(**json.loads(done.stdout))


@pytest.fixture(scope="module")
def results() -> dict[Run, Digests]:
    with ThreadPoolExecutor(2) as threads:
        return dict(zip(RUNS, threads.map(_digests, RUNS), strict=True))


@pytest.mark.parametrize("computation", ["evaluation", "gauss_newton", "genetic", "diagnosis"])
def test_the_number_of_blas_threads_changes_no_bit(results: dict[Run, Digests], computation: str) -> None:
    for kernels in {run.kernels for run in RUNS}:
        of_kernels = {run: found.digests for run, found in results.items() if run.kernels == kernels}
        same = {run: digests[computation] for run, digests in of_kernels.items() if computation in digests}
        assert len(same) != 1
        assert len(set(same.values())) <= 1, same


def test_the_processes_had_the_requested_threads(results: dict[Run, Digests]) -> None:
    """Also: what the guard found is restored after the last computation."""
    for run, found in results.items():
        wanted = int(run.forced or run.variable or os.cpu_count() or 1)
        assert found.threads
        if run.variable is None:
            assert set(found.threads) == {wanted}
        else:  # OpenBLAS starts no more threads than there are processors
            assert set(found.threads) == {min(wanted, os.cpu_count() or 1)}


@pytest.mark.parametrize("function", GUARDED, ids=lambda function: f"{function.__module__}.{function.__qualname__}")
def test_functions_that_compute_results_use_the_guard(function: Callable[..., object]) -> None:
    """They are wrapped by the guard."""
    assert getattr(function, "one_blas_thread", False)
