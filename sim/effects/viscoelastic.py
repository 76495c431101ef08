"""Foam that relaxes: a standard linear solid, whose second spring stands behind a dashpot."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.effects.contract import Effect, Parameter, Values
from sim.effects.wing import WingScene
from sim.kernels.laws import connector_port
from sim.kernels.vector import load, load0, load1, store, store0, store1

_METRES = [0.1, 0.1, 0.1, 1.0, 1.0, 1.0]  # a strain of one radian is felt a chord away


def _law(frame: Any, moment: int) -> None:  # noqa: ARG001 (all laws are told the moment)
    """A Maxwell element along each axis, beside the spring and the damper: z' = r - z / tau, wrench -k z."""
    port = connector_port(frame)
    for k in range(6):
        stiffness, state, rate = port.parameters[1 + k], port.state[k], port.rate[k]
        decay, drive, pull = port.decay[k], port.drive[k], port.pull[k]
        for c in range(port.places):
            spring, fading = load1(stiffness, c), 1.0 / load(port.parameters, 0, c)
            z, r = load1(state, c), load(port.twist, c, k)
            store1(rate, c, r - z * fading)
            store1(decay, c, fading)
            store1(drive, c, fading * 0.0 + 1.0)
            store1(pull, c, spring)
            store(port.wrench, c, k, load(port.wrench, c, k) - spring * z)
            store0(port.stored, load0(port.stored) + 0.5 * spring * z * z)
            store0(port.lost, load0(port.lost) + spring * z * z * fading)


def _wing(scene: WingScene, values: Values) -> None:
    stiffness = np.moveaxis(scene.lanes.stiffness * values["k"], 1, 0)
    scene.add_connector_law(_law, [values["tau"], *stiffness], axes=[0, 1, 2, 3, 4, 5], states=_METRES)


EFFECT = Effect(
    name="viscoelastic",
    title="Viscoelastic relaxation",
    family="structure",
    port="connector",
    size=(Parameter("k", "1", 0.0, 2.0, 0.3, "stiffness that relaxes, as a part of the stiffness that stays"),),
    shape=(Parameter("tau", "s", 0.002, 2.0, 0.05, "relaxation time", scale="log"),),
    power="dissipative",
    memory="one strain per connector and axis",
    source="Zener, Elasticity and Anelasticity of Metals (1948): standard linear solid; Ferry, Viscoelastic Properties "
    "of Polymers (1980), ch. 1",
    signature="bends less and later when flapped faster: stiffness and loss depend on the frequency, not on the air",
    confused_with=("hysteresis",),
    wing=_wing,
)
