"""Measurement fault: the time of the forces counts from another instant of the beat than described."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_forces
from wingfit.sim.effects.ports.observation import Sampling


def _observe(sampling: Sampling, values: Values) -> None:
    """Mix the force with that of another phase; a fault has a share of 1, and smaller ones are on the way to it."""
    orders = np.arange(sampling.beat.shape[1] // 2 + 1)
    turned = np.exp(2j * np.pi * orders * values["phase"][:, None])
    sampling.filtered(np.asarray(1.0 + values["share"][:, None] * (turned - 1.0), complex))


EFFECT = fault_of_forces(
    name="phase_reference",
    title="Wrong start of the beat",
    size=(Parameter("share", "1", 0.0, 1.0, 1.0, "1: times count from the phase below", positions=(1.0,)),),
    shape=(Parameter("phase", "1", 0.1, 0.9, 0.5, "phase of the beat at which time is zero, in beats"),),
    law="F'(t*) = F(t*) + share (F(t* + phase) - F(t*))",
    source="Armanini et al. (2016), section 3.2.2: the phase of the beat comes from a sensor on the mechanism, whose "
    "mark may be anywhere in the beat",
    signature="the forces have their shape, at another phase, which is the same in every condition",
    confused_with=("clock_offset", "filter_delay", "axis_sign"),
    observe=_observe,
)
