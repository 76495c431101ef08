"""Digests of all bits of small computations, as JSON: ``python -m tests.workers.digests [THREADS] [NAME ...]``.

NAME selects computations (default: all), THREADS sets the number of BLAS threads (default: that of the environment).
``--unguarded`` switches the guard off, to see which digests depend on it.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
from threadpoolctl import ThreadpoolController, threadpool_limits

from tests.diagnosis.pendulum_rig import PendulumRig, recorded
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.problem import Evaluation, Problem, base_genome
from wingfit.calibration.result import judge
from wingfit.calibration.search import CalibrationSpec, calibrate, model_for, prepare
from wingfit.diagnosis import DiagnosisSpec, diagnose_subject
from wingfit.records import Dataset, load_dataset, wing_or_vehicle
from wingfit.records.blas_threads import OneBlasThread
from wingfit.workers.in_process import InProcessEvaluator

EXAMPLE = Path(__file__).parents[2] / "examples" / "robird"
SMALL = CalibrationSpec(division="4", mode="joint", genes=("E_f", "E_r", "D_E"), seed=3)


def main(arguments: list[str]) -> None:
    """Print the digests."""
    if "--unguarded" in arguments:
        OneBlasThread.__enter__ = lambda _: None  # type: ignore[method-assign]
        OneBlasThread.__exit__ = lambda *_: None  # type: ignore[method-assign]
    forced = [int(argument) for argument in arguments if argument.isdigit()]
    names = [name for name in COMPUTATIONS if name in arguments] or list(COMPUTATIONS)
    with threadpool_limits(forced[0] if forced else None):
        digests = {name: digest(COMPUTATIONS[name]()) for name in names}
        libraries = ThreadpoolController().select(user_api="blas").info()
    print(json.dumps({"digests": digests, "threads": [library["num_threads"] for library in libraries]}))


def digest(values: Iterable[object]) -> str:
    """Hash of the bits of arrays, and of what other values print as (floats print all their bits)."""
    found = hashlib.sha256()
    for value in values:
        found.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    return found.hexdigest()[:16]


def bits(evaluation: Evaluation) -> list[object]:
    """All numbers of an evaluation."""
    return [value for part in evaluation.per_recording for value in (part.squares, part.distance, part.residuals)]


def problem(division: str = "11") -> tuple[Problem, np.ndarray[tuple[int, int], np.dtype[np.float64]]]:
    """The aerodynamic stage of the example campaign, and nine individuals."""
    dataset, spec = wing_or_vehicle(load_dataset(EXAMPLE)), CalibrationSpec(division=division)
    model, stage = model_for(dataset, spec), prepare(spec, dataset).stages[1]
    genes = [gene for gene in model.genes if gene.name in stage.free]
    rng = np.random.default_rng(0)
    values = np.array([[float(gene.from_unit(rng.uniform())) for gene in genes] for _ in range(9)])
    return Problem(model, stage.recordings[:1], stage.free, base_genome(model)), values


def campaign() -> Dataset:
    """Two recordings of the example, 14,880 samples each: OpenBLAS splits sums of more than 10,000."""
    dataset = wing_or_vehicle(load_dataset(EXAMPLE))
    return replace(dataset, recordings=dataset.recordings[:2], held_out=())


def evaluation() -> list[object]:
    """Misfits and residuals of a batch, as it is and as it comes out of a pickle."""
    posed, values = problem()
    travelled = pickle.loads(pickle.dumps(posed))  # noqa: S301  our own bytes
    return [digest(bits(InProcessEvaluator().evaluate(one, values, residuals=True))) for one in (posed, travelled)]


def gauss_newton() -> list[object]:
    """Two iterations, and how their result stands."""
    spec, evaluator = replace(SMALL, method="gauss_newton", max_generations=2), InProcessEvaluator()
    *_, last = calibrate(spec, campaign(), evaluator)
    return [last, judge(spec, campaign(), evaluator, last.genome)]


def genetic() -> list[object]:
    """Two generations and two iterations of the finish, of more that would follow."""
    spec = replace(SMALL, population=8, max_generations=2, finish=True)
    return list(islice(calibrate(spec, campaign(), InProcessEvaluator()), 4))


def diagnosis() -> list[object]:
    """A pendulum whose spring hardens, in recordings long enough for OpenBLAS to split their sums."""
    truth = {"stiffness": 0.25, "damping": 3e-3, "inertia": 1.2e-3, "cubic.k3": 0.3}
    records, spec = recorded(truth, noise=5e-4, seed=1, frames=372), DiagnosisSpec()
    evaluator: Evaluator = InProcessEvaluator()
    *_, last = diagnose_subject(PendulumRig(), "pendulum", records, (), spec, evaluator)
    return [last.finding and replace(last.finding, seconds=0.0)]


COMPUTATIONS: dict[str, Callable[[], list[object]]] = {
    "evaluation": evaluation,
    "gauss_newton": gauss_newton,
    "genetic": genetic,
    "diagnosis": diagnosis,
}

if __name__ == "__main__":
    main(sys.argv[1:])
