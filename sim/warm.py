"""Compile the numerical kernels into the on-disk cache before the first run: ``python -m wingfit.sim.warm``."""

from __future__ import annotations

import time

from wingfit.records import Genome
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import TRIALS, delfly
from wingfit.sim.virtual_rigs.balance import blank_recording as blank_forces
from wingfit.sim.virtual_rigs.campaign import WIND_TUNNEL, blank_recording, robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

WITH_STATES = ("circulation_lag", "dynamic_stall", "induced_inflow", "wake_capture")


def main() -> None:
    """Simulate two beats of the coarsest wing, and one of the vehicle without and with effects that have states."""
    start = time.perf_counter()
    model = FlexibleWing(robird_wing(), "4", numerics=Numerics(steps=8, max_beats=2))
    model.beat([gene.nominal for gene in model.genes], blank_recording(model.wing, WIND_TUNNEL[0]))
    vehicle = BladeElementWing(delfly()).with_effects(*WITH_STATES)
    genome = Genome.nominal(vehicle.genes)
    switched_on = {name: value for one in vehicle.chosen for name, value in one.typical(vehicle.vehicle).items()}
    for one in (genome, genome.replace(switched_on)):
        vehicle.observe([one.values], blank_forces(TRIALS[0].condition))
    print(f"kernels ready after {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
