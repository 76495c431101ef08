"""Effect: the flow separates from the upper surface late and reattaches late (dynamic stall)."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import ALPHA, CIRCULATION, LIFT_SLOPE, MEAN_CHORD, SPEED
from wingfit.sim.kernels.lanes.lanewise import exponential
from wingfit.sim.kernels.lanes.vector import greatest, least, load, magnitude, root, store
from wingfit.sim.kernels.laws import strip_port
from wingfit.sim.vehicle.states import separate, steady_attachment

_RECENT = 0.25  # chords travelled over which the rate of alpha of a strip is taken
_STEEPEST = 50.0  # exponent beyond which the steady attachment is 0 or 1 to round-off
_METRES = 0.01  # m of motion of the wing per unit of either state


def _stall(scene: VehicleScene, values: Values) -> None:
    """Multiply the circulation due to the angle of attack alpha by 1 - share (1 - ((1 + sqrt X) / 2)^2).

    X, the attached fraction of the chord, follows delay X' + X = X_0(alpha - advance alpha') with time in chords
    travelled; X_0 is that of steady flow (:func:`wingfit.sim.vehicle.states.steady_attachment`); share, delay and
    advance are parameters of the effect.
    """
    attached = attached_fraction(scene, values)
    separate(attached, values["share"], scene.wings.rotation, scene.flow.circulation)


def attached_fraction(scene: VehicleScene, values: Values) -> Array:
    """Return X [sides, B, n, 8] of :func:`_stall`."""
    flow, chord = scene.flow, scene.chords
    stall = np.stack([values["angle"], values["width"], values["advance"]], axis=1)
    steady = np.empty_like(flow.speed)
    steady_attachment(flow.along, flow.normal, flow.speed, chord, stall, scene.step, steady)
    return scene.follow(1.0 / (values["delay"][:, None] * chord), steady)


def _law(frame: Any, moment: int) -> None:
    """Change the loads of a wing's strips as :func:`_stall` does; states: 1 - X (separated fraction), delayed alpha.

    The delayed alpha follows alpha within _RECENT chords travelled. Its difference from alpha gives alpha' without
    accelerations. ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    for s in range(port.places):
        chords = load(port.flow, s, SPEED) * (1.0 / port.geometry[s, MEAN_CHORD])
        alpha, separated = magnitude(load(port.flow, s, ALPHA)), load(port.state, 0, s)
        gained = alpha - load(port.state, 1, s)
        seen = alpha - load(port.parameters, 4, s) * (1.0 / _RECENT) * gained
        steep = (load(port.parameters, 1, s) - seen) / load(port.parameters, 2, s)
        steady = 1.0 / (exponential(least(greatest(steep, -_STEEPEST), _STEEPEST)) + 1.0)
        relaxing, following = chords / load(port.parameters, 3, s), chords * (1.0 / _RECENT)
        store(port.rate, 0, s, relaxing * (steady - separated))
        store(port.decay, 0, s, relaxing)
        store(port.rate, 1, s, following * gained)
        store(port.decay, 1, s, following)
        half = root(least(greatest(1.0 - separated, 0.0), 1.0)) * 0.5 + 0.5
        left = 1.0 - load(port.parameters, 0, s) * (1.0 - half * half)
        store(port.loads, s, CIRCULATION, load(port.loads, s, CIRCULATION) * left)
        store(port.loads, s, LIFT_SLOPE, load(port.loads, s, LIFT_SLOPE) * left)


def _wing(scene: WingScene, values: Values) -> None:
    names = ("share", "angle", "width", "delay", "advance")
    scene.add_strip_law(_law, [values[name] for name in names], states=[_METRES, _METRES])


SEPARATION = (
    Parameter(
        "angle", "rad", 0.15, 1.2, 0.4, "angle of attack at which steady flow is separated from half of the chord"
    ),
    Parameter(
        "width", "rad", 0.02, 0.3, 0.08, "range of angles of attack over which steady flow separates", scale="log"
    ),
    Parameter("delay", "1", 0.2, 10.0, 0.5, "time constant of separation, in chords travelled", scale="log"),
    Parameter("advance", "1", 0.0, 10.0, 2.0, "delay of the onset of stall while alpha grows, in chords travelled"),
)  # parameters of X

EFFECT = effect_of_air(
    name="dynamic_stall",
    title="Dynamic stall",
    size=(
        Parameter("share", "1", 0.0, 1.0, 0.5, "fraction of Kirchhoff's loss of lift that occurs; 1 is the full loss"),
    ),
    shape=SEPARATION,
    memory="the attached fraction of the chord at each station of a vehicle's wing or strip of a flexible wing; for "
    "each strip also its last angle of attack",
    law="(delay c / V) X' = X_0(alpha - advance (c / V) alpha') - X\n"
    "X_0(alpha) = 1 / (1 + exp((alpha - angle) / width))\n"
    "Gamma_alpha' = Gamma_alpha (1 - share (1 - ((1 + X^(1/2)) / 2)^2))",
    source="Goman and Khrabrov (1994), Journal of Aircraft 31, 1109: delayed separation point X; Kirchhoff: lift is "
    "proportional to ((1 + sqrt X) / 2)^2",
    signature="lift breaks down late in each stroke, at high angles of attack, and recovers late too, so that lift "
    "over angle forms a loop",
    confused_with=("leading_edge_vortex", "circulation_lag", "tip_loss", "stall_vortex", "varying_coefficients"),
    wing=_wing,
    vehicle=deferred("circulation", _stall),
)
