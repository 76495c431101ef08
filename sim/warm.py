"""Compile the numerical kernels into the on-disk cache before the first run: ``python -m wingfit.sim.warm``."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import event
from numba.core.registry import cpu_target

from wingfit.records import Genome
from wingfit.sim import vehicle
from wingfit.sim.kernels import jit
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import TRIALS, delfly
from wingfit.sim.virtual_rigs.balance import blank_recording as blank_forces
from wingfit.sim.virtual_rigs.campaign import WIND_TUNNEL, blank_recording, robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

WITH_STATES = ("circulation_lag", "dynamic_stall", "induced_inflow", "wake_capture")
FUNCTIONS = 221  # compiled in all, about equally fast; for progress only
Report = Callable[[float], None]  # called with the fraction that is done


def compiled() -> bool:
    """Return whether the kernels of the wing and the vehicle have been compiled for this processor."""
    marker = _marker()
    return marker.is_file() and marker.read_text() == _target()


def compile_kernels(report: Report) -> None:
    """Simulate two beats of the coarsest wing, and one of the vehicle without and with effects that have states."""
    progress = _Progress(report)
    event.register("numba:compile", progress)
    try:
        model = FlexibleWing(robird_wing(), "4", numerics=Numerics(steps=8, max_beats=2))
        model.beat([gene.nominal for gene in model.genes], blank_recording(model.wing, WIND_TUNNEL[0]))
        forces = BladeElementWing(delfly()).with_effects(*WITH_STATES)
        genome = Genome.nominal(forces.genes)
        switched_on = {name: value for one in forces.chosen for name, value in one.typical(forces.vehicle).items()}
        for one in (genome, genome.replace(switched_on)):
            forces.observe([one.values], blank_forces(TRIALS[0].condition))
    finally:
        event.unregister("numba:compile", progress)
    _marker().write_text(_target())


class _Progress(event.Listener):  # type: ignore[misc]
    """Reports the fraction of FUNCTIONS that numba has compiled."""

    def __init__(self, report: Report) -> None:
        self.report, self.count = report, 0

    def on_start(self, event: Any) -> None:
        """Nothing: only finished functions count."""

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        """Count a function."""
        self.count += 1
        self.report(min(self.count / FUNCTIONS, 0.99))


def _marker() -> Path:
    """File beside the compiled kernels of the vehicle, whose folder also depends on the kernels of the wing."""
    return jit.cache_folder(Path(vehicle.__file__).resolve().parent) / "compiled"


def _target() -> str:
    return f"numba {numba.__version__}, {cpu_target.target_context.codegen().magic_tuple()}"


def main() -> None:
    """Compile, with progress on standard error."""
    start = time.perf_counter()

    def report(part: float) -> None:
        left = (time.perf_counter() - start) * (1.0 - part) / part
        sys.stderr.write(f"\rcompiling the simulator: {part:4.0%}, about {left:.0f} s left ")
        sys.stderr.flush()

    compile_kernels(report)
    sys.stderr.write("\r" + " " * 60 + "\r")
    print(f"kernels ready after {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
