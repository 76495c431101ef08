"""Effect: carbon rods in straws that are loose within a clearance and held by dry friction beyond it."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_joints
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.lanes.vector import greatest, least, load, load0, load1, magnitude, store, store0, store1
from wingfit.sim.kernels.laws import connector_port

_METRES = [0.1]  # m/rad: one radian of bending moves a point one chord away
_FOAM_ROW = 4  # row of the stiffness for stretching along the span, which is that of the foam alone
_TINY = 1e-30
_SHAKE = 0.1  # returns slipped rods slowly: without it the periodic motion depends on how it began


def _law(frame: Any, moment: int) -> None:
    """Add to each connector with rods the moment -k h about x, where h is the part of the state w beyond the play.

    w' = r - (r |h| + |r| h) / (2 h_max) - e |r| w / w_max, r being the relative angular rate of the bodies (rad/s).
    This is Dahl's friction: under increasing load, the rods slip more the nearer h is to h_max; under decreasing load,
    they act as springs. The last term returns the rods to their unloaded position: a bend by w_max = play + h_max
    reduces w by the fraction e = _SHAKE. ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = connector_port(frame)
    state, rate, decay, drive, pull = port.state[0], port.rate[0], port.decay[0], port.drive[0], port.pull[0]
    stored, lost = load0(port.stored), load0(port.lost)
    for c in range(port.places):
        if port.parameters[4, c, 0] == 0.0:  # no rods here, in any individual
            for array in (rate, decay, drive, pull):
                store1(array, c, 0.0)
            continue
        spring, play, per = load(port.parameters, 0, c), load(port.parameters, 1, c), load(port.parameters, 2, c)
        shake = load(port.parameters, 3, c)
        w, r = load1(state, c), load(port.twist, c, 0)
        held = greatest(w - play, 0.0) + least(w + play, 0.0)
        size, speed = magnitude(held), magnitude(r)
        side, ahead = held / (size + _TINY), r / (speed + _TINY)
        slip = 0.5 * per * (r * size + speed * held) + shake * speed * w
        store1(rate, c, r - slip)
        store1(decay, c, 0.5 * per * (r * side + speed * side * side) + shake * speed)
        store1(drive, c, 1.0 - 0.5 * per * (size + ahead * held) - shake * ahead * w)
        store1(pull, c, spring * side * side)
        store(port.wrench, c, 0, load(port.wrench, c, 0) - spring * held)
        stored += 0.5 * spring * held * held
        lost += spring * held * slip
    store0(port.stored, stored)
    store0(port.lost, lost)


def _wing(scene: WingScene, values: Values) -> None:
    joints = Joints.of(scene.structure)
    part = joints.part[:, None]
    play, most = part * values["clearance"], part * values["friction"]
    slipping = joints.within & np.array([c.rods.any() for c in scene.structure.connectors])
    spring, mask = values["stick"] * of_rods(scene), slipping[:, None].astype(float)
    scene.add_connector_law(_law, [spring, play, 1.0 / most, _SHAKE / (play + most), mask], axes=[0], states=_METRES)


def of_rods(scene: WingScene) -> Array:
    """Return the bending stiffness [C, W] (N m/rad) that rods add to each connector (C connectors, W individuals).

    It is the bending stiffness minus that of the foam, whose modulus follows from the stiffness in stretching along the
    span. The bending is out of the wing's plane; in its plane the wing is too stiff for rods to slip.
    """
    connectors, stiffness = scene.structure.connectors, scene.lanes.stiffness
    found = np.zeros_like(stiffness[:, 0])
    for k, c in enumerate(connectors):
        if c.rods.any():
            modulus = stiffness[k, _FOAM_ROW] / c.foam[_FOAM_ROW] if c.foam[_FOAM_ROW] else 0.0
            found[k] = stiffness[k, 0] - modulus * c.foam[0]
    return found


_STICK = "bending stiffness of the sticking rods over the full bending stiffness of the rods"

EFFECT = effect_of_joints(
    name="rod_slip",
    of_rods=True,
    title="Rods that slip in their straw",
    size=(
        Parameter(
            "friction", "rad", 0.0, 0.5, 0.05, "bend of the whole span, beyond the clearance, at which the rods slip"
        ),
    ),
    shape=(
        Parameter(
            "clearance", "rad", 0.0, 0.3, 0.02, "bend of the whole span, to either side, up to which the rods are loose"
        ),
        Parameter("stick", "1", 0.02, 1.0, 0.3, _STICK, scale="log"),
    ),
    power="dissipative",
    memory="the bending carried by friction, for each connector with rods",
    law="w' = r - (r |h| + |r| h) / (2 h_max) - 0.1 |r| w / (w_0 + h_max)\n"
    "h = max(w - w_0, 0) + min(w + w_0, 0),     M = -k h\n"
    "h_max = p friction,   w_0 = p clearance,   k = stick K_rods",
    source="Dahl (1968), A Solid Friction Model, Aerospace Corporation TOR-0158: friction; Visintin (1994), "
    "Differential Models of Hysteresis: play",
    signature="the wing is stiffer in small swings than in large ones, and its bending lags behind the load where the "
    "stroke reverses",
    confused_with=("hysteresis", "cubic_stiffness"),
    wing=_wing,
)
