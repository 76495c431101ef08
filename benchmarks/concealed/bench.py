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

from benchmarks.concealed.drifting import STIFFNESS_DRIFT, drifting
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
from benchmarks.concealed.rigs import VEHICLES, WINGS, as_described, size_of
from benchmarks.concealed.strength import rms
from benchmarks.concealed.trials import DRIFT, FLING, Build, name_of
from wingfit.calibration.preparation import as_fitted
from wingfit.calibration.spec import CalibrationSpec, model_for, wing_model
from wingfit.records import Condition, Dataset, Recording, Vehicle, Wing
from wingfit.sim.model import Model
from wingfit.sim.vehicle.terms import DRAG
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]
Quality = TypeVar("Quality")
Motion = TypeVar("Motion")

SPREAD = 1.6  # true parameters are drawn between estimate / SPREAD and estimate * SPREAD
LEAST_NOISE_M = 2e-4
BALANCE_BEATS = 12
SMALLEST, LARGEST = 0.02, 4.0  # limits of a strength, as multiples of the typical strength
MOST = {"marker_swap": 1.9, "tip_loss": 2.0, "dynamic_stall": 1.4, "circulation_lag": 1.0}
"""Upper limits, as multiples of the typical strength, of laws that are only valid below LARGEST."""
KEPT = 64  # simulated beats that are cached
ROBIRD_MARKERS, DELFLY_MASS = 49, 17.4e-3  # for which settings of cameras and balance are drawn; kg


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
        return {**self.physics, **self.faults, DRIFT: STIFFNESS_DRIFT}

    @cached_property
    def model(self) -> Model:
        """The nominal model that will be diagnosed; it is refitted to measure the strength of hidden effects."""
        spec = CalibrationSpec(without=self.build.without)
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

        def made(genes: Mapping[str, float], dice: np.random.Generator) -> Made:
            return self.shown(self.beat(condition, genes, hidden), condition, wrong, quality, dice)

        found = made(genome, copy.deepcopy(rng))
        if DRIFT not in hidden:
            return found
        part = hidden[DRIFT]["strength"]
        return found._replace(recording=drifting(lambda *of: made(*of).recording, genome, part, rng))


class Filmset(NamedTuple):
    """Settings of the wing's measurement: how it is filmed, and the poses of the pair of cameras."""

    filming: Filming
    cameras: Cameras


class WingBench(Bench[Beat, Filmset]):
    """Bench of the flexible wing: its plant, filmed by two cameras."""

    @cached_property
    def rig(self) -> Wing:
        """The wing as it is; a laboratory describes it less exactly."""
        return WINGS[self.build.body][0]

    def model_beside(self, genome: Mapping[str, float]) -> FlexibleWing:
        """The nominal model, whose search for a periodic motion starts from the motion with parameters ``genome``.

        Parameters near ``genome`` then need half as many simulated beats.
        """
        found = wing_model(Dataset("nominal", self.rig, ()), CalibrationSpec(division=self.build.division))
        return replace(found, near=tuple(genome[gene.name] for gene in found.genes))

    def described(self, rng: np.random.Generator) -> Wing:
        """Return the wing as a laboratory describes it."""
        return as_described(self.rig, rng)

    @property
    def faults(self) -> Mapping[str, Law]:
        """Faults of cameras, clocks and trackers."""
        return CAMERA_FAULTS

    @property
    def physics(self) -> Mapping[str, Law]:
        """Effects in the wing, its drive and the air."""
        return {name: _law(kind, self.rig) for name, kind in KINDS.items()}

    def limits(self, name: str) -> tuple[float, float]:
        """Smallest and largest strength / typical strength; for physics the largest is from :attr:`Kind.largest`."""
        low, high = super().limits(name)
        return low, KINDS[name].largest / KINDS[name].typical if name in KINDS else high

    def phase(self, beat: Beat, name: str, parameters: Parameters) -> float | None:
        """Phase (beats) at which an effect acts, from the start of the beat as a dataset defines it; None if always.

        ``parameters`` hold phases from drive phase 0 instead, as plant and cameras use them.
        """
        if name in beat.turns:
            return beat.phase(beat.turns[name])
        if "turn" in parameters:
            return beat.phase(parameters["turn"])
        return beat.phase(2 * np.pi * parameters["phase"]) if "phase" in parameters else None

    def quality(self, rng: np.random.Generator) -> Filmset:
        """Settings drawn from ``rng``: noise, gaps, poses of the cameras, and two to four beats."""
        filming = draw_filming(rng)
        near = with_noise(filming, size_of(self.rig) * filming.noise.level)  # cameras are as near as the wing is small
        return Filmset(
            replace(near, lost=near.lost * len(self.rig.markers) // ROBIRD_MARKERS), draw_cameras(self.rig, rng)
        )

    def quieter(self, quality: Filmset, level: float) -> Filmset:
        """Copy of the settings ``quality`` with the noise of the tracks multiplied by ``level``."""
        noise = level * quality.filming.noise.level
        return quality._replace(filming=with_noise(quality.filming, noise))

    def least(self, quality: Filmset) -> float:
        """Factor by which the noise must be multiplied to be LEAST_NOISE_M, that of the best trackers; at most 1."""
        return min(1.0, size_of(self.rig) * LEAST_NOISE_M / quality.filming.noise.level)

    def ideal(self, quality: Filmset) -> Filmset:
        """Copy of the settings ``quality`` without noise, and with all markers visible in all frames."""
        perfect = replace(with_noise(quality.filming, 0.0), lost=0, gap_rate=0.0)
        return quality._replace(filming=perfect)

    def fitted(self, recording: Recording) -> Recording:
        """Return the recording unchanged, because tracks are fitted unfiltered."""
        return recording

    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Beat:
        """One periodic beat of the plant, with the true tracks of all markers, m."""
        effects = tuple(
            Effect(name, values["strength"], {key: value for key, value in values.items() if key != "strength"})
            for name, values in hidden.items()
        )
        return simulate_wing(self.rig, self.build.plant, genome, condition, Hidden(effects))

    def shown(
        self, beat: Beat, condition: Condition, hidden: Concealed, quality: Filmset, rng: np.random.Generator
    ) -> Made:
        """Film the ``beat`` under ``condition``, with the faults ``hidden`` of cameras, clocks and trackers."""
        made = film(beat.tracks, self.rig, condition, quality.filming, rng, hidden, cameras=quality.cameras)
        return Made(made.recording, made.noise)


def _law(kind: Kind, wing: Wing) -> Law:
    """Convert the description of a wing's effect to the class used for the vehicle's effects and measurement faults."""

    def values(parameters: Parameters) -> Mapping[str, float]:
        shape = {name: value for name, value in parameters.items() if name != "strength"}
        return kind.genes(wing, parameters["strength"], shape) if kind.genes else {}

    shape = {name: (low, high) for name, (_, low, high) in kind.shape.items()}
    return Law(kind.name, "physics", kind.typical, kind.source, kind.listed, shape=shape, values=values)


class VehicleBench(Bench[Array, Weighing]):
    """Bench of the DelFly: its plant, on a force balance."""

    @cached_property
    def rig(self) -> Vehicle:
        """The vehicle."""
        return VEHICLES[self.build.body][0]

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the genes that a diagnosis fits; as both axes are recorded, also those of drag."""
        return (*self.model.searched, *DRAG)

    def described(self, rng: np.random.Generator) -> Vehicle:  # noqa: ARG002
        """Return the vehicle: its wings are weighed and its motion is measured."""
        return self.rig

    @property
    def faults(self) -> Mapping[str, Law]:
        """Faults of the balance."""
        return BALANCE_FAULTS

    @property
    def physics(self) -> Mapping[str, Law]:
        """Effects in the wings and the air that can be hidden."""
        return VEHICLE_LAWS

    def quality(self, rng: np.random.Generator) -> Weighing:
        """Settings of a balance drawn from ``rng``, for the vehicle's weight, which records BALANCE_BEATS beats."""
        drawn, heavy = draw_weighing(rng), self.rig.mass / DELFLY_MASS
        larger = {name: heavy * getattr(drawn, name) for name in ("sensor", "rattle", "wander")}
        return replace(drawn, beats=BALANCE_BEATS, **larger)

    def quieter(self, quality: Weighing, level: float) -> Weighing:
        """Copy of the settings ``quality`` with noise, drift and variation between beats multiplied by ``level``."""
        smaller = {name: level * getattr(quality, name) for name in ("sensor", "rattle", "wander", "scatter", "jitter")}
        return replace(quality, **smaller)

    def least(self, quality: Weighing) -> float:  # noqa: ARG002
        """Factor 1/3 on the noise, because the mean over nine times as many beats has a third of the noise."""
        return 1 / 3

    def ideal(self, quality: Weighing) -> Weighing:
        """Copy of the settings ``quality`` without noise, drift and variation between beats."""
        return silent(quality)

    def fitted(self, recording: Recording) -> Recording:
        """Low-pass the recording at the multiple of the flap frequency used by Armanini et al. (2016), section 3.4."""
        return as_fitted(CalibrationSpec(), recording)

    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Array:
        """Forces [n, 2] along body x and z (N) over one beat."""
        absent = self.build.without if self.rig.claps else (*self.build.without, FLING)
        terms = tuple(term for term in PROPOSED if term not in absent)
        return simulate_vehicle(self.rig, genome, condition, hidden, terms=terms)

    def shown(
        self, beat: Array, condition: Condition, hidden: Concealed, quality: Weighing, rng: np.random.Generator
    ) -> Made:
        """Record the forces ``beat`` [n, 2] (N) with the balance and its faults ``hidden``."""
        made = weigh(beat, self.rig, condition, quality, rng, hidden)
        noise = self.fitted(replace(made.recording, values=made.recording.values - made.clean)).values
        return Made(made.recording, rms(noise.ravel()))


def bench_of(build: Build) -> Bench[Beat, Filmset] | Bench[Array, Weighing]:
    """The bench of the rig named in ``build``."""
    return VehicleBench(build) if build.rig == "vehicle" else WingBench(build)


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
