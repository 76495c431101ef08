"""A wing whose stiffness falls while it is recorded, slowly against the beat: foam and glue that warm or relax."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from benchmarks.concealed.plant.law import Law
from benchmarks.concealed.trials import DRIFT
from wingfit.records import Recording

NODES = 5  # motions between which a wing drifts during a recording
STIFFNESSES = ("E_f", "G_f", "E_r", "G_r")
STIFFNESS_DRIFT = Law(
    DRIFT, "physics", 0.15, "Gibson and Ashby (1997), Cellular Solids, ch. 6: foams soften as they warm", listed=False
)


def drifting(
    record: Callable[[Mapping[str, float], np.random.Generator], Recording],
    genome: Mapping[str, float],
    part: float,
    rng: np.random.Generator,
) -> Recording:
    """Return a recording during which the stiffness falls by a ``part`` of its mean: one motion turns into the next.

    ``record`` records a genome, with the same noise for the same state of the generator.
    """
    made = []
    for share in np.linspace(0.5, -0.5, NODES):
        softer = {name: value * (1.0 + share * part * (name in STIFFNESSES)) for name, value in genome.items()}
        made.append(record(softer, copy.deepcopy(rng)))
    at = np.linspace(0.0, NODES - 1.0, len(made[0].times))
    low = np.minimum(at.astype(int), NODES - 2)
    share, values, rows = (at - low)[:, None], np.stack([one.values for one in made]), np.arange(len(at))
    return replace(made[0], values=(1.0 - share) * values[low, rows] + share * values[low + 1, rows])
