"""Measurement fault: vehicle and balance oscillate on their mount, and the resonance distorts the forces."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    part, natural, damping = (values[name][:, None] for name in ("part", "frequency", "damping"))
    ratio = sampling.harmonics / natural
    passed = 1.0 / (1.0 - ratio * ratio + 2j * (damping * ratio))
    sampling.filtered(np.asarray(1.0 + part * (passed - 1.0), np.complex128))


EFFECT = fault_of_forces(
    name="balance_resonance",
    title="Balance resonance",
    size=(Parameter("part", "1", 0.0, 1.0, 0.1, "fraction of the force that passes through the oscillating mass"),),
    shape=(
        Parameter("frequency", "Hz", 20.0, 500.0, 100.0, "natural frequency of the mount", scale="log"),
        Parameter("damping", "1", 0.005, 0.5, 0.02, "damping ratio of the mount", scale="log"),
    ),
    memory="deflection of the mount, and the rate of this deflection",
    law="F_k' = F_k (1 + part (G - 1)),     G = 1 / (1 - r^2 + 2 i damping r),   r = k f / frequency",
    source="Den Hartog (1956), Mechanical Vibrations: transmissibility, the force that the spring of a damped "
    "oscillator passes on",
    signature="harmonics near one fixed frequency are too large and shifted in phase, at any flap frequency",
    confused_with=("filter_delay", "added_mass"),
    observe=_observe,
)
