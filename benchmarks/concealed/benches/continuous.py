"""The bench of a continuous wing: a geometrically exact rod in finite elements, filmed by two cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from benchmarks.concealed.benches.wing import WingBench, hidden_of
from benchmarks.concealed.plant.continuum.simulate import EFFECTS, simulate
from benchmarks.concealed.plant.law import Concealed, Law
from benchmarks.concealed.plant.wing.simulate import Beat
from wingfit.records import Condition


class ContinuousBench(WingBench):
    """Bench of a continuous wing, whose description has the moduli of the multi-body model."""

    @property
    def physics(self) -> Mapping[str, Law]:
        """Effects that the rod can contain."""
        return {name: law for name, law in super().physics.items() if name in EFFECTS}

    def coarse(self) -> WingBench:
        """A bench of the multi-body plant that is divided like the model."""
        return WingBench(replace(self.build, plant=self.build.division))

    def simulated(self, condition: Condition, genome: Mapping[str, float], hidden: Concealed) -> Beat:
        """One periodic beat of the rod, with the true tracks of all markers, m."""
        return simulate(self.rig, genome, condition, hidden_of(hidden))
