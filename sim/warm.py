"""Compile the kernels into the on-disk cache, so that the first run starts at once: ``python -m sim.warm``."""

from __future__ import annotations

import time

from sim.flexible_wing import FlexibleWing
from sim.numerics import Numerics
from sim.rig import WIND_TUNNEL, blank_recording, robird_wing


def main() -> None:
    """Simulate two beats of the coarsest wing once."""
    start = time.perf_counter()
    model = FlexibleWing(robird_wing(), "4", numerics=Numerics(steps=8, max_beats=2))
    model.beat([gene.nominal for gene in model.genes], blank_recording(model.wing, WIND_TUNNEL[0]))
    print(f"kernels ready after {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
