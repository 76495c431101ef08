"""Measurement fault: the axes of the balance are rotated relative to those of the body."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    c, s = (turn(values["angle"])[:, None] for turn in (np.cos, np.sin))
    x, z = sampling.beat[..., 0], sampling.beat[..., 1]
    sampling.beat = np.stack([c * x - s * z, s * x + c * z], axis=-1)


EFFECT = fault_of_forces(
    name="balance_tilt",
    title="Balance axes tilted",
    size=(Parameter("angle", "rad", -0.2, 0.2, 0.02, "nose-up angle from the body's x axis to the balance's"),),
    law="X' = X cos angle - Z sin angle\nZ' = X sin angle + Z cos angle",
    source="Barlow, Rae and Pope (1999), Low-Speed Wind Tunnel Testing, ch. 7: alignment of a balance",
    signature="each force component contains a constant fraction of the other component, at every phase and in every "
    "condition",
    confused_with=("balance_offset", "scale_error"),
    observe=_observe,
)
