"""A small deterministic search in place of the wing's, so that the runner's own logic is tested in milliseconds.

The search is a random walk whose numbers are keyed by seed and generation: resumed equals uninterrupted, as the service
relies on. ``gate`` lets a test hold it between generations.
"""

# ruff: noqa: ARG002  it takes what the real engine takes and needs little of it
from __future__ import annotations

import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NoReturn

import numpy as np

from wingfit.calibration.estimates.uncertainty import Correlations
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces.estimation import Prediction
from wingfit.calibration.forces.result import Agreement, ForceComparison, GlobalModel, Source
from wingfit.calibration.result import Comparison, GeneResult, RecordingResult, Result
from wingfit.calibration.search import CalibrationSpec, Generation, resolved
from wingfit.checks.load import Checked
from wingfit.records import Condition, Dataset, FourierDrive, Hinge, Marker, Materials, Recording, Station, Wing
from wingfit.service.runs.engine import Engine
from wingfit.sim.model import Solution
from wingfit.sim.wing.outputs import ConnectorLoad, Motor, Outputs, Section, Strip
from wingfit.workers import EvaluatorKind, RunningEvaluator
from wingfit.workers.watch import Standing

TARGET = {"stiffness": 3.0, "damping": 0.2}
NOMINAL = {"stiffness": 1.0, "damping": 0.1}
BOUNDS = {"stiffness": (0.1, 10.0), "damping": (0.01, 1.0)}
STAGES = ("structural", "aerodynamic")
UNLUCKY, DEADLY = 13, 666
STUCK_SEED = 14  # of runs whose check hangs in `stuck_server`


class NoEvaluator(RunningEvaluator):
    """Evaluates nothing: the toy search does without."""

    kind: EvaluatorKind = "in_process"
    workers, standing = 1, Standing(1)

    def _misfits(self, *_: Any) -> NoReturn:
        raise AssertionError("the toy search evaluates nothing")

    def close(self) -> None:
        pass


def archive(**changes: Any) -> bytes:
    """What a test uploads in place of a zip."""
    plain = {"name": "toy", "recordings": ["slow", "fast", "unseen"], "held_out": ["unseen"], "pad": ""}
    return json.dumps(plain | changes).encode()


class Fault:
    def __init__(self, where: str, value: str | None, message: str) -> None:
        self.where, self.value, self.message = where, value, message


class ArchiveError(ValueError):
    """Looks like wingfit.records.DatasetError."""

    def __init__(self, *errors: Fault) -> None:
        super().__init__("; ".join(error.message for error in errors))
        self.errors = list(errors)


class ToyEngine(Engine):
    """A search that takes no time; ``seconds`` per generation, ``gate`` called before each."""

    def __init__(self, seconds: float = 0.0, gate: Callable[[int], None] | None = None) -> None:
        self.seconds, self.gate = seconds, gate
        self.started_from: list[int] = []
        self.at_once = 0
        self.most_at_once = 0
        self._lock = threading.Lock()

    def load(self, data: bytes, filename: str) -> Dataset:
        try:
            plain = json.loads(data)
            names, held_out = tuple(plain["recordings"]), tuple(plain["held_out"])
        except (ValueError, KeyError, TypeError) as error:
            raise ArchiveError(Fault(f"{filename}, line 1", data[:20].hex(), f"not a toy archive: {error}")) from None
        return Dataset(plain["name"], _wing(), tuple(_recording(name) for name in names), held_out)

    def load_checked(self, data: bytes, filename: str) -> Checked:
        return Checked(self.load(data, filename), ())  # what it loads was never measured

    def check(self, spec: CalibrationSpec, dataset: Dataset) -> CalibrationSpec:
        if spec.recordings and set(spec.recordings) <= set(dataset.held_out):
            raise ValueError("only held-out recordings are named; name one that may be fitted")
        return resolved(spec, dataset)

    def gene_names(self, spec: CalibrationSpec, dataset: Dataset) -> tuple[str, ...]:
        if spec.division not in ("4", "11", "24", "3,3,2"):
            raise ValueError(f"division {spec.division!r} has no strips")
        return tuple(TARGET)

    def genome(
        self,
        spec: CalibrationSpec,
        dataset: Dataset,
        values: Mapping[str, float],
    ) -> dict[str, float]:
        for name, value in values.items():
            lower, upper = BOUNDS[name]
            if not lower <= value <= upper:
                raise ValueError(f"gene '{name}' is {value:g}; it must lie in [{lower:g}, {upper:g}]")
        return NOMINAL | dict(values)

    def genes(
        self,
        spec: CalibrationSpec,
        dataset: Dataset,
        genome: Mapping[str, float],
    ) -> tuple[GeneResult, ...]:
        return tuple(
            GeneResult(name, "1", name, NOMINAL[name], genome[name], *BOUNDS[name], True, None, None) for name in TARGET
        )

    def calibrate(
        self,
        spec: CalibrationSpec,
        dataset: Dataset,
        evaluator: Evaluator,
        checkpoint: dict[str, Any] | None,
    ) -> Iterator[Generation]:
        state = checkpoint or {"done": 0, "genome": NOMINAL}
        self.started_from.append(state["done"])
        total = spec.max_generations * len(STAGES)
        with self._lock:
            self.at_once += 1
            self.most_at_once = max(self.most_at_once, self.at_once)
        try:
            for done in range(state["done"], total):
                if self.gate:
                    self.gate(done)
                time.sleep(self.seconds)
                if spec.seed == UNLUCKY and done == 2:
                    raise ArithmeticError("the thirteenth seed breaks")
                if spec.seed == DEADLY and done == 2:
                    os.kill(os.getpid(), signal.SIGKILL)
                state = {"done": done + 1, "genome": _improve(state["genome"], spec.seed, done)}
                yield _generation(spec, state, total)
        finally:
            with self._lock:
                self.at_once -= 1

    def found(self, spec: CalibrationSpec, dataset: Dataset, checkpoint: dict[str, Any]) -> dict[str, dict[str, float]]:
        return {STAGES[0]: checkpoint["genome"]}

    def summarise(
        self,
        spec: CalibrationSpec,
        dataset: Dataset,
        evaluator: Evaluator,
        checkpoint: dict[str, Any],
    ) -> Result:
        genome = checkpoint["genome"]
        records = tuple(
            RecordingResult(r.name, r.name in dataset.held_out, "structural", 8, 2e-3, misfit(genome))
            for r in dataset.recordings
        )
        genes = tuple(
            GeneResult(name, "1", name, NOMINAL[name], genome[name], *BOUNDS[name], True, 0.02, True) for name in TARGET
        )
        together = Correlations(tuple(TARGET), ((1.0, -0.95), (-0.95, float("nan"))))
        return Result(genes, records, 2e-3, misfit(genome), 2e-3, misfit(genome), None, correlations=(together,))

    def compare(
        self,
        spec: CalibrationSpec,
        dataset: Dataset,
        genome: Mapping[str, float],
        recording: str,
    ) -> Comparison:
        if genome["stiffness"] > 9:
            raise ValueError("the simulation diverged at 0.1 s")
        record = dataset.recording(recording)
        simulated = np.nan_to_num(record.positions) + misfit(genome)
        phase = np.arange(len(record.times)) / len(record.times)
        solution = Solution(144, 7, 0.2 * spec.accuracy)
        return Comparison(recording, phase, record.markers, record.positions, simulated, spec.accuracy, solution)

    def loads(
        self,
        spec: CalibrationSpec,
        dataset: Dataset,
        genome: Mapping[str, float],
        recording: Recording,
    ) -> Outputs:
        if genome["stiffness"] > 9:
            raise ValueError("the simulation diverged at 0.1 s")
        return _loads(genome["stiffness"] * recording.condition.flap_frequency / 3.0)

    def forces(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str, source: Source
    ) -> ForceComparison:
        raise AssertionError("the toy is a wing")

    def agreements(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
    ) -> tuple[Agreement, ...]:
        raise AssertionError("the toy is a wing")

    def predict(self, spec: CalibrationSpec, dataset: Dataset, law: GlobalModel, condition: Condition) -> Prediction:
        raise AssertionError("the toy is a wing")


def _loads(size: float, n: int = 16) -> Outputs:
    """One beat of a wing of two bodies whose upstroke crosses the horizontal at a quarter of the drive's beat."""
    phase = np.arange(n) / n
    wave, six = np.cos(2 * np.pi * phase), np.zeros((n, 6))
    six[:, 0], six[:, 5] = size * wave, 2 * size * wave
    motor = Motor(0.5 * wave, 3.0 * wave, size * wave, 3.0 * size * wave**2)
    connector = ConnectorLoad(
        "front rod", "root", ("front rod", "1.1"), np.array([0.0, 0.03, 0.0]), six, six, wave**2, wave**2
    )
    force = np.stack([-wave - 0.1, 0 * wave, 3 * wave + 1.0], axis=1)
    strips = (Strip("strip 1", (0.03, 0.2), force, -size * wave**2), Strip("strip 2", (0.2, 0.3), force, 0 * wave))
    return Outputs(
        phase, 0.25, (motor, motor), (connector,), (Section("root", 0.03, six), Section("strips 1-2", 0.2, six / 2)),
        strips, np.zeros((n, 2, 6)), np.zeros((n, 2, 6)), np.zeros(n), np.zeros(n),
        np.array([0.0, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0]), wave**2, wave**2, wave,
        solution=Solution(96, 5, 2e-5),
    )  # fmt: skip


def misfit(genome: Mapping[str, float]) -> float:
    """Distance from the target."""
    return 1e-3 * sum((genome[name] - TARGET[name]) ** 2 for name in TARGET)


def _improve(genome: Mapping[str, float], seed: int, done: int) -> dict[str, float]:
    step = np.random.default_rng((seed, done)).normal(0, 0.1, len(TARGET))
    trial = {name: float(genome[name] + step[i]) for i, name in enumerate(TARGET)}
    return min((dict(genome), trial), key=misfit)


def _generation(spec: CalibrationSpec, state: dict[str, Any], total: int) -> Generation:
    stage, index = divmod(state["done"] - 1, spec.max_generations)
    return Generation(
        stage=STAGES[stage],
        index=index,
        best=misfit(state["genome"]) ** 2,
        mean=float("inf") if state["done"] == 1 else 1.0,
        diversity=1.0 / state["done"],
        distance=misfit(state["genome"]),
        evaluations=spec.population * state["done"],
        failed=1,
        reasons=("diverged at 0.1 s",),
        genome=dict(state["genome"]),
        progress=state["done"] / total,
        checkpoint=state,
    )


def _wing() -> Wing:
    return Wing(
        name="toy",
        stations=(Station(0.0, 0.0, 0.1, 0.002), Station(0.3, 0.0, 0.1, 0.002)),
        materials=Materials(30.0, 0.02),
        rods=(),
        driven_rods=("front", "rear"),
        markers=(Marker("a", (0.0, 0.1, 0.0), 1e-5), Marker("b", (0.0, 0.2, 0.0), 1e-5)),
        reference_markers=("a",),
        hinge=Hinge(0.0, 0.0),
        drive=FourierDrive(0.0, (0.5,), (0.0,)),
    )


def _recording(name: str) -> Recording:
    values = np.linspace(0.0, 0.1, 4 * 6).reshape(4, 6)
    values[1, 3:] = np.nan
    return Recording(
        name=name,
        rig="vacuum_chamber",
        condition=Condition(flap_frequency=3.0, phase_lag=np.pi / 4, pressure=1e4, temperature=293.15),
        times=np.arange(4) / 12.0,
        markers=("a", "b"),
        values=values,
    )


class FaultyEngine(ToyEngine):
    """Its simulations fail by a mistake, where only a request arrives that names what exists."""

    def compare(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
    ) -> Comparison:
        raise RuntimeError(f"a word about {recording} that is nobody's business")
