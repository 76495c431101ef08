"""How long users wait, part by part: ``python -m benchmarks.speed [--json] [--only PART ...]``.

Times of the simulator are processor times of one thread for one individual, all lanes being used; the other times are
elapsed times on two processors. "Certified" means from rest to a periodic motion whose estimated error is below 0.1 mm.
The whole takes about two hours; run it on a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks import calibration, diagnosis
from benchmarks.common.files import REPOSITORY
from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show
from benchmarks.physics import flops
from benchmarks.physics.convergence import Subject, by_default
from benchmarks.simulator import CONDITIONS, DIVISIONS, Peer, case, run_peer, search_seconds
from wingfit.calibration.estimates.linearised import unit_at, values_at
from wingfit.calibration.search import CalibrationSpec
from wingfit.inference.differences import TANGENT_STEP, differences
from wingfit.records import Condition, load_dataset, save_dataset, wing_or_vehicle
from wingfit.sim.kernels import LANES
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.workers import make_evaluator

Array = npt.NDArray[np.float64]

BODIES, WORKERS, SEED = 24, 2, 1
EXACT = Numerics(periodic=1e-11, max_beats=100)
STRONG = 0.05  # of the largest derivative; weaker ones are compared with this
REPETITIONS = 3
PEER_SECONDS = 90.0
PAIRS = (1e-3, 5e-4)  # sizes of the central differences that are extrapolated to zero
WARM = "import time; t = time.perf_counter(); from wingfit.sim.warm import main; main(); print(time.perf_counter() - t)"


def kernels() -> dict[str, Any]:
    """Cost of a beat and of a certified motion of 24 bodies, and the share of the processor's peak that is reached."""
    operations, peak = flops.count_step(DIVISIONS[BODIES]).operations, flops.peak_gflops()
    rows = {medium: case(BODIES, medium, operations) for medium in CONDITIONS}
    peak = max(peak, flops.peak_gflops())
    return {
        "fraction_of_peak_24": min(row["gflops"] for row in rows.values()) / peak,
        "ms_per_beat_24_air": rows["air"]["ms_per_beat"],
        "ms_certified_24": {medium: row["default_ms_per_individual"] for medium, row in rows.items()},
        "certified_error_mm": {medium: row["default_error_mm"] for medium, row in rows.items()},
        "times_faster_than_exudyn_certified": min(_times_faster(row) for row in rows.values()),
    }


def _times_faster(row: dict[str, Any]) -> float:
    """Time of Exudyn for a periodic motion of the same accuracy over that of a certified motion; NaN without Exudyn.

    Exudyn simulates as many beats as the motion needs to become periodic without acceleration.
    """
    found = run_peer(Peer("exudyn", BODIES, row["medium"]), PEER_SECONDS)["cpu_ms_per_beat"]
    plain = row["beats_to_periodic_plain"]
    return math.nan if found is None or plain is None else found * plain / row["default_ms_per_individual"]


def derivatives() -> dict[str, Any]:
    """Cost of the derivatives by 18 genes in certified motions, with the motion they start from, and their error."""
    wings, errors = [], []
    for condition in CONDITIONS.values():
        subject, times = Subject(DIVISIONS[BODIES], condition), []
        for repetition in range(REPETITIONS, -1, -1):
            # Another genome each time, so that its motion is not known from before; the last is the subject's.
            genome = subject.genome[0] * (1.0 + 1e-6 * repetition)
            began = time.thread_time()
            found = _slopes(subject.model.tangent(genome), genome, condition, TANGENT_STEP, sides=1)
            times.append(time.thread_time() - began)
        wings.append(1e3 * min(times[1:]) / by_default(subject).ms)
        exact = replace(subject.model, numerics=replace(EXACT, steps=len(found)))
        coarse, fine = (_slopes(exact, subject.genome[0], condition, step) for step in PAIRS)
        expected = (4 * fine - coarse) / 3
        size = np.abs(expected).max(axis=(0, 1, 2))
        error = np.abs(found - expected).max(axis=(0, 1, 2)) / np.maximum(size, STRONG * size.max())
        errors.append(float(error.max()))
    return {"jacobian_18_genes_in_wings": max(wings), "sensitivity_error": max(errors)}


def _slopes(model: FlexibleWing, genome: Array, condition: Condition, step: float, sides: int = 2) -> Array:
    """Derivatives [n, M, 3, G] of the tracks with respect to the genes, by differences of this step."""
    blank = blank_recording(model.wing, condition)

    def simulate(units: Array) -> tuple[list[Array], list[str | None]]:
        beats = model.beats(values_at(list(model.genes), units), blank)
        return [np.array([beat.tracks for beat in beats])], [beat.reason for beat in beats]

    unit = unit_at(list(model.genes), genome)
    return differences(simulate, unit, np.arange(len(unit)), step=step, sides=sides).slopes[0]


def calibrations() -> dict[str, Any]:
    """Duration of a joint calibration of the example by Gauss-Newton, and of the thesis's genetic search."""
    evaluator = make_evaluator("processes", WORKERS)
    try:
        spec = CalibrationSpec(division=str(BODIES), method="gauss_newton", mode="joint")
        joint = calibration.run(spec, wing_or_vehicle(load_dataset(calibration.EXAMPLE)), evaluator, "joint")
    finally:
        evaluator.close()
    return {
        "joint_calibration_s": joint.seconds,
        "joint_calibration_mm": 1e3 * joint.result.after,
        "genetic_search_24_s": search_seconds(),
    }


def one_diagnosis() -> dict[str, Any]:
    """Duration of the diagnosis of twelve recordings with 24 bodies."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "twelve.nc"
        save_dataset(diagnosis.recorded(str(BODIES), "8x4", SEED), path)
        found = diagnosis.measured(path, str(BODIES), "processes", WORKERS)
    return {"diagnosis_24_s": found["seconds"], "diagnosis_24_named": found["named"]}


def concealed() -> dict[str, Any]:
    """Duration of a sample of the concealed trials."""
    began = time.monotonic()
    command = [sys.executable, "-m", "benchmarks.concealed", "--quick", "--json"]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603
    return {"concealed_quick_s": time.monotonic() - began}


def reliabilities() -> dict[str, Any]:
    """How often the genetic search and the method "auto" find the best genome."""
    command = [sys.executable, "-m", "benchmarks.reliability", "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return {name: found[name] for name in ("auto_reliability_percent", "genetic_reliability_percent")}


def starting() -> dict[str, Any]:
    """Time until the first simulation: with nothing compiled, and with everything compiled."""
    with tempfile.TemporaryDirectory() as scratch:
        # A copy of the package without what was compiled, which would be found beside the sources.
        shutil.copytree(REPOSITORY / "wingfit", Path(scratch) / "wingfit", ignore=shutil.ignore_patterns("__pycache__"))
        environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
        seconds = []
        for _ in range(2):
            done = subprocess.run(  # noqa: S603
                [sys.executable, "-c", WARM], cwd=scratch, env=environment, check=True, capture_output=True, text=True
            )
            seconds.append(float(done.stdout.split()[-1]))
    return {"cold_compile_s": seconds[0], "warm_start_s": seconds[1]}


PARTS: dict[str, Callable[[], dict[str, Any]]] = {
    "kernels": kernels,
    "derivatives": derivatives,
    "calibrations": calibrations,
    "diagnosis": one_diagnosis,
    "concealed": concealed,
    "starting": starting,
    "reliability": reliabilities,
}


def main() -> None:
    """Measure the parts that the command line names, and print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print only the JSON object")
    parser.add_argument("--only", action="append", choices=PARTS, default=[], help="only this part; may be repeated")
    arguments = parser.parse_args()
    chosen = arguments.only or list(PARTS)
    figures: dict[str, Any] = {"cpu": cpu(), "lanes": LANES}
    began = time.monotonic()
    for number, name in enumerate(chosen, 1):
        show(f"[{number}/{len(chosen)}, {time.monotonic() - began:.0f} s] {name}")
        figures |= PARTS[name]()
    figures |= {"seconds": time.monotonic() - began, "commit": commit()}
    show("", last=True)
    if not arguments.json:
        print("\n".join(f"{name}: {value}" for name, value in figures.items()))
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
