"""Vehicle and balance swing on their mount: a resonance is mixed into the forces."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    part, natural, damping = (values[name][:, None] for name in ("part", "frequency", "damping"))
    ratio = sampling.harmonics / natural
    felt = 1.0 / (1.0 - ratio * ratio + 2j * (damping * ratio))
    sampling.filtered(np.asarray(1.0 + part * (felt - 1.0), np.complex128))


EFFECT = Effect(
    name="balance_resonance",
    title="Balance resonance",
    family="measurement",
    port="observation",
    size=(Parameter("part", "1", 0.0, 1.0, 0.1, "part of the force that goes through the swinging mass"),),
    shape=(
        Parameter("frequency", "Hz", 20.0, 500.0, 100.0, "natural frequency of the mount", scale="log"),
        Parameter("damping", "1", 0.005, 0.5, 0.02, "its damping ratio", scale="log"),
    ),
    memory="deflection of the mount and its rate",
    source="force passed on by the spring of a damped oscillator, 1 / (1 - r^2 + 2 i zeta r) (Den Hartog 1956, "
    "Mechanical Vibrations: transmissibility)",
    signature="harmonics near one fixed frequency are too large and turn in phase there, at any flapping frequency",
    confused_with=("filter_delay", "added_mass"),
    observe=_observe,
    observed=("forces",),
)
