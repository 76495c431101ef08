"""A wing that changes while it is recorded, slowly against the beat: foam and glue that warm or relax, a motor too."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from benchmarks.concealed.plant.law import Concealed, Law
from benchmarks.concealed.trials import DRIFTS
from wingfit.records import Recording

NODES = 5  # motions between which a wing drifts during a recording
STIFFNESSES = ("E_f", "G_f", "E_r", "G_r")
_STIFFNESS, _MOTOR = DRIFTS
LAWS = {
    _STIFFNESS: Law(
        _STIFFNESS,
        "physics",
        0.15,
        "Gibson and Ashby (1997), Cellular Solids, ch. 6: foams soften as they warm",
        values=lambda given: {f"{_STIFFNESS}.part": -given["strength"]},
    ),
    _MOTOR: Law(
        _MOTOR,
        "physics",
        0.03,
        "Hughes and Drury (2013), Electric Motors and Drives, ch. 3: windings that warm give less torque",
        listed=False,
    ),
}
"""How a wing may drift, by name: what the strength is the fall of, in a recording, as a fraction of its mean."""


def drifting(
    record: Callable[[Mapping[str, float], Concealed, np.random.Generator], Recording],
    genome: Mapping[str, float],
    hidden: Concealed,
    rng: np.random.Generator,
) -> Recording:
    """Return a recording during which the wing drifts as ``hidden`` says: one motion turns into the next.

    ``record`` records a genome with hidden effects that do not drift, with the same noise for the same state of the
    generator.
    """
    steady = {name: values for name, values in hidden.items() if name not in DRIFTS}
    fall = {name: hidden[name]["strength"] if name in hidden else 0.0 for name in DRIFTS}
    made = []
    for share in np.linspace(0.5, -0.5, NODES):
        softer = {
            name: value * (1.0 + share * fall[_STIFFNESS] * (name in STIFFNESSES)) for name, value in genome.items()
        }
        swing = {"stroke_amplitude": {"strength": float(share * fall[_MOTOR])}} if fall[_MOTOR] else {}
        made.append(record(softer, {**steady, **swing}, copy.deepcopy(rng)))
    at = np.linspace(0.0, NODES - 1.0, len(made[0].times))
    low = np.minimum(at.astype(int), NODES - 2)
    share, values, rows = (at - low)[:, None], np.stack([one.values for one in made]), np.arange(len(at))
    return replace(made[0], values=(1.0 - share) * values[low, rows] + share * values[low + 1, rows])
