"""Effect: a rotational spring and damper between one station of the wing and the ground, such as a clamped cable."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values, place
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.lanes.matrices import load_matrix, load_vector
from wingfit.sim.kernels.lanes.vector import load, load0, store, store0
from wingfit.sim.kernels.laws import point_port


def _law(frame: Any, moment: int) -> None:
    """Add the moment -k a - c omega, a = vee(R - R^T) / 2, on the clamped body, in the world.

    R is the rotation of the body, the identity at rest; a is the sine of the angle of R times its axis,
    and omega the angular velocity (rad/s). The parameters of the law are k (N m/rad) and c (N m s/rad). The moment of
    the spring derives from the potential k (3 - tr R) / 2. A further rotation by the small vector t, in the world,
    changes a by (tr R I - R) t / 2. ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = point_port(frame)
    stored, lost = load0(port.stored), load0(port.lost)
    for p in range(port.places):
        spring, damper = load(port.parameters, 0, p), load(port.parameters, 1, p)
        R, omega = load_matrix(port.turn, p), load_vector(port.twist, p, 0)
        trace = R[0] + R[4] + R[8]
        sine = (0.5 * (R[7] - R[5]), 0.5 * (R[2] - R[6]), 0.5 * (R[3] - R[1]))
        for i in range(3):
            drag = damper * omega[i]
            store(port.wrench, p, i, load(port.wrench, p, i) - spring * sine[i] - drag)
            store(port.damping, p, 7 * i, load(port.damping, p, 7 * i) + damper)
            store(port.stiffness, p, 7 * i, load(port.stiffness, p, 7 * i) + 0.5 * spring * trace)
            for j in range(3):
                at = 6 * i + j
                store(port.stiffness, p, at, load(port.stiffness, p, at) - 0.5 * spring * R[3 * i + j])
            lost += drag * omega[i]
        stored += 0.5 * spring * (3.0 - trace)
    store0(port.stored, stored)
    store0(port.lost, lost)


def _wing(scene: WingScene, values: Values) -> None:
    """Share the cable among the two strips beside it, linearly in its station, so that tracks are smooth in that."""
    strips = len(scene.structure.division.bodies)
    at = np.clip(values["station"] * strips - 0.5, 0.0, strips - 1.0)
    inner = np.minimum(np.floor(at), strips - 2.0)
    for strip, share in ((inner, inner + 1.0 - at), (inner + 1.0, at - inner)):
        middle = (strip + 0.5) / strips
        scene.add_point_law(_law, middle, np.full_like(middle, 0.5), [values["k"] * share, values["c"] * share])


EFFECT = Effect(
    name="cable",
    title="Clamped cable",
    family="structure",
    port="point",
    size=(
        Parameter("k", "N m/rad", 0.0, 2.0, 0.2, "rotational stiffness of the cable between the wing and the ground"),
        Parameter("c", "N m s/rad", 0.0, 0.02, 0.002, "rotational damping constant of the cable"),
    ),
    shape=place(0.3, 0.5)[:1],  # along a rigid chord, it does not matter where a moment acts
    power="dissipative",
    law="M = -k vee(R - R^T) / 2 - c omega,     P = c |omega|^2",
    source="Timoshenko (1955), Strength of Materials, part I, ch. V: the moment 4 E I / L rotates the end of a beam by "
    "one radian; Rayleigh (1877), The Theory of Sound, ch. IV: potential energy and dissipation function",
    signature="the wing flaps and twists less, by an angle that grows from the root to one station and is the same "
    "from there to the tip, in vacuum as in air",
    confused_with=("tether", "stroke_amplitude", "hinge_offset"),
    wing=_wing,
)
