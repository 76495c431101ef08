"""Numbers that no change of structure may move: simulated motions, forces, and searches.

``python -m tests.golden.numbers`` computes them and writes ``golden.json`` beside this file. Do that only for a change
that is meant to move numbers, and say so in CHANGELOG.md under "Numbers that moved".
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
import numpy as np
import numpy.typing as npt
import scipy

from wingfit.calibration.search import CalibrationSpec, calibrate, model_for
from wingfit.records import Dataset, load_dataset, wing_or_vehicle
from wingfit.workers.in_process import InProcessEvaluator

Array = npt.NDArray[np.float64]

FILE = Path(__file__).with_name("golden.json")
EXAMPLES = Path(__file__).parents[2] / "examples"
SAMPLES = 12
"""Values of each case that are stored as numbers, for machines whose last bits differ."""

ROBIRD, DELFLY = "robird", "delfly"


def machine() -> str:
    """What the last bits of a number depend on: instruction set, compiler and libraries."""
    features = sorted(name for name, on in llvm.get_host_cpu_features().items() if on)
    digest = hashlib.sha256(",".join(features).encode()).hexdigest()[:12]
    versions = f"numba {numba.__version__}, numpy {np.__version__}, scipy {scipy.__version__}"
    return f"{llvm.get_host_cpu_name()} {digest}, {versions}"


def motion(example: str, recordings: int, **settings: Any) -> Callable[[], Array]:
    """What the model of an example predicts for its first recordings: nominal genes, and two genomes near by."""

    def compute() -> Array:
        dataset = wing_or_vehicle(load_dataset(EXAMPLES / example))
        model = model_for(dataset, CalibrationSpec(**settings))
        rng = np.random.default_rng(7)
        nominal = np.array([gene.nominal for gene in model.genes])
        span = np.array([gene.upper - gene.lower for gene in model.genes])
        genomes = np.stack([nominal, *(nominal + 0.02 * span * rng.uniform(0, 1, len(nominal)) for _ in range(2))])
        observed = [model.observe(genomes, recording) for recording in _spread(dataset, recordings)]
        return np.concatenate([one.channels.ravel() for one in observed])

    return compute


def search(example: str, recordings: int, *, genes: bool = True, **settings: Any) -> Callable[[], Array]:
    """The history of a short search in this process: fitness and, with ``genes``, best genome of each generation."""

    def compute() -> Array:
        dataset = wing_or_vehicle(load_dataset(EXAMPLES / example))
        names = tuple(recording.name for recording in _spread(dataset, recordings))
        spec = replace(CalibrationSpec(recordings=names, seed=3), **settings)
        generations = list(calibrate(spec, dataset, InProcessEvaluator()))
        if not genes:
            return np.array([one.best for one in generations])
        rows = [[one.best, one.mean, one.diversity, one.distance, *one.genome.values()] for one in generations]
        return np.array(rows, float).ravel()

    return compute


def _spread(dataset: Dataset, count: int) -> list[Any]:
    """``count`` recordings that are fitted, from the first to the last."""
    fitted = [recording for recording in dataset.recordings if recording.name not in dataset.held_out]
    return [fitted[k] for k in np.linspace(0, len(fitted) - 1, count).astype(int)]


WING_EFFECTS = ("hinge_offset", "added_mass", "camera_shift", "backlash")
VEHICLE_EFFECTS = ("wake_capture", "dynamic_stall", "balance_resonance")

CASES: dict[str, Callable[[], Array]] = {
    "motion of the wing, 11 bodies": motion(ROBIRD, 2, division="11"),
    "motion of the wing, 24 bodies": motion(ROBIRD, 2, division="24"),
    "motion of the wing with effects": motion(ROBIRD, 2, division="11", effects=WING_EFFECTS),
    "forces of the vehicle": motion(DELFLY, 2),
    "forces of the vehicle with effects": motion(DELFLY, 2, effects=VEHICLE_EFFECTS),
    "genetic search": search(ROBIRD, 2, division="4", population=8, max_generations=2),
    "CMA-ES": search(ROBIRD, 2, division="4", mode="joint", method="cma_es", population=8, max_generations=2),
    "Gauss-Newton on the wing": search(ROBIRD, 2, division="4", method="gauss_newton", max_generations=2),
    "fitness of Gauss-Newton on the wing": search(
        ROBIRD, 2, genes=False, division="4", method="gauss_newton", max_generations=2
    ),
    "Gauss-Newton on the vehicle": search(DELFLY, 2),
}

# Two iterations of Gauss-Newton leave badly determined genes where the rounding of the last bits sends them: on
# machines that are not in the golden file only the fitness is compared, to this relative tolerance.
KNOWN_MACHINES_ONLY = {"Gauss-Newton on the wing"}
ELSEWHERE = {"fitness of Gauss-Newton on the wing": 5e-3}


def entry(values: Array) -> dict[str, Any]:
    """What is stored of a case: the digest of all values, and some of them."""
    finite = values[np.isfinite(values)]
    chosen = finite[np.linspace(0, len(finite) - 1, SAMPLES).astype(int)]
    digest = hashlib.sha256(np.ascontiguousarray(values, "<f8").tobytes()).hexdigest()
    return {"count": len(values), "sha256": digest, "values": chosen.tolist()}


def main() -> None:
    """Write the golden file of this machine."""
    stored: dict[str, Any] = json.loads(FILE.read_text()) if FILE.exists() else {}
    stored[machine()] = {name: entry(compute()) for name, compute in CASES.items()}
    FILE.write_text(json.dumps(stored, indent=1) + "\n")


if __name__ == "__main__":
    main()
