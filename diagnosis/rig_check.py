"""The contract of a rig as checks that run: shapes, determinism, effects that are off, bounds, failures, smoothness."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wingfit.inference.differences import STEP
from wingfit.records import Gene, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.records.series import belongs_to
from wingfit.rigs.dataset_model import model_of
from wingfit.rigs.rig import Rig, required_rig
from wingfit.rigs.rig_model import RigModel
from wingfit.rigs.run import Run
from wingfit.rigs.suspect import Suspect

ROUGH = 0.2  # largest relative change of a derivative when its step is halved
VISIBLE = 1e-9  # of a channel's range: smaller changes count as none
OUTSIDE = 0.02  # of a gene's range: how far from its bounds it is simulated

Outcome = Literal["pass", "warn", "fail"]


@dataclass(frozen=True)
class CheckResult:
    """Outcome of one check; ``words`` say what was found and, unless it passed, what to do."""

    name: str
    outcome: Outcome
    words: str


def check_rig(rig: Rig, dataset: SeriesDataset) -> Iterator[CheckResult]:
    """Check ``rig`` on the first recording of ``dataset``; yields one result for each requirement of the contract."""
    try:
        model = model_of(required_rig(rig), dataset)
    except ValueError as error:
        yield CheckResult("fits the dataset", "fail", str(error))
        return
    yield CheckResult("fits the dataset", "pass", f"{len(rig.channels)} channels, {len(rig.inputs)} inputs")
    recording = dataset.recordings[0]
    checks = _Checks(model, recording)
    first = checks.simulated(checks.nominal)
    if isinstance(first, str):
        yield CheckResult("simulates its nominal genes", "fail", f"recording {recording.name}: {first}")
        return
    yield CheckResult(
        "simulates its nominal genes", "pass", f"recording {recording.name}: {checks.milliseconds:.3g} ms"
    )
    for check in (checks.repeats, checks.leaves_arguments, checks.bounds, checks.derivatives, checks.off, checks.ports):
        yield from check()


class _Checks:
    def __init__(self, model: RigModel, recording: Series) -> None:
        self.model, self.recording = model, recording
        self.nominal = np.array([gene.nominal for gene in model.genes])
        began = time.perf_counter()
        model.observe(self.nominal, recording)
        self.milliseconds = 1e3 * (time.perf_counter() - began)

    def simulated(self, genome: Array, model: RigModel | None = None) -> Array | str:
        """Return the channels [T, C] of ``genome`` [G], or why it cannot be simulated."""
        seen = (model or self.model).observe(genome, self.recording)
        return seen.channels[0] if seen.reasons[0] is None else str(seen.reasons[0])

    def repeats(self) -> Iterator[CheckResult]:
        """The same genome gives the same numbers, after others too."""
        other = np.array([self._inside(gene) for gene in self.model.genes])
        first, _, again = (self.simulated(one) for one in (self.nominal, other, self.nominal))
        same = isinstance(first, np.ndarray) and isinstance(again, np.ndarray) and np.array_equal(first, again)
        words = "the same genome gives the same numbers"
        if not same:
            words = (
                "the same genome gives other numbers the second time: simulate must depend on its arguments alone (a "
                "random number without a fixed seed, or a state kept from an earlier call?)"
            )
        yield CheckResult("is deterministic", "pass" if same else "fail", words)

    def leaves_arguments(self) -> Iterator[CheckResult]:
        """The simulation does not change the times and inputs that it gets, from which faults are computed."""
        runs, rig, recording = list[Run](), self.model.rig, self.recording

        def watched(genes: Mapping[str, float], run: Run) -> Mapping[str, Array]:
            runs.append(run)
            return rig.simulate(genes, run)

        self.simulated(self.nominal, replace(self.model, rig=replace(rig, simulate=watched)))
        same = all(
            np.array_equal(recording.times, run.times)
            and all(np.array_equal(u, run.inputs[name]) for name, u in recording.inputs.items())
            for run in runs
        )
        words = "" if same else "simulate changes run.times or run.inputs: copy them before changing them"
        yield CheckResult("leaves its arguments as they are", "pass" if same else "fail", words)

    def bounds(self) -> Iterator[CheckResult]:
        """Every gene can be simulated near its bounds, or fails with a reason."""
        for k, gene in enumerate(self.model.genes):
            if not self._matters(gene):
                continue
            for end, unit in (("lower", OUTSIDE), ("upper", 1.0 - OUTSIDE)):
                genome = self.nominal.copy()
                genome[k] = float(gene.from_unit(unit))
                found = self.simulated(genome)
                if isinstance(found, str):
                    words = (
                        f"near the {end} bound of {gene.name} ({genome[k]:.4g} {gene.unit}): {found}; narrow its bounds"
                    )
                    yield CheckResult("simulates up to its bounds", "warn", words)

    def derivatives(self) -> Iterator[CheckResult]:
        """Derivatives do not depend on the step: the simulation is smooth, and more accurate than a step's change."""
        for k, gene in enumerate(self.model.genes):
            if not self._matters(gene):
                continue
            wide, narrow = (self._derivative(k, gene, step) for step in (STEP, STEP / 2))
            if wide is None or narrow is None:
                continue
            size = float(np.linalg.norm(wide))
            if size == 0.0:
                yield CheckResult(
                    "depends on its genes", "warn", f"{gene.name} changes nothing in {self.recording.name}"
                )
            elif (change := float(np.linalg.norm(wide - narrow)) / size) > ROUGH:
                yield CheckResult(
                    "is smooth",
                    "warn",
                    f"the derivative by {gene.name} changes by {100 * change:.0f} % when its step is halved: "
                    "integrate more accurately, or avoid sudden changes",
                )

    def off(self) -> Iterator[CheckResult]:
        """A suspect whose sizes are zero changes nothing, whatever its shape; with its typical size it does."""
        for suspect in self.model.rig.suspects:
            yield self._off(suspect)

    def _off(self, suspect: Suspect) -> CheckResult:
        name = f"suspect {suspect.name} is off at zero"
        model = self.model.with_effects(suspect.name)
        nominal = self.simulated(self.nominal)
        shape = [gene.nominal if gene.name in suspect.size_genes else self._inside(gene) for gene in suspect.genes]
        off = self.simulated(np.concatenate([self.nominal, shape]), model)
        if isinstance(off, str) or isinstance(nominal, str):
            return CheckResult(name, "fail", f"it cannot be simulated with size zero: {off}")
        if not np.array_equal(off, nominal):
            return CheckResult(name, "fail", "with size zero it changes the channels: zero must switch it off exactly")
        typical = [suspect.typical[gene.name] for gene in suspect.genes]
        on = self.simulated(np.concatenate([self.nominal, typical]), model)
        if isinstance(on, str):
            return CheckResult(name, "warn", f"with its typical size it cannot be simulated: {on}")
        if np.abs(on - nominal).max() <= VISIBLE * np.ptp(nominal, axis=0).max():
            return CheckResult(name, "warn", f"with its typical size ({typical}) it changes nothing in this recording")
        return CheckResult(name, "pass", "")

    def ports(self) -> Iterator[CheckResult]:
        """A constant force at each port changes the channels."""
        for port in self.model.rig.ports:
            name = f"port {port.name} is used"
            model = self.model.with_effects(f"constant_force.{port.name}")
            nominal, pushed = (
                self.simulated(self.nominal),
                self.simulated(np.append(self.nominal, 0.2 * port.force), model),
            )
            if isinstance(pushed, str) or isinstance(nominal, str):
                yield CheckResult(name, "warn", f"with a constant force it cannot be simulated: {pushed}")
            elif np.array_equal(pushed, nominal):
                yield CheckResult(
                    name, "fail", f"a force changes nothing: simulate must add run.force({port.name!r}, ...)"
                )
            else:
                yield CheckResult(name, "pass", "")

    def _matters(self, gene: Gene) -> bool:
        """Return whether ``gene`` belongs to no other recording."""
        others = (one for one in self.model.all_recordings if one is not self.recording)
        return not any(belongs_to(gene.name, one.name) for one in others)

    @staticmethod
    def _inside(gene: Gene) -> float:
        return float(gene.from_unit(0.5 * float(gene.to_unit(gene.nominal)) + 0.3))

    def _derivative(self, k: int, gene: Gene, step: float) -> Array | None:
        ends = []
        at = float(np.clip(gene.to_unit(gene.nominal), STEP, 1.0 - STEP))
        for unit in (at - step, at + step):
            genome = self.nominal.copy()
            genome[k] = float(gene.from_unit(unit))
            found = self.simulated(genome)
            if isinstance(found, str):
                return None
            ends.append(found)
        return (ends[1] - ends[0]) / (2.0 * step)
