"""Effect: bending stiffness that increases or decreases as the wing bends further."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_joints
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.lanes.vector import load, load0, store, store0
from wingfit.sim.kernels.laws import connector_port

_SOFTEST = 0.7  # largest fraction of the stiffness that softening removes; the tangent loses at most 5/4 of it


def _law(frame: Any, moment: int) -> None:
    """Add to each connector the moment of a nonlinear spring, whose potential V depends on its bending.

    s is the sine of the bending angle, from the antisymmetric part of Q, the rotation of the second body in the first;
    k is the linear bending stiffness times the parameter E. V = k u^2 / (4 b (1 + c u)) with u = b s^2, so that dV/ds =
    k s (u + c u^2 / 2) / (1 + c u)^2. This is cubic for c = 0 and otherwise levels off at k s / (2 c). b = 1 / p^2,
    where p is the length that the connector represents as a fraction of the span; E and c: see :func:`shape`. A
    relative angular rate r gives s' = (tr Q - Q) r / 2, so that the moment is -(tr Q - Q^T) (dV/ds) / 2. ``frame`` and
    ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = connector_port(frame)
    stored = load0(port.stored)
    for c in range(port.places):
        q0, q1, q2, q3 = load(port.Q, c, 0), load(port.Q, c, 1), load(port.Q, c, 2), load(port.Q, c, 3)
        q4, q5, q6 = load(port.Q, c, 4), load(port.Q, c, 5), load(port.Q, c, 6)
        # of k and b about x and y one is zero: a connector bends about one axis and twists about the other
        kx, ky = load(port.parameters, 0, c), load(port.parameters, 1, c)
        bx, by = load(port.parameters, 2, c), load(port.parameters, 3, c)
        sx, sy, trace = 0.5 * (load(port.Q, c, 7) - q5), 0.5 * (q2 - q6), q0 + q4 + load(port.Q, c, 8)
        level, u = load(port.parameters, 4, c), bx * sx * sx + by * sy * sy
        part = 1.0 / (1.0 + level * u)
        more = (u + 0.5 * level * u * u) * part * part
        gx, gy = 0.5 * kx * sx * more, 0.5 * ky * sy * more
        store(port.wrench, c, 0, load(port.wrench, c, 0) - (trace - q0) * gx + q3 * gy)
        store(port.wrench, c, 1, load(port.wrench, c, 1) + q1 * gx - (trace - q4) * gy)
        store(port.wrench, c, 2, load(port.wrench, c, 2) + q2 * gx + q5 * gy)
        steeper = more + 2.0 * u * part * part * part
        store(port.stiffness, c, 0, load(port.stiffness, c, 0) + kx * steeper)
        store(port.stiffness, c, 1, load(port.stiffness, c, 1) + ky * steeper)
        stored += (kx + ky) * u * u * part / (4.0 * (bx + by))
    store0(port.stored, stored)


def _wing(scene: WingScene, values: Values) -> None:
    joints = Joints.of(scene.structure)
    slope, level = shape(values["change"])
    k = joints.bending(scene.lanes.stiffness * slope)
    about_x, per = joints.along_span, 1.0 / joints.part**2
    b = [np.repeat(np.where(mask, per, 0.0)[:, None], len(slope), axis=1) for mask in (about_x, ~about_x)]
    scene.add_connector_law(_law, [*k, *b, level])


def shape(change: Array) -> tuple[Array, Array]:
    """Return E and c of the relative change of stiffness E (u + c u^2 / 2) / (1 + c u)^2, which is ``change`` at u = 1.

    A positive ``change`` (hardening) gives a cubic law, c = 0. A negative one (softening) starts as a cubic law and
    levels off at E / (2 c) = -_SOFTEST.
    """
    level = 1.0 / np.sqrt(1.0 - np.maximum(-change, 0.0) / _SOFTEST) - 1.0
    return np.where(change > 0.0, change, -2.0 * _SOFTEST * level), level


_TEXT = "relative change of bending stiffness where the whole span is bent by one radian"

EFFECT = effect_of_joints(
    name="cubic_stiffness",
    title="Cubic bending stiffness",
    size=(Parameter("change", "1", -0.5, 10.0, 3.0, _TEXT),),
    power="conservative",
    law="M = -E K s (u + c u^2 / 2) / (1 + c u)^2,     u = (s / p)^2\n"
    "change >= 0:   E = change,   c = 0\n"
    "change < 0:    c = (1 + change / 0.7)^(-1/2) - 1,   E = -1.4 c",
    source="Duffing (1918), Erzwungene Schwingungen bei veränderlicher Eigenfrequenz; Nayfeh and Mook (1979), "
    "Nonlinear Oscillations, ch. 4; the limit on softening was added here",
    signature="the swing grows less than in proportion to the drive (more, where the wing softens), and the motion "
    "contains third harmonics",
    confused_with=("damage", "hysteresis", "rod_slip"),
    wing=_wing,
)
