"""Duration of one diagnosis: twelve recordings, a wing of 24 bodies, data of a finer discretisation.

``python -m benchmarks.diagnosis --json`` simulates recordings under twelve conditions with the separate wing model of
``benchmarks.concealed``, in which one effect is hidden, and diagnoses the files as a user does. It prints the time, the
longest interval between two progress reports, and the ratio of true to estimated remaining time at half of the work.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common import machine
from benchmarks.common.kernel_time import kernel_time
from benchmarks.concealed.benches.bench import record_all
from benchmarks.concealed.benches.wing import WingBench
from benchmarks.concealed.plant.law import Concealed
from benchmarks.concealed.trials import FREQUENCIES, LAGS, THICK_PA, THIN_PA, Build, chamber, name_of, tunnel
from wingfit.calibration.spec import CalibrationSpec
from wingfit.cli.base.output import progress
from wingfit.diagnosis import DiagnosisSpec, Progress, diagnose
from wingfit.records import Dataset, load_dataset, save_dataset, wing_or_vehicle
from wingfit.workers import EvaluatorKind, make_evaluator

HIDDEN: Concealed = {"added_mass": {"strength": 1.0}}
FITTED = (
    *(chamber(THIN_PA, LAGS[k % 3], FREQUENCIES[k]) for k in (0, 2, 4)),
    *(chamber(THICK_PA, LAGS[k % 3], FREQUENCIES[k]) for k in (1, 3)),
    *(tunnel(LAGS[k % 3], FREQUENCIES[k + 1], speed) for k, speed in enumerate((3.5, 5.0, 6.0, 7.5))),
)
HELD_OUT = (chamber(THIN_PA, LAGS[1], 2.5), chamber(THICK_PA, LAGS[2], 3.0), tunnel(LAGS[2], 3.5, 8.5))
HALF = 0.5  # fraction of the work at which the estimated remaining time is checked


def recorded(division: str, plant: str, seed: int) -> Dataset:
    """Simulate twelve recordings with random parameters; the same seed gives bit-identical data.

    ``division``, ``plant``: discretisations of the model to be diagnosed and of the simulated wing.
    """
    bench = WingBench(Build("wing", division, plant))
    genome = bench.genome(np.random.default_rng([seed, 1]))
    recordings = tuple(record_all(bench, (*FITTED, *HELD_OUT), genome, HIDDEN, seed))
    return Dataset("twelve", bench.rig, recordings, tuple(name_of(condition) for condition in HELD_OUT))


def measured(path: Path, division: str, evaluator: EvaluatorKind, workers: int) -> dict[str, Any]:
    """Diagnose the file at ``path`` and return time, progress reports and verdict.

    ``division``: discretisation of the model; ``evaluator``, ``workers``: kind and number of processes that simulate.
    """
    spec, pool = DiagnosisSpec(CalibrationSpec(division=division)), make_evaluator(evaluator, workers)
    reports: list[tuple[float, Progress]] = []
    began = time.perf_counter()
    try:
        with progress("diagnosing") as tell:
            for report in diagnose(wing_or_vehicle(load_dataset(path)), spec, pool):
                reports.append((time.perf_counter() - began, report))
                tell(report.fraction, None, report.stage)
    finally:
        pool.close()
    finding = reports[-1][1].finding
    if finding is None:
        raise RuntimeError("the diagnosis ended without a finding")
    times = np.array([at for at, _ in reports])
    half, then = next((at, one.fraction) for at, one in reports if one.fraction >= HALF)
    return {
        "seconds": float(times[-1]),
        "evaluations": finding.evaluations,
        "reports": len(reports),
        "longest_silence_s": float(np.diff(times, prepend=0.0).max()),
        "left_at_half_over_told": float((times[-1] - half) / (half * (1.0 - then) / then)),
        "stages": _stages(reports),
        "verdict": finding.verdict,
        "named": list(finding.named),
        "model": finding.model,
        "held_out_over_floor": finding.proof and finding.proof.after.value,
    }


def profiled(path: Path, division: str) -> dict[str, Any]:
    """Diagnose the file at ``path`` in this process; return the figures of :func:`measured` and the kernels' share."""
    began = time.thread_time()
    with kernel_time() as kernels:
        found = measured(path, division, "in_process", 1)
    processor = time.thread_time() - began
    return found | {
        "processor_seconds": processor,
        "kernels_percent": 100 * kernels.seconds / processor,
        "group_beats": kernels.beats,
        "lanes_in_use_percent": kernels.lanes_in_use_percent,
        "one_lane_in_use_percent": 100 * kernels.alone / kernels.seconds,
    }


def _stages(reports: Sequence[tuple[float, Progress]]) -> dict[str, float]:
    """Return the seconds spent in each kind of stage: the first two words of the stage's name in ``reports``.

    ``reports``: (time in s, progress) of each report.
    """
    spent: dict[str, float] = {}
    for (at, one), (after, _) in pairwise(reports):
        name = " ".join(one.stage.split()[:2])
        spent[name] = spent.get(name, 0.0) + after - at
    return spent


def main() -> None:
    """Parse the command line, simulate, diagnose, and print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.diagnosis", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--division", default="24", help="discretisation of the model")
    parser.add_argument("--plant", default="8x4", help="discretisation of the plant")
    parser.add_argument("--evaluator", choices=("processes", "ray", "in_process"), default="ray")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--profile", action="store_true", help="compute in one process, and say where the time goes")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "twelve.nc"
        save_dataset(recorded(options.division, options.plant, options.seed), path)
        if options.profile:
            found = profiled(path, options.division)
        else:
            found = measured(path, options.division, options.evaluator, options.workers)
    figures = {"cpu": machine.cpu(), "commit": machine.commit(), **found}
    width = max(map(len, figures))
    for name, value in figures.items():
        print(f"{name:{width}} {value}")
    if options.json:
        print(json.dumps(figures))


if __name__ == "__main__":
    main()
