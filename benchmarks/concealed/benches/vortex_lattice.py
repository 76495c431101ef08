"""The bench of a flapping vehicle in an unsteady vortex lattice, on a force balance.

The nominal model is quasi-steady, so it has no lag of the circulation and no loss of lift at the tips; and its
inertia is as printed, which is not what a balance feels. All are effects of the library, and in most trials the model
has them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from benchmarks.concealed.benches.vehicle import Array, VehicleBench
from benchmarks.concealed.plant.law import Concealed, Law
from benchmarks.concealed.plant.measurement.balance import Weighing
from benchmarks.concealed.plant.vortex_lattice.simulate import LAWS, simulate
from wingfit.records import Condition

CHEAP, UNSTEADY = 6.0, 3.0  # times the DelFly's balance, and its beats: the lattice's own error is below such noise
WING = {"C_l": 2.41, "C_r": 4.81, "C_D0": 0.01, "C_Dpi2": 1.5}  # lift slope of the aspect ratio by Helmbold (1942)
NATURE = {
    "circulation_lag.share": 0.7,
    "circulation_lag.rate": 1.3,
    "tip_loss.spacing": 0.03,
    "wing_acceleration.share": 1.0,
}


class VortexLatticeBench(VehicleBench):
    """Bench of the ornithopter. ``genome`` of its plant has no meaning: a vortex lattice has no coefficients."""

    @property
    def physics(self) -> Mapping[str, Law]:
        """Changes of the wings' motion and of the stream that can be hidden."""
        return LAWS

    def coarse(self) -> VehicleBench:
        """A bench of the blade-element plant, in which hidden effects change the forces in nearly the same way."""
        return VehicleBench(self.build)

    def genome(self, rng: np.random.Generator) -> dict[str, float]:  # noqa: ARG002
        """Parameters of the model near its best fit, from which refits start."""
        near = WING | NATURE
        return {gene.name: near.get(gene.name, gene.nominal) for gene in self.model.genes}

    def quality(self, rng: np.random.Generator) -> Weighing:
        """Settings of a balance drawn from ``rng``, with a cheap sensor and a motor that runs unevenly."""
        drawn = super().quality(rng)
        uneven = {name: UNSTEADY * getattr(drawn, name) for name in ("scatter", "jitter")}
        return replace(drawn, sensor=CHEAP * drawn.sensor, **uneven)

    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Array:  # noqa: ARG002
        """Forces [n, 2] along body x and z (N) over one beat."""
        return simulate(self.rig, condition, hidden, inertia="acceleration")
