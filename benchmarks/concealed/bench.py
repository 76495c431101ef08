"""Both plants behind one interface: the rig as its user describes it, what can be hidden, how it is recorded."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.law import Concealed, Law, Parameters
from benchmarks.concealed.plant.measurement.balance import FAULTS as BALANCE_FAULTS
from benchmarks.concealed.plant.measurement.balance import Weighing, draw_weighing, silent, weigh
from benchmarks.concealed.plant.measurement.cameras import Cameras, draw_cameras
from benchmarks.concealed.plant.measurement.film import FAULTS as CAMERA_FAULTS
from benchmarks.concealed.plant.measurement.film import Filming, draw_filming, film, with_noise
from benchmarks.concealed.plant.vehicle.laws import LAWS as VEHICLE_LAWS
from benchmarks.concealed.plant.vehicle.simulate import PROPOSED
from benchmarks.concealed.plant.vehicle.simulate import simulate as simulate_vehicle
from benchmarks.concealed.plant.wing.simulate import Beat
from benchmarks.concealed.plant.wing.simulate import simulate as simulate_wing
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS
from benchmarks.concealed.plant.wing_effects.hidden import Effect, Hidden
from benchmarks.concealed.plant.wing_effects.kind import Kind
from benchmarks.concealed.strength import rms
from benchmarks.concealed.trials import Build
from wingfit.calibration.plan import prepared
from wingfit.calibration.spec import CalibrationSpec, model_for, wing_model
from wingfit.records import Condition, Dataset, Recording, Vehicle, Wing
from wingfit.sim.model import Model
from wingfit.sim.virtual_rigs.balance import delfly
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]
Quality = TypeVar("Quality")
Motion = TypeVar("Motion")

SPREAD = 1.6  # true parameters lie within this factor of the estimates, about
LEAST_NOISE_M = 2e-4
BALANCE_BEATS = 12
SMALLEST, LARGEST = 0.02, 4.0  # strengths, in parts of the typical one
MOST = {"marker_swap": 1.9, "tip_loss": 2.0, "dynamic_stall": 1.4, "circulation_lag": 1.0}
"""Largest strengths in parts of the typical ones, where a law has an end that is nearer."""
KEPT = 64  # beats of plants that are remembered


class Made(NamedTuple):
    """A recording, and the root mean square of the noise in it as it is fitted, m or N."""

    recording: Recording
    noise: float


@dataclass(frozen=True, eq=False)
class Bench(ABC, Generic[Motion, Quality]):
    """A plant with its cameras or balance: ``Motion`` is a beat of it, ``Quality`` how well it is recorded."""

    build: Build
    beats: OrderedDict[Hashable, Motion] = field(default_factory=OrderedDict, repr=False)

    @property
    @abstractmethod
    def rig(self) -> Wing | Vehicle:
        """As its user describes it, with the estimates of the nominal genes."""

    @property
    @abstractmethod
    def faults(self) -> Mapping[str, Law]:
        """What can be wrong with the recording."""

    @property
    @abstractmethod
    def physics(self) -> Mapping[str, Law]:
        """What can be hidden in the plant."""

    @abstractmethod
    def quality(self, rng: np.random.Generator) -> Quality:
        """How well it is recorded, drawn."""

    @abstractmethod
    def quieter(self, quality: Quality, level: float) -> Quality:
        """The same quality with its noise multiplied by ``level``."""

    @abstractmethod
    def least(self, quality: Quality) -> float:
        """The least such level that is met in practice."""

    @abstractmethod
    def ideal(self, quality: Quality) -> Quality:
        """The same without noise, and with nothing missing."""

    @abstractmethod
    def fitted(self, recording: Recording) -> Recording:
        """A recording as everybody fits it: strengths and noise are those in its band."""

    @abstractmethod
    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Motion:
        """A beat of the plant."""

    @abstractmethod
    def shown(
        self, beat: Motion, condition: Condition, hidden: Concealed, quality: Quality, rng: np.random.Generator
    ) -> Made:
        """A recording of a beat."""

    @cached_property
    def laws(self) -> dict[str, Law]:
        """All that can be hidden."""
        return {**self.physics, **self.faults}

    @cached_property
    def model(self) -> Model:
        """The nominal model that the tool is given, for the scorer's refit."""
        spec = CalibrationSpec(without=self.build.without)
        if self.build.division:
            spec = replace(spec, division=self.build.division)
        return model_for(Dataset("nominal", self.rig, ()), spec)

    def model_beside(self, genome: Mapping[str, float]) -> Model:  # noqa: ARG002
        """The same for individuals near ``genome``."""
        return self.model

    def phase(self, beat: Motion, name: str, parameters: Parameters) -> float | None:  # noqa: ARG002
        """When in the beat, as a dataset defines it, a thing acts; None where it acts all the time."""
        return parameters.get("phase")

    def limits(self, name: str) -> tuple[float, float]:
        """Between which strengths a thing may be hidden, in parts of the typical one."""
        return SMALLEST, MOST.get(name, LARGEST)

    def coarse(self) -> Bench[Motion, Quality]:
        """The same with a plant of the model's own division; itself where it is that."""
        if self.build.plant == self.build.division:
            return self
        return type(self)(replace(self.build, plant=self.build.division))

    def genome(self, rng: np.random.Generator) -> dict[str, float]:
        """True values of the nominal genes; those that the model does not search are as estimated."""
        drawn = {gene.name: float(gene.nominal * SPREAD ** rng.uniform(-1.0, 1.0)) for gene in self.model.genes}
        return {g.name: drawn[g.name] if g.name in self.model.searched else g.nominal for g in self.model.genes}

    def beat(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Motion:
        """A beat of the plant. It is remembered, for what is wrong with a camera changes none."""
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
        """One recording."""
        wrong = {name: values for name, values in hidden.items() if name in self.faults}
        return self.shown(self.beat(condition, genome, hidden), condition, wrong, quality, rng)


class Filmset(NamedTuple):
    """How a wing is filmed, and by which cameras."""

    filming: Filming
    cameras: Cameras


class WingBench(Bench[Beat, Filmset]):
    """The flexible wing before cameras."""

    @cached_property
    def rig(self) -> Wing:
        """The Robird's wing."""
        return robird_wing()

    def model_beside(self, genome: Mapping[str, float]) -> FlexibleWing:
        """It begins each search for a periodic motion at that of ``genome``: half the beats for neighbours."""
        found = wing_model(Dataset("nominal", self.rig, ()), CalibrationSpec(division=self.build.division))
        return replace(found, near=tuple(genome[gene.name] for gene in found.genes))

    @property
    def faults(self) -> Mapping[str, Law]:
        """Of cameras, clocks and trackers."""
        return CAMERA_FAULTS

    @property
    def physics(self) -> Mapping[str, Law]:
        """Of the wing, its drive and the air."""
        return {name: _law(kind, self.rig) for name, kind in KINDS.items()}

    def limits(self, name: str) -> tuple[float, float]:
        """As of any bench; a kind of the plant's says itself how large it may be."""
        low, high = super().limits(name)
        return low, KINDS[name].largest / KINDS[name].typical if name in KINDS else high

    def phase(self, beat: Beat, name: str, parameters: Parameters) -> float | None:
        """Of the drive phases that plant and cameras know, counted from the start of the beat."""
        if name in beat.turns:
            return beat.phase(beat.turns[name])
        if "turn" in parameters:
            return beat.phase(parameters["turn"])
        return beat.phase(2 * np.pi * parameters["phase"]) if "phase" in parameters else None

    def quality(self, rng: np.random.Generator) -> Filmset:
        """Any noise, any gaps, any pair of cameras; two to four apparent beats."""
        return Filmset(draw_filming(rng), draw_cameras(self.rig, rng))

    def quieter(self, quality: Filmset, level: float) -> Filmset:
        """Tracks with less noise."""
        noise = level * quality.filming.noise.level
        return quality._replace(filming=with_noise(quality.filming, noise))

    def least(self, quality: Filmset) -> float:
        """The best trackers leave LEAST_NOISE_M."""
        return min(1.0, LEAST_NOISE_M / quality.filming.noise.level)

    def ideal(self, quality: Filmset) -> Filmset:
        """All markers in all frames."""
        perfect = replace(with_noise(quality.filming, 0.0), lost=0, gap_rate=0.0)
        return quality._replace(filming=perfect)

    def fitted(self, recording: Recording) -> Recording:
        """As it is."""
        return recording

    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Beat:
        """With the tracks of all markers."""
        effects = tuple(
            Effect(name, values["strength"], {key: value for key, value in values.items() if key != "strength"})
            for name, values in hidden.items()
        )
        return simulate_wing(self.rig, self.build.plant, genome, condition, Hidden(effects))

    def shown(
        self, beat: Beat, condition: Condition, hidden: Concealed, quality: Filmset, rng: np.random.Generator
    ) -> Made:
        """Filmed."""
        made = film(beat.tracks, self.rig, condition, quality.filming, rng, hidden, cameras=quality.cameras)
        return Made(made.recording, made.noise)


def _law(kind: Kind, wing: Wing) -> Law:
    """A kind of the wing's plant, as laws of the vehicle and of cameras are told."""

    def values(parameters: Parameters) -> Mapping[str, float]:
        shape = {name: value for name, value in parameters.items() if name != "strength"}
        return kind.genes(wing, parameters["strength"], shape) if kind.genes else {}

    shape = {name: (low, high) for name, (_, low, high) in kind.shape.items()}
    return Law(kind.name, "physics", kind.typical, kind.source, kind.listed, shape=shape, values=values)


class VehicleBench(Bench[Array, Weighing]):
    """The DelFly on a balance."""

    @cached_property
    def rig(self) -> Vehicle:
        """The vehicle of Armanini et al. (2016)."""
        return delfly()

    @property
    def faults(self) -> Mapping[str, Law]:
        """Of the balance."""
        return BALANCE_FAULTS

    @property
    def physics(self) -> Mapping[str, Law]:
        """Of the wings and the air; what the baseline has already cannot be hidden."""
        return VEHICLE_LAWS

    def quality(self, rng: np.random.Generator) -> Weighing:
        """Any balance, over BALANCE_BEATS beats."""
        return replace(draw_weighing(rng), beats=BALANCE_BEATS)

    def quieter(self, quality: Weighing, level: float) -> Weighing:
        """All that does not repeat with the beat is smaller."""
        smaller = {name: level * getattr(quality, name) for name in ("sensor", "rattle", "wander", "scatter", "jitter")}
        return replace(quality, **smaller)

    def least(self, quality: Weighing) -> float:  # noqa: ARG002
        """A third: averaging nine times as many beats."""
        return 1 / 3

    def ideal(self, quality: Weighing) -> Weighing:
        """Without any noise."""
        return silent(quality)

    def fitted(self, recording: Recording) -> Recording:
        """Low-passed at the seed's multiple of the flap frequency (Armanini et al. 2016, 3.4), as forces always are."""
        return prepared(CalibrationSpec(), recording)

    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Array:
        """Forces [n, 2] over a beat."""
        terms = tuple(term for term in PROPOSED if term not in self.build.without)
        return simulate_vehicle(self.rig, genome, condition, hidden, terms=terms)

    def shown(
        self, beat: Array, condition: Condition, hidden: Concealed, quality: Weighing, rng: np.random.Generator
    ) -> Made:
        """Weighed."""
        made = weigh(beat, self.rig, condition, quality, rng, hidden)
        noise = self.fitted(replace(made.recording, values=made.recording.values - made.clean)).values
        return Made(made.recording, rms(noise.ravel()))


def bench_of(build: Build) -> Bench[Beat, Filmset] | Bench[Array, Weighing]:
    """The bench for a rig."""
    return VehicleBench(build) if build.rig == "vehicle" else WingBench(build)
