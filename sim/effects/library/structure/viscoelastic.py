"""Effect: foam that relaxes, as a standard linear solid: a second spring acts in series with a dashpot."""

from __future__ import annotations

from typing import Any

from wingfit.sim.effects.contract import Parameter, Values, effect_of_joints
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.lanes.vector import load, load0, load1, store, store0, store1
from wingfit.sim.kernels.laws import connector_port

_METRES = [0.1, 0.1]  # m/rad: one radian moves a point one chord away


def _law(frame: Any, moment: int) -> None:
    """Add to each connector, parallel to its spring and damper, a Maxwell element about x and about y.

    This is a spring of stiffness k (N m/rad) in series with a dashpot: its moment is -k z, and the strain z of its
    spring follows z' = r - z / tau, with the relative angular rate r of the two bodies (rad/s) and the relaxation time
    tau (s). The parameters are k about x and about y, and 1 / tau; the states are z about x and about y. ``frame`` and
    ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = connector_port(frame)
    stored, lost = load0(port.stored), load0(port.lost)
    for k in range(2):
        state, rate, decay, drive, pull = port.state[k], port.rate[k], port.decay[k], port.drive[k], port.pull[k]
        for c in range(port.places):
            spring, fading = load(port.parameters, k, c), load(port.parameters, 2, c)
            z = load1(state, c)
            fades, force = z * fading, spring * z
            store1(rate, c, load(port.twist, c, k) - fades)
            store1(decay, c, fading)
            store1(drive, c, 1.0)
            store1(pull, c, spring)
            store(port.wrench, c, k, load(port.wrench, c, k) - force)
            stored += 0.5 * force * z
            lost += force * fades
    store0(port.stored, stored)
    store0(port.lost, lost)


def _wing(scene: WingScene, values: Values) -> None:
    """Add the law to bending and torsion only, because the wing hardly strains otherwise."""
    spring = Joints.of(scene.structure).out_of_plane(scene.lanes.stiffness * values["k"])
    scene.add_connector_law(_law, [*spring, 1.0 / values["tau"]], axes=[0, 1], states=_METRES)


EFFECT = effect_of_joints(
    name="viscoelastic",
    title="Viscoelastic relaxation",
    size=(Parameter("k", "1", 0.0, 2.0, 0.3, "stiffness of the relaxing spring over the elastic stiffness"),),
    shape=(Parameter("tau", "s", 0.002, 0.5, 0.05, "relaxation time of this spring", scale="log"),),
    power="dissipative",
    memory="strain of the second spring in bending and in torsion, for each connector",
    law="z' = r - z / tau,     M = -k K z",
    source="Zener (1948), Elasticity and Anelasticity of Metals: standard linear solid; Ferry (1980), Viscoelastic "
    "Properties of Polymers, ch. 1",
    signature="at higher flap frequencies the wing bends less and later, and this change of stiffness and loss does "
    "not depend on the air",
    confused_with=("hysteresis",),
    wing=_wing,
)
