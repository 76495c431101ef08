"""Common interface to the two plants (independent simulators of a wing and of a vehicle) with their measurement.

A bench simulates a plant with hidden effects and records it with simulated cameras or a balance.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.benches import drifting
from benchmarks.concealed.plant.law import Concealed, Law, Parameters
from benchmarks.concealed.trials import DRIFTS, Build, name_of
from wingfit.calibration.spec import CalibrationSpec, model_for
from wingfit.records import Condition, Dataset, Recording, Vehicle, Wing
from wingfit.sim.model import Model

Array = npt.NDArray[np.float64]
Quality = TypeVar("Quality")
Motion = TypeVar("Motion")

SPREAD = 1.6  # true parameters are drawn between estimate / SPREAD and estimate * SPREAD
SMALLEST, LARGEST = 0.02, 4.0  # limits of a strength, as multiples of the typical strength
MOST = {"marker_swap": 1.9, "tip_loss": 2.0, "dynamic_stall": 1.4, "circulation_lag": 1.0, "stall_vortex": 2.0}
"""Upper limits, as multiples of the typical strength, of laws that are only valid below LARGEST."""
KEPT = 64  # simulated beats that are cached


class Made(NamedTuple):
    """A recording, and the RMS of its noise (m or N) after the filtering that precedes a fit."""

    recording: Recording
    noise: float


@dataclass(frozen=True, eq=False)
class Bench(ABC, Generic[Motion, Quality]):
    """A plant (simulator that produces test data) with its cameras or balance.

    ``build`` says which rig, discretisation and terms; ``beats`` caches simulated wing beats. ``Motion`` is the type of
    one simulated beat, ``Quality`` that of the settings of cameras or balance.
    """

    build: Build
    beats: OrderedDict[Hashable, Motion] = field(default_factory=OrderedDict, repr=False)

    @property
    @abstractmethod
    def rig(self) -> Wing | Vehicle:
        """The rig as it is, with estimates of the nominal model's parameters (genes)."""

    @abstractmethod
    def described(self, rng: np.random.Generator) -> Wing | Vehicle:
        """The description of the rig in the dataset, with the errors of a laboratory."""

    @property
    @abstractmethod
    def faults(self) -> Mapping[str, Law]:
        """Faults that the measurement can have, by name."""

    @property
    @abstractmethod
    def physics(self) -> Mapping[str, Law]:
        """Effects that can be hidden in the plant, by name."""

    @abstractmethod
    def quality(self, rng: np.random.Generator) -> Quality:
        """Settings of cameras or balance, drawn from ``rng``."""

    @abstractmethod
    def quieter(self, quality: Quality, level: float) -> Quality:
        """Copy of the settings ``quality`` with the noise multiplied by ``level``."""

    @abstractmethod
    def least(self, quality: Quality) -> float:
        """Smallest factor on the noise of ``quality`` that real equipment reaches, for :meth:`quieter`."""

    @abstractmethod
    def ideal(self, quality: Quality) -> Quality:
        """Copy of the settings ``quality`` without noise and gaps."""

    @abstractmethod
    def fitted(self, recording: Recording) -> Recording:
        """Apply the filter that precedes every fit; strengths of effects and noise are measured on the result."""

    @abstractmethod
    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Motion:
        """One beat of the plant simulated under ``condition`` with parameters ``genome`` and the effects ``hidden``."""

    @abstractmethod
    def shown(
        self, beat: Motion, condition: Condition, hidden: Concealed, quality: Quality, rng: np.random.Generator
    ) -> Made:
        """Record ``beat`` with cameras or balance of settings ``quality``, with the measurement faults ``hidden``."""

    @cached_property
    def laws(self) -> dict[str, Law]:
        """All effects that can be hidden, physics and faults of the measurement, by name."""
        return {**self.physics, **self.faults, **drifting.LAWS}

    @cached_property
    def model(self) -> Model:
        """The nominal model that will be diagnosed; it is refitted to measure the strength of hidden effects."""
        spec = CalibrationSpec(without=self.build.without, effects=self.build.effects)
        if self.build.division:
            spec = replace(spec, division=self.build.division)
        return model_for(Dataset("nominal", self.rig, ()), spec)

    def model_beside(self, genome: Mapping[str, float]) -> Model:  # noqa: ARG002
        """The nominal :attr:`model`, set up to simulate parameters near ``genome`` faster, if the rig allows it."""
        return self.model

    def phase(self, beat: Motion, name: str, parameters: Parameters) -> float | None:  # noqa: ARG002
        """Phase (beats) at which the effect ``name`` acts, from the start of the beat as a dataset defines it.

        None if the effect acts at all phases.
        """
        return parameters.get("phase")

    def limits(self, name: str) -> tuple[float, float]:
        """Smallest and largest strength of the effect ``name``, as multiples of its typical strength."""
        return SMALLEST, MOST.get(name, LARGEST)

    def coarse(self) -> Bench[Motion, Quality]:
        """A bench whose plant is discretised like the model; this bench if its plant already is."""
        if self.build.plant == self.build.division:
            return self
        return type(self)(replace(self.build, plant=self.build.division))

    def genome(self, rng: np.random.Generator) -> dict[str, float]:
        """Random true values of the model's parameters by name; parameters that are not fitted keep their estimates."""
        drawn = {gene.name: float(gene.nominal * SPREAD ** rng.uniform(-1.0, 1.0)) for gene in self.model.genes}
        return {g.name: drawn[g.name] if g.name in self.searched else g.nominal for g in self.model.genes}

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the genes that a diagnosis fits to what is recorded."""
        return self.model.searched

    def beat(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Motion:
        """One beat by :meth:`simulated`, cached; measurement faults in ``hidden`` are ignored."""
        inside = {name: values for name, values in hidden.items() if name in self.physics}
        key = (condition, tuple(genome.items()), tuple((n, tuple(v.items())) for n, v in inside.items()))
        if key not in self.beats:
            self.beats[key] = self.simulated(condition, genome, inside)
        while len(self.beats) > KEPT:
            self.beats.popitem(last=False)
        return self.beats[key]

    def recording(
        self,
        condition: Condition,
        genome: Mapping[str, float],
        hidden: Concealed,
        quality: Quality,
        rng: np.random.Generator,
    ) -> Made:
        """Simulate and record one condition, with all physics and measurement faults in ``hidden``."""
        wrong = {name: values for name, values in hidden.items() if name in self.faults}

        def made(genes: Mapping[str, float], inside: Concealed, dice: np.random.Generator) -> Made:
            return self.shown(self.beat(condition, genes, inside), condition, wrong, quality, dice)

        found = made(genome, hidden, copy.deepcopy(rng))
        if not set(DRIFTS) & set(hidden):
            return found
        changing = drifting.drifting(lambda *of: made(*of).recording, genome, hidden, rng)
        return found._replace(recording=changing)


def record_all(
    bench: Bench[Motion, Quality],
    conditions: Sequence[Condition],
    genome: Mapping[str, float],
    hidden: Concealed,
    seed: int,
) -> Iterator[Recording]:
    """Yield a recording under each of ``conditions``, all with the same settings of cameras or balance.

    The same ``seed`` gives bit-identical recordings.
    """
    quality = bench.quality(np.random.default_rng([seed, 2]))
    for number, condition in enumerate(conditions):
        made = bench.recording(condition, genome, hidden, quality, np.random.default_rng([seed, 3, number]))
        yield replace(made.recording, name=name_of(condition))
