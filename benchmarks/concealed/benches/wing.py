"""The bench of the flexible wing: the multi-body plant, filmed by two cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from benchmarks.concealed.benches.bench import Bench, Made
from benchmarks.concealed.plant.law import Concealed, Law, Parameters
from benchmarks.concealed.plant.measurement.cameras import Cameras, draw_cameras
from benchmarks.concealed.plant.measurement.film import FAULTS as CAMERA_FAULTS
from benchmarks.concealed.plant.measurement.film import Filming, draw_filming, film, with_noise
from benchmarks.concealed.plant.wing.simulate import Beat
from benchmarks.concealed.plant.wing.simulate import simulate as simulate_wing
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS
from benchmarks.concealed.plant.wing_effects.hidden import Effect, Hidden
from benchmarks.concealed.plant.wing_effects.kind import Kind
from benchmarks.concealed.rigs import WINGS, as_described, size_of
from wingfit.calibration.spec import CalibrationSpec, wing_model
from wingfit.records import Condition, Dataset, Recording, Wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

LEAST_NOISE_M = 2e-4
ROBIRD_MARKERS = 49  # for which settings of cameras are drawn


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
        return simulate_wing(self.rig, self.build.plant, genome, condition, hidden_of(hidden))

    def shown(
        self, beat: Beat, condition: Condition, hidden: Concealed, quality: Filmset, rng: np.random.Generator
    ) -> Made:
        """Film the ``beat`` under ``condition``, with the faults ``hidden`` of cameras, clocks and trackers."""
        made = film(beat.tracks, self.rig, condition, quality.filming, rng, hidden, cameras=quality.cameras)
        return Made(made.recording, made.noise)


def hidden_of(hidden: Concealed) -> Hidden:
    """Convert the parameters of hidden effects to the class that the wing's plants use."""
    return Hidden(
        tuple(
            Effect(name, values["strength"], {key: value for key, value in values.items() if key != "strength"})
            for name, values in hidden.items()
        )
    )


def _law(kind: Kind, wing: Wing) -> Law:
    """Convert the description of a wing's effect to the class used for the vehicle's effects and measurement faults."""

    def values(parameters: Parameters) -> Mapping[str, float]:
        shape = {name: value for name, value in parameters.items() if name != "strength"}
        return kind.genes(wing, parameters["strength"], shape) if kind.genes else {}

    shape = {name: (low, high) for name, (_, low, high) in kind.shape.items()}
    return Law(kind.name, "physics", kind.typical, kind.source, kind.listed, shape=shape, values=values)
