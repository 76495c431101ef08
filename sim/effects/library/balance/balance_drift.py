"""Measurement fault: the zero of the balance drifts steadily, and also while its gauges warm up."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    since = (sampling.times - sampling.times[:, :1])[:, :, None]
    warm = -np.expm1(-since / values["time"][:, None, None])
    steady = sampling.along_axes(values["x"], values["z"])
    thermal = sampling.along_axes(values["thermal_x"], values["thermal_z"])
    sampling.added += since * steady[:, None] + warm * thermal[:, None]


EFFECT = fault_of_forces(
    name="balance_drift",
    title="Balance drift",
    size=(
        Parameter("x", "1/s", -0.1, 0.1, 0.005, "steady drift along x, in weights per second"),
        Parameter("z", "1/s", -0.1, 0.1, 0.005, "steady drift along z, in weights per second"),
        Parameter("thermal_x", "1", -0.3, 0.3, 0.01, "force along x that warming up adds in the end, in weights"),
        Parameter("thermal_z", "1", -0.3, 0.3, 0.01, "force along z that warming up adds in the end, in weights"),
    ),
    shape=(Parameter("time", "s", 0.1, 100.0, 2.0, "time constant of the warming", scale="log"),),
    memory="temperature of the gauges, counted from the first sample of a recording",
    law="F' = F + m g [(x, z) t + (thermal_x, thermal_z) (1 - exp(-t / time))]",
    source="Doebelin (2004), Measurement Systems: zero drift and first-order warming of strain gauges",
    signature="the mean force over a beat changes from the first beat to the last, and the shape over the beat stays "
    "the same",
    confused_with=("balance_offset",),
    observe=_observe,
)
