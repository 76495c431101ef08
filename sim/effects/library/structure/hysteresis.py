"""Effect: hysteresis of bending and torsion by the law of Bouc and Wen."""

from __future__ import annotations

from typing import Any

from wingfit.sim.effects.contract import Parameter, Values, effect_of_joints
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.lanes.lanewise import power
from wingfit.sim.kernels.lanes.vector import load, load0, load1, magnitude, store, store0, store1
from wingfit.sim.kernels.laws import connector_port

_METRES = [0.1, 0.1]  # m/rad: one radian moves a point one chord away
_TINY = 1e-30


def _law(frame: Any, moment: int) -> None:
    """Add to each connector the moment -k z about x and y.

    z, the elastic part of the angle, is a state: z' = r - beta |r| |q|^(n - 1) q - gamma r |q|^n, beta + gamma = 1. r
    is the relative angular rate of the two bodies (rad/s), q is z over its largest value. The parameters are k about x
    and about y, the inverse of the largest z, gamma and n. ``frame`` and ``moment``: see
    :mod:`wingfit.sim.kernels.laws`.
    """
    port = connector_port(frame)
    stored, lost = load0(port.stored), load0(port.lost)
    for k in range(2):  # about x and y
        state, rate, decay, drive, pull = port.state[k], port.rate[k], port.decay[k], port.drive[k], port.pull[k]
        for c in range(port.places):
            spring, per = load(port.parameters, k, c), load(port.parameters, 2, c)
            gamma, n = load(port.parameters, 3, c), load(port.parameters, 4, c)
            z, r = load1(state, c), load(port.twist, c, k)
            q, speed = z * per, magnitude(r)
            size = magnitude(q)
            less = power(size, n - 1.0)
            beta = 1.0 - gamma
            yielding = less * (beta * speed * q + gamma * r * size)
            store1(rate, c, r - yielding)
            store1(decay, c, n * per * less * (beta * speed + gamma * r * q / (size + _TINY)))
            store1(drive, c, 1.0 - less * (beta * q * r / (speed + _TINY) + gamma * size))
            store1(pull, c, spring)
            store(port.wrench, c, k, load(port.wrench, c, k) - spring * z)
            stored += 0.5 * spring * z * z
            lost += spring * z * yielding
    store0(port.stored, stored)
    store0(port.lost, lost)


def _wing(scene: WingScene, values: Values) -> None:
    joints = Joints.of(scene.structure)
    spring = joints.out_of_plane(scene.lanes.stiffness * values["k"])
    per = 1.0 / (joints.part[:, None] * values["yield_angle"])
    parameters = [*spring, per, values["gamma"], values["n"]]
    scene.add_connector_law(_law, parameters, axes=[0, 1], states=_METRES)


EFFECT = effect_of_joints(
    name="hysteresis",
    title="Hysteresis",
    size=(Parameter("k", "1", 0.0, 2.0, 0.3, "stiffness of the yielding spring over the elastic stiffness"),),
    shape=(
        Parameter(
            "yield_angle",
            "rad",
            0.01,
            1.0,
            0.1,
            "bend or twist of the whole span at which the spring yields",
            scale="log",
        ),
        Parameter("gamma", "1", -0.5, 0.5, 0.5, "shape of the loop: the gamma of the law, with beta = 1 - gamma"),
        Parameter("n", "1", 1.0, 4.0, 1.0, "exponent of the law: the larger it is, the sharper yielding sets in"),
    ),
    power="dissipative",
    memory="the elastic part of bending and of twist, for each connector",
    law="z' = r - beta |r| |q|^(n - 1) q - gamma r |q|^n,     q = z / z_y,   beta = 1 - gamma\n"
    "M = -k K z,     z_y = p yield_angle",
    source="Bouc (1967), Forced vibration of mechanical systems with hysteresis; Wen (1976), Journal of the "
    "Engineering Mechanics Division ASCE 102, 249; Ikhouane and Rodellar (2007), Systems with Hysteresis",
    signature="the energy lost in a beat does not depend on the flap frequency, and the wing is stiffer in small "
    "swings than in large ones",
    confused_with=("viscoelastic", "rod_slip"),
    wing=_wing,
)
