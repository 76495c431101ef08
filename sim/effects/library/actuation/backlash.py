"""Effect: play where the driving rods hold the wing, which turns freely between two stops."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.lanes.lanewise import angle, cosine_and_sine
from wingfit.sim.kernels.lanes.matrices import load_matrix
from wingfit.sim.kernels.lanes.vector import greatest, load, load0, magnitude, root, store, store0
from wingfit.sim.kernels.laws import connector_port


def _law(frame: Any, moment: int) -> None:
    """Add a pin about x, free to turn by half the play, b / 2, to either side, in series with the spring of rotation.

    Q is the rotation of the second body in the first; g_0, g_1, g_2 are the spring's constants G (thesis Eq. 5). The
    spring stores -g_0 Q_00 - r cos(phi), with p = r cos(phi) = g_1 Q_11 + g_2 Q_22 and q = r sin(phi) = g_1 Q_21 - g_2
    Q_12. With the pin turned by psi, it stores -g_0 Q_00 - r cos(phi - psi). This energy is least at psi = phi within
    the play, and at the stop beyond it. The effect thus replaces cos(phi) by C(phi), and the moment about x, -r
    sin(phi), by -r S with S = -C': S is zero within the play and the sine of phi -+ b / 2 beyond it. The law adds the
    difference. From h before a stop to h behind it, S is a parabola. ``frame`` and ``moment``: see
    :mod:`wingfit.sim.kernels.laws`.
    """
    port = connector_port(frame)
    for c in range(port.places):
        if port.parameters[0, c, 0] == 0.0:  # a joint within the wing, in any individual
            continue
        half, h = load(port.parameters, 1, c), load(port.parameters, 2, c)
        g1, g2 = load(port.parameters, 3, c), load(port.parameters, 4, c)
        Q = load_matrix(port.Q, c)
        p, q = g1 * Q[4] + g2 * Q[8], g1 * Q[7] - g2 * Q[5]
        r, phi = root(p * p + q * q), angle(q, p)
        size = magnitude(phi)
        beyond = greatest(size - half - h, 0.0)
        x = greatest(size - half + h, 0.0) - beyond  # 0 to 2 h
        cosine, sine = cosine_and_sine(beyond)
        C = cosine - x * x * x / (12.0 * h) - h * beyond
        S = (0.25 * x * x / h + sine) * phi / (size + 1e-300)
        less, s = (C * p + S * q) / r - 1.0, (C * q - S * p) / r  # cosine minus one, and sine, of the pin's angle
        n = (Q[1] * g1 * less - Q[2] * g2 * s, Q[1] * g1 * s + Q[2] * g2 * less)
        store(port.wrench, c, 0, load(port.wrench, c, 0) + q - r * S)
        store(port.wrench, c, 1, load(port.wrench, c, 1) - n[1])
        store(port.wrench, c, 2, load(port.wrench, c, 2) + n[0])
        store(port.stiffness, c, 0, load(port.stiffness, c, 0) + 0.5 * r * x * cosine / h - p)
        store0(port.stored, load0(port.stored) + p - r * C)


def _wing(scene: WingScene, values: Values) -> None:
    """Let the springs at the root have play; the damper there (foam glued to the rod) still acts as before."""
    k = np.moveaxis(scene.lanes.stiffness[:, :3], 1, 0)
    half, root = 0.5 * values["b"], ~Joints.of(scene.structure).within[:, None]
    g1, g2 = 0.5 * (k[2] + k[0] - k[1]), 0.5 * (k[0] + k[1] - k[2])
    scene.add_connector_law(_law, [root.astype(float), half, values["edge"] * values["b"], g1, g2])


EFFECT = Effect(
    name="backlash",
    title="Backlash",
    family="actuation",
    port="connector",
    size=(Parameter("b", "rad", 0.0, 0.12, 0.015, "full angle about x through which the wing turns freely"),),
    shape=(
        Parameter(
            "edge", "1", 0.02, 0.25, 0.02,
            "how soft the stops are: distance before and behind one over which the spring sets in, as a fraction of b",
            scale="log",
        ),
    ),
    power="conservative",
    law="M_x = 0                                    |phi| < b / 2\nM_x = -r sin(phi - sign(phi) b / 2)        beyond",
    source="Dubowsky and Freudenstein (1971), Journal of Engineering for Industry 93, 305, and Nordin and Gutman "
    "(2002), Automatica 38, 1633, sect. 2: dead band between two stops; Fasse (1997): the spring in series with it",
    signature="the wing lags by half the play after each reversal of the load at the root and then jumps across, and "
    "the size of the jump does not depend on the load",
    confused_with=("stroke_amplitude", "compliant_drive"),
    wing=_wing,
)  # fmt: skip
