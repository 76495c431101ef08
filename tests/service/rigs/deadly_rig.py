"""A rig of which a simulation ends its process. It imports little, since every process of a driver imports it."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import replace

from tests.service.rigs import decay_rig
from wingfit.records.array_types import Array
from wingfit.rigs.run import Run

DEADLY = 2.5  # 1/s: rate above which the simulation ends its process


def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """Of a good simulation, the results after some time; a deadly one ends the process."""
    if genes["rate"] > DEADLY:
        os._exit(3)
    time.sleep(0.3)  # so that the others are under way when it ends
    return decay_rig.simulate(genes, run)


rig = replace(decay_rig.rig, simulate=simulate)
